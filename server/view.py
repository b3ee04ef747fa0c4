"""A run as the page shows it: thinned curves of trial 0 and of the averages over trials."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from engine import registry
from engine.evaluation.consistency import nees_interval
from engine.evaluation.metrics import curves
from engine.runner import Shard
from engine.tracks import Belief, Reference, Series, Tracks, stack, stack_references
from server.wire import rounded

#: A screen shows no more times than this.
TIMES = 800

Parts = Sequence[tuple[Shard, Reference, Tracks]]


def thinned(count: int, most: int) -> np.ndarray:
    """At most `most` of the indices 0..count-1, evenly spread, first and last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)) if count else np.zeros(0, int)


def build(outline: dict[str, Any], parts: Parts, names: Sequence[str]) -> dict[str, Any]:
    """The view of the finished shards of a run, and of its mission's outline as workers tell it."""
    time_s = np.array(outline["time_s"], dtype=float)
    keep = thinned(len(time_s), TIMES)
    most = max((len(_trials(parts, name)) for name in names), default=0)
    return {
        "time_s": rounded(time_s[keep]),
        "subjects": outline["subjects"],
        "truth": {s: rounded(np.array(p, dtype=float)[keep]) for s, p in outline["truth"].items()},
        "algorithms": {n: _algorithm(n, parts, keep) for n in names if _trials(parts, n)},
        "nees_interval": list(nees_interval(max(most, 1))),
        "events": outline["events"],
    }


def _trials(parts: Parts, name: str) -> list[int]:
    return sorted(t for shard, _, _ in parts if shard.algorithm == name for t in shard.trials)


def _algorithm(name: str, parts: Parts, keep: np.ndarray) -> dict[str, Any]:
    mine = sorted((p for p in parts if p[0].algorithm == name), key=lambda p: p[0].trials[0])
    tracks = stack([t for _, _, t in mine])
    reference = stack_references([(r, len(shard.trials)) for shard, r, _ in mine])
    known = registry.algorithms().get(name)
    first = mine[0][0].trials[0] == 0
    return {
        "title": known.title if known else name,
        "centralized": bool(known and known.centralized),
        "trials": len(_trials(parts, name)),
        "subjects": {s: _subject(reference.truth.get(s), belief, keep, first) for s, belief in tracks.beliefs.items()},
        "series": {key: _series(series, keep) for key, series in tracks.series.items()},
        "notes": list(tracks.notes),
        "graph": first and bool(tracks.graph),
    }


def _subject(truth: np.ndarray | None, belief: Belief, keep: np.ndarray, first: bool) -> dict[str, Any]:
    over_time = curves(truth, belief)
    cov = belief.cov[0, keep]
    return {
        "mean": rounded(belief.mean[0, keep]) if first else [],
        "cov": rounded(np.stack([cov[:, 0, 0], cov[:, 0, 1], cov[:, 1, 1]], axis=-1), 6) if first else [],
        "error_m": rounded(over_time.error_m[keep]),
        "sigma_m": rounded(over_time.sigma_m[keep]),
        "nees": rounded(over_time.nees[keep]),
    }


def _series(series: Series, keep: np.ndarray) -> dict[str, Any]:
    with np.errstate(invalid="ignore"):
        value = series.value.mean(axis=0)[keep]
    return {
        "title": series.title,
        "unit": series.unit,
        "value": rounded(value, 5),
        "subjects": list(series.subjects),
    }
