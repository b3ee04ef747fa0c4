"""Estimators that only listen: every arrival reaches them, and nobody steers by what they find.

On a recording the receivers are where it says; on a simulated pursuit those that cannot move stay at their start and
the others are in perfect formation about the true target.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from engine.gaussian.forms import Moments
from engine.notes import Note
from engine.pursuit.arrivals import Surprise
from engine.pursuit.diary import innovations
from engine.pursuit.mission import PursuitMission
from engine.pursuit.multilateration import locate
from engine.pursuit.options import FilterOptions
from engine.pursuit.tracker import Tracker
from engine.registry import Progress
from engine.scenario.errors import Problem, ScenarioError
from engine.tracks import Belief, Series, Tracks

#: Errors smaller than this count as `within_1m`, m.
NEAR_M = 1.0


@dataclass(frozen=True)
class Arrivals:
    """Pings at time_s (P,): distance_m (trials, P, R), heard (trials, P, R), places (trials, P, R, d) m."""

    time_s: np.ndarray
    distance_m: np.ndarray
    heard: np.ndarray
    places: np.ndarray


class FilterChoice(FilterOptions):
    """Of the filter that listens."""

    receivers: list[str] = Field([], max_length=32, description="the receivers it listens to, by name; none named: all")


def listen(mission: PursuitMission) -> Arrivals:
    """All arrivals of a mission, at all its receivers."""
    c, d = mission.scenario.network.sound_speed_mps, mission.dimensions
    if mission.log is not None:
        since_first = mission.log.arrival_s - mission.log.time_s[:, None]
        places = np.broadcast_to(mission.log.places[:, :d], (1, *since_first.shape, d))
        heard = np.isfinite(since_first)[None]
        return Arrivals(mission.log.time_s, np.where(heard, c * since_first, 0.0), heard, places)
    assert mission.chances is not None
    cycle_s, end_s = mission.scenario.cycle_s, float(mission.time_s[-1])
    time_s = cycle_s * np.arange(int(np.ceil(end_s / cycle_s - 1e-9)))
    chances, P = mission.chances, len(time_s)
    source = np.stack([mission.target_at(t + chances.jitter_s[:, k]) for k, t in enumerate(time_s)], axis=1)
    places = np.zeros((mission.trials, P, len(mission.names), d))
    stays = np.array([v.max_speed_mps == 0 for v in mission.scenario.vehicles])
    in_formation = source[:, :, None, :2] + mission.offsets
    places[..., :2] = np.where(stays[:, None], mission.starts()[:, None], in_formation)
    places[..., 2:] = mission.depths_m[:, None]
    distance = np.linalg.norm(places - source[:, :, None], axis=-1)
    distance += c * chances.jitter_s[:, :P, None] + chances.noise_m[:, :P]
    return Arrivals(time_s, distance, chances.pings[:, :P], places)


def run_multilateration(mission: PursuitMission, progress: Progress) -> Tracks:
    """Every ping by itself; between pings, and where one does not tell, the last position stands."""
    pings, d = listen(mission), mission.dimensions
    start = np.broadcast_to(mission.first.mean[:, None, :d], (*pings.heard.shape[:2], d))
    found = locate(pings.distance_m, pings.heard, pings.places, mission.scenario.network.range_sigma_m, start)
    good = np.isfinite(found.mean).all(axis=-1)
    latest = np.maximum.accumulate(np.where(good, np.arange(len(pings.time_s)), -1), axis=1)
    column = np.searchsorted(pings.time_s, mission.time_s + 1e-9, side="right") - 1
    chosen = latest[:, column]
    trial = np.arange(mission.trials)[:, None]
    known = chosen >= 0
    first = mission.first
    mean = np.where(known[..., None], found.mean[trial, chosen, :2], first.mean[:, None, :2])
    cov = np.where(known[..., None, None], found.cov[trial, chosen, :2, :2], first.cov[:, None, :2, :2])
    progress(1.0, None)
    lost = int((~good).sum())
    notes = (Note("{} pings gave no position", lost),) if lost else ()
    return _tracks(mission, Moments(mean, cov), notes)


def run_filter(mission: PursuitMission, progress: Progress) -> Tracks:
    """The sigma-point filter over all pings, from the receivers chosen."""
    options = FilterChoice(**mission.options.get("tdoa_filter", {}))
    chosen = _chosen(mission, options)
    pings = listen(mission)
    tracker = Tracker.of(mission, Moments(mission.first.mean[:, None], mission.first.cov[:, None]), options)
    surprises: list[Surprise] = []
    for k, moment in enumerate(pings.time_s):
        tracker.advance(float(moment))
        tracker.begin()
        distance, heard = pings.distance_m[:, None, k, chosen], pings.heard[:, None, k, chosen]
        _, surprise = tracker.hear(distance, heard, pings.places[:, None, k, chosen])
        surprises.append(surprise)
        if k % 20 == 0:
            progress(k / len(pings.time_s), None)
    tracker.finish(float(mission.time_s[-1]))
    belief = Moments(tracker.mean[:, 0, :, :2], tracker.cov[:, 0, :, :2, :2])
    return _tracks(mission, belief, (), (pings.time_s, surprises))


def _chosen(mission: PursuitMission, options: FilterChoice) -> list[int]:
    problems = [
        Problem(
            f"options.tdoa_filter.receivers[{n}]",
            f"there is no receiver {name!r}",
            f"there are: {', '.join(mission.names)}",
        )
        for n, name in enumerate(options.receivers)
        if name not in mission.names
    ]
    if problems:
        raise ScenarioError(problems)
    return [mission.names.index(name) for name in options.receivers or mission.names]


def _tracks(
    mission: PursuitMission,
    belief: Moments,
    notes: tuple[Note, ...],
    heard: tuple[np.ndarray, list[Surprise]] | None = None,
) -> Tracks:
    """The one estimate, as every vehicle's that pursues."""
    subjects = [s for s in mission.truth if s == "target" or s.startswith("target-")]
    series = {}
    for s in subjects:
        away = np.linalg.norm(belief.mean - mission.truth[s], axis=-1)
        near = np.where(np.isfinite(away), away < NEAR_M, np.nan)
        series[f"within_1m/{s}"] = Series("Share of positions within 1 m", "1", near, (s,))
    surprise = {s: innovations(*heard, 0) for s in subjects} if heard else {}
    return Tracks(
        beliefs={s: Belief(belief.mean, belief.cov) for s in subjects},
        series=series,
        innovations=surprise,
        notes=notes,
    )
