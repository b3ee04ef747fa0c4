"""Beliefs by kernels: bandwidths by leave-one-out likelihood, densities, modes, distance from a Gaussian."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from engine.slam.variables import wrap

#: Draws with which the divergence from a Gaussian is averaged.
DRAWS = 2000


@dataclass(frozen=True)
class Kde:
    """N evenly weighted Gaussian kernels (C19 eq. 4.97): points (N, d), bandwidth (d,); angles are wrapped."""

    points: np.ndarray
    bandwidth: np.ndarray
    angles: tuple[int, ...] = ()

    def log_density(self, at: np.ndarray) -> np.ndarray:
        """Log density (...,) at places (..., d)."""
        return _log_mean(self._log_kernels(at))

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Draws (count, d)."""
        chosen = self.points[rng.integers(len(self.points), size=count)]
        return chosen + self.bandwidth * rng.standard_normal(chosen.shape)

    @cached_property
    def mode(self) -> np.ndarray:
        """The place of highest density (d,): mean shift from the densest kernel."""
        best = self.points[np.argmax(self.log_density(self.points))]
        for _ in range(50):
            weights = np.exp(self._log_kernels(best))
            moved = best + (weights[:, None] * _away(self.points, best, self.angles)).sum(0) / weights.sum()
            if np.abs(moved - best).max() < 1e-6 * self.bandwidth.max():
                break
            best = moved
        return best

    def _log_kernels(self, at: np.ndarray) -> np.ndarray:
        z = _away(np.asarray(at)[..., None, :], self.points, self.angles) / self.bandwidth
        return -0.5 * np.square(z).sum(-1) - np.log(self.bandwidth).sum() - 0.5 * z.shape[-1] * np.log(2 * np.pi)


def fit(points: np.ndarray, angles: tuple[int, ...] = ()) -> Kde:
    """The estimate of a density from draws (N, d), bandwidths by leave-one-out likelihood (C19 §4.3.2).

    Their ratio between dimensions is that of the spreads of neighbours, which a distribution of several modes or
    along a ring does not stretch as its covariance would be.
    """
    from scipy.optimize import minimize_scalar  # a quarter of a second, which missions without kernels need not wait

    points = np.asarray(points, dtype=float)
    N, d = points.shape
    if N < 2:
        raise ValueError(f"a kernel density needs at least two points, got {N}")
    apart = _away(points[:, None], points, angles)
    local = np.sort(np.abs(apart), axis=1)[:, max(N // 4, 1)].mean(0)
    scale = np.maximum(local, 1e-9 * (1.0 + np.abs(points).max(0)))
    squared = np.square(apart / scale).sum(-1)
    np.fill_diagonal(squared, np.inf)

    def unlikely(log_h: float) -> float:
        z = -0.5 * squared * np.exp(-2 * log_h)
        return float(-np.mean(_log_sum(np.maximum(z, -700.0))) + d * log_h)

    found = minimize_scalar(unlikely, bounds=(np.log(1e-3), np.log(10.0)), method="bounded")
    return Kde(points, scale * float(np.exp(found.x)), angles)


def from_gaussian(kde: Kde, rng: np.random.Generator) -> float:
    """How far a belief is from the Gaussian of its moments (nats): the larger of both divergences (C19 eq. 5.3)."""
    mean = kde.points.mean(0)
    cov = np.cov(kde.points.T).reshape(len(mean), len(mean)) + np.diag(np.square(kde.bandwidth))
    # Kernels in two places leave a Gaussian that is flat across the line between them.
    low = np.linalg.cholesky(cov + 1e-9 * np.trace(cov) * np.eye(len(mean)))

    def log_normal(at: np.ndarray) -> np.ndarray:
        z = np.linalg.solve(low, (at - mean).T)
        return -0.5 * np.square(z).sum(0) - np.log(np.diag(low)).sum() - 0.5 * len(mean) * np.log(2 * np.pi)

    own = kde.sample(DRAWS, rng)
    its = mean + rng.standard_normal((DRAWS, len(mean))) @ low.T
    forward = np.mean(kde.log_density(own) - log_normal(own))
    # Where no kernel reaches the density is nil to the machine; what the draw then weighs is bounded.
    backward = np.mean(log_normal(its) - np.maximum(kde.log_density(its), log_normal(its) - 50.0))
    return float(max(forward, backward, 0.0))


def contour_levels(kde: Kde, masses: tuple[float, ...] = (0.2, 0.4, 0.6, 0.8)) -> np.ndarray:
    """Densities whose contours hold these masses (M,), by the quantiles of the density at its own kernels."""
    return np.exp(np.quantile(kde.log_density(kde.points), 1.0 - np.asarray(masses)))


def _away(a: np.ndarray, b: np.ndarray, angles: tuple[int, ...]) -> np.ndarray:
    d = a - b
    for i in angles:
        d[..., i] = wrap(d[..., i])
    return d


def _log_sum(z: np.ndarray) -> np.ndarray:
    top = z.max(-1, keepdims=True)
    return top[..., 0] + np.log(np.exp(z - top).sum(-1))


def _log_mean(z: np.ndarray) -> np.ndarray:
    return _log_sum(z) - np.log(z.shape[-1])
