"""Recorded arrival times at receivers whose places are known."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engine.mission.logs import log_folder
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.pursuit import PursuitScenario, Recorded


@dataclass(frozen=True)
class Log:
    """Pings that enough receivers heard for a position: arrival_s (pings, receivers), NaN where not.

    places (receivers, 3) m.
    time_s (pings,) is each ping's first arrival, truth (pings, 2) m the reference then, NaN where there is none.
    """

    names: tuple[str, ...]
    places: np.ndarray
    arrival_s: np.ndarray
    time_s: np.ndarray
    truth: np.ndarray


def read(scenario: PursuitScenario) -> Log:
    """The log a scenario names. Raises ScenarioError where files are absent, unreadable or do not fit each other."""
    mission = scenario.mission
    assert mission is not None
    folder = log_folder(scenario)
    arrivals = _matrix(folder / mission.arrivals, "mission.arrivals")
    places = _matrix(folder / mission.receivers, "mission.receivers")
    if places.shape[1] != 3:
        _refuse("mission.receivers", f"has {places.shape[1]} columns", "give x, y and depth")
    if len(arrivals) != len(places):
        _refuse("mission.arrivals", f"has {len(arrivals)} rows for {len(places)} receivers", "give one for each")
    if mission.names and len(mission.names) != len(places):
        _refuse("mission.names", f"{len(mission.names)} names for {len(places)} receivers", "give one for each")
    names = tuple(mission.names) or tuple(f"r{n + 1}" for n in range(len(places)))
    heard = np.isfinite(arrivals).sum(axis=0) > scenario.dimensions
    if heard.sum() < 2:
        _refuse("mission.arrivals", "has no two pings that enough receivers heard", "give a longer recording")
    arrival_s = arrivals[:, heard].T
    time_s = np.nanmin(arrival_s, axis=1)
    if not (np.diff(time_s) > 0).all():
        _refuse("mission.arrivals", "its pings are not in order of time", "sort the columns")
    return Log(names, places, arrival_s, time_s, _reference(mission, folder, time_s))


def _reference(mission: Recorded, folder: Path, time_s: np.ndarray) -> np.ndarray:
    """The reference track's position of each ping, found by its time."""
    truth = np.full((len(time_s), 2), np.nan)
    if mission.track is None:
        return truth
    with (folder / mission.track).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    needed = [c for c in (mission.track_time, mission.track_x, mission.track_y, mission.track_count) if c is not None]
    for column in needed:
        if not rows or column not in rows[0]:
            _refuse("mission.track", f"has no column {column!r}", "name the columns of its time, x and y")
    for row in rows:
        if mission.track_count is not None and int(row[mission.track_count] or 0) < mission.track_least:
            continue
        moment = float(row[mission.track_time]) - mission.origin_s
        n = int(np.argmin(np.abs(time_s - moment)))
        if abs(time_s[n] - moment) < 1.0:
            truth[n] = float(row[mission.track_x]), float(row[mission.track_y])
    return truth - np.array(mission.origin_m)


def _matrix(path: Path, key: str) -> np.ndarray:
    try:
        return np.atleast_2d(np.genfromtxt(path, delimiter=",", dtype=float))
    except ValueError as error:
        problem = Problem(key, f"is no table of numbers: {error}", "give the same columns in every row")
        raise ScenarioError([problem]) from None


def _refuse(key: str, found: str, remedy: str) -> None:
    raise ScenarioError([Problem(key, found, remedy)])
