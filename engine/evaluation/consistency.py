"""Whether an estimator's confidence can be believed: NEES against its chi-square interval over trials.

Bar-Shalom, Li and Kirubarajan (2001), section 5.4: if the errors are Gaussian and the covariances right,
the sum over N trials of the NEES of a 2-dof position belief at one time is chi-square with 2 N degrees of
freedom, so its average over trials is 2 in the mean and lies in `nees_interval` at 95 % of the times.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import gammaincinv

from engine.tracks import Belief

#: Overconfident: the trial-averaged NEES is above its upper bound at more than this share of the times.
ABOVE_ALLOWED = 0.10
#: Conservative: it is below its lower bound at more than this share of the times.
BELOW_ALLOWED = 0.50
#: A covariance whose 1 - correlation^2 is not above this counts as singular.
SINGULAR = 8 * np.finfo(float).eps
#: An error (m) that a claim of exact knowledge may have.
EXACT_M = 1e-9


@cache
def interval(dof: int, count: int) -> tuple[float, float]:
    """95 % two-sided interval of the mean of `count` independent chi-square variables of `dof` each."""
    low, high = 2 * gammaincinv(dof * count / 2, [0.025, 0.975]) / count
    return float(low), float(high)


def nees_interval(trials: int) -> tuple[float, float]:
    """95 % interval of the NEES of a position in the plane, averaged over `trials` at one time."""
    return interval(2, trials)


def nees(truth: np.ndarray, belief: Belief) -> np.ndarray:
    """Normalized estimation error squared, (trials, T), expected to be 2; truth (trials or 1, T, 2) m.

    NaN where there is no reference. An estimate that is not finite, or whose covariance is not positive
    definite, is infinitely overconfident: inf. The one exception is exact knowledge that is right (a singular
    covariance and no error, such as a surveyed beacon's), which leaves nothing to test: NaN.
    """
    xx, s, slope = _factors(belief.cov)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        error = belief.mean - truth
        ex, ey = error[..., 0], error[..., 1]
        value = ex * ex / xx + (ey - slope * ex) ** 2 / s
        sound = (xx > 0) & (s > SINGULAR * belief.cov[..., 1, 1]) & np.isfinite(value)
        if not sound.all():
            exact = (np.hypot(ex, ey) <= EXACT_M) & (xx >= 0) & (s >= 0)
            value = np.where(sound, value, np.where(exact, np.nan, np.inf))
    known = np.isfinite(truth).all(axis=-1)
    return value if known.all() else np.where(known, value, np.nan)


def sigma(belief: Belief) -> np.ndarray:
    """Fourth root of the xy covariance's determinant, (trials, T) m; 0 where it is not positive definite."""
    xx, s, _ = _factors(belief.cov)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.sqrt(np.sqrt(np.where((xx <= 0) | (s <= 0), 0.0, xx * s)))


def _factors(cov: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Variance of x, variance of y given x, slope of y on x: no cancellation in long thin ellipses."""
    xx, xy, yy = cov[..., 0, 0], 0.5 * (cov[..., 0, 1] + cov[..., 1, 0]), cov[..., 1, 1]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        slope = np.where(xx > 0, xy / xx, 0.0)
        return xx, yy - slope * xy, slope


@dataclass(frozen=True)
class Verdict:
    """What the NEES says of an estimator.

    name: "consistent", "conservative", "overconfident" or "no reference"; consistent is False only for the
    overconfident and None without a reference; anees may be inf, and is NaN where nothing could be tested.
    """

    name: str
    consistent: bool | None
    anees: float
    interval: tuple[float, float]
    sentence: str


def judge(value: np.ndarray) -> Verdict:
    """The verdict on NEES values (trials, T), NaN where there is nothing to compare with."""
    return verdict(*trial_mean(value), value.shape[0])


def verdict(average: np.ndarray, count: np.ndarray, trials: int) -> Verdict:
    """The verdict on the NEES averaged over `count` of the trials at each time, both (T,).

    Each time is judged by the interval of the trials that count there.
    """
    low, high = nees_interval(trials)
    tested = count > 0
    if not tested.any():
        return Verdict("no reference", None, np.nan, (low, high), "There is no reference to compare with.")
    average, count = average[tested], count[tested]
    bounds = {int(n): nees_interval(int(n)) for n in np.unique(count)}
    above = float(np.mean(average > np.array([bounds[int(n)][1] for n in count])))
    below = float(np.mean(average < np.array([bounds[int(n)][0] for n in count])))
    failed = float(np.mean(np.isinf(average)))
    anees = float(average.mean())
    over = "one trial" if trials == 1 else f"{trials} trials"
    too_high = f"NEES is above the 97.5 % bound of {high:.3g} at {above:.0%} of the times"
    too_low = f"below the 2.5 % bound of {low:.3g} at {below:.0%}"
    allowed = f"({ABOVE_ALLOWED:.0%} allowed)"
    if above > ABOVE_ALLOWED:
        name, finding = "overconfident", f"{too_high} {allowed}"
    elif below > BELOW_ALLOWED:
        name, finding = "conservative", f"NEES is {too_low} of the times, so it knows more than it says"
    else:
        name, finding = "consistent", f"{too_high} {allowed} and {too_low}"
    sentence = f"{name.capitalize()}: over {over} its {finding}; "
    if failed:
        sentence += f"at {failed:.0%} an estimate is not finite or its covariance not positive definite"
    else:
        sentence += f"it averages {anees:.3g} where 2 is right"
    sentence += ". One trial is a weak test." if trials == 1 else "."
    return Verdict(name, name != "overconfident", anees, (low, high), sentence)


def trial_mean(value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over trials of (trials, T) without the NaN, and how many those are, both (T,); NaN for none."""
    counted = ~np.isnan(value)
    count = counted.sum(axis=0)
    if counted.all():
        return value.mean(axis=0), count
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sum(value, axis=0, where=counted) / count, count
