"""Updating a belief about the target with the arrival times of one ping at any of the receivers (C19 eq. 3.11-3.19).

The ping's own time is unknown, so only differences of arrivals count. Differences that share an arrival are
correlated: every one is taken against the same arrival, with R = sigma^2 (I + 1 1'). A lost arrival is absent: its
row is cut out of the update exactly, where C19 sets its noise to infinity.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric, transpose
from engine.pursuit.sigma_points import Rule, spread


@dataclass(frozen=True)
class Surprise:
    """Innovations (..., r) of an update, whitened: independent standard normals if the filter is right, NaN where
    nothing came."""

    white: np.ndarray

    @property
    def dof(self) -> np.ndarray:
        """Degrees of freedom (...,)."""
        return np.isfinite(self.white).sum(axis=-1)

    @property
    def nis(self) -> np.ndarray:
        """Normalized innovation squared (...,), 0 where nothing came."""
        return np.nansum(self.white**2, axis=-1)


def update(
    prior: Moments,
    arrivals_m: np.ndarray,
    heard: np.ndarray,
    places: np.ndarray,
    sigma_m: float,
    rule: Rule,
    iterations: int = 1,
    blur: np.ndarray | None = None,
) -> tuple[Moments, Surprise]:
    """Condition a belief over [position, heading] on the arrivals that were heard.

    arrivals_m (..., r): sound speed times arrival time, on any clock the receivers share, m; heard (..., r) bool;
    places (..., r, d) m; sigma_m: of one arrival. Fewer than two arrivals leave a belief as it is. iterations above 1
    linearize again about the result (Garcia-Fernandez et al. 2015), which counts where the prior is wide. blur
    (..., d, d) m^2 is the covariance of the source about the position believed in: what it moves within its clock's
    jitter.
    Singular geometries (receivers in one point, on top of the target) are no special case.
    """
    d = places.shape[-1]
    z, used, reference = differences(arrivals_m, heard)
    R = sigma_m**2 * (np.eye(z.shape[-1]) + 1.0)
    both = used[..., :, None] & used[..., None, :]
    R = np.where(both, R, 0.0) + _diagonal(~used)
    posterior, surprise = prior, None
    for _ in range(iterations):
        z_hat, H, spreading = _linearized(posterior, places, reference, used, rule)
        residual = np.where(used, z - z_hat - apply(H, prior.mean - posterior.mean), 0.0)
        noise = R + spreading
        if blur is not None:
            noise = noise + H[..., :d] @ blur @ transpose(H[..., :d])
        S = symmetric(H @ prior.cov @ transpose(H) + noise)
        K = transpose(np.linalg.solve(S, H @ prior.cov))
        if surprise is None:
            white = np.linalg.solve(np.linalg.cholesky(S), residual[..., None])[..., 0]
            surprise = Surprise(np.where(used, white, np.nan))
        left = np.eye(prior.mean.shape[-1]) - K @ H
        posterior = Moments(
            prior.mean + apply(K, residual), symmetric(left @ prior.cov @ transpose(left) + K @ noise @ transpose(K))
        )
    assert surprise is not None, "iterations is at least 1"
    return posterior, surprise


def differences(arrivals_m: np.ndarray, heard: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Differences (..., r) to the first arrival heard, which of them count, and the number of that arrival (...,)."""
    reference = np.argmax(heard, axis=-1)
    used = heard & (np.arange(heard.shape[-1]) != reference[..., None])
    first = np.take_along_axis(arrivals_m, reference[..., None], axis=-1)
    return np.where(used, arrivals_m - first, 0.0), used, reference


def range_differences(points: np.ndarray, places: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Differences (..., m, r) of the distances from points (..., m, d) to places (..., r, d), as `differences`."""
    apart = points[..., :, None, :] - places[..., None, :, :]
    distance = np.sqrt(np.einsum("...i,...i->...", apart, apart))
    return distance - np.take_along_axis(distance, reference[..., None, None], axis=-1)


def _linearized(
    belief: Moments, places: np.ndarray, reference: np.ndarray, used: np.ndarray, rule: Rule
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Statistical linear regression of the differences over a belief: mean, H, and covariance of what it leaves."""
    d = places.shape[-1]
    quadrature = rule(belief.mean.shape[-1])
    points = spread(belief, quadrature)
    Z = np.where(used[..., None, :], range_differences(points[..., :d], places, reference), 0.0)
    z_hat = apply(transpose(Z), quadrature.weights)
    centred = Z - z_hat[..., None, :]
    weighted = quadrature.weights[:, None] * centred
    P_zx = transpose(weighted) @ (points - belief.mean[..., None, :])
    H = transpose(np.linalg.solve(belief.cov, transpose(P_zx)))
    left = symmetric(transpose(centred) @ weighted - H @ transpose(P_zx))
    return z_hat, H, left


def _diagonal(flags: np.ndarray) -> np.ndarray:
    return flags[..., :, None] * np.eye(flags.shape[-1])
