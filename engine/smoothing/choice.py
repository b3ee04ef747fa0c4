"""Which priors to broadcast again: the last k, or greedily the k best for the current pose (W15 section IV-C).

A chain here is its links with priors only, in order, the odometry between them composed; all trials at once, with a
leading axis of candidates where several choices are weighed.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric


def received_probability(broadcasts: np.ndarray, loss: float) -> np.ndarray:
    """Probability that a link broadcast so many times has been received at least once (W15 eq. 17)."""
    return 1.0 - loss**broadcasts


def current_information(anchor: np.ndarray, priors: np.ndarray, weight: np.ndarray, odometry: np.ndarray) -> np.ndarray:
    """Marginal information (..., 2, 2) of the current pose given weighted priors along the chain.

    anchor (..., 2, 2) is the information about the first of n poses; priors (..., n, 2, 2) and weight (..., n) theirs;
    odometry (..., n, 2, 2) the covariances from each to the next, the last to the current pose. The Schur complement of
    Lambda_odo + sum p_i Lambda_i is taken pose by pose.
    """
    information = anchor
    eye = np.eye(anchor.shape[-1])
    for i in range(priors.shape[-3]):
        information = information + weight[..., i, None, None] * priors[..., i, :, :]
        information = symmetric(information @ np.linalg.inv(eye + odometry[..., i, :, :] @ information))
    return information


def k_last(priors: list[int], k: int) -> list[int]:
    """The k most recent of ascending link numbers."""
    return priors[::-1][:k]


def k_best(
    anchor: np.ndarray, priors: np.ndarray, broadcasts: np.ndarray, odometry: np.ndarray, k: int, loss: float
) -> np.ndarray:
    """Greedily the k priors that tell most about the current pose (W15 section IV-C): places (trials, k) in 0..n-1.

    broadcasts (trials, n) counts earlier broadcasts of each, loss is the assumed loss rate r; never sent ones come
    first, the latest before the others, since nobody can have them. -1 fills up where there are fewer than k.
    """
    trials, n = broadcasts.shape
    sent = broadcasts.astype(float).copy()
    chosen = np.full((trials, k), -1)
    taken = np.zeros((trials, n), bool)
    everyone = np.arange(trials)
    for slot in range(min(k, n)):
        added = sent[None] + np.eye(n)[:, None, :]
        information = current_information(anchor, priors, received_probability(added, loss), odometry)
        score = np.linalg.slogdet(information)[1].T
        new = (broadcasts == 0) & ~taken
        score = np.where(new, 1e6 + np.arange(n), score)
        score[taken] = -np.inf
        best = score.argmax(axis=1)
        chosen[:, slot] = best
        taken[everyone, best] = True
        sent[everyone, best] += 1
    return chosen
