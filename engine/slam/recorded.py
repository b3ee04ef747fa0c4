"""Recorded range logs as missions: the beacons' places, which the log may know, are kept for scoring alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.mission.log import Log
from engine.mission.recorded import read as read_log
from engine.navigation.chains import integrate
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.navigation import NavigationScenario
from engine.scenario.slam import MAX_POSES, SlamScenario
from engine.slam.log import Reading, SlamLog

#: Keeps the covariance of a step in which the vehicle stood still positive definite, m^2 and rad^2.
STILL = np.diag([1e-4, 1e-4, 1e-6])


@dataclass(frozen=True)
class Recorded:
    """A recording: pose times time_s (P,), the log, and the truth {name: (1, P, 2)} where there is one."""

    time_s: np.ndarray
    log: SlamLog
    truth: dict[str, np.ndarray]
    notes: tuple[str, ...]


def read(scenario: SlamScenario) -> Recorded:
    """Read a recording: a pose at every range that is used, one of each beacon in every `ranging.every_s`.

    Raises ScenarioError where files are missing, or there is no odometry or no range.
    """
    shared = ("title", "duration_s", "seed", "vehicles", "mission", "origin")
    navigation = NavigationScenario.model_validate(
        {"schema": 1, "family": "navigation"} | {key: getattr(scenario, key) for key in shared}
    )
    whole = read_log(navigation, [0])
    v = next(i for i, vehicle in enumerate(whole.vehicles) if vehicle.kind != "fixed")
    vehicle = whole.vehicles[v]
    if vehicle.odometry is None:
        message = f"{vehicle.name!r} has no odometry"
        raise ScenarioError([Problem("mission.odometry", message, "map its pose increments")])
    used = chosen(whole, v, scenario.ranging.every_s)
    if not used:
        raise ScenarioError([Problem("mission.ranges", f"{vehicle.name!r} measured no range", "map the ranges")])
    toa, heard = whole.acoustics.toa_s, whole.acoustics.travel_time_s[0] * whole.sound_speed_mps
    time_s = np.unique(np.concatenate([[0.0], toa[used]]))
    if len(time_s) > MAX_POSES:
        problem = Problem("ranging.every_s", f"makes {len(time_s)} poses, at most {MAX_POSES}", "give a longer time")
        raise ScenarioError([problem])
    steps, cov = integrate(vehicle.odometry, time_s)
    readings = []
    for r in used:
        sender = whole.vehicles[int(whole.acoustics.sender[whole.acoustics.broadcast[r]])]
        pose = int(np.searchsorted(time_s, toa[r]))
        readings.append(Reading(pose, sender.name, float(heard[r]) / scenario.ranging.scale, vehicle.range_sigma_m))
    initial = vehicle.initial
    start_cov = np.zeros((3, 3))
    start_cov[:2, :2] = initial.position_cov
    start_cov[2, 2] = initial.heading_sigma_rad**2
    truth = {n: _between(whole.time_s, position[0], time_s)[None] for n, position in whole.truth.items()}
    for beacon in whole.vehicles:
        if beacon.kind == "fixed":
            truth[beacon.name] = np.broadcast_to(beacon.initial.position_m[0], (1, len(time_s), 2)).copy()
    log = SlamLog(
        steps=steps[:, 0],
        step_cov=cov[:, 0] + STILL,
        fix_m=np.full((len(time_s), 2), np.nan),
        fix_sigma_m=0.0,
        fixed=(),
        readings=tuple(readings),
        start=np.array([*initial.position_m[0], initial.heading_rad[0]]),
        start_cov=start_cov,
    )
    return Recorded(time_s, log, truth, whole.notes)


def chosen(log: Log, vehicle: int, every_s: float) -> list[int]:
    """Numbers of the receptions to use: the first of each sender in every stretch of every_s, in order of time."""
    acoustics, taken, used = log.acoustics, set(), []
    for r in np.flatnonzero(acoustics.receiver == vehicle):
        window = (int(acoustics.sender[acoustics.broadcast[r]]), int(acoustics.toa_s[r] // every_s))
        inside = 0.0 <= acoustics.toa_s[r] <= log.duration_s
        if inside and window not in taken and np.isfinite(acoustics.travel_time_s[0, r]):
            taken.add(window)
            used.append(int(r))
    return used


def _between(time_s: np.ndarray, position: np.ndarray, at_s: np.ndarray) -> np.ndarray:
    """Positions (T, 2) interpolated at other times; NaN beside what is NaN."""
    return np.stack([np.interp(at_s, time_s, column) for column in position.T], axis=-1)
