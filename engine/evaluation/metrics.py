"""Figures of every algorithm and subject: error, believed error, consistency, correlation, ranges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from engine.evaluation.consistency import EXACT_M, interval, judge, nees, nees_interval, sigma, trial_mean
from engine.tracks import Belief, Innovations, Series, Tracks

#: One subject's metrics under the names of result.json; None where a figure does not exist.
SubjectMetrics = dict[str, Any]


class Scored(Protocol):
    """Report times (T,) and truth {subject: (trials or 1, T, 2)}, NaN where there is no reference."""

    @property
    def time_s(self) -> np.ndarray: ...
    @property
    def truth(self) -> Mapping[str, np.ndarray]: ...


@dataclass(frozen=True)
class Curves:
    """One subject over time, each (T,): RMS error over trials (m), mean sigma (m), trial-averaged NEES.

    interval holds the NEES at 95 % of the times if the estimator is consistent. NaN where there is no
    reference; nees is inf where a covariance is not positive definite.
    """

    error_m: np.ndarray
    sigma_m: np.ndarray
    nees: np.ndarray
    interval: tuple[float, float]


def curves(truth: np.ndarray | None, belief: Belief) -> Curves:
    """Error, sigma and NEES over time of one belief against truth (trials or 1, T, 2) m, or None."""
    trials, T = belief.mean.shape[:2]
    if truth is None:
        truth = np.full((1, T, 2), np.nan)
    return Curves(
        np.sqrt(_mean_square(truth, belief)),
        sigma(belief).mean(axis=0),
        trial_mean(nees(truth, belief))[0],
        nees_interval(trials),
    )


def evaluate(
    mission: Scored, results: Mapping[str, Tracks], centralized: str | None = None
) -> dict[str, dict[str, SubjectMetrics]]:
    """The metrics of every algorithm and subject as result.json has them; `centralized` names the benchmark.

    rmse_m is over trials and times, final_rmse_m over trials at the last time with a reference; sigma_m is
    the mean over trials and times of the fourth root of the xy covariance's determinant, final_sigma_m its
    mean at the last time; sigma_growth its mean over the last quarter of the mission relative to the second, above
    one where uncertainty keeps growing; anees the mean over times of the NEES averaged over trials; max_deviation_m the
    largest distance over trials and times between the mean and the benchmark's. error_median_m is the median over
    trials of a trial's mean error, final_error_median_m that of the error at its last time with a reference. A series
    of one subject becomes a metric of the same name, its mean over trials and times, with NAME_interval, the 95 %
    interval of that mean over trials, and three medians over trials: NAME_median of a trial's mean, NAME_first and
    NAME_final of the first and the last value known. Undefined or infinite figures are None.
    """
    benchmark = results[centralized].beliefs if centralized is not None and centralized in results else {}
    return {
        name: {
            subject: _subject(mission.truth.get(subject), subject, tracks, benchmark.get(subject))
            for subject in tracks.beliefs
        }
        for name, tracks in results.items()
    }


def growth(spread: np.ndarray) -> float | None:
    """Mean of a curve (T,) over its last quarter relative to its second; None for a curve too short or zero."""
    quarter = len(spread) // 4
    early = spread[quarter : 2 * quarter].mean() if quarter else 0.0
    return number(spread[-quarter:].mean() / early) if early > 0 else None


def _subject(truth: np.ndarray | None, subject: str, tracks: Tracks, benchmark: Belief | None) -> SubjectMetrics:
    belief = tracks.beliefs[subject]
    if truth is None:
        truth = np.full((1, belief.mean.shape[1], 2), np.nan)
    spread = sigma(belief)
    metrics = _error(truth, belief) | {
        "sigma_m": number(spread.mean()),
        "final_sigma_m": number(spread[:, -1].mean()),
        "sigma_growth": growth(spread.mean(axis=0)),
    }
    ranges = gate(tracks.innovations[subject]) if subject in tracks.innovations else None

    verdict = judge(nees(truth, belief))
    name, consistent, sentence = verdict.name, verdict.consistent, verdict.sentence
    if metrics["rmse_m"] is not None and name == "no reference":
        name, consistent = "consistent", True
        sentence = f"Consistent: it says that its position is known exactly, and it is, to {EXACT_M:g} m."
    elif name == "no reference" and ranges and ranges["mean_nis"] is not None:
        low, high = ranges["nis_interval"]
        sentence += (
            f" Of {ranges['offered']} ranges {ranges['accepted']} passed the gate; their squared innovations "
            f"average {ranges['mean_nis']:.3g} of what was predicted ({low:.3g} to {high:.3g} at 95 %)."
        )
    metrics |= {
        "anees": number(verdict.anees),
        "anees_interval": list(verdict.interval),
        "consistent": consistent,
        "verdict": name,
        "explanation": sentence,
        "max_deviation_m": None if benchmark is None else number(distance(belief.mean, benchmark.mean).max()),
    }
    together = correlations(subject, tracks.series)
    if together:
        metrics["correlation"] = together
    if ranges:
        metrics["ranges"] = ranges
    for key, curve in tracks.series.items():
        what = key.partition("/")[0]
        if curve.subjects == (subject,) and what not in metrics:
            known = curve.value[np.isfinite(curve.value)]
            metrics[what] = number(known.mean()) if known.size else None
            metrics[f"{what}_interval"] = _interval(curve.value)
            metrics[f"{what}_median"] = _median(curve.value)
            for which, order in (("first", 1), ("final", -1)):
                metrics[f"{what}_{which}"] = _median(_one(curve.value[:, ::order]))
    return metrics


def _interval(value: np.ndarray) -> list[float | None] | None:
    """The 95 % interval over trials of a series' mean (trials, T); None for fewer than two trials that have one."""
    having = np.isfinite(value).any(axis=1)
    if having.sum() < 2:
        return None
    mean = np.nanmean(value[having], axis=1)
    half = 1.96 * mean.std(ddof=1) / np.sqrt(len(mean))
    return [number(mean.mean() - half), number(mean.mean() + half)]


def _median(value: np.ndarray) -> float | None:
    """The median over trials of the mean over times of what is known of (trials, T); None where nothing is."""
    known = np.isfinite(value)
    having = known.any(axis=1)
    if not having.any():
        return None
    means = np.where(known, value, 0.0)[having].sum(axis=1) / known[having].sum(axis=1)
    return number(np.median(means))


def _one(value: np.ndarray) -> np.ndarray:
    """The first known value of each trial of (trials, T): (trials, 1), NaN where there is none."""
    return np.take_along_axis(value, np.isfinite(value).argmax(axis=1)[:, None], axis=1)


def _error(truth: np.ndarray, belief: Belief) -> SubjectMetrics:
    known = np.flatnonzero(np.isfinite(truth).all(axis=-1).any(axis=0))
    if not known.size:
        return dict.fromkeys(("rmse_m", "final_rmse_m", "error_median_m", "final_error_median_m"))
    weight = np.isfinite(truth).all(axis=-1).sum(axis=0)[known].astype(float)
    square = _mean_square(truth, belief)[known]
    off = distance(belief.mean, truth)
    failed = not np.isfinite(square).all()
    return {
        "rmse_m": number(np.sqrt((square * weight).sum() / weight.sum())),
        "final_rmse_m": number(np.sqrt(square[-1])),
        "error_median_m": None if failed else _median(off),
        "final_error_median_m": None if failed else _median(off[:, known[-1:]]),
    }


def _mean_square(truth: np.ndarray, belief: Belief) -> np.ndarray:
    """Squared error averaged over the trials with a reference, (T,) m^2; NaN where none has or one failed."""
    square = distance(belief.mean, truth) ** 2
    known = np.broadcast_to(np.isfinite(truth).all(axis=-1), square.shape)
    if known.all():
        return square.mean(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sum(square, axis=0, where=known) / known.sum(axis=0)


def distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Between positions (..., 2) m: (...,)."""
    with np.errstate(invalid="ignore"):
        difference = a - b
        return np.hypot(difference[..., 0], difference[..., 1])


def correlations(subject: str, series: Mapping[str, Series]) -> dict[str, dict[str, float | None]]:
    """Correlation of `subject` with each other one of the series `correlation/A~B`, averaged over trials.

    mean, min, max over time and the final value; drop is the largest fall from an earlier peak.
    """
    found = {}
    for key, curve in series.items():
        if not key.startswith("correlation/") or len(curve.subjects) != 2 or subject not in curve.subjects:
            continue
        other = curve.subjects[1 - curve.subjects.index(subject)]
        value, _ = trial_mean(curve.value)
        value = value[np.isfinite(value)]
        if value.size:
            found[other] = {
                "mean": number(value.mean()),
                "min": number(value.min()),
                "max": number(value.max()),
                "final": number(value[-1]),
                "drop": number((np.maximum.accumulate(value) - value).max()),
            }
    return found


def gate(innovations: Innovations) -> dict[str, Any]:
    """Ranges offered and accepted over all trials, and the accepted ones' mean NIS, expected to be 1.

    nis_interval holds the mean NIS at 95 % if the innovations are white; a gate lowers it a little.
    """
    offered = np.isfinite(innovations.value)
    accepted = offered & innovations.accepted
    n = int(accepted.sum())
    square = innovations.value[accepted] ** 2 / innovations.variance[accepted]
    return {
        "offered": int(offered.sum()),
        "accepted": n,
        "mean_nis": number(square.mean()) if n else None,
        "nis_interval": list(interval(1, n)) if n else None,
    }


def number(value: Any) -> float | None:
    """A float for JSON, which knows neither NaN nor infinity: None."""
    return float(value) if np.isfinite(value) else None
