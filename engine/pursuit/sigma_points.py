"""Sigma points: a Gaussian as weighted points that go through a nonlinear function (C19 eq. 3.2-3.10)."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric, transpose


@dataclass(frozen=True)
class Quadrature:
    """Points (m, n) and weights (m,), summing to one, that stand for a standard normal of n dimensions."""

    nodes: np.ndarray
    weights: np.ndarray


@cache
def unscented(n: int, kappa: float | None = None) -> Quadrature:
    """The 2 n + 1 points of Julier and Uhlmann; kappa is 3 - n, but not below 0, where none is given.

    C19 (3.3)-(3.4) print k / 2(N+k) for the outer weights; it is 1 / 2(N+k). ValueError where n + kappa is not above 0.
    """
    kappa = max(3.0 - n, 0.0) if kappa is None else kappa
    if n + kappa <= 0:
        raise ValueError(f"kappa: {kappa:g} for {n} dimensions; it must be above {-n}")
    reach = np.sqrt(n + kappa) * np.eye(n)
    nodes = np.concatenate([np.zeros((1, n)), reach, -reach])
    weights = np.full(2 * n + 1, 0.5 / (n + kappa))
    weights[0] = kappa / (n + kappa)
    return Quadrature(nodes, weights)


@cache
def gauss_hermite(n: int) -> Quadrature:
    """The tensor grid of the three-point Hermite rule, 3^n points.

    C19 (3.10) gives abscissas +-1.2247 and weights 0.2954, 1.1816, 0.2954 for the weight function exp(-x^2); for a
    standard normal they are times sqrt 2 and over sqrt pi, and there are 3^n points, not 3 n.
    """
    nodes = np.array(list(itertools.product((-np.sqrt(3.0), 0.0, np.sqrt(3.0)), repeat=n)))
    weights = np.prod(np.where(nodes == 0.0, 2 / 3, 1 / 6), axis=1)
    return Quadrature(nodes, weights)


Rule = Callable[[int], Quadrature]


def spread(moments: Moments, rule: Quadrature) -> np.ndarray:
    """The points (..., m, n) of a Gaussian."""
    return moments.mean[..., None, :] + rule.nodes @ transpose(root(moments.cov))


def gather(points: np.ndarray, weights: np.ndarray) -> Moments:
    """Mean and covariance of weighted points (..., m, n) (C19 eq. 3.5-3.6)."""
    mean = apply(transpose(points), weights)
    centred = points - mean[..., None, :]
    return Moments(mean, symmetric(transpose(centred) @ (weights[:, None] * centred)))


def root(cov: np.ndarray) -> np.ndarray:
    """A square root L of covariances (..., n, n), L L' = cov: Cholesky's, or by eigenvalues where one is singular."""
    try:
        return np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(cov)
        return vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
