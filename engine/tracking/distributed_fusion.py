"""Optimal distributed fusion (RC eq. 6-8): a weighted sum of estimates, the weight minimizing its error's volume."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric, transpose
from engine.tracking.recursion import Fused
from engine.tracking.scalar_weight import smallest_volume


def distributed_fusion(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """y_f = (1 - l) y_1 + l y_2 with the l in [0, 1] of the smallest det E[(y_f - x)(y_f - x)'] (RC eq. 8).

    One number weighs all components, as in the paper; more than two estimates are folded in one after the other.
    In one dimension this is state vector fusion. actual (..., N, n, N, n) is tracked, so what is believed is so.
    """
    N, n = believed.shape[-3:-1]
    cases = believed.shape[:-3]
    scalar = np.zeros((*cases, N))
    scalar[..., 0] = 1.0
    for j in range(1, N):
        P11 = np.einsum("...a,...aibk,...b->...ik", scalar, actual, scalar, optimize=True)
        P12 = np.einsum("...a,...aik->...ik", scalar, actual[..., :, :, j, :], optimize=True)
        P22 = actual[..., j, :, j, :]
        cross = P12 + transpose(P12)

        def mixed(w: np.ndarray, P11=P11, P22=P22, cross=cross) -> np.ndarray:
            return (1 - w) ** 2 * P11 + w**2 * P22 + w * (1 - w) * cross

        weight = _best(P11, P12, P22, n, mixed, cases)
        scalar = (1 - weight)[..., None] * scalar
        scalar[..., j] += weight
    weights = scalar[..., None, None] * np.eye(n)
    return Fused(weights, symmetric(np.einsum("...a,...aibk,...b->...ik", scalar, actual, scalar, optimize=True)))


def _best(P11, P12, P22, n, mixed, cases) -> np.ndarray:
    """The best weight of the second estimate: in one dimension in closed form (RC eq. 8 and 13)."""
    if n > 1:
        return smallest_volume(mixed, cases)
    a, b, c = P11[..., 0, 0], P12[..., 0, 0], P22[..., 0, 0]
    spread = a + c - 2 * b
    return np.clip(np.divide(a - b, spread, out=np.zeros_like(spread), where=spread > 1e-15 * (a + c)), 0.0, 1.0)
