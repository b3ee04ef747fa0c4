"""Naive fusion (RC eq. 15): estimates fused as if they were independent, so what they share counts twice."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric
from engine.tracking.recursion import LEAST, Fused


def naive_fusion(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """P_f = (sum P_j^-1)^-1, W_j = P_f P_j^-1; believed (..., N, n, n). Looks at nobody's cross-covariance."""
    inverse = np.linalg.inv(believed + LEAST * np.eye(believed.shape[-1]))
    fused = symmetric(np.linalg.inv(inverse.sum(axis=-3)))
    return Fused(fused[..., None, :, :] @ inverse, fused)
