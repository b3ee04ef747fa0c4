"""A simulated navigation mission: every vehicle's sensors, the channel between them, and the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engine.mission.channel import sound
from engine.mission.log import Log
from engine.mission.reports import report_times
from engine.mission.vehicle import sense, voyage
from engine.scenario.navigation import NavigationScenario


def simulate(scenario: NavigationScenario, trials: Sequence[int]) -> Log:
    """Fly the scenario's trials of the given numbers; the same numbers give the same log, whatever the block."""
    if scenario.duration_s is None:
        raise ValueError("a simulated mission needs a duration")
    voyages = [voyage(v, scenario.seed) for v in scenario.vehicles]
    time_s = report_times(scenario.duration_s, scenario.report_interval_s)
    return Log(
        duration_s=scenario.duration_s,
        trials=len(trials),
        time_s=time_s,
        truth={v.vehicle.name: np.array(v.route(time_s).position)[None] for v in voyages},
        vehicles=tuple(sense(v, scenario.duration_s, trials) for v in voyages),
        acoustics=sound(scenario, voyages, trials),
        sound_speed_mps=scenario.network.sound_speed_mps,
        sound_speed_sigma_mps=scenario.network.sound_speed_sigma_mps,
        gate_sigma=scenario.network.gate_sigma,
    )
