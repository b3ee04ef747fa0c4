"""State vector fusion (Bar-Shalom and Campo 1986, RC eq. 9-13): optimal where cross-covariances are tracked."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric, transpose
from engine.tracking.recursion import Fused


def state_vector_fusion(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """Maximum likelihood from the estimates alone: W_j = P_f sum_i (P^-1)_ij, P_f = (sum_ij (P^-1)_ij)^-1.

    actual (..., N, n, N, n) is the joint error covariance that the nodes track together, so what is believed is so.
    Estimates are added one after the other by Bar-Shalom and Campo's two-track form, which stays defined where two
    estimates are the same.
    """
    N, n = believed.shape[-3:-1]
    cases = believed.shape[:-3]
    weights = np.zeros((*cases, N, n, n))
    weights[..., 0, :, :] = np.eye(n)
    for j in range(1, N):
        P11 = np.einsum("...aij,...ajbk,...blk->...il", weights, actual, weights, optimize=True)
        P12 = np.einsum("...aij,...ajk->...ik", weights, actual[..., :, :, j, :], optimize=True)
        P22 = actual[..., j, :, j, :]
        S = symmetric(P11 + P22 - P12 - transpose(P12))
        K = (P11 - P12) @ np.linalg.pinv(S, rcond=1e-12, hermitian=True)
        weights = (np.eye(n) - K)[..., None, :, :] @ weights
        weights[..., j, :, :] += K
    fused = np.einsum("...aij,...ajbk,...blk->...il", weights, actual, weights, optimize=True)
    return Fused(weights, symmetric(fused))
