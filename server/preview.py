"""What was understood of a recorded mission: sensors and their readings, ranges, and a plan of it all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from engine.mission import recorded
from engine.mission.log import Log, VehicleLog
from engine.scenario.navigation import NavigationScenario
from server.view import thinned
from server.wire import rounded

SENSORS = ("odometry", "velocity", "heading", "depth", "fixes")
#: Points of a track, and ranges, that are told.
POINTS, RANGES = 400, 1500


def understood(scenario: NavigationScenario, root: Path) -> dict[str, Any]:
    """What a scenario makes of the log in a folder below root. Raises ScenarioError for what cannot be read."""
    log = recorded.read(scenario.model_copy(update={"origin": str(root)}), [0])
    return {
        "duration_s": log.duration_s,
        "notes": list(log.notes),
        "vehicles": [_vehicle(log, vehicle) for vehicle in log.vehicles],
        "ranges": _ranges(log),
        "pairs": _pairs(log),
    }


def _vehicle(log: Log, vehicle: VehicleLog) -> dict[str, Any]:
    sensors = []
    for kind in SENSORS:
        sensor = getattr(vehicle, kind)
        if sensor is not None:
            t = sensor.time_s
            sensors.append({"kind": kind, "readings": len(t), "from_s": float(t[0]), "to_s": float(t[-1])})
    truth = log.truth.get(vehicle.name)
    fixes = vehicle.fixes.value[0] if vehicle.fixes is not None else np.zeros((0, 2))
    return {
        "name": vehicle.name,
        "kind": vehicle.kind,
        "start_m": rounded(vehicle.initial.position_m[0]),
        "sensors": sensors,
        "truth": _track(truth[0][np.isfinite(truth[0]).all(axis=1)]) if truth is not None else [],
        "reckoned": _track(reckoned(vehicle)),
        "fixes": _track(fixes),
    }


def reckoned(vehicle: VehicleLog) -> np.ndarray:
    """Positions (N, 2) m by integrating a vehicle's odometry, else its velocities, from where it believes to start."""
    start = vehicle.initial.position_m[0]
    if vehicle.odometry is not None:
        forward, left, turn = vehicle.odometry.value[0].T
        before = vehicle.initial.heading_rad[0] + np.concatenate([[0.0], np.cumsum(turn)[:-1]])
        steps = _turned(forward, left, before)
    elif vehicle.velocity is not None and vehicle.heading is not None:
        t = vehicle.velocity.time_s
        heading = np.interp(t, vehicle.heading.time_s, np.unwrap(vehicle.heading.value[0]))
        forward, left = vehicle.velocity.value[0].T
        steps = _turned(forward, left, heading) * np.diff(t, prepend=t[:1])[:, None]
    else:
        return np.zeros((0, 2))
    return start + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def _turned(forward: np.ndarray, left: np.ndarray, heading: np.ndarray) -> np.ndarray:
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([c * forward - s * left, s * forward + c * left], axis=-1)


def _track(points: np.ndarray) -> list[Any]:
    return rounded(points[thinned(len(points), POINTS)], 2) if len(points) else []


def _ranges(log: Log) -> list[Any]:
    """Ranges over time [s, m], thinned."""
    a = log.acoustics
    found = np.stack([a.toa_s, a.travel_time_s[0] * log.sound_speed_mps], axis=-1)
    found = found[np.isfinite(found[:, 1])]
    return rounded(found[thinned(len(found), RANGES)], 2) if len(found) else []


def _pairs(log: Log) -> list[dict[str, Any]]:
    """Who heard whom, how often, over which ranges."""
    a = log.acoustics
    names = [v.name for v in log.vehicles]
    distance = a.travel_time_s[0] * log.sound_speed_mps
    pairs = []
    for s, sender in enumerate(names):
        for r, receiver in enumerate(names):
            mine = distance[(a.sender[a.broadcast] == s) & (a.receiver == r)]
            heard = mine[np.isfinite(mine)]
            if len(mine):
                extent = [float(heard.min()), float(heard.max())] if len(heard) else None
                pairs.append({"from": sender, "to": receiver, "heard": len(heard), "of": len(mine), "range_m": extent})
    return pairs
