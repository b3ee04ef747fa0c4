"""Inverse covariance intersection (Noack, Sijs, Reinhardt and Hanebeck 2017): tighter than CI for shared information.

Consistent where what the estimates have in common is common information (a shared prior, earlier exchanges), which is
the case of this family; not for every conceivable correlation, as covariance intersection is.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric
from engine.tracking.recursion import Fused
from engine.tracking.scalar_weight import smallest_volume


def inverse_covariance_intersection(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """P_f^-1 = P_1^-1 + P_2^-1 - (w P_1 + (1 - w) P_2)^-1 with the w of the smallest det P_f.

    believed (..., N, n, n); more than two estimates are folded in one after the other. Looks at nobody's
    cross-covariance.
    """
    N, n = believed.shape[-3:-1]
    cases = believed.shape[:-3]
    weights = np.zeros((*cases, N, n, n))
    weights[..., 0, :, :] = np.eye(n)
    fused = believed[..., 0, :, :]
    for j in range(1, N):
        P1, P2 = fused, believed[..., j, :, :]
        mine, theirs = np.linalg.inv(P1), np.linalg.inv(P2)

        def intersection(w: np.ndarray, P1=P1, P2=P2, mine=mine, theirs=theirs) -> np.ndarray:
            return np.linalg.inv(mine + theirs - np.linalg.inv(w * P1 + (1 - w) * P2))

        w = smallest_volume(intersection, cases)[..., None, None]
        shared = np.linalg.inv(w * P1 + (1 - w) * P2)
        fused = symmetric(intersection(w))
        weights = (fused @ (mine - w * shared))[..., None, :, :] @ weights
        weights[..., j, :, :] += fused @ (theirs - (1 - w) * shared)
    return Fused(weights, fused)
