"""A run as the page shows it: thinned curves of trial 0, of averages and percentiles over trials, and comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from engine import registry
from engine.evaluation.consistency import nees_interval, sigma
from engine.evaluation.metrics import curves
from engine.evaluation.paired import differences, figures
from engine.evaluation.spread import errors, percentiles, surprise
from engine.runner import Shard
from engine.tracks import Belief, Innovations, Reference, Series, Tracks, stack, stack_references
from server.wire import rounded

#: A screen shows no more times than this.
TIMES = 800
#: Innovations are averaged over this many spans of the mission.
SPANS = 80
#: A gap longer than this (s) begins a new run of fixes.
FIX_GAP_S = 30.0
#: The percentiles over trials that are shown: the middle one and a band.
BAND = (0.05, 0.5, 0.95)
#: The shares of all errors for which the view tells how large they are.
SHARES = np.linspace(0.0, 1.0, 101)

Parts = Sequence[tuple[Shard, Reference, Tracks]]


def thinned(count: int, most: int) -> np.ndarray:
    """At most `most` of the indices 0..count-1, evenly spread, first and last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)) if count else np.zeros(0, int)


def build(outline: dict[str, Any], parts: Parts, names: Sequence[str]) -> dict[str, Any]:
    """The view of the finished shards of a run, and of its mission's outline as workers tell it."""
    time_s = np.array(outline["time_s"], dtype=float)
    keep = thinned(len(time_s), TIMES)
    trials = {name: _trials(parts, name) for name in names}
    most = max(map(len, trials.values()), default=0)
    told = {name: _gathered(name, parts) for name in names if trials[name]}
    span = (time_s[0], time_s[-1], SPANS) if len(time_s) else (0.0, 0.0, SPANS)
    return {
        "time_s": rounded(time_s[keep]),
        "subjects": outline["subjects"],
        "truth": {s: rounded(np.array(p, dtype=float)[keep]) for s, p in outline["truth"].items()},
        "algorithms": {n: _algorithm(n, trials[n], *found, keep, span) for n, found in told.items()},
        "nees_interval": list(nees_interval(max(most, 1))),
        "nees_interval_alone": list(nees_interval(1)),
        "band": list(BAND),
        "differences": _differences(told, trials),
        "events": _events(outline["events"]),
    }


def _events(events: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """What happened, in order; fixes of a subject that follow each other within FIX_GAP_S as one, until `until_s`."""
    told: list[dict[str, Any]] = []
    latest: dict[str, dict[str, Any]] = {}
    for event in events:
        last = latest.get(event["subject"]) if event["kind"] == "fix" else None
        if last is not None and event["time_s"] - last["until_s"] <= FIX_GAP_S:
            last["until_s"] = event["time_s"]
            continue
        if event["kind"] == "fix":
            event = latest[event["subject"]] = event | {"until_s": event["time_s"]}
        told.append(event)
    return told


def _trials(parts: Parts, name: str) -> list[int]:
    return sorted(t for shard, _, _ in parts if shard.algorithm == name for t in shard.trials)


def _gathered(name: str, parts: Parts) -> tuple[Reference, Tracks]:
    mine = sorted((p for p in parts if p[0].algorithm == name), key=lambda p: p[0].trials[0])
    reference = stack_references([(r, len(shard.trials)) for shard, r, _ in mine])
    return reference, stack([t for _, _, t in mine])


def _differences(told: dict[str, tuple[Reference, Tracks]], trials: dict[str, list[int]]) -> dict[str, Any]:
    """{figure: {subject: {algorithm: {baseline: [mean, half width of the 95 % interval]}}}}; None for none."""
    found = {
        name: {s: figures(reference.truth.get(s), belief) for s, belief in tracks.beliefs.items()}
        for name, (reference, tracks) in told.items()
    }
    return {
        figure: {
            subject: {
                name: {other: rounded(np.array([d.mean, d.half]), 6) for other, d in others.items()}
                for name, others in algorithms.items()
            }
            for subject, algorithms in subjects.items()
        }
        for figure, subjects in differences(found, trials).items()
    }


def _algorithm(
    name: str,
    trials: list[int],
    reference: Reference,
    tracks: Tracks,
    keep: np.ndarray,
    span: tuple[float, float, int],
) -> dict[str, Any]:
    known = registry.algorithms().get(name)
    first = trials[0] == 0
    return {
        "title": known.title if known else name,
        "centralized": bool(known and known.centralized),
        "trials": len(trials),
        "subjects": {s: _subject(reference.truth.get(s), belief, keep, first) for s, belief in tracks.beliefs.items()},
        "series": {key: _series(series, keep) for key, series in tracks.series.items()},
        "surprise": {s: _surprise(seen, span) for s, seen in tracks.innovations.items()},
        "notes": [str(note) for note in tracks.notes],
        "graph": first and "graphs" in tracks.graph,
        "schedule": first and "slots" in tracks.graph,
        "sound": first and "moments" in tracks.graph,
    }


def _subject(truth: np.ndarray | None, belief: Belief, keep: np.ndarray, first: bool) -> dict[str, Any]:
    over_time = curves(truth, belief)
    cov = belief.cov[0, keep]
    error = errors(truth, belief)
    return {
        "mean": rounded(belief.mean[0, keep]) if first else [],
        "cov": rounded(np.stack([cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]], axis=-1), 6) if first else [],
        "error_m": rounded(over_time.error_m[keep]),
        "sigma_m": rounded(over_time.sigma_m[keep]),
        "nees": rounded(over_time.nees[keep]),
        "band": {
            "error_m": _band(error[:, keep]),
            "sigma_m": _band(sigma(belief)[:, keep]),
        },
        "distribution_m": _distribution(truth, error, keep),
    }


def _distribution(truth: np.ndarray | None, error: np.ndarray, keep: np.ndarray) -> list[float]:
    """The errors (trials, T) m that SHARES of them, at the times kept, do not exceed; the last is the largest of all.

    Empty where there is no reference, and where an estimate failed, so that its error is no number.
    """
    if truth is None:
        return []
    known = np.broadcast_to(np.isfinite(truth).all(axis=-1), error.shape)
    if not known[:, keep].any() or not np.isfinite(error[known]).all():
        return []
    found = np.quantile(error[:, keep][known[:, keep]], SHARES)
    found[-1] = error[known].max()
    return rounded(found)


def _band(value: np.ndarray, digits: int = 3) -> list[list[Any]] | None:
    """Percentiles BAND of (trials, T); None where all trials are the same."""
    if len(value) == 1 or np.array_equal(value, np.broadcast_to(value[0], value.shape), equal_nan=True):
        return None
    return rounded(percentiles(value, BAND), digits)


def _surprise(seen: Innovations, span: tuple[float, float, int]) -> dict[str, Any]:
    return {name: rounded(value) for name, value in vars(surprise(seen, *span)).items()}


def _series(series: Series, keep: np.ndarray) -> dict[str, Any]:
    with np.errstate(invalid="ignore"):
        value = series.value.mean(axis=0)[keep]
    return {
        "title": series.title,
        "unit": series.unit,
        "value": rounded(value, 5),
        "band": _band(series.value[:, keep], 5),
        "subjects": list(series.subjects),
    }
