"""What the trials of a run scatter by: errors one by one, percentiles over trials, innovations over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.evaluation.consistency import interval
from engine.tracks import Belief, Innovations


def errors(truth: np.ndarray | None, belief: Belief) -> np.ndarray:
    """Distance of every estimate from truth (trials or 1, T, 2) m: (trials, T) m, NaN where there is no reference."""
    if truth is None:
        return np.full(belief.mean.shape[:2], np.nan)
    with np.errstate(invalid="ignore"):
        away = belief.mean - truth
        return np.hypot(away[..., 0], away[..., 1])


def percentiles(value: np.ndarray, shares: Sequence[float]) -> np.ndarray:
    """Percentiles over trials of (trials, T) at shares of 0..1, (len(shares), T), interpolated as NumPy does it.

    What is not finite is left out; NaN where nothing is left.
    """
    order = np.sort(np.where(np.isfinite(value), value, np.nan), axis=0)
    last = np.isfinite(order).sum(axis=0) - 1
    found = np.full((len(shares), value.shape[1]), np.nan)
    there = np.flatnonzero(last >= 0)
    for row, share in zip(found, shares):
        place = share * last[there]
        low = np.floor(place).astype(int)
        high = np.ceil(place).astype(int)
        row[there] = order[low, there] + (place - low) * (order[high, there] - order[low, there])
    return found


@dataclass(frozen=True)
class Surprise:
    """Squared innovations relative to what was predicted, averaged over trials in spans of time, each (B,).

    time_s: middle of the span; value: the mean of those accepted, 1 expected; low, high: where it is at 95 % if they
    are white; refused: share of those offered that the gate refused.
    """

    time_s: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    refused: np.ndarray


def surprise(innovations: Innovations, start_s: float, end_s: float, spans: int) -> Surprise:
    """The innovations of start_s..end_s in equal spans of time; spans in which none was accepted are left out."""
    length = max(end_s - start_s, np.finfo(float).tiny)
    place = np.clip(((innovations.time_s - start_s) / length * spans).astype(int), 0, spans - 1)
    offered = np.isfinite(innovations.value) & (innovations.variance > 0)
    accepted = offered & innovations.accepted
    with np.errstate(invalid="ignore", divide="ignore"):
        square = np.where(accepted, innovations.value**2 / innovations.variance, 0.0)

    def total(of: np.ndarray) -> np.ndarray:
        return np.bincount(place, weights=of.sum(axis=0), minlength=spans)

    count, all_offered = total(accepted), total(offered)
    there = np.flatnonzero(count > 0)
    bounds = np.array([interval(1, int(n)) for n in count[there]]).reshape(-1, 2)
    return Surprise(
        start_s + (there + 0.5) * length / spans,
        total(square)[there] / count[there],
        bounds[:, 0],
        bounds[:, 1],
        1 - count[there] / all_offered[there],
    )
