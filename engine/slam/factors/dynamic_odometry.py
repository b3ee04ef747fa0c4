"""Motion of a point with velocity, a first-order system (DynPoint2DynPoint2, C19 eqs. 4.129-4.130)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.slam.factors.factor import Factor, whitener


@dataclass(frozen=True)
class DynamicOdometry(Factor):
    """b - a = delta (x, y, vx, vy), and (p_b - p_a) / dt = (v_a + v_b) / 2 within the velocity's noise.

    The paper's (4.130) subtracts half the sum squared; the mean velocity is meant.
    """

    delta: np.ndarray
    W: np.ndarray
    dt_s: float
    velocity_sigma_mps: float

    def residual(self, *values: np.ndarray) -> np.ndarray:
        a, b = values
        moved = (b - a - self.delta) @ self.W.T
        drift = (b[..., :2] - a[..., :2]) / self.dt_s - 0.5 * (a[..., 2:] + b[..., 2:])
        return np.concatenate([moved, drift / self.velocity_sigma_mps], axis=-1)

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        step = self.delta + rng.standard_normal((*strata.shape, 4)) @ np.linalg.inv(self.W).T
        return values[0] + step if towards == 1 else values[1] - step

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        eye, zero = np.eye(2), np.zeros((2, 2))
        velocity = np.hstack([zero, 0.5 * eye]) / self.velocity_sigma_mps
        position = np.hstack([eye, zero]) / (self.dt_s * self.velocity_sigma_mps)
        Ja = np.vstack([-self.W, -position - velocity])
        Jb = np.vstack([self.W, position - velocity])
        return self.residual(*values), [Ja, Jb]


def dynamic_odometry(
    a: str, b: str, delta: np.ndarray, cov: np.ndarray, dt_s: float, velocity_sigma_mps: float
) -> DynamicOdometry:
    """Displacement and change of velocity, delta (4,) with covariance (4, 4), over dt_s seconds."""
    return DynamicOdometry(
        (a, b), np.asarray(delta, float), whitener(cov), dt_s, velocity_sigma_mps, linear=True, determines=True
    )
