"""Recorded missions in PyFG."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.mission import fly
from engine.mission.log import Log
from engine.mission.pyfg import parse, resect
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError

TEXT = """VERTEX_SE2 100 A0 1 2 0.5
VERTEX_SE2 101 A1 2 2 0.6
VERTEX_SE2 103 A2 4 3 0.7
VERTEX_SE2 100.5 B0 -1 0 0
VERTEX_SE2 103 B1 -1 2 0
VERTEX_XY L0 50 60
VERTEX_XY L1 10 10
VERTEX_XY:PRIOR 101 L1 10.5 9.5 0.25 0.1 0.5
EDGE_SE2 0 A0 A1 1 0.1 0.1 0.01 0.001 0 0.02 0 0.003
EDGE_SE2 0 A1 A2 2 0.2 0.1 0.01 0 0 0.02 0 0.003
EDGE_SE2 100.5 B0 B1 0 2 0 0.01 0 0 0.02 0 0.003
EDGE_RANGE 0 A1 L1 15 0.01
EDGE_RANGE 0 A2 L0 75 0.01
EDGE_RANGE 103 B1 A2 6 0.01
SOMETHING else
"""
SCENARIO: dict[str, Any] = {
    "schema": 1,
    "title": "graph",
    "family": "navigation",
    "report_interval_s": 0.5,
    "mission": {
        "kind": "recorded",
        "format": "pyfg",
        "log": "graph",
        "file": "graph.pyfg",
        "robots": {"A": "diver", "B": "rover"},
        "nodes": {"L0": "buoy"},
        "moving_beacon": "kayak",
    },
    "vehicles": [
        {"name": name, "kind": kind, "initial": {"position_sigma_m": 1.0}, "sensors": {"modem": {"range_sigma_m": 1.0}}}
        for name, kind in (("diver", "auv"), ("rover", "surface"), ("buoy", "fixed"), ("kayak", "surface"))
    ],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "graph").mkdir()
    (tmp_path / "graph" / "graph.pyfg").write_text(TEXT)
    return tmp_path


def read(folder: Path, changes: dict[str, Any] | None = None) -> Log:
    return fly(toml.override(toml.validate(SCENARIO), changes or {}), [0], logs=[folder])  # type: ignore[arg-type]


def test_poses_give_times_odometry_and_reference(folder):
    log = read(folder)
    diver, rover = log.vehicles[:2]
    np.testing.assert_allclose(diver.odometry.time_s, [1, 3])
    np.testing.assert_array_equal(diver.odometry.value, [[[1, 0.1, 0.1], [2, 0.2, 0.1]]])
    np.testing.assert_array_equal(diver.odometry.cov[0], [[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.003]])
    np.testing.assert_array_equal(diver.initial.position_m, [[1, 2]])
    np.testing.assert_array_equal(diver.initial.heading_rad, [0.5])
    np.testing.assert_allclose(rover.odometry.time_s, [3])
    np.testing.assert_allclose(log.truth["diver"][0, :3], [[1, 2], [1.5, 2], [2, 2]])
    assert log.duration_s == 3 and set(log.truth) == {"diver", "rover"}


def test_a_range_is_a_broadcast_heard_by_its_first_key(folder):
    a = read(folder).acoustics
    pairs = sorted((float(t), int(s), int(r)) for t, s, r in zip(a.toa_s, a.sender[a.broadcast], a.receiver))
    assert pairs == [(1.0, 3, 0), (3.0, 0, 1), (3.0, 2, 0)]
    np.testing.assert_allclose(np.sort(a.travel_time_s[0] * 1500), [6, 15, 75])
    np.testing.assert_allclose(a.tol_s[a.broadcast], a.toa_s - a.travel_time_s[0])


def test_points_are_fixed_nodes_or_the_moving_beacons_fixes_at_launch(folder):
    log = read(folder)
    buoy, kayak = log.vehicles[2:]
    np.testing.assert_array_equal(buoy.initial.position_m, [[50, 60]])
    np.testing.assert_array_equal(kayak.fixes.value, [[[10.5, 9.5]]])
    np.testing.assert_array_equal(kayak.fixes.cov, [[[0.25, 0.1], [0.1, 0.5]]])
    np.testing.assert_allclose(kayak.fixes.time_s, [1 - 15 / 1500])


def test_the_scenarios_noise_goes_before_the_files_which_may_be_scaled(folder):
    own = {"per_reading": {"forward_sigma_m": 0.5}, "per_sqrt_s": {"turn_sigma_deg": 2.0}}
    cov = read(folder, {"vehicles.diver.sensors.odometry": own}).vehicles[0].odometry.cov
    np.testing.assert_allclose(cov[1], np.diag([0.25, 0, 2 * np.radians(2.0) ** 2]))
    scaled = read(folder, {"mission.odometry_cov_scale": 4.0}).vehicles[0].odometry.cov
    np.testing.assert_allclose(scaled[1], np.diag([0.04, 0.08, 0.012]))


def test_a_reference_that_is_no_truth_is_labelled_or_left_out(folder):
    assert "no independent truth" in read(folder, {"mission.reference": "own_navigation"}).notes[0]
    start = {
        f"vehicles.{name}.initial.{key}": value
        for name in ("diver", "rover")
        for key, value in (("position_m", [0, 0]), ("heading_deg", 0))
    }
    assert read(folder, {"mission.reference": "none"} | start).truth == {}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("EDGE_RANGE 0 A1 L1 15 0.01", "EDGE_RANGE 0 A1 L1 fifteen 0.01", "line 12: this is no complete EDGE_RANGE"),
        ("EDGE_RANGE 0 A1 L1 15 0.01", "EDGE_RANGE 0 A1", "line 12"),
        ("EDGE_RANGE 0 A1 L1 15 0.01", "EDGE_RANGE 0 A1 L1 nan 0.01", "line 12: a number is not finite"),
        ("EDGE_RANGE 0 A1 L1 15 0.01", "EDGE_RANGE 0 A1 L1 -3 0.01", "line 12: -3 is no range"),
        ("EDGE_RANGE 0 A1 L1", "EDGE_RANGE 0 A9 L1", "A9, which is no pose"),
        ("EDGE_RANGE 0 A1 L1", "EDGE_RANGE 0 A1 L7", "L7, which is no vehicle's"),
        ("VERTEX_SE2 101 A1", "VERTEX_SE2 101 A0", "line 2: pose A0 again"),
        ("VERTEX_SE2 101 A1", "VERTEX_SE2 104 A1", "no odometry from A0 to the next pose A2"),
        ("VERTEX_SE2 101 A1", "VERTEX_SE2 100 A1", "poses A0 and A1 are at the same time"),
        ("VERTEX_SE2 103 B1", "VERTEX_SE2 103 C1", "mission.robots"),
        ("EDGE_SE2 0 A1 A2", "EDGE_SE2 0 A1 A5", "lacks pose A5"),
    ],
)
def test_a_bad_line_is_named(folder, old, new, words):
    (folder / "graph" / "graph.pyfg").write_text(TEXT.replace(old, new))
    with pytest.raises(ScenarioError, match=words):
        read(folder)


def test_a_loop_closure_is_no_odometry(folder):
    (folder / "graph" / "graph.pyfg").write_text(TEXT + "EDGE_SE2 0 A0 A2 9 9 9 1 0 0 1 0 1\n")
    np.testing.assert_array_equal(read(folder).vehicles[0].odometry.value, [[[1, 0.1, 0.1], [2, 0.2, 0.1]]])


def test_a_range_that_stands_twice_is_used_once(folder):
    (folder / "graph" / "graph.pyfg").write_text(TEXT + "EDGE_RANGE 0 A2 L0 75 0.01\nEDGE_RANGE 0 A2 L0 76 0.01\n")
    log = read(folder)
    assert sorted(np.round(log.acoustics.travel_time_s[0] * 1500)) == [6, 15, 75, 76]
    assert log.notes == ("1 ranges stand in the file twice and are used once",)


@pytest.mark.parametrize("content", [b"", b"hello\n", b"\xff\xfe\x00\x01", b"VERTEX_XY L0 1 2\n"])
def test_a_file_without_poses_is_refused(folder, content):
    (folder / "graph" / "graph.pyfg").write_bytes(content)
    with pytest.raises(ScenarioError):
        read(folder)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mission.robots": {"A": "diver"}}, "robot 'B'"),
        ({"mission.robots": {"A": "diver", "B": "rover", "C": "kayak"}}, "no poses of 'C'"),
        ({"mission.nodes": {"L9": "buoy"}}, "no point 'L9'"),
        ({"mission.nodes": {}}, "L0, which is no vehicle's"),
        ({"mission.landmarks": ["diver"]}, "no two landmarks"),
    ],
)
def test_a_mapping_that_does_not_fit_the_file_is_named(folder, changes, words):
    with pytest.raises(ScenarioError, match=words):
        read(folder, changes)


@given(
    st.lists(st.tuples(st.floats(-20, 20), st.floats(-20, 20)), min_size=2, max_size=6, unique=True),
    st.tuples(st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1)),
)
def test_landmarks_seen_together_give_the_position_whatever_the_heading(landmarks, pose):
    marks, position = np.array(landmarks), np.array(pose[:2])
    c, s = np.cos(pose[2]), np.sin(pose[2])
    offsets = (marks - position) @ np.array([[c, -s], [s, c]])
    found = resect(marks, offsets, np.tile(np.eye(2) * 0.01, (len(marks), 1, 1)))
    if found is not None:
        np.testing.assert_allclose(found[0], position, atol=1e-5)


def test_a_fix_from_landmarks_is_as_uncertain_as_it_says():
    rng = np.random.default_rng(1)
    marks, position, sigma = np.array([[3.0, 1.0], [-2.0, 4.0], [5.0, 6.0]]), np.array([1.0, 2.0]), 0.05
    errors, cov = [], np.eye(2)
    for _ in range(2000):
        offsets = marks - position + sigma * rng.standard_normal((3, 2))
        found = resect(marks, offsets, np.tile(np.eye(2) * sigma**2, (3, 1, 1)))
        assert found is not None
        errors.append(found[0] - position)
        cov = found[1]
    np.testing.assert_allclose(np.cov(np.array(errors).T), cov, atol=0.1 * cov.max())


# --- the public logs -----------------------------------------------------------------------------------------------


@pytest.mark.recorded
def test_marines_beacon_is_where_it_was_measured_and_its_ranges_fit_the_truth(recorded_data):
    """56 ranges, three of them copies. Each has its own fix of the beacon.

    Against the true diver they are off by about 1.1 m, 0.4 m of it bias.
    """
    recorded_data("marine")
    log = fly(library.find("marine-diver"), [0])  # type: ignore[arg-type]
    a, beacon = log.acoustics, log.vehicles[1]
    assert len(a.toa_s) == len(beacon.fixes.time_s) == 53
    assert "3 ranges stand in the file twice" in log.notes[0]
    np.testing.assert_allclose(beacon.fixes.time_s, a.tol_s)
    diver = np.stack([np.interp(a.toa_s, log.time_s, log.truth["diver"][0, :, i]) for i in range(2)], axis=-1)
    residual = 1500 * a.travel_time_s[0] - np.linalg.norm(diver - beacon.fixes.value[0], axis=-1)
    assert np.sqrt((residual**2).mean()) == pytest.approx(1.1, abs=0.2)
    assert abs(residual.mean()) == pytest.approx(0.4, abs=0.1)


@pytest.mark.recorded
def test_goats_times_are_the_vertices_and_its_outliers_are_kept(recorded_data):
    graph = parse(recorded_data("goats") / "goats_14.pyfg")
    log = fly(library.find("goats-auv"), [0])  # type: ignore[arg-type]
    a = log.acoustics
    assert len(a.toa_s) == 1558 and len(graph.ranges) == 1558
    assert a.toa_s[0] == 1.0 and a.toa_s[-1] == 5008.0
    buoys = np.stack([v.initial.position_m[0] for v in log.vehicles[1:]])
    auv = np.stack([np.interp(a.toa_s, log.time_s, log.truth["auv"][0, :, i]) for i in range(2)], axis=-1)
    residual = 1500 * a.travel_time_s[0] - np.linalg.norm(auv - buoys[a.sender[a.broadcast] - 1], axis=-1)
    assert np.nanmax(np.abs(residual)) > 150
    assert np.nanmedian(np.abs(residual)) < 5
    assert "no independent truth" in log.notes[0]


@pytest.mark.recorded
def test_mrclams_ranges_run_between_robots(recorded_data):
    """3537 ranges between five robots; the publishers removed their bias, so they fit the truth to 0.1 m."""
    recorded_data("mrclam6")
    log = fly(library.find("mrclam6-ranges-only"), [0])  # type: ignore[arg-type]
    a = log.acoustics
    assert {v.name for v in log.vehicles} == set(log.truth)
    assert len(a.toa_s) > 3500 and (a.receiver != a.sender[a.broadcast]).all()
    names = [v.name for v in log.vehicles]

    def place(who: np.ndarray, time_s: np.ndarray) -> np.ndarray:
        out = np.empty((len(who), 2))
        for i, name in enumerate(names):
            mine = who == i
            for axis in range(2):
                out[mine, axis] = np.interp(time_s[mine], log.time_s, log.truth[name][0, :, axis])
        return out

    apart = np.linalg.norm(place(a.receiver, a.toa_s) - place(a.sender[a.broadcast], a.toa_s), axis=-1)
    residual = 1500 * a.travel_time_s[0] - apart
    assert np.nanmedian(np.abs(residual)) < 0.15
