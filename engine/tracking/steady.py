"""The steady state of every fuser: beliefs by Newton's method, actual covariances by doubling.

Plain iteration of the recursion converges like (1 - c)^k with c of the order of sqrt(Q / R): a slow target with poor
sensors would take a hundred thousand rounds. Newton's steps do not depend on it, and are only trusted where they end at
a fixed point with positive definite covariances.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import symmetric, transpose
from engine.tracking import recursion
from engine.tracking.model import Model
from engine.tracking.recursion import Nodes, Rule

#: Plain rounds before the first Newton step, Newton steps at most, and the relative step that counts as arrived.
WARM, MOST, STILL = 12, 60, 1e-10
#: Relative size of the difference quotients' increments.
NUDGE = 1e-7
#: Doublings: enough for 2^60 rounds.
DOUBLINGS = 60


def settle(model: Model, rule: Rule | None) -> tuple[Nodes, np.ndarray]:
    """The nodes after infinitely many rounds, and which cases (...) have such a state; the others are meaningless."""
    believed, settled = _beliefs(model, rule)
    nodes = _alike(believed)
    nodes, gains = recursion.observe(model, recursion.predict(model, nodes))
    N, n = model.nodes, model.size
    cases = believed.shape[:-3]
    keep = np.stack([np.broadcast_to(np.eye(n) - K @ H, (*cases, n, n)) for K, H in zip(gains, model.H)], axis=-3)
    noise = np.einsum("...aij,...jk,...blk->...aibl", keep, model.Q, keep)
    for i, K in enumerate(gains):
        noise[..., i, :, i, :] += K @ model.R[i] @ transpose(K)
    W = np.eye(N)[:, :, None, None] * np.eye(n) if rule is None else recursion.fuse(nodes, rule)[1]
    noise = recursion.mixed(W, noise)
    carry = np.swapaxes(np.broadcast_to(W, (*cases, N, N, n, n)) @ (keep @ model.F)[..., None, :, :, :], -3, -2)
    flat = (*cases, N * n, N * n)
    actual, ended = _stein(carry.reshape(flat), noise.reshape(flat))
    return Nodes(believed, actual.reshape(*cases, N, n, N, n)), settled & ended


def _alike(believed: np.ndarray) -> Nodes:
    """Nodes that share one estimate which is as good as they believe: what rules that track covariances meet."""
    n, N = believed.shape[-1], believed.shape[-3]
    actual = np.broadcast_to(believed[..., :, :, None, :], (*believed.shape[:-3], N, n, N, n))
    return Nodes(believed, actual.copy())


def _beliefs(model: Model, rule: Rule | None) -> tuple[np.ndarray, np.ndarray]:
    """The believed covariances (..., N, n, n) that a round leaves as they are, and the cases that have them.

    With everybody hearing everybody the nodes share one estimate after each round; the rules that look at actual
    covariances believe them. So the belief alone decides the next belief, and Newton's method has n (n + 1) / 2
    unknowns per node, in units of the present variances. It starts from more than the prior, which may be none.
    """
    n = model.size
    row, column = np.triu_indices(n)

    def after(believed: np.ndarray) -> np.ndarray:
        return recursion.step(model, _alike(believed), rule).believed

    B = recursion.start(model).believed + np.eye(n)
    for _ in range(WARM):
        B = after(B)
    arrived = np.zeros(B.shape[:-3], bool)
    for _ in range(MOST):
        size = np.sqrt(np.einsum("...ii->...i", B))
        unit = size[..., :, None] * size[..., None, :]
        told = after(B)
        slopes = []
        for i, j in zip(row, column):
            nudge = np.zeros((n, n))
            nudge[i, j] = nudge[j, i] = NUDGE
            slopes.append((((after(B + nudge * unit) - told) / unit) / NUDGE)[..., row, column])
        short = ((told - B) / unit)[..., row, column]
        J = np.eye(len(row)) - np.stack(slopes, axis=-1)
        with np.errstate(all="ignore"):
            move = np.zeros_like(B)
            move[..., row, column] = _solve(J, short)
            move[..., column, row] = move[..., row, column]
            newton = B + move * unit
            sound = np.isfinite(newton).all(axis=(-1, -2))
            sound[sound] = np.linalg.eigvalsh(newton[sound])[..., 0] > 0
        arrived = (sound & (np.abs(move).max(axis=(-1, -2)) < STILL)).all(axis=-1)
        B = np.where(sound[..., None, None], newton, told)
        if arrived.all():
            break
    return symmetric(B), arrived


def _solve(J: np.ndarray, short: np.ndarray) -> np.ndarray:
    """J^-1 short, NaN where J is singular."""
    singular = np.linalg.det(J) == 0
    found = np.linalg.solve(np.where(singular[..., None, None], np.eye(J.shape[-1]), J), short[..., None])[..., 0]
    return np.where(singular[..., None], np.nan, found)


def _stein(carry: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The X = carry X carry' + noise, (..., n, n), NaN where there is none; by doubling, X_2k = C_k X_k C_k' + X_k."""
    X, C = noise, carry
    ended = np.zeros(carry.shape[:-2], bool)
    with np.errstate(all="ignore"):
        for _ in range(DOUBLINGS):
            more = C @ X @ transpose(C)
            X, C = np.where(ended[..., None, None], X, X + more), C @ C
            ended |= np.abs(more).max(axis=(-1, -2)) <= 1e-17 * np.abs(X).max(axis=(-1, -2))
            if ended.all():
                break
    ended &= np.isfinite(X).all(axis=(-1, -2))
    return symmetric(np.where(ended[..., None, None], X, np.nan)), ended


def settle_centrally(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """The central filter's steady covariance (..., n, n) and where there is one: a single node with every sensor."""
    H = np.concatenate(model.H, axis=-2)
    cases = np.broadcast_shapes(*(R.shape[:-2] for R in model.R))
    R = np.zeros((*cases, len(H), len(H)))
    row = 0
    for r in model.R:
        m = r.shape[-1]
        R[..., row : row + m, row : row + m] = r
        row += m
    nodes, settled = settle(Model(model.F, model.Q, (H,), (R,), model.prior), None)
    return nodes.believed[..., 0, :, :], settled
