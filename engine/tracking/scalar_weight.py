"""The weight in [0, 1] that makes a covariance's volume smallest, for many cases at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: Rounds of the search: the weight is then known to 1e-9.
ROUNDS = 43
_GOLDEN = (np.sqrt(5.0) - 1) / 2


def smallest_volume(cov_at: Callable[[np.ndarray], np.ndarray], cases: tuple[int, ...]) -> np.ndarray:
    """argmin over w in [0, 1] of det cov_at(w), by golden section and its two ends; w (*cases,).

    cov_at takes weights (*cases, 1, 1) and gives covariances (*cases, n, n) whose determinant is unimodal in w.
    """

    def volume(w: np.ndarray) -> np.ndarray:
        return np.linalg.slogdet(cov_at(w[..., None, None]))[1]

    low, high = np.zeros(cases), np.ones(cases)
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_a, at_b = volume(a), volume(b)
    for _ in range(ROUNDS):
        left = at_a < at_b
        high, low = np.where(left, b, high), np.where(left, low, a)
        a_next = np.where(left, high - _GOLDEN * (high - low), b)
        b_next = np.where(left, a, low + _GOLDEN * (high - low))
        fresh = volume(np.where(left, a_next, b_next))
        at_a, at_b = np.where(left, fresh, at_b), np.where(left, at_a, fresh)
        a, b = a_next, b_next
    found = 0.5 * (low + high)
    candidates = np.stack([found, np.zeros(cases), np.ones(cases)])
    volumes = np.stack([volume(c) for c in candidates])
    best = np.argmin(volumes, axis=0)
    return np.take_along_axis(candidates, best[None], axis=0)[0]
