"""Hydrophone records from a person's own files: WAV, .npy or a column of text, cut at the times of transmission."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from engine.acoustics.sonar import Sonar
from engine.scenario.errors import Problem, ScenarioError

SUFFIXES = (".wav", ".npy", ".txt")


def read_records(path: Path, sonar: Sonar, starts_s: np.ndarray, key: str, *, channel: int = 0) -> np.ndarray:
    """Records (T, record_samples), float32, beginning at transmissions starts_s (T,), s from the file's start.

    A WAV file (its rate must be the sonar's; of several channels one is taken), a .npy array or a text column of
    samples is cut at the starts; a .npy array (T, record_samples) has a row for each. What lies beyond the file's
    end is silence, as long as some of each record is there. Raises ScenarioError at `key`.
    """
    samples = _samples(path, sonar, key, channel)
    if samples.ndim == 2:
        if samples.shape != (len(starts_s), sonar.record_samples):
            raise _fault(
                key,
                f"{path.name} has {samples.shape[0]} records of {samples.shape[1]} samples",
                f"give {len(starts_s)} (one for each time) of {sonar.record_samples}",
            )
        return samples
    first = np.rint(np.asarray(starts_s) * sonar.sampling_hz).astype(np.int64)
    for at, start in zip(first, starts_s):
        if not 0 <= at < len(samples):
            lasts = len(samples) / sonar.sampling_hz
            raise _fault(
                key, f"{path.name} lasts {lasts:g} s, a transmission is at {start:g} s", "count times from its start"
            )
    padded = np.concatenate([samples, np.zeros(sonar.record_samples, dtype=np.float32)])
    return padded[first[:, None] + np.arange(sonar.record_samples)]


def read_waveform(path: Path, sonar: Sonar, key: str) -> np.ndarray:
    """A transmitted waveform (n,) from a file of samples at the sonar's rate. Raises ScenarioError at `key`."""
    found = _samples(path, sonar, key, 0).astype(float)
    if found.ndim != 1 or not 2 <= len(found) <= sonar.record_samples or not found.any():
        raise _fault(
            key, f"{path.name} is no waveform", f"give one of 2 to {sonar.record_samples} samples, not silence"
        )
    return found


def _samples(path: Path, sonar: Sonar, key: str, channel: int) -> np.ndarray:
    """All of a file's samples, float32: (n,), or (T, n) where it is cut already."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise _fault(key, f"{path.name} is no kind of file known here", f"give one of: {', '.join(SUFFIXES)}")
    try:
        if suffix == ".wav":
            found = _wav(path, sonar, key, channel)
        elif suffix == ".npy":
            found = np.load(path, mmap_mode="r", allow_pickle=False)  # no memory for what a header only promises
            if not isinstance(found, np.ndarray):
                raise ValueError("it is an archive of several arrays")
        else:
            found = np.loadtxt(path, delimiter=",", ndmin=1).ravel()
    except (OSError, ValueError, EOFError, struct.error) as error:
        raise _fault(key, f"{path.name} cannot be read: {error}", "check the file") from None
    if found.ndim not in (1, 2) or not np.issubdtype(found.dtype, np.number) or np.iscomplexobj(found):
        raise _fault(key, f"{path.name} holds {found.dtype} of shape {found.shape}", "give samples or rows of them")
    found = found.astype(np.float32)
    if not np.isfinite(found).all():
        raise _fault(key, f"{path.name} has samples that are not finite", "leave out broken records")
    return found


def _wav(path: Path, sonar: Sonar, key: str, channel: int) -> np.ndarray:
    from scipy.io import wavfile  # brings MATLAB's formats with it, a tenth of a second

    rate, found = wavfile.read(path)
    if rate != sonar.sampling_hz:
        raise _fault(key, f"{path.name} is sampled at {rate} Hz, the sonar at {sonar.sampling_hz:g}", "make them equal")
    channels = found.reshape(len(found), -1).T
    if not 0 <= channel < len(channels):
        raise _fault(key, f"{path.name} has {len(channels)} channels, not a number {channel}", "count from 0")
    found = channels[channel]
    if np.issubdtype(found.dtype, np.integer):
        silence = 128 if found.dtype == np.uint8 else 0
        full = 128 if found.dtype == np.uint8 else -float(np.iinfo(found.dtype).min)
        return (found.astype(np.float64) - silence) / full
    return found


def _fault(key: str, message: str, remedy: str) -> ScenarioError:
    return ScenarioError([Problem(key, message, remedy)])
