"""Covariance intersection (Julier and Uhlmann 1997): consistent whatever the correlation, at a price."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric
from engine.tracking.recursion import LEAST, Fused
from engine.tracking.scalar_weight import balance, ratios


def covariance_intersection(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """P_f^-1 = w P_1^-1 + (1 - w) P_2^-1 with the w of the smallest det P_f; believed (..., N, n, n).

    More than two estimates are folded in one after the other. Looks at nobody's cross-covariance.
    """
    N, n = believed.shape[-3:-1]
    believed = believed + LEAST * np.eye(n)
    weights = np.zeros(believed.shape)
    weights[..., 0, :, :] = np.eye(n)
    fused = believed[..., 0, :, :]
    for j in range(1, N):
        P2 = believed[..., j, :, :]
        w = weight(fused, P2)[..., None, None]
        mine, theirs = np.linalg.inv(fused), np.linalg.inv(P2)
        fused = symmetric(np.linalg.inv(w * mine + (1 - w) * theirs))
        weights = (w * fused @ mine)[..., None, :, :] @ weights
        weights[..., j, :, :] += (1 - w) * fused @ theirs
    return Fused(weights, fused)


def weight(P1: np.ndarray, P2: np.ndarray) -> np.ndarray:
    """The w (...,) for which det(w P_1^-1 + (1 - w) P_2^-1) is largest; its logarithm is concave in w."""
    q = ratios(P1, P2)
    return balance(lambda w: ((1 - q) / (w + (1 - w) * q)).sum(axis=-1), q)
