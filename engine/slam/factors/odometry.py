"""Relative motion between two variables (Point2Point2, Pose2Pose2; C19 eq. 4.126)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.slam.factors.factor import Factor, whitener
from engine.slam.variables import POSE2, Kind, wrap


@dataclass(frozen=True)
class Displacement(Factor):
    """b - a = delta (d,) in axes that do not turn with the vehicle."""

    kind: Kind
    delta: np.ndarray
    W: np.ndarray

    def residual(self, *values: np.ndarray) -> np.ndarray:
        a, b = values
        return self.kind.difference(b - a, self.delta) @ self.W.T

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        noise = rng.standard_normal((*strata.shape, self.kind.dim)) @ np.linalg.inv(self.W).T
        step = self.delta + noise
        return values[0] + step if towards == 1 else values[1] - step

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        return self.residual(*values), [-self.W, self.W]


@dataclass(frozen=True)
class PoseOdometry(Factor):
    """Pose b seen from pose a: delta (x, y, turn) in a's axes."""

    delta: np.ndarray
    W: np.ndarray

    def residual(self, *values: np.ndarray) -> np.ndarray:
        a, b = values
        c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
        dx, dy = b[..., 0] - a[..., 0], b[..., 1] - a[..., 1]
        seen = np.stack([c * dx + s * dy, -s * dx + c * dy, b[..., 2] - a[..., 2]], axis=-1)
        return POSE2.difference(seen, self.delta) @ self.W.T

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        a, b = values
        d = b[..., :2] - a[..., :2]
        c, s = np.broadcast_arrays(np.cos(a[..., 2]), np.sin(a[..., 2]), d[..., 0])[:2]
        J = np.zeros((*d.shape[:-1], 3, 3))
        J[..., 0, 0], J[..., 0, 1], J[..., 1, 0], J[..., 1, 1], J[..., 2, 2] = c, s, -s, c, 1.0
        back = -J
        back[..., 0, 2], back[..., 1, 2] = c * d[..., 1] - s * d[..., 0], -c * d[..., 0] - s * d[..., 1]
        return self.residual(*values), [self.W @ back, self.W @ J]

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        step = self.delta + rng.standard_normal((*strata.shape, 3)) @ np.linalg.inv(self.W).T
        x, y, turn = step[..., 0], step[..., 1], step[..., 2]
        if towards == 1:
            a = values[0]
            c, s = np.cos(a[..., 2]), np.sin(a[..., 2])
            return np.stack([a[..., 0] + c * x - s * y, a[..., 1] + s * x + c * y, wrap(a[..., 2] + turn)], axis=-1)
        b = values[1]
        heading = b[..., 2] - turn
        c, s = np.cos(heading), np.sin(heading)
        return np.stack([b[..., 0] - c * x + s * y, b[..., 1] - s * x - c * y, wrap(heading)], axis=-1)


def displacement(a: str, b: str, kind: Kind, delta: np.ndarray, cov: np.ndarray) -> Displacement:
    """b - a = delta (d,) with covariance (d, d)."""
    return Displacement((a, b), kind, np.asarray(delta, float), whitener(cov), linear=True, determines=True)


def pose_odometry(a: str, b: str, delta: np.ndarray, cov: np.ndarray) -> PoseOdometry:
    """Pose b relative to pose a, delta (3,) in a's axes with covariance (3, 3)."""
    return PoseOdometry((a, b), np.asarray(delta, float), whitener(cov), determines=True)
