from __future__ import annotations

import numpy as np
import pytest
from scipy.io import wavfile

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.recorded import read_records
from engine.scenario.errors import ScenarioError
from tests.engine.acoustics.waters import SONAR, at, heard, line

STARTS = np.array([0.5, 1.5, 2.5])


@pytest.fixture
def sound():
    """Three seconds with a transmission at every start, and its records."""
    records = heard(line(3), at(60.0, 1.0), np.random.default_rng(0), snr_db=30.0)
    records = 0.5 * records / np.abs(records).max()
    whole = np.zeros(int(3 * SONAR.sampling_hz), dtype=np.float32)
    for start, record in zip(STARTS, records):
        at_ = int(start * SONAR.sampling_hz)
        whole[at_ : at_ + len(record)] = record
    return whole, records


@pytest.mark.parametrize("kind", [np.float32, np.int16, np.int32])
def test_a_wav_file_is_cut_at_the_transmissions(tmp_path, sound, kind):
    whole, records = sound
    scaled = whole if kind is np.float32 else (whole.astype(float) * -float(np.iinfo(kind).min)).astype(kind)
    wavfile.write(tmp_path / "sea.wav", int(SONAR.sampling_hz), np.stack([np.zeros_like(scaled), scaled], axis=1))
    found = read_records(tmp_path / "sea.wav", SONAR, STARTS, "mission.records", channel=1)
    np.testing.assert_allclose(found, records, atol=5e-5)
    ranges = np.abs(matched_filter(found, SONAR)).argmax(-1) * SONAR.metres_per_sample
    np.testing.assert_allclose(ranges, np.linalg.norm(at(60.0, 1.0) - line(3), axis=1), atol=0.37)


def test_an_array_file_has_samples_or_rows(tmp_path, sound):
    whole, records = sound
    np.save(tmp_path / "whole.npy", whole)
    np.save(tmp_path / "rows.npy", records.astype(np.float64))
    for name in ("whole.npy", "rows.npy"):
        np.testing.assert_array_equal(read_records(tmp_path / name, SONAR, STARTS, "mission.records"), records)


def test_faults_are_named(tmp_path, sound):
    whole, records = sound
    wavfile.write(tmp_path / "slow.wav", 8000, whole)
    np.save(tmp_path / "rows.npy", records)
    np.save(tmp_path / "nan.npy", np.full(8000, np.nan))
    np.save(tmp_path / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    np.savez(tmp_path / "archive.npz", whole)
    (tmp_path / "archive.npz").rename(tmp_path / "archive.npy")
    np.save(tmp_path / "promise.npy", np.zeros(9))
    promise = (tmp_path / "promise.npy").read_bytes().replace(b"(9,), }" + b" " * 13, b"(9" + b"0" * 13 + b",), }")
    (tmp_path / "promise.npy").write_bytes(promise)
    (tmp_path / "sea.mp3").write_bytes(b"")
    (tmp_path / "broken.wav").write_bytes(b"RIFF")
    for name, starts, words in (
        ("slow.wav", STARTS, "8000 Hz"),
        ("rows.npy", STARTS[:2], "3 records"),
        ("nan.npy", STARTS[:1] * 0, "not finite"),
        ("objects.npy", STARTS, "cannot be read"),
        ("archive.npy", STARTS, "archive of several"),
        ("promise.npy", STARTS, "cannot be read"),
        ("sea.mp3", STARTS, "no kind of file"),
        ("broken.wav", STARTS, "cannot be read"),
        ("absent.wav", STARTS, "cannot be read"),
    ):
        with pytest.raises(ScenarioError, match=words) as raised:
            read_records(tmp_path / name, SONAR, starts, "mission.records")
        assert raised.value.problems[0].key == "mission.records"
    np.save(tmp_path / "whole.npy", whole)
    with pytest.raises(ScenarioError, match="lasts 3 s"):
        read_records(tmp_path / "whole.npy", SONAR, np.array([4.0]), "mission.records")
