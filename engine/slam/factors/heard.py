"""A range whose density has several peaks, direct path and echoes, and may be wrong altogether."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from engine.slam.factors.factor import Factor
from engine.slam.factors.range import ranging

#: The most peaks kept, the least share of the density for one, and the narrowest peak (m).
PEAKS, LEAST_MASS, NARROWEST_M = 6, 1e-3, 0.05


@dataclass(frozen=True)
class Heard(Factor):
    """Distance between two variables by peaks: range_m, sigma_m, log_odds (K,), the odds over a wrong range's.

    At a point of linearization the peak that explains it best holds, or none does and the range says nothing
    (max-mixture, Olson and Agarwal 2013). slack_m widens the peaks for that choice alone, by what the distance may
    still be off when it is made. doubt is the chance that the range is wrong altogether.
    """

    range_m: np.ndarray
    sigma_m: np.ndarray
    log_odds: np.ndarray
    slack_m: float
    doubt: float

    def residual(self, *values: np.ndarray) -> np.ndarray:
        e, _, _ = self._explained(*values)
        return e

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        e, u, slope = self._explained(*values)
        jacobians = []
        for sign, value in ((1.0, values[0]), (-1.0, values[1])):
            J = np.zeros((*e.shape, value.shape[-1]))
            J[..., 0, :2] = sign * slope[..., None] * u
            jacobians.append(J)
        return e, jacobians

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        odds = np.exp(self.log_odds - self.log_odds.max())
        k = rng.choice(len(odds), size=strata.shape, p=odds / odds.sum())
        r = np.abs(self.range_m[k] + self.sigma_m[k] * rng.standard_normal(strata.shape))
        angle = 2 * np.pi * strata
        return values[1 - towards][..., :2] + r[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def refused(self, *values: np.ndarray) -> np.ndarray:
        """Whether (...,) no peak explains the distance."""
        _, _, slope = self._explained(*values)
        return slope == 0.0

    def _explained(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual (..., 2): whitened distance and penalty of the choice; direction (..., 2), slope of the first."""
        d = a[..., :2] - b[..., :2]
        r = np.hypot(d[..., 0], d[..., 1])
        u = np.where(r[..., None] > 0, d / np.where(r > 0, r, 1.0)[..., None], [1.0, 0.0])
        off = r[..., None] - self.range_m
        wide = np.hypot(self.sigma_m, self.slack_m)
        # Peaks count by their mass, so a slack of many widths does not make them all unlikely.
        score = self.log_odds - 0.5 * np.square(off / wide)
        k = score.argmax(-1)
        holds = np.take_along_axis(score, k[..., None], -1)[..., 0] > 0.0
        z = np.take_along_axis(off, k[..., None], -1)[..., 0] / self.sigma_m[k]
        best = self.log_odds.max()
        penalty = np.sqrt(2.0 * np.where(holds, best - self.log_odds[k], max(best, 0.0)))
        e = np.stack([np.where(holds, z, 0.0), penalty], axis=-1)
        return e, u, np.where(holds, 1.0 / self.sigma_m[k], 0.0)


def heard(
    a: str, b: str, ranges_m: np.ndarray, density: np.ndarray, slack_m: float, doubt: float, least_sigma_m: float = 0.0
) -> Heard:
    """A range by its density (W,) over evenly spaced ranges_m (W,); `doubt` is the chance that it is all wrong.

    least_sigma_m is the error that the density does not know of (a bent path, a pose between two pings).
    """
    centre, sigma, mass = peaks(ranges_m, density)
    return _of_peaks(a, b, centre, np.hypot(sigma, least_sigma_m), mass, slack_m, doubt)


def reading(a: str, b: str, range_m: float, sigma_m: float, slack_m: float, doubt: float) -> Factor:
    """A recorded range, which is wrong altogether with chance `doubt`."""
    if doubt <= 0:
        return ranging(a, b, range_m, sigma_m)
    return _of_peaks(a, b, np.array([range_m]), np.array([sigma_m]), np.ones(1), slack_m, doubt)


#: Length over which a wrong range may fall, m.
ASTRAY_M = 300.0


def _of_peaks(
    a: str, b: str, centre: np.ndarray, sigma: np.ndarray, mass: np.ndarray, slack_m: float, doubt: float
) -> Heard:
    doubt = min(max(doubt, 1e-6), 1.0 - 1e-6)
    # A right range has the density mass / (sqrt(2 pi) sigma) at its peak, a wrong one 1 / ASTRAY_M.
    odds = (1 - doubt) * mass / (np.sqrt(2 * np.pi) * sigma) / (doubt / ASTRAY_M)
    return Heard((a, b), centre, sigma, np.log(odds), slack_m, doubt)


def peaks(ranges_m: np.ndarray, density: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres, standard deviations (m) and shares of a density's peaks, cut at the valleys between them."""
    total = density.sum()
    if not total > 0:
        raise ValueError("a range density must have some mass")
    inner = density[1:-1]
    lows = np.flatnonzero((inner <= density[:-2]) & (inner < density[2:])) + 1
    cuts = np.concatenate([[0], lows, [len(density)]])
    found = []
    for start, stop in pairwise(cuts):
        mass = density[start:stop].sum() / total
        if mass < LEAST_MASS:
            continue
        weight = density[start:stop] / density[start:stop].sum()
        centre = weight @ ranges_m[start:stop]
        spread = np.sqrt(weight @ np.square(ranges_m[start:stop] - centre))
        found.append((mass, centre, max(spread, NARROWEST_M)))
    found.sort(reverse=True)
    mass, centre, sigma = np.array(found[:PEAKS]).T
    return centre, sigma, mass / mass.sum()
