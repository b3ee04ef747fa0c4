"""The two files of the result directory have the contract's names, shapes and types."""

from __future__ import annotations

import io
import json

import numpy as np
from pydantic import BaseModel

from engine.evaluation.result import assemble, packet_figures
from engine.tracks import Belief, PacketCount, Reference, Samples, Tracks

TRIALS, T = 3, 4


class Than(BaseModel):
    metric: str = "sigma_m"
    algorithm: str = "cekf"
    subject: str = "iver"
    factor: float = 1.0


class Claim(BaseModel):
    text: str = "NEKF is the surer one"
    metric: str = "sigma_m"
    algorithm: str = "nekf"
    subject: str = "iver"
    operator: str = "<"
    bound: float | None = None
    than: Than | None = Than()


class Scenario(BaseModel):
    title: str = "Two"
    family: str = "navigation"
    seed: int = 11
    trials: int = TRIALS
    claims: list[Claim] = [Claim()]


def result():
    rng = np.random.default_rng(0)
    truth = {"iver": rng.normal(size=(1, T, 2)), "lost": np.full((1, T, 2), np.nan)}
    mean = rng.normal(size=(TRIALS, T, 2))
    wide, narrow = (np.broadcast_to(v * np.eye(2), (TRIALS, T, 2, 2)) for v in (4.0, 1.0))
    cekf = Tracks({s: Belief(mean, wide) for s in truth}, cpu_s=0.5)
    nekf = Tracks(
        {s: Belief(mean + 1.0, narrow) for s in truth},
        packets=PacketCount(sent=6, received=4, bytes_sent=174, floats_sent=36, largest_bytes=29),
        samples={"iver": Samples(np.arange(2.0), np.zeros((TRIALS, 2, 50, 2), np.float32))},
        notes=("iver: something to know",),
        cpu_s=0.25,
    )
    return assemble(Scenario(), Reference(np.arange(float(T)), truth), {"nekf": nekf, "cekf": cekf})


def test_result_json_is_the_contract():
    written = json.loads(json.dumps(result().to_json(), allow_nan=False))
    assert set(written) == {"schema", "scenario", "seed", "trials", "algorithms", "claims"}
    assert (written["schema"], written["seed"], written["trials"]) == (1, 11, TRIALS)
    assert written["scenario"]["title"] == "Two"
    nekf = written["algorithms"]["nekf"]
    assert set(nekf) == {"subjects", "packets", "cpu_s", "notes"}
    assert (nekf["cpu_s"], nekf["notes"]) == (0.25, ["iver: something to know"])
    assert set(nekf["subjects"]) == {"iver", "lost"}
    assert set(nekf["subjects"]["iver"]) >= {
        "rmse_m",
        "final_rmse_m",
        "sigma_m",
        "final_sigma_m",
        "anees",
        "anees_interval",
        "consistent",
        "max_deviation_m",
    }
    assert written["claims"] == [
        {"text": "NEKF is the surer one", "value": 1.0, "operator": "<", "bound": 2.0, "holds": True}
    ]


def test_the_benchmark_is_the_registered_centralized_estimator():
    subjects = result().to_json()["algorithms"]["nekf"]["subjects"]
    np.testing.assert_allclose(subjects["iver"]["max_deviation_m"], np.sqrt(2.0))


def test_arrays_survive_the_file_with_the_contracts_names_shapes_and_types():
    finished = result()
    file = io.BytesIO()
    np.savez(file, **finished.arrays())
    file.seek(0)
    arrays = np.load(file)
    expected = {"time_s": (T,), "nekf/iver/samples": (TRIALS, 2, 50, 2), "nekf/iver/samples_time_s": (2,)}
    for subject in ("iver", "lost"):
        expected[f"truth/{subject}"] = (TRIALS, T, 2)
        for name in ("nekf", "cekf"):
            expected[f"{name}/{subject}/mean"] = (TRIALS, T, 2)
            expected[f"{name}/{subject}/cov"] = (TRIALS, T, 2, 2)
    assert {k: arrays[k].shape for k in arrays.files} == expected
    assert {arrays[k].dtype for k in arrays.files} == {np.dtype(np.float64)}
    np.testing.assert_array_equal(arrays["truth/iver"][2], finished.truth["iver"][0])


def test_packets_are_averaged_over_broadcasts_and_counted_over_trials():
    """Four packets of 118 bytes in all, in 20 s of missions: 47.2 bit/s, more than a channel of 40 carries."""
    count = PacketCount(sent=4, received=7, bytes_sent=118, floats_sent=24, largest_bytes=30, mission_s=20.0)
    assert packet_figures(count, 40.0) == {
        "sent": 4,
        "received": 7,
        "bytes_per_packet": 29.5,
        "floats_per_packet": 6.0,
        "largest_bytes": 30,
        "bits_per_second": 47.2,
        "exceeds_capacity": True,
    }
    assert packet_figures(count, 50.0)["exceeds_capacity"] is False
    assert packet_figures(PacketCount())["bytes_per_packet"] == 0.0
