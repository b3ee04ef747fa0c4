"""Recorded range logs as missions with unknown beacons."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.scenario.slam import SlamScenario
from engine.slam.mission import fly, outline

pytestmark = pytest.mark.recorded
SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


def recorded(name: str, every_s: float, scale: float = 1.0) -> SlamScenario:
    """The log of a navigation scenario as one of unknown beacons."""
    tables = tomllib.loads((SCENARIOS / f"{name}.toml").read_text())
    kept = {key: tables[key] for key in ("schema", "title", "duration_s", "mission", "vehicles")}
    return SlamScenario.model_validate(kept | {"family": "slam", "ranging": {"every_s": every_s, "scale": scale}})


def test_plaza_has_ranges_to_four_beacons_of_known_place(recorded_data):
    """They read seven per cent too long, which a scale takes away."""
    recorded_data("plaza1")
    mission = fly(recorded("plaza1-four-beacons", 20.0, 1.07), [0])
    log = mission.log(0)
    assert mission.vehicle == "robot" and set(mission.beacons) == {"west", "south", "east", "north"}
    assert len(mission.time_s) == log.poses and log.steps.shape == (log.poses - 1, 3)
    assert np.all(np.linalg.eigvalsh(log.step_cov) > 0)
    robot = mission.truth["robot"][0]
    off = [r.range_m - np.linalg.norm(robot[r.pose] - mission.truth[r.beacon][0, r.pose]) for r in log.readings]
    assert abs(np.median(off)) < 0.3
    windows = {(r.beacon, int(mission.time_s[r.pose] // 20.0)) for r in log.readings}
    assert len(windows) == len(log.readings) > 250


def test_reckoning_the_steps_from_the_start_follows_the_truth_for_a_while(recorded_data):
    recorded_data("plaza1")
    mission = fly(recorded("plaza1-four-beacons", 20.0), [0])
    log = mission.log(0)
    assert log.start is not None
    pose, track = log.start.copy(), [log.start[:2].copy()]
    for step in log.steps:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        pose += [c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]]
        track.append(pose[:2].copy())
    error = np.linalg.norm(np.array(track) - mission.truth["robot"][0], axis=1)
    assert error[mission.time_s < 60].max() < 2.0


def test_goats_says_that_its_reference_proves_nothing(recorded_data):
    recorded_data("goats")
    mission = fly(recorded("goats-auv", 20.0), [0, 1])
    assert len(mission.beacons) == 4 and any("proves nothing" in n or "prove nothing" in n for n in mission.notes)
    shown = outline(mission)
    assert len(shown.subjects) == 5 and len([e for e in shown.events if e["kind"] == "packet"]) > 500
