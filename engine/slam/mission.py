"""A mission of localization and mapping by sound, ready for estimators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from engine.mission.logs import log_folder
from engine.registry import Outline
from engine.scenario.recording import Simulated, SonarRecording
from engine.scenario.slam import SlamScenario
from engine.slam.log import SlamLog
from engine.slam.recorded import Recorded, read
from engine.slam.simulate import fly_trial, truth
from engine.slam.sonar_recording import read_sonar


@dataclass(frozen=True)
class SlamMission:
    """One block of trials: the poses' times time_s (P,), the truth {name: (1, P, 2)} there, and who is who.

    options {algorithm: {name: value}} is what the scenario asks of single algorithms.
    """

    scenario: SlamScenario
    trials: tuple[int, ...]
    time_s: np.ndarray
    truth: dict[str, np.ndarray]
    vehicle: str
    beacons: tuple[str, ...]
    recorded: Recorded | None = None
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was noticed on reading a recording."""
        return () if self.recorded is None else self.recorded.notes

    def log(self, k: int) -> SlamLog:
        """The log of trial number k of the block, flown anew at every call: records of all trials would fill memory."""
        return self.recorded.log if self.recorded is not None else fly_trial(self.scenario, self.trials[k])


def fly(scenario: SlamScenario, trials: Sequence[int]) -> SlamMission:
    """The mission of a block of trials, given by their absolute numbers."""
    if not isinstance(scenario.mission, Simulated):
        if isinstance(scenario.mission, SonarRecording):
            recorded = read_sonar(scenario, scenario.mission, log_folder(scenario))
            moving, beacons = scenario.mission.vehicle, (scenario.mission.beacon,)
        else:
            recorded = read(scenario)
            moving = next(v.name for v in scenario.vehicles if v.kind != "fixed")
            beacons = tuple(v.name for v in scenario.vehicles if v.kind == "fixed")
        return SlamMission(
            scenario, tuple(trials), recorded.time_s, recorded.truth, moving, beacons, recorded, scenario.options
        )
    assert scenario.vehicle is not None and scenario.beacon is not None
    time_s, vehicle, beacon = truth(scenario)
    names = scenario.vehicle.name, scenario.beacon.name
    places = dict(zip(names, (vehicle[None], beacon[None])))
    return SlamMission(scenario, tuple(trials), time_s, places, names[0], (names[1],), options=scenario.options)


def outline(mission: SlamMission) -> Outline:
    """Vehicle, beacons, what was heard of them and the fixes, of the first trial."""
    scenario, log = mission.scenario, mission.log(0)
    depth = {c.name: c.depth_m for c in (scenario.vehicle, scenario.beacon) if c is not None}
    depth |= {v.name: v.depth_m for v in scenario.vehicles}
    kinds = {v.name: v.kind for v in scenario.vehicles}
    subjects = [
        {"name": mission.vehicle, "kind": kinds.get(mission.vehicle, "auv"), "depth_m": depth.get(mission.vehicle, 0.0)}
    ]
    subjects += [{"name": name, "kind": "beacon", "depth_m": depth.get(name, 0.0)} for name in mission.beacons]
    heard = [(p.pose, p.beacon, p.strongest_m) for p in log.pings]
    heard += [(r.pose, r.beacon, r.range_m) for r in log.readings]
    heard += [(k, a.beacon, a.array.focus_m) for a in log.arrays for k in a.poses]
    events: list[tuple[float, dict[str, Any]]] = []
    for pose, beacon, range_m in {(pose, beacon): (pose, beacon, r) for pose, beacon, r in heard}.values():
        arrived = float(mission.time_s[pose])
        travelled = range_m / scenario.sonar.sound_speed_mps
        sent, arrived = (arrived - travelled, arrived) if log.readings else (arrived, arrived + travelled)
        packet = {"kind": "packet", "from": beacon, "to": mission.vehicle, "heard": True}
        events.append((arrived, packet | {"tol_s": sent, "toa_s": arrived}))
    for pose in log.fixed:
        at = float(mission.time_s[pose])
        events.append((at, {"kind": "fix", "subject": mission.vehicle, "time_s": at}))
    return Outline(subjects, [event for _, event in sorted(events, key=lambda e: e[0])])
