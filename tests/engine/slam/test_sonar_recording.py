"""A simulated mission written as a person's hydrophone file, and read back."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scipy.io import wavfile

from engine.scenario.errors import ScenarioError
from engine.scenario.slam import SlamScenario
from engine.slam.mission import fly, outline
from engine.slam.simulate import records
from tests.engine.slam.missions import scenario


@pytest.fixture
def sea(tmp_path):
    """The folder of a recording, and the mission it is of."""
    simulated = scenario(duration_s=49.0, arrays={"count": 3})
    mission = fly(simulated, [0])
    log = mission.log(0)
    sounds = records(simulated, np.arange(50), 0)
    sounds = 0.9 * sounds / np.abs(sounds).max()
    whole = np.zeros((50, 37_500), dtype=np.float32)
    whole[:, : sounds.shape[1]] = sounds
    (tmp_path / "trial").mkdir()
    wavfile.write(tmp_path / "trial" / "sea.wav", 37_500, whole.ravel())
    np.save(tmp_path / "trial" / "rows.npy", sounds)
    reckoned = np.concatenate([log.fix_m[:1], log.fix_m[:1] + np.cumsum(log.steps, axis=0)])
    with open(tmp_path / "trial" / "pings.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["t", "x", "y", "gx", "gy", "tx", "ty"])
        for k in range(50):
            fix = log.fix_m[k] if k in log.fixed else ["", ""]
            table.writerow([100.0 + k, *reckoned[k], *fix, *mission.truth["auv"][0, k]])
    return tmp_path, mission


def described(folder, **changes) -> SlamScenario:
    mission = {
        "kind": "recorded",
        "format": "sonar",
        "log": "trial",
        "records": "rows.npy",
        "pings": "pings.csv",
        "time": "t",
        "x": "x",
        "y": "y",
        "fix_x": "gx",
        "fix_y": "gy",
        "truth_x": "tx",
        "truth_y": "ty",
        "beacon_m": [3.0, -2.0],
    }
    tables = {"schema": 1, "title": "Read back", "family": "slam", "origin": str(folder), "mission": mission | changes}
    return SlamScenario.model_validate(tables | {"ranging": {"count": 20}, "arrays": {"count": 3, "elements": 8}})


def test_a_recording_reads_back_as_the_mission_it_is_of(sea):
    folder, simulated = sea
    read, flown = fly(described(folder), [0]), simulated.log(0)
    log = read.log(0)
    assert read.vehicle == "auv" and read.beacons == ("beacon",)
    assert read.time_s[0] == 0.0 and log.fixed == flown.fixed
    np.testing.assert_allclose(log.steps, flown.steps, atol=1e-9)
    np.testing.assert_allclose(read.truth["auv"], simulated.truth["auv"])
    assert [p.pose for p in log.pings] == [p.pose for p in flown.pings]
    for found, known in zip(log.pings, flown.pings):
        assert found.strongest_m == pytest.approx(known.strongest_m, abs=0.05)
    for found, known in zip(log.arrays, flown.arrays):
        assert found.poses == known.poses
        assert found.array.focus_m == pytest.approx(known.array.focus_m, abs=0.1)
    assert len(outline(read).subjects) == 2


def test_a_wav_file_is_cut_at_the_starts(sea):
    folder, simulated = sea
    path = folder / "trial" / "pings.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0] + ",at", *(f"{line},{k}" for k, line in enumerate(lines[1:]))]))
    log = fly(described(folder, records="sea.wav", start="at"), [0]).log(0)
    for found, known in zip(log.pings, simulated.log(0).pings):
        assert found.strongest_m == pytest.approx(known.strongest_m, abs=0.05)


def test_the_transmitted_waveform_may_be_a_file(sea):
    folder, simulated = sea
    np.save(folder / "trial" / "chirp.npy", 0.1 * np.cos(2 * np.pi * np.arange(800) * 0.03))
    other = fly(described(folder, chirp="chirp.npy"), [0]).log(0)
    apart = [abs(a.strongest_m - b.strongest_m) > 0.5 for a, b in zip(other.pings, simulated.log(0).pings)]
    assert np.mean(apart) > 0.5


def test_faults_are_named(sea):
    folder, _ = sea
    with pytest.raises(ScenarioError, match=r"mission\.records.*no file"):
        fly(described(folder, records="absent.wav"), [0])
    with pytest.raises(ScenarioError, match="no column 'z'"):
        fly(described(folder, x="z"), [0])
    np.save(folder / "trial" / "chirp.npy", np.zeros(100))
    with pytest.raises(ScenarioError, match="no waveform"):
        fly(described(folder, chirp="chirp.npy"), [0])
    few = described(folder).model_copy(update={"ranging": described(folder).ranging.model_copy(update={"count": 60})})
    with pytest.raises(ScenarioError, match="more than the 50 poses"):
        fly(few, [0])
