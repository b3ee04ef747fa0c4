"""Optimal distributed fusion (RC eq. 6-8): a weighted sum of estimates, the weights minimizing its error's volume."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric
from engine.tracking.combination import best_weights, combined, pseudoinverse
from engine.tracking.recursion import LEAST, Fused

#: Rounds of the search in more than one dimension; it stops where no weight moves by more than STILL.
MOST, STILL = 60, 1e-11
#: Difference of log det below which round-off, not the weights, decides.
LEVEL = 1e-12


def distributed_fusion(believed: np.ndarray, actual: np.ndarray) -> Fused:
    """y_f = sum_j l_j y_j, sum_j l_j = 1, with the l of the smallest det E[(y_f - x)(y_f - x)'] (RC eq. 8).

    One number weighs all components of an estimate, as in the paper; in one dimension this is state vector fusion.
    actual (..., N, n, N, n) is tracked, so what is believed is so.
    """
    eye = np.eye(believed.shape[-1])
    l = best_weights(actual)[..., 0, 0] if len(eye) == 1 else _smallest_volume(actual)
    weights = l[..., None, None] * eye
    return Fused(weights, combined(weights, actual))


def _smallest_volume(joint: np.ndarray) -> np.ndarray:
    """The weights l (..., N), summing to one, of the smallest det sum_ab l_a l_b P_ab.

    log det is concave, so from any M it is at most log det M + tr(M^-1 (P - M)), which is quadratic in l: to minimize
    that never makes the volume larger, whatever the start, and Newton's step takes over where it is as good. There can
    be several valleys: the search starts from every estimate alone and keeps the best.
    """
    eye = np.eye(joint.shape[-1])

    def volume(l: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        P = combined(l[..., None, None] * eye, joint) + LEAST * eye
        return P, np.linalg.slogdet(P)[1]

    N = joint.shape[-4]
    l = np.broadcast_to(np.eye(N).reshape(N, *(1,) * (joint.ndim - 4), N), (N, *joint.shape[:-3]))
    P, logdet = volume(l)
    for _ in range(MOST):
        inverse = np.linalg.inv(P)
        trace = np.einsum("s...ki,...aibk->s...ab", inverse, joint)
        sure = best_weights(trace[..., :, None, :, None])[..., 0, 0]
        fast = l + _newton(l, inverse, trace, joint)
        (P_sure, at_sure), (P_fast, at_fast) = volume(sure), volume(fast)
        take = at_fast <= np.minimum(at_sure, logdet) + LEVEL
        before, l = l, np.where(take[..., None], fast, sure)
        P, logdet = np.where(take[..., None, None], P_fast, P_sure), np.where(take, at_fast, at_sure)
        if np.abs(l - before).max() < STILL:
            break
    best = np.argmin(logdet, axis=0)
    return np.take_along_axis(l, best[None, ..., None], axis=0)[0]


def _newton(l: np.ndarray, inverse: np.ndarray, trace: np.ndarray, joint: np.ndarray) -> np.ndarray:
    """Newton's step (..., N) of log det sum_ab l_a l_b P_ab among weights of the same sum; trace_ab = tr(P^-1 P_ab)."""
    C = inverse[..., None, :, :] @ symmetric(np.einsum("s...b,...aibk->s...aik", l, joint))
    slope = 2 * (trace @ l[..., None])
    curve = 2 * symmetric(trace) - 4 * np.einsum("...aik,...bki->...ab", C, C)
    rest = np.vstack([-np.ones(l.shape[-1] - 1), np.eye(l.shape[-1] - 1)])
    return -(rest @ (pseudoinverse(rest.T @ curve @ rest) @ (rest.T @ slope)))[..., 0]
