"""Optimal distributed fusion (RC eq. 6-8): a weighted sum of estimates, the weights minimizing its error's volume."""

from __future__ import annotations

import numpy as np

from engine.tracking.combination import best_weights, combined
from engine.tracking.recursion import LEAST, Fused

#: Rounds of the search in more than one dimension; it stops where no weight moves by more than STILL, which leaves
#: the volume right to its square.
MOST, STILL = 100, 1e-7


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
    that again and again never makes the volume larger. There can be several valleys: the search starts from every
    estimate alone and keeps the best.
    """
    eye = np.eye(joint.shape[-1])
    P = np.moveaxis(np.einsum("...aiak->...aik", joint), -3, 0)
    l = np.zeros((len(P), *joint.shape[:-3]))
    for _ in range(MOST):
        trace = np.einsum("s...ki,...aibk->s...ab", np.linalg.inv(P + LEAST * eye), joint, optimize=True)
        before, l = l, best_weights(trace[..., :, None, :, None])[..., 0, 0]
        P = combined(l[..., None, None] * eye, joint)
        if np.abs(l - before).max() < STILL:
            break
    best = np.argmin(np.linalg.slogdet(P + LEAST * eye)[1], axis=0)
    return np.take_along_axis(l, best[None, ..., None], axis=0)[0]
