"""Factor graphs over trajectories as flat arrays: Gaussian factors, pose-to-pose factors, ranges.

Unknowns are numbered scalars; a variable is a run of them. Poses of all vehicles come in order of time, so that
factors join near neighbours; the few that everything sees (fixed nodes, the sound speed) come last, as the border.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engine.gaussian.forms import apply, symmetric, transpose
from engine.navigation.ranging import NEAREST_M
from engine.smoothing.composition import between, between_jacobians


@dataclass(frozen=True)
class Gaussians:
    """Factors exp(-1/2 d' Lambda d + d' eta) of the displacement d of unknowns idx (F, k) from the reference.

    matrix (F, k, k), vector (F, k).
    """

    idx: np.ndarray
    matrix: np.ndarray
    vector: np.ndarray


@dataclass(frozen=True)
class Betweens:
    """Relative SE(2) poses z (F, 3) with covariance R (F, 3, 3) from poses first (F, 3) to second (F, 3)."""

    first: np.ndarray
    second: np.ndarray
    z: np.ndarray
    information: np.ndarray

    @property
    def idx(self) -> np.ndarray:
        return np.concatenate([self.first, self.second], axis=1)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Measured less expected relation (F, 3), the heading wrapped."""
        e = self.z - between(x[self.first], x[self.second])
        e[:, 2] = (e[:, 2] + np.pi) % (2 * np.pi) - np.pi
        return e

    def linearize(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gauss-Newton blocks (F, 6, 6) and (F, 6) at x."""
        J = np.concatenate(between_jacobians(x[self.first], x[self.second]), axis=-1)
        JtL = transpose(J) @ self.information
        return symmetric(JtL @ J), apply(JtL, self.residual(x))

    def cost(self, x: np.ndarray) -> float:
        e = self.residual(x)
        return 0.5 * float(np.einsum("fi,fij,fj->", e, self.information, e))


@dataclass(frozen=True)
class Ranges:
    """Horizontal ranges value (F,) m with sigma (F,) m between positions receiver (F, 2) and sender (F, 2).

    scale, where set, is the unknown kappa of ranges measured as (1 + kappa) times the distance.
    """

    receiver: np.ndarray
    sender: np.ndarray
    value: np.ndarray
    sigma: np.ndarray
    scale: int | None = None

    @property
    def idx(self) -> np.ndarray:
        parts = [self.receiver, self.sender]
        if self.scale is not None:
            parts.append(np.full((len(self.value), 1), self.scale))
        return np.concatenate(parts, axis=1)

    def expected(self, x: np.ndarray) -> np.ndarray:
        """The ranges (F,) that positions x would give."""
        distance = np.linalg.norm(x[self.receiver] - x[self.sender], axis=-1)
        return distance if self.scale is None else distance * (1 + x[self.scale])

    def normalized(self, x: np.ndarray) -> np.ndarray:
        """Residuals (F,) in standard deviations."""
        return (self.value - self.expected(x)) / self.sigma

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Rows (F, k) of the expected ranges by their unknowns, zero where the direction is unknown."""
        difference = x[self.receiver] - x[self.sender]
        distance = np.linalg.norm(difference, axis=-1)
        near = distance < NEAREST_M
        u = difference / np.where(near, 1.0, distance)[:, None]
        u[near] = 0.0
        if self.scale is None:
            return np.concatenate([u, -u], axis=1)
        u = u * (1 + x[self.scale])
        return np.concatenate([u, -u, distance[:, None]], axis=1)

    def linearize(self, x: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gauss-Newton blocks (F, k, k) and (F, k) at x, each factor weighted by weight (F,)."""
        J = self.jacobian(x) / self.sigma[:, None]
        e = self.normalized(x) * weight
        return J[:, :, None] * (J * weight[:, None])[:, None, :], J * e[:, None]

    def cost(self, x: np.ndarray, weight: np.ndarray) -> float:
        return 0.5 * float((weight * self.normalized(x) ** 2).sum())


@dataclass(frozen=True)
class Graph:
    """Factors over `banded` unknowns in order of time and `border` ones after them.

    reference (banded + border,) is what displacements of Gaussian factors count from, and where solving starts.
    """

    reference: np.ndarray
    banded: int
    gaussians: tuple[Gaussians, ...] = ()
    betweens: tuple[Betweens, ...] = ()
    ranges: tuple[Ranges, ...] = field(default=())

    @property
    def border(self) -> int:
        return len(self.reference) - self.banded


def priors(idx: np.ndarray, mean: np.ndarray, cov: np.ndarray, reference: np.ndarray) -> Gaussians:
    """Gaussian beliefs mean (F, k), cov (F, k, k) of unknowns idx (F, k), for a graph with that reference."""
    matrix = symmetric(np.linalg.inv(cov))
    return Gaussians(idx, matrix, apply(matrix, mean - reference[idx]))


def increments(first: np.ndarray, second: np.ndarray, z: np.ndarray, R: np.ndarray, reference: np.ndarray) -> Gaussians:
    """Relations z (F, 2), R (F, 2, 2) of R^2 from positions first (F, 2) to second (F, 2)."""
    L = symmetric(np.linalg.inv(R))
    matrix = np.concatenate([np.concatenate([L, -L], axis=-1), np.concatenate([-L, L], axis=-1)], axis=-2)
    push = apply(L, z - (reference[second] - reference[first]))
    return Gaussians(np.concatenate([first, second], axis=1), matrix, np.concatenate([-push, push], axis=-1))
