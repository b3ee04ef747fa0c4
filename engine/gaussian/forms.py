"""Moment and information forms of a Gaussian, and what one does with blocks of them.

Leading axes are independent trials throughout; a block is a slice of the state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Moments:
    """Gaussian by mean (..., n) and covariance (..., n, n)."""

    mean: np.ndarray
    cov: np.ndarray


@dataclass(frozen=True)
class Information:
    """Gaussian by information vector eta (..., n) and matrix Lambda (..., n, n), W12 section 3."""

    vector: np.ndarray
    matrix: np.ndarray


def transpose(matrix: np.ndarray) -> np.ndarray:
    """The transpose of the last two axes."""
    return np.swapaxes(matrix, -1, -2)


def symmetric(matrix: np.ndarray) -> np.ndarray:
    """The symmetric part of (..., n, n), against round-off."""
    return 0.5 * (matrix + transpose(matrix))


def apply(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Matrix (..., m, n) times vector (..., n)."""
    return (matrix @ vector[..., None])[..., 0]


def to_information(moments: Moments) -> Information:
    """Lambda = Sigma^-1, eta = Lambda mu; LinAlgError where the covariance is singular."""
    matrix = symmetric(np.linalg.inv(moments.cov))
    return Information(apply(matrix, moments.mean), matrix)


def to_moments(information: Information) -> Moments:
    """Sigma = Lambda^-1, mu = Sigma eta; LinAlgError where the information is singular."""
    cov = symmetric(np.linalg.inv(information.matrix))
    return Moments(apply(cov, information.vector), cov)


def keep(moments: Moments, *blocks: slice) -> Moments:
    """Marginalize out everything but the named blocks, in the order given."""
    n = moments.mean.shape[-1]
    index = np.concatenate([np.arange(n)[block] for block in blocks])
    return Moments(moments.mean[..., index], moments.cov[..., index[:, None], index])


def drop(moments: Moments, block: slice) -> Moments:
    """Marginalize one block out."""
    n = moments.mean.shape[-1]
    start, stop, _ = block.indices(n)
    return keep(moments, slice(0, start), slice(stop, n))


def augment(moments: Moments, block: slice) -> Moments:
    """Append a copy of a block as a delayed state, fully correlated with it."""
    return keep(moments, slice(None), block)


def join(first: Moments, second: Moments) -> Moments:
    """Stack two independent Gaussians (block-diagonal covariance)."""
    n, m = first.mean.shape[-1], second.mean.shape[-1]
    trials = np.broadcast_shapes(first.mean.shape[:-1], second.mean.shape[:-1])
    cov = np.zeros((*trials, n + m, n + m))
    cov[..., :n, :n] = first.cov
    cov[..., n:, n:] = second.cov
    mean = np.empty((*trials, n + m))
    mean[..., :n] = first.mean
    mean[..., n:] = second.mean
    return Moments(mean, cov)


def condition(moments: Moments, block: slice, value: np.ndarray) -> Moments:
    """The distribution of the rest given that a block takes `value` (..., k)."""
    n = moments.mean.shape[-1]
    index = np.arange(n)
    known = index[block]
    rest = np.delete(index, known)
    S = moments.cov[..., known[:, None], known]
    P = moments.cov[..., rest[:, None], known]
    K = transpose(np.linalg.solve(S, transpose(P)))
    mean = moments.mean[..., rest] + apply(K, value - moments.mean[..., known])
    return Moments(mean, symmetric(moments.cov[..., rest[:, None], rest] - K @ transpose(P)))


def marginal_information(information: Information, kept: slice) -> Information:
    """Marginalize everything but one block out of the information form, by the Schur complement (W12 eq. 4)."""
    n = information.vector.shape[-1]
    index = np.arange(n)
    a = index[kept]
    b = np.delete(index, a)
    ab = information.matrix[..., a[:, None], b]
    bb = information.matrix[..., b[:, None], b]
    gain = transpose(np.linalg.solve(bb, transpose(ab)))
    matrix = information.matrix[..., a[:, None], a] - gain @ transpose(ab)
    vector = information.vector[..., a] - apply(gain, information.vector[..., b])
    return Information(vector, symmetric(matrix))
