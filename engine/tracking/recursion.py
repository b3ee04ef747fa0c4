"""What every fuser believes, and what is really so: the joint error covariance of all nodes, step by step.

Every fuser here is linear with gains that do not depend on the data, so its actual error covariance follows exactly.
With the errors of all N nodes stacked, a prediction adds the common process noise to all of them, a measurement
shrinks one of them, and a fusion mixes them. Beliefs are kept beside it: the covariance each node thinks it has.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import symmetric, transpose
from engine.tracking.model import Model


@dataclass(frozen=True)
class Nodes:
    """believed (..., N, n, n), each node's own covariance; actual (..., N, n, N, n), the joint one of all errors."""

    believed: np.ndarray
    actual: np.ndarray

    def actual_of(self, node: int) -> np.ndarray:
        """The actual error covariance (..., n, n) of one node."""
        return self.actual[..., node, :, node, :]


@dataclass(frozen=True)
class Fused:
    """The fused estimate sum_j W_j y_j: weights (..., N, n, n) and the covariance it is believed to have."""

    weights: np.ndarray
    believed: np.ndarray


#: Added to the variances a rule inverts, m^2: nothing beside any sensor, and enough where somebody claims perfection.
LEAST = 1e-150

#: A fusion rule: from the believed covariances (..., N, n, n) and the actual joint one (..., N, n, N, n) of the
#: estimates that met. Only rules that track cross-covariances may look at the latter's off-diagonal blocks.
Rule = Callable[[np.ndarray, np.ndarray], Fused]


def start(model: Model, cases: tuple[int, ...] = ()) -> Nodes:
    """All nodes hold the same estimate, with the model's prior covariance."""
    N, n = model.nodes, model.size
    cases = np.broadcast_shapes(cases, model.prior.shape[:-2], *(r.shape[:-2] for r in model.R))
    believed = np.broadcast_to(model.prior[..., None, :, :], (*cases, N, n, n)).copy()
    actual = np.broadcast_to(model.prior[..., None, :, None, :], (*cases, N, n, N, n)).copy()
    return Nodes(believed, actual)


def predict(model: Model, nodes: Nodes) -> Nodes:
    """The target moves: the same process noise enters everybody's error (RC eq. 1)."""
    F, Q = model.F, model.Q
    believed = F[..., None, :, :] @ nodes.believed @ transpose(F)[..., None, :, :] + Q[..., None, :, :]
    F = F[..., None, None, :, :]
    blocks = F @ np.swapaxes(nodes.actual, -3, -2) @ transpose(F)
    return Nodes(believed, np.swapaxes(blocks + Q[..., None, None, :, :], -3, -2))


def gain(model: Model, believed: np.ndarray, node: int) -> np.ndarray:
    """Kalman gain (..., n, m) of one node by what it believes."""
    H, R = model.H[node], model.R[node]
    P = believed[..., node, :, :]
    return transpose(np.linalg.solve(H @ P @ H.T + R, H @ P))


def observe(model: Model, nodes: Nodes) -> tuple[Nodes, list[np.ndarray]]:
    """Every node updates with its own sensor (RC eq. 7); also the gains it used."""
    believed, actual = nodes.believed.copy(), nodes.actual.copy()
    gains = [gain(model, nodes.believed, i) for i in range(model.nodes)]
    for i, K in enumerate(gains):
        keep = np.eye(model.size) - K @ model.H[i]
        KRK = K @ model.R[i] @ transpose(K)
        believed[..., i, :, :] = symmetric(keep @ believed[..., i, :, :] @ transpose(keep) + KRK)
        actual[..., i, :, :, :] = np.einsum("...ij,...jbk->...ibk", keep, actual[..., i, :, :, :])
        actual[..., :, :, i, :] = np.einsum("...akj,...ij->...aki", actual[..., :, :, i, :], keep)
        actual[..., i, :, i, :] += KRK
    return Nodes(believed, actual), gains


def fuse(nodes: Nodes, rule: Rule, heard: np.ndarray | None = None) -> tuple[Nodes, np.ndarray]:
    """Every node fuses its estimate with those it heard and takes the result as its own.

    heard (..., N, N) flags, [i, j] where i heard j; None: everybody heard everybody, so all agree afterwards. Also
    returns the mixing weights (..., N, N, n, n), y_i' = sum_j W_ij y_j.
    """
    cases, (N, n) = nodes.believed.shape[:-3], nodes.believed.shape[-3:-1]
    W = np.zeros((*cases, N, N, n, n))
    believed = np.empty_like(nodes.believed)
    if heard is None:
        fused = rule(nodes.believed, nodes.actual)
        W[...] = fused.weights[..., None, :, :, :]
        believed[...] = fused.believed[..., None, :, :]
    else:
        W[...] = np.eye(N)[:, :, None, None] * np.eye(n)
        believed[...] = nodes.believed
        flags = np.broadcast_to(heard, (*cases, N, N)) | np.eye(N, dtype=bool)
        for i in range(N):
            for pattern in np.unique(flags[..., i, :].reshape(-1, N), axis=0):
                met = np.flatnonzero(pattern)
                if met.size < 2:
                    continue
                where = (flags[..., i, :] == pattern).all(axis=-1)
                part = nodes.actual[where][..., met, :, :, :][..., met, :]
                fused = rule(nodes.believed[where][..., met, :, :], part)
                rows = np.zeros((int(where.sum()), N, n, n))
                rows[:, met] = fused.weights
                W[where, i] = rows
                believed[where, i] = fused.believed
    return Nodes(believed, mixed(W, nodes.actual)), W


def mixed(W: np.ndarray, joint: np.ndarray) -> np.ndarray:
    """The joint covariance (..., A, n, A, n) of the errors y_a' = sum_b W_ab y_b; W (..., A, N, n, n)."""
    A, N, n = W.shape[-4:-1]
    stacked = np.swapaxes(W, -3, -2).reshape(*W.shape[:-4], A * n, N * n)
    cov = stacked @ joint.reshape(*joint.shape[:-4], N * n, N * n) @ transpose(stacked)
    return symmetric(cov).reshape(*cov.shape[:-2], A, n, A, n)


def step(model: Model, nodes: Nodes, rule: Rule | None) -> Nodes:
    """One round: predict, observe, fuse (RC Fig. 2); without a rule nobody cooperates."""
    nodes, _ = observe(model, predict(model, nodes))
    return nodes if rule is None else fuse(nodes, rule)[0]


def history(model: Model, rule: Rule | None, steps: int) -> list[Nodes]:
    """The nodes after 0, 1, ..., steps rounds."""
    seen = [start(model)]
    for _ in range(steps):
        seen.append(step(model, seen[-1], rule))
    return seen


def central(model: Model, P: np.ndarray) -> np.ndarray:
    """One round of the central filter (CF): predict, then every sensor's measurement (RC eq. 3-4)."""
    P = symmetric(model.F @ P @ transpose(model.F) + model.Q)
    for H, R in zip(model.H, model.R):
        K = transpose(np.linalg.solve(H @ P @ H.T + R, H @ P))
        keep = np.eye(model.size) - K @ H
        P = symmetric(keep @ P @ transpose(keep) + K @ R @ transpose(K))
    return P
