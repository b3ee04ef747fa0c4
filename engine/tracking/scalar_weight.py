"""The one weight between two covariances by which covariance intersection and its inverse choose theirs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engine.gaussian.forms import transpose

#: Halvings of [0, 1]: the weight is then known to round-off. Ratios closer to one than TIED are no difference.
HALVINGS, TIED = 53, 1e-12


def ratios(P1: np.ndarray, P2: np.ndarray) -> np.ndarray:
    """The variances (..., n) of P1 along the axes in which P2 is the identity and P1 is diagonal."""
    root = np.linalg.inv(np.linalg.cholesky(P2))
    return np.linalg.eigvalsh(root @ P1 @ transpose(root))


def balance(slope: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> np.ndarray:
    """Where in [0, 1] a slope that falls with the weight crosses zero, by bisection; an end where it does not.

    slope takes w (..., 1) and gives (...,). Where the ratios q (..., n) are all one, every weight is as good: it is one
    half there, so that round-off does not choose among equals.
    """
    tied = np.asarray((np.abs(q - 1) < TIED).all(axis=-1))
    low, high = np.zeros(tied.shape), np.ones(tied.shape)
    first, last = slope(low[..., None]) <= 0, slope(high[..., None]) >= 0
    for _ in range(0 if np.all(first | last) else HALVINGS):
        middle = 0.5 * (low + high)
        rising = slope(middle[..., None]) > 0
        low, high = np.where(rising, middle, low), np.where(rising, high, middle)
    return np.where(tied, 0.5, np.where(first, 0.0, np.where(last, 1.0, low)))
