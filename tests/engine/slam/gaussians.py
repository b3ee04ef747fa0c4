"""Random linear graphs and their exact posterior by one dense solve, the judge of the tree's answers."""

from __future__ import annotations

import numpy as np

from engine.slam.factors.factor import Factor
from engine.slam.factors.odometry import displacement
from engine.slam.factors.prior import prior
from engine.slam.graph import Graph
from engine.slam.variables import POINT2


def chain(length: int, rng: np.random.Generator, closures: int = 0) -> Graph:
    """Points in a row with odometry, a prior at the start, and loop closures between random pairs."""
    graph = Graph()
    names = [f"x{i}" for i in range(length)]
    factors: list[Factor] = [prior(names[0], POINT2, rng.normal(size=2), np.diag([0.5, 0.2]))]
    pairs = [(i, i + 1) for i in range(length - 1)]
    pairs += [tuple(sorted(rng.choice(length, 2, replace=False))) for _ in range(closures)]  # type: ignore[misc]
    for a, b in pairs:
        A = rng.normal(size=(2, 2))
        factors.append(displacement(names[a], names[b], POINT2, rng.normal(size=2) * 3, A @ A.T + 0.1 * np.eye(2)))
    graph.add(dict.fromkeys(names, POINT2), factors)
    return graph


def exact(graph: Graph) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Means {variable: (d,)} and covariances {variable: (d, d)} of a linear graph, by a dense inverse."""
    at, size = {}, 0
    for v, kind in graph.kinds.items():
        at[v] = slice(size, size + kind.dim)
        size += kind.dim
    Lam, eta = np.zeros((size, size)), np.zeros(size)
    for factor in graph.factors:
        zeros = [np.zeros(graph.kinds[v].dim) for v in factor.variables]
        e, J = factor.linearize(*zeros)
        for v, Jv in zip(factor.variables, J, strict=True):
            eta[at[v]] -= Jv.T @ e
            for u, Ju in zip(factor.variables, J, strict=True):
                Lam[at[v], at[u]] += Jv.T @ Ju
    cov = np.linalg.inv(Lam)
    mean = cov @ eta
    return {v: mean[s] for v, s in at.items()}, {v: cov[s, s] for v, s in at.items()}
