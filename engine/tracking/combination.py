"""The best unbiased linear combination of correlated estimates of one state."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric, transpose


def best_weights(joint: np.ndarray) -> np.ndarray:
    """The W_j (..., N, n, n), sum_j W_j = I, for which sum_j W_j y_j has the smallest error covariance.

    joint (..., N, n, N, n): error covariance of all estimates together. The first estimate is corrected by its
    differences to the others (Bar-Shalom and Campo's two-track form, RC eq. 9, for N tracks), so that it stays defined
    where estimates share an error or are the same, and the joint covariance is singular.
    """
    N, n = joint.shape[-4:-2]
    cases = joint.shape[:-4]
    weights = np.zeros((*cases, N, n, n))
    if N > 1:
        to_first = joint[..., :, :, :1, :]
        away = joint - to_first
        spread = (away - away[..., :1, :, :, :])[..., 1:, :, 1:, :].reshape(*cases, (N - 1) * n, (N - 1) * n)
        cross = (to_first[..., :1, :, :, :] - joint[..., :1, :, 1:, :]).reshape(*cases, n, (N - 1) * n)
        K = cross @ pseudoinverse(symmetric(spread))
        weights[..., 1:, :, :] = np.moveaxis(K.reshape(*cases, n, N - 1, n), -2, -3)
    weights[..., 0, :, :] = np.eye(n) - weights[..., 1:, :, :].sum(axis=-3)
    return weights


def combined(weights: np.ndarray, joint: np.ndarray) -> np.ndarray:
    """Error covariance (..., n, n) of sum_j W_j y_j, whatever the weights (..., N, n, n)."""
    N, n = weights.shape[-3:-1]
    row = np.swapaxes(weights, -3, -2).reshape(*weights.shape[:-3], n, N * n)
    return symmetric(row @ joint.reshape(*joint.shape[:-4], N * n, N * n) @ transpose(row))


def pseudoinverse(matrix: np.ndarray) -> np.ndarray:
    """Of a symmetric (..., k, k); a single number's without a decomposition."""
    if matrix.shape[-1] == 1:
        return np.divide(1.0, matrix, out=np.zeros_like(matrix), where=matrix > 0)
    return np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)
