"""Missions made by hand with surfacings, and their chains as sent and received."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np

from engine.mission.log import Fixes, Log
from engine.navigation.mission import Launch, NavigationMission, prepare
from engine.smoothing.local_chain import LocalChain, local_chain

sys.path.insert(0, str(Path(__file__).parents[1] / "navigation"))
from loglab import make_log, path

SURFACINGS = ((150.0, 180.0), (400.0, 430.0), (650.0, 680.0))


def surfacing_log(surfacings=SURFACINGS, *, trials: int = 3, duration_s: float = 900.0, **settings) -> Log:
    """Two vehicles that dead-reckon; the first has a fix a second, 3 m, in some intervals."""
    log = make_log([(0, 1), (1, 0)], trials=trials, duration_s=duration_s, fixed_by_gps=(), **settings)
    if not surfacings:
        return log
    rng = np.random.default_rng(1)
    time = np.concatenate([np.arange(a, b) for a, b in surfacings])
    value = path(0, time) + rng.normal(size=(trials, len(time), 2)) * 3.0
    fixes = Fixes(time, value, np.tile(np.eye(2) * 9.0, (len(time), 1, 1)))
    first = dataclasses.replace(log.vehicles[0], fixes=fixes)
    return dataclasses.replace(log, vehicles=(first, *log.vehicles[1:]))


def chain_of(mission: NavigationMission, vehicle: int = 0, *, consistent: bool = False) -> LocalChain:
    """The approximate chain of a vehicle of a mission."""
    return local_chain(
        mission.log.vehicles[vehicle],
        mission.chains[vehicle],
        launch_times(mission, vehicle),
        mission.trials,
        consistent=consistent,
    )


def launch_times(mission: NavigationMission, vehicle: int = 0) -> np.ndarray:
    return np.array([e.time_s for e in mission.events if isinstance(e, Launch) and e.vehicle == vehicle])


def surfacing_mission(surfacings=SURFACINGS, options: dict | None = None, **settings) -> NavigationMission:
    return prepare(surfacing_log(surfacings, **settings), options)
