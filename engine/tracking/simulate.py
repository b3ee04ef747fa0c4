"""Monte Carlo of the model: targets, measurements and the estimates every fuser makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import apply
from engine.tracking import recursion
from engine.tracking.model import Model
from engine.tracking.recursion import Nodes, Rule


@dataclass(frozen=True)
class Draws:
    """One block of trials: target (trials, T+1, n), prior estimate (trials, n), measurements N x (trials, T, m)."""

    target: np.ndarray
    prior: np.ndarray
    z: tuple[np.ndarray, ...]


def draw(model: Model, steps: int, trials: int, rng: np.random.Generator) -> Draws:
    """Targets that start at the origin and move by the model, a prior estimate around the start, measurements."""
    n = model.size
    return shape(
        model,
        rng.standard_normal((trials, n)),
        rng.standard_normal((trials, steps, n)),
        tuple(rng.standard_normal((trials, steps, r.shape[-1])) for r in model.R),
    )


def shape(model: Model, prior: np.ndarray, process: np.ndarray, noise: tuple[np.ndarray, ...]) -> Draws:
    """Turn standard normals into a block of trials of the model."""
    trials, steps, n = process.shape
    w = apply(_root(model.Q), process)
    target = np.zeros((trials, steps + 1, n))
    for k in range(steps):
        target[:, k + 1] = apply(model.F, target[:, k]) + w[:, k]
    z = tuple(apply(H, target[:, 1:]) + apply(_root(R), v) for H, R, v in zip(model.H, model.R, noise))
    return Draws(target, apply(_root(model.prior), prior), z)


def _root(cov: np.ndarray) -> np.ndarray:
    """A square root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(cov)
    return vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]


@dataclass(frozen=True)
class Estimates:
    """Estimates (trials, T+1, N, n) of every node, believed and actual covariances (trials or 1, T+1, N, n, n)."""

    mean: np.ndarray
    believed: np.ndarray
    actual: np.ndarray


def estimate(model: Model, draws: Draws, rule: Rule | None, heard: np.ndarray | None = None) -> Estimates:
    """Run every node of one fuser over the trials; heard (trials, T, N, N) says who heard whom, None: everybody."""
    trials, steps = draws.z[0].shape[:2]
    N = model.nodes
    nodes = recursion.start(model, () if heard is None else (trials,))
    y = np.repeat(draws.prior[:, None], N, axis=1)
    means, seen = [y], [_apart(nodes)]
    for k in range(steps):
        nodes = recursion.predict(model, nodes)
        y = apply(model.F, y)
        nodes, gains = recursion.observe(model, nodes)
        y = np.stack(
            [y[:, i] + apply(gains[i], draws.z[i][:, k] - apply(model.H[i], y[:, i])) for i in range(N)], axis=1
        )
        if rule is not None:
            nodes, W = recursion.fuse(nodes, rule, None if heard is None else heard[:, k])
            y = np.einsum("...abij,tbj->tai" if heard is None else "tabij,tbj->tai", W, y, optimize=True)
        means.append(y)
        seen.append(_apart(nodes))
    believed, actual = np.stack(seen, axis=-4).reshape(2, -1, steps + 1, N, model.size, model.size)
    return Estimates(np.stack(means, axis=1), believed, actual)


def estimate_centrally(model: Model, draws: Draws) -> Estimates:
    """The central filter over the trials; every node is given its estimate."""
    steps, N = draws.z[0].shape[1], model.nodes
    P, y = model.prior, draws.prior
    means, believed = [y], [P]
    for k in range(steps):
        P = model.F @ P @ model.F.T + model.Q
        y = apply(model.F, y)
        for i, (H, R) in enumerate(zip(model.H, model.R)):
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            y = y + apply(K, draws.z[i][:, k] - apply(H, y))
            keep = np.eye(model.size) - K @ H
            P = keep @ P @ keep.T + K @ R @ K.T
        means.append(y)
        believed.append(P)
    everyone = np.repeat(np.stack(means, axis=1)[:, :, None], N, axis=2)
    cov = np.repeat(np.stack(believed)[None, :, None], N, axis=2)
    return Estimates(everyone, cov, cov)


def _apart(nodes: Nodes) -> np.ndarray:
    """Believed and actual covariance of every node by itself, (2, ..., N, n, n)."""
    return np.stack([nodes.believed, np.einsum("...aiaj->...aij", nodes.actual)])
