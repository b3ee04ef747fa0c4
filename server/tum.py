"""Tracks as other tools for trajectories read them: TUM text files, a row a pose, `time x y z qx qy qz qw`.

evo compares and plots such files: `evo_ape tum truth-scout.txt cekf-scout.txt`. What is told here is positions in the
plane, so that z is 0 and the rotation none; rows without a position are left out.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path

import numpy as np

from server.problems import Refusal

#: s, m, and the rotation that is none.
ROW = ["%.6f", "%.6f", "%.6f", "%d", "%d", "%d", "%d", "%d"]


def zipped(arrays: Path, trial: int) -> bytes:
    """A ZIP of one trial of an arrays.npz: NAME-SUBJECT.txt of every algorithm and of the truth.

    Refusal 422 where there is no such trial. Of large files only the trial is read.
    """
    packed = io.BytesIO()
    with zipfile.ZipFile(arrays) as found, zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as written:
        time_s = _read(found, "time_s.npy")
        for member in found.namelist():
            track = re.fullmatch(r"(truth)/([^/]+)\.npy|([^/]+)/([^/]+)/mean\.npy", member)
            if track is None:
                continue
            truth, of, algorithm, subject = track.groups()
            name = re.sub(r"[^\w.-]+", "_", f"{truth or algorithm}-{of or subject}")
            written.writestr(f"{name}.txt", _rows(time_s, _read(found, member, trial)))
    return packed.getvalue()


def _rows(time_s: np.ndarray, xy_m: np.ndarray) -> bytes:
    known = np.isfinite(xy_m).all(axis=1)
    still = np.zeros((int(known.sum()), 5))
    still[:, -1] = 1.0
    text = io.BytesIO()
    np.savetxt(text, np.column_stack([time_s[known], xy_m[known], still]), fmt=ROW)
    return text.getvalue()


def _read(found: zipfile.ZipFile, member: str, trial: int | None = None) -> np.ndarray:
    """An array of an npz, or one of its trials alone."""
    with found.open(member) as file:
        np.lib.format.read_magic(file)
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        if trial is not None:
            if trial >= shape[0]:
                raise Refusal(422, "no-such-trial", f"trial: there are the trials 0 to {shape[0] - 1}, not {trial}")
            shape = shape[1:]
            file.seek(trial * int(np.prod(shape)) * dtype.itemsize, io.SEEK_CUR)
        return np.frombuffer(file.read(int(np.prod(shape)) * dtype.itemsize), dtype).reshape(shape)
