"""Statistics over any number of trials in little room: what blocks of trials leave, and how it adds up.

Sums over trials at every report time give what `engine.evaluation.metrics` computes from whole tracks; the errors of
single trials are kept as mean, variance and counts in fixed classes. Adding is exact but for rounding, so the same
blocks added in the same order give the same bits whoever computed them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from engine.evaluation.consistency import EXACT_M, nees, sigma, verdict
from engine.evaluation.metrics import distance, growth, number
from engine.tracks import Belief

#: Classes of errors, m: each 2 % wider than the one before, so that a quantile is known to 1 %.
EDGES_M = np.geomspace(1e-4, 1e7, 1281)
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 0.99)


@dataclass(frozen=True)
class Spread:
    """Values of single trials: how many, their mean, their summed squared deviation, and counts by class of EDGES_M.

    The first class holds what is below all edges, the last what is above, or not finite.
    """

    count: int
    mean: float
    squares: float
    classes: np.ndarray

    @staticmethod
    def of(value: np.ndarray) -> Spread:
        """The spread of values (n,)."""
        if not value.size:
            return Spread(0, 0.0, 0.0, np.zeros(len(EDGES_M) + 1, dtype=np.int64))
        classes = np.bincount(np.searchsorted(EDGES_M, value, side="right"), minlength=len(EDGES_M) + 1)
        with np.errstate(invalid="ignore"):
            mean = float(value.mean())
            return Spread(len(value), mean, float(((value - mean) ** 2).sum()), classes)

    def __add__(self, other: Spread) -> Spread:
        """Chan, Golub and LeVeque (1983), eq. 1.5."""
        count = self.count + other.count
        if not self.count or not other.count:
            return other if other.count else self
        apart = other.mean - self.mean
        mean = self.mean + apart * other.count / count
        squares = self.squares + other.squares + apart**2 * self.count * other.count / count
        return Spread(count, mean, squares, self.classes + other.classes)

    def quantile(self, q: float) -> float:
        """The value that a fraction q of the trials does not exceed, to half a class; inf beyond the last edge."""
        below = np.cumsum(self.classes)
        wanted = q * self.count
        place = int(np.searchsorted(below, wanted, side="left"))
        if place >= len(EDGES_M):
            return np.inf
        if place == 0:
            return float(EDGES_M[0])
        inside = (wanted - below[place - 1]) / self.classes[place]
        return float(EDGES_M[place - 1] * (EDGES_M[place] / EDGES_M[place - 1]) ** inside)

    def told(self) -> dict[str, Any]:
        """Mean, standard deviation, the 95 % interval of the mean, and quantiles; None for what is undefined."""
        if not self.count:
            return {"trials": 0, "mean_m": None, "deviation_m": None, "mean_interval_m": None, "quantiles_m": None}
        deviation = np.sqrt(self.squares / (self.count - 1)) if self.count > 1 else np.nan
        half = 1.96 * deviation / np.sqrt(self.count)
        return {
            "trials": self.count,
            "mean_m": number(self.mean),
            "deviation_m": number(deviation),
            "mean_interval_m": [number(self.mean - half), number(self.mean + half)] if np.isfinite(half) else None,
            "quantiles_m": {f"{q:g}": number(self.quantile(q)) for q in QUANTILES},
        }


@dataclass(frozen=True)
class Summary:
    """One algorithm's belief of one subject over `trials` trials.

    Sums over trials, each (T,): square of the squared errors (m^2) and known of the trials with a reference, spread of
    sigma (m), nees and tested of the NEES and the trials it exists in. error and final are the RMS errors of single
    trials and their errors at the last time with a reference; deviation_m is the largest distance to the benchmark's
    mean, NaN without one.
    """

    trials: int
    square: np.ndarray
    known: np.ndarray
    spread: np.ndarray
    nees: np.ndarray
    tested: np.ndarray
    error: Spread
    final: Spread
    deviation_m: float

    @staticmethod
    def of(truth: np.ndarray | None, belief: Belief, benchmark: Belief | None) -> Summary:
        """The summary of a block of trials against truth (trials or 1, T, 2) m."""
        trials, T = belief.mean.shape[:2]
        if truth is None:
            truth = np.full((1, T, 2), np.nan)
        known = np.broadcast_to(np.isfinite(truth).all(axis=-1), (trials, T))
        square = distance(belief.mean, truth) ** 2
        surprise = nees(truth, belief)
        counted = ~np.isnan(surprise)
        having = known.any(axis=1)
        per_trial = np.sqrt(np.sum(square, axis=1, where=known)[having] / known[having].sum(axis=1))
        last = np.flatnonzero(known.any(axis=0))[-1:]
        ends = [np.sqrt(square[known[:, t], t]) for t in last]
        return Summary(
            trials=trials,
            square=np.sum(square, axis=0, where=known),
            known=known.sum(axis=0),
            spread=sigma(belief).sum(axis=0),
            nees=np.sum(surprise, axis=0, where=counted),
            tested=counted.sum(axis=0),
            error=Spread.of(per_trial),
            final=Spread.of(ends[0] if ends else np.zeros(0)),
            deviation_m=np.nan if benchmark is None else float(distance(belief.mean, benchmark.mean).max()),
        )

    def __add__(self, other: Summary) -> Summary:
        sums = {f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(Summary)[:-1]}
        return Summary(**sums, deviation_m=float(np.fmax(self.deviation_m, other.deviation_m)))

    def metrics(self) -> dict[str, Any]:
        """The metrics of result.json that follow from a summary, and the spread over trials."""
        some = np.flatnonzero(self.known)
        with np.errstate(invalid="ignore", divide="ignore"):
            rmse = np.sqrt(self.square.sum() / self.known.sum()) if some.size else np.nan
            final = np.sqrt(self.square[some[-1]] / self.known[some[-1]]) if some.size else np.nan
            found = verdict(self.nees / self.tested, self.tested, self.trials)
        spread = self.spread / self.trials
        name, consistent, sentence = found.name, found.consistent, found.sentence
        if number(rmse) is not None and name == "no reference":
            name, consistent = "consistent", True
            sentence = f"Consistent: it says that its position is known exactly, and it is, to {EXACT_M:g} m."
        return {
            "rmse_m": number(rmse),
            "final_rmse_m": number(final),
            "sigma_m": number(spread.mean()),
            "final_sigma_m": number(spread[-1]),
            "sigma_growth": growth(spread),
            "anees": number(found.anees),
            "anees_interval": list(found.interval),
            "consistent": consistent,
            "verdict": name,
            "explanation": sentence,
            "max_deviation_m": number(self.deviation_m),
            "error_over_trials": self.error.told(),
            "final_error_over_trials": self.final.told(),
        }

    def curves(self) -> dict[str, list[float | None]]:
        """RMS error (m), mean sigma (m) and mean NEES over trials at every report time."""
        with np.errstate(invalid="ignore", divide="ignore"):
            lines = {
                "error_m": np.sqrt(self.square / self.known),
                "sigma_m": self.spread / self.trials,
                "nees": self.nees / self.tested,
            }
        return {name: [number(value) for value in line] for name, line in lines.items()}
