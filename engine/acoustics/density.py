"""Discrete densities made of a filter's or a beamformer's output, and samples of them (C19 section 4.2.2)."""

from __future__ import annotations

import numpy as np


def floored(weight: np.ndarray, floor: float) -> np.ndarray:
    """Density (..., n) of non-negative weights (..., n) above their quantile `floor` in [0, 1) (C19 Algorithm 2).

    Where nothing is above the floor (a flat or an empty row), the density is uniform.
    """
    weight = np.maximum(weight, 0.0)
    n = weight.shape[-1]
    cut = min(int(floor * n), n - 1)
    excess = np.maximum(weight - np.partition(weight, cut, axis=-1)[..., cut, None], 0.0)
    total = excess.sum(-1, keepdims=True)
    flat = ~(total > 0)
    return np.where(flat, 1.0 / n, excess / np.where(flat, 1.0, total))


def likely(log_likelihood: np.ndarray) -> np.ndarray:
    """Weights (..., n) of log likelihoods (..., n), the largest of each row 1 (C19 eq. 4.26)."""
    return np.exp(log_likelihood - log_likelihood.max(-1, keepdims=True))


def noise_power(filtered: np.ndarray) -> np.ndarray:
    """Mean square (...,) of the noise in the complex output of matched filters (..., n), by its median.

    Few delays have a signal, so the median is the noise's: ln 2 times its mean square.
    """
    return np.median(np.abs(filtered) ** 2, axis=-1) / np.log(2)


def draw(density: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Bin positions of densities (..., n) at quantiles u (...,) in [0, 1): (...,), bin k from k - 1/2 to k + 1/2.

    The leading axes broadcast, so that several are drawn from one density.

    Inverts the piecewise linear distribution function, so that a million draws need no alias tables of a million
    densities that are each drawn from once.
    """
    cumulative = np.cumsum(density, axis=-1)
    u = u * cumulative[..., -1]
    k = np.minimum((cumulative <= u[..., None]).sum(-1), density.shape[-1] - 1)
    wide = (*k.shape, density.shape[-1])
    upper = np.take_along_axis(np.broadcast_to(cumulative, wide), k[..., None], -1)[..., 0]
    mass = np.take_along_axis(np.broadcast_to(density, wide), k[..., None], -1)[..., 0]
    return k + 0.5 - (upper - u) / np.where(mass > 0, mass, 1.0)
