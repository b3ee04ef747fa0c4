"""Whether one estimator is better than another: their figures' difference, trial by trial, with its interval.

All algorithms of a run see the same trials, so a difference is taken within each trial: what one trial has of bad
luck falls out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from engine.evaluation.consistency import sigma
from engine.evaluation.spread import errors
from engine.tracks import Belief

#: Probability with which an interval holds the difference that is true.
CONFIDENCE = 0.95

#: Figures of every trial, each (trials,), by the names that result.json has for them over all trials.
Figures = dict[str, np.ndarray]


@dataclass(frozen=True)
class Difference:
    """Mean difference, and half the width of its interval: NaN where there are fewer than two trials."""

    mean: float
    half: float


def figures(truth: np.ndarray | None, belief: Belief) -> Figures:
    """One subject's figures trial by trial: RMSE over time, final error, mean and final sigma, m; NaN for none."""
    error, spread = errors(truth, belief), sigma(belief)
    known = np.isfinite(error)
    count = known.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        rmse = np.sqrt(np.sum(error**2, axis=1, where=known) / count)
    reached = np.flatnonzero(known.any(axis=0))
    final = error[:, reached[-1]] if reached.size else np.full(len(error), np.nan)
    return {"rmse_m": rmse, "final_rmse_m": final, "sigma_m": spread.mean(axis=1), "final_sigma_m": spread[:, -1]}


def difference(value: np.ndarray, baseline: np.ndarray) -> Difference:
    """Mean of value - baseline, both (trials,), with Student's interval; pairs that are not finite are left out."""
    apart = value - baseline
    apart = apart[np.isfinite(apart)]
    n = len(apart)
    if n == 0:
        return Difference(np.nan, np.nan)
    if n == 1:
        return Difference(float(apart[0]), np.nan)
    half = stdtrit(n - 1, 0.5 + CONFIDENCE / 2) * apart.std(ddof=1) / np.sqrt(n)
    return Difference(float(apart.mean()), float(half))


def differences(
    found: Mapping[str, Mapping[str, Figures]], trials: Mapping[str, Sequence[int]]
) -> dict[str, dict[str, dict[str, dict[str, Difference]]]]:
    """{figure: {subject: {algorithm: {baseline: Difference}}}} of every algorithm against every other.

    found: {algorithm: {subject: Figures}} of the trials {algorithm: numbers}; those that both have are compared.
    """
    told: dict[str, dict[str, dict[str, dict[str, Difference]]]] = {}
    for name, subjects in found.items():
        for other, theirs in found.items():
            if other == name:
                continue
            _, mine, yours = np.intersect1d(trials[name], trials[other], return_indices=True)
            for subject in subjects.keys() & theirs.keys():
                for figure, value in subjects[subject].items():
                    place = told.setdefault(figure, {}).setdefault(subject, {}).setdefault(name, {})
                    place[other] = difference(value[mine], theirs[subject][figure][yours])
    return told
