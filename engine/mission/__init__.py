"""Missions: simulated from a scenario's paths and sensors, or read from a person's own recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from engine.mission.log import Log
from engine.mission.simulate import simulate
from engine.scenario.navigation import NavigationScenario
from engine.scenario.recording import Simulated


def fly(scenario: NavigationScenario, trials: Sequence[int], *, logs: Sequence[Path | str] = ()) -> Log:
    """The log of a block of trials, given by their absolute numbers; `logs` are further folders to find recordings in.

    A recording is the same in every trial. Raises ScenarioError where it is missing or cannot be read.
    """
    if isinstance(scenario.mission, Simulated):
        return simulate(scenario, trials)
    from engine.mission.recorded import read

    return read(scenario, trials, logs)
