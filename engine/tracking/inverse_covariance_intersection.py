"""Inverse covariance intersection (Noack, Sijs, Reinhardt and Hanebeck 2017): tighter than CI for shared information.

Consistent where what the estimates have in common is common information (a shared prior, earlier exchanges), which is
the case of this family; not for every conceivable correlation, as covariance intersection is.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric
from engine.tracking.recursion import LEAST, Fused
from engine.tracking.scalar_weight import balance, ratios


def inverse_covariance_intersection(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """P_f^-1 = P_1^-1 + P_2^-1 - (w P_1 + (1 - w) P_2)^-1 with the w of the smallest det P_f.

    believed (..., N, n, n); more than two estimates are folded in one after the other. Looks at nobody's
    cross-covariance.
    """
    N, n = believed.shape[-3:-1]
    believed = believed + LEAST * np.eye(n)
    weights = np.zeros(believed.shape)
    weights[..., 0, :, :] = np.eye(n)
    fused = believed[..., 0, :, :]
    for j in range(1, N):
        P1, P2 = fused, believed[..., j, :, :]
        w = weight(P1, P2)[..., None, None]
        mine, theirs, shared = np.linalg.inv(P1), np.linalg.inv(P2), np.linalg.inv(w * P1 + (1 - w) * P2)
        fused = symmetric(np.linalg.inv(mine + theirs - shared))
        weights = (fused @ (mine - w * shared))[..., None, :, :] @ weights
        weights[..., j, :, :] += fused @ (theirs - (1 - w) * shared)
    return Fused(weights, fused)


def weight(P1: np.ndarray, P2: np.ndarray) -> np.ndarray:
    """The w (...,) for which det(P_1^-1 + P_2^-1 - (w P_1 + (1 - w) P_2)^-1) is largest; concave in w, as its log is.

    Where P_2 is the identity and P_1 diagonal with entries q, its factors are 1 / q + 1 - 1 / (w q + 1 - w).
    """
    q = ratios(P1, P2)

    def slope(w: np.ndarray) -> np.ndarray:
        mixed = w * q + 1 - w
        return (q * (q - 1) / (mixed * ((1 + q) * mixed - q))).sum(axis=-1)

    return balance(slope, q)
