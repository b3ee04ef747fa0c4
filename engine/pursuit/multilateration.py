"""The source of one ping from its arrival times alone, by nonlinear least squares: no motion model, no memory."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric, transpose

STEPS = 60
#: A source this many times farther from the receivers' middle than they are spread is not located.
FARTHEST = 50.0


def locate(arrivals_m: np.ndarray, heard: np.ndarray, places: np.ndarray, sigma_m: float, start: np.ndarray) -> Moments:
    """Position and covariance (..., d) of each ping's source by Levenberg and Marquardt's method from start (..., d).

    arrivals_m, heard (..., r), places (..., r, d) m. The ping's time is eliminated: residuals are taken from their mean
    over the receivers that heard it. NaN where fewer than d + 1 did, or the geometry does not tell.
    """
    d, n = places.shape[-1], heard.sum(axis=-1)
    weight = heard.astype(float)
    enough = n > d
    measured = np.where(heard, arrivals_m, 0.0)

    def residual(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        apart = x[..., None, :] - places
        distance = np.linalg.norm(apart, axis=-1)
        J = weight[..., None] * (apart / np.maximum(distance, 1e-9)[..., None])
        r = weight * (measured - distance)
        count = np.maximum(n, 1)[..., None]
        J = J - weight[..., None] * (J.sum(axis=-2) / count)[..., None, :]
        return r - weight * (r.sum(axis=-1, keepdims=True) / count), J

    x, damping = np.array(start, dtype=float), np.full(heard.shape[:-1], 1e-3)
    r, J = residual(x)
    for _ in range(STEPS):
        N = transpose(J) @ J
        scale = np.maximum(np.einsum("...ii->...i", N), 1e-9)
        step = np.linalg.solve(
            N + damping[..., None, None] * (scale[..., None] * np.eye(d)), apply(transpose(J), r)[..., None]
        )
        tried = x + step[..., 0]
        r_new, J_new = residual(tried)
        better = np.einsum("...i,...i->...", r_new, r_new) <= np.einsum("...i,...i->...", r, r)
        x = np.where(better[..., None], tried, x)
        r, J = np.where(better[..., None], r_new, r), np.where(better[..., None, None], J_new, J)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-12, 1e12)
    N = transpose(J) @ J
    spread = np.max(np.linalg.norm(places - places.mean(axis=-2, keepdims=True), axis=-1), axis=-1)
    near = np.linalg.norm(x - places.mean(axis=-2), axis=-1) < FARTHEST * spread
    values = np.linalg.eigvalsh(N)
    sound = enough & near & (values[..., 0] > 1e-10 * np.maximum(values[..., -1], 1e-300))
    cov = np.full(N.shape, np.nan)
    cov[sound] = sigma_m**2 * np.linalg.inv(N[sound])
    return Moments(np.where(sound[..., None], x, np.nan), symmetric(cov))
