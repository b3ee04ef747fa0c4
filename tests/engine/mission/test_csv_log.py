"""A log written as CSV reads back as itself, so every estimator says the same of both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine import registry
from engine.mission import csv_log, fly
from engine.mission.csv_log import degrees_of
from engine.mission.log import Log
from engine.navigation.mission import prepare
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError


def again(scenario, folder: Path) -> tuple[Log, Log]:
    log = fly(scenario, [0])
    csv_log.write(log, scenario, folder / "log")
    return log, fly(library.find(str(folder / "log")), [0])  # type: ignore[arg-type]


def assert_same(a: Log, b: Log) -> None:
    assert (a.duration_s, a.sound_speed_mps, a.gate_sigma) == (b.duration_s, b.sound_speed_mps, b.gate_sigma)
    np.testing.assert_array_equal(a.time_s, b.time_s)
    assert [v.name for v in a.vehicles] == [v.name for v in b.vehicles]
    for v, w in zip(a.vehicles, b.vehicles):
        assert (v.kind, v.depth_m, v.range_sigma_m, v.acceleration_psd) == (
            w.kind,
            w.depth_m,
            w.range_sigma_m,
            w.acceleration_psd,
        )
        for name in ("velocity", "heading", "odometry", "depth", "fixes"):
            x, y = getattr(v, name), getattr(w, name)
            assert (x is None) == (y is None), name
            if x is not None:
                for field, value in vars(x).items():
                    np.testing.assert_array_equal(value, getattr(y, field), err_msg=f"{v.name} {name} {field}")
        for field in ("position_m", "position_cov", "velocity_mps"):
            np.testing.assert_array_equal(getattr(v.initial, field), getattr(w.initial, field))
    for field, value in vars(a.acoustics).items():
        np.testing.assert_array_equal(value, getattr(b.acoustics, field), err_msg=field)
    for name in a.truth:
        np.testing.assert_array_equal(a.truth[name], b.truth[name])


SIMULATED = toml.override(
    library.find("walls2011-topology-a"),
    {
        "duration_s": 600,
        "network.loss": 0.4,
        "network.sound_speed_sigma_mps": 3.0,
        "network.gate_sigma": 4.0,
        "vehicles.iver28.surfacings": [{"start_s": 290, "end_s": 320}],
    },
)


def test_a_simulated_log_reads_back_to_the_last_bit(tmp_path):
    log, back = again(SIMULATED, tmp_path)
    assert_same(log, back)
    assert np.isnan(log.acoustics.travel_time_s).any()


@pytest.mark.parametrize("name", ["dead_reckoning", "cekf", "nekf"])
def test_an_estimator_says_the_same_of_a_log_and_its_csv(tmp_path, name):
    log, back = again(SIMULATED, tmp_path)
    algorithm = registry.algorithm(name)
    first, second = (algorithm.run(prepare(x), registry.silent) for x in (log, back))
    for subject, belief in first.beliefs.items():
        np.testing.assert_array_equal(belief.mean, second.beliefs[subject].mean)
        np.testing.assert_array_equal(belief.cov, second.beliefs[subject].cov)
    assert (first.packets.sent, first.packets.received) == (second.packets.sent, second.packets.received)


def test_broadcasts_that_nobody_could_hear_are_kept(tmp_path):
    scenario = toml.override(SIMULATED, {"network.links": [["iver28", "iver31"]]})
    log, back = again(scenario, tmp_path)
    assert len(back.acoustics.tol_s) == len(log.acoustics.tol_s) > len(log.acoustics.toa_s)
    assert_same(log, back)


def test_the_folder_is_a_scenario_of_one_recorded_trial(tmp_path):
    again(SIMULATED, tmp_path)
    scenario = library.find(str(tmp_path / "log"))
    assert scenario.trials == 1 and scenario.claims == []
    assert scenario.mission.kind == "recorded"  # type: ignore[attr-defined]
    assert scenario.algorithms == SIMULATED.algorithms


def coarse(folder: Path, late_s: float) -> Log:
    """SIMULATED, its launches written down as late_s after their arrivals, read again."""
    again(SIMULATED, folder)
    file = folder / "log" / "ranges.csv"
    header, *rows = (line.split(",") for line in file.read_text().splitlines())
    arrival = {row[0]: float(row[2]) for row in reversed(rows)}  # the first of each broadcast
    for row in rows:
        row[1] = repr(arrival[row[0]] + late_s)
    file.write_text("\n".join(",".join(row) for row in [header, *rows]) + "\n")
    return fly(library.find(str(folder / "log")), [0])  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["cekf", "nekf", "deif", "mdeif", "k_best", "centralized_smoother"])
def test_a_log_whose_packets_arrive_at_the_instant_of_their_launch_is_borne(tmp_path, name):
    """Where times are written in whole seconds they often do."""
    log = coarse(tmp_path, 0.0)
    assert np.any(log.acoustics.toa_s == log.acoustics.tol_s[log.acoustics.broadcast])
    tracks = registry.algorithm(name).run(prepare(log), registry.silent)
    assert np.isfinite(tracks.beliefs["iver28"].mean).all()


def test_a_launch_after_its_arrival_is_refused_with_its_row(tmp_path):
    with pytest.raises(ScenarioError, match=r"ranges.csv line 2, column 'tol_s'.*after its arrival.*one clock"):
        coarse(tmp_path, 0.5)


def test_a_folder_with_a_scenario_is_not_written_over(tmp_path):
    again(SIMULATED, tmp_path)
    with pytest.raises(FileExistsError):
        csv_log.write(fly(SIMULATED, [0]), SIMULATED, tmp_path / "log")  # type: ignore[arg-type]


def test_a_log_with_world_velocities_reads_back(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "v.csv").write_text("t,e,n\n0,1,0.5\n1,1.1,0.4\n2,1,0.3\n")
    scenario = toml.validate(
        {
            "schema": 1,
            "title": "drifter",
            "family": "navigation",
            "mission": {
                "kind": "recorded",
                "format": "csv",
                "log": "in",
                "velocity": [{"vehicle": "d", "file": "v.csv", "time": "t", "east": "e", "north": "n"}],
            },
            "vehicles": [
                {
                    "name": "d",
                    "kind": "auv",
                    "initial": {"position_sigma_m": 1, "position_m": [0, 0]},
                    "sensors": {"dvl": {"along_sigma_mps": 0.1, "cross_sigma_mps": 0.1}, "heading": {"sigma_deg": 1}},
                }
            ],
        },
        origin=str(tmp_path),
    )
    assert_same(*again(scenario, tmp_path))


@given(st.floats(-50, 50))
def test_a_heading_survives_as_degrees(radians):
    assert np.radians(degrees_of(radians)) == pytest.approx(radians, rel=1e-15, abs=0)


@pytest.mark.recorded
@pytest.mark.parametrize("name", ["plaza1-two-beacons", "marine-diver", "goats-auv"])
def test_a_recorded_log_written_again_is_the_same(tmp_path, recorded_data, name):
    scenario = library.find(name)
    recorded_data(scenario.mission.log)  # type: ignore[attr-defined]
    log, back = again(scenario, tmp_path)
    assert_same(log, back)
    for v, w in zip(log.vehicles, back.vehicles):
        np.testing.assert_array_equal(v.initial.heading_rad, w.initial.heading_rad)
