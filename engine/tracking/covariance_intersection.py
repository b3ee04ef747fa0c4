"""Covariance intersection (Julier and Uhlmann 1997): consistent whatever the correlation, at a price."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric
from engine.tracking.recursion import Fused
from engine.tracking.scalar_weight import smallest_volume


def covariance_intersection(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """P_f^-1 = w P_1^-1 + (1 - w) P_2^-1 with the w of the smallest det P_f; believed (..., N, n, n).

    More than two estimates are folded in one after the other. Looks at nobody's cross-covariance.
    """
    N, n = believed.shape[-3:-1]
    cases = believed.shape[:-3]
    weights = np.zeros((*cases, N, n, n))
    weights[..., 0, :, :] = np.eye(n)
    fused = believed[..., 0, :, :]
    for j in range(1, N):
        mine, theirs = np.linalg.inv(fused), np.linalg.inv(believed[..., j, :, :])

        def intersection(w: np.ndarray, mine=mine, theirs=theirs) -> np.ndarray:
            return np.linalg.inv(w * mine + (1 - w) * theirs)

        w = smallest_volume(intersection, cases)[..., None, None]
        fused = symmetric(intersection(w))
        weights = (w * fused @ mine)[..., None, :, :] @ weights
        weights[..., j, :, :] += (1 - w) * fused @ theirs
    return Fused(weights, fused)
