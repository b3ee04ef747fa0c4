"""A range between two variables' positions (Point2Point2Range, C19 eq. 4.127)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.slam.factors.factor import Factor


@dataclass(frozen=True)
class Range(Factor):
    """Distance (m) between the first two coordinates of two variables, Gaussian."""

    range_m: float
    sigma_m: float

    def residual(self, *values: np.ndarray) -> np.ndarray:
        d = values[0][..., :2] - values[1][..., :2]
        return ((np.hypot(d[..., 0], d[..., 1]) - self.range_m) / self.sigma_m)[..., None]

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Points on the ring about the other variable; strata give the bearing. Only a Point2 can be drawn."""
        r = np.abs(self.range_m + self.sigma_m * rng.standard_normal(strata.shape))
        angle = 2 * np.pi * strata
        return values[1 - towards][..., :2] + r[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        a, b = values
        d = a[..., :2] - b[..., :2]
        r = np.hypot(d[..., 0], d[..., 1])[..., None]
        u = np.where(r > 0, d / np.where(r > 0, r, 1.0), [1.0, 0.0]) / self.sigma_m
        e = (r - self.range_m) / self.sigma_m
        return e, [_padded(u, a.shape[-1]), _padded(-u, b.shape[-1])]


def _padded(u: np.ndarray, d: int) -> np.ndarray:
    J = np.zeros((*u.shape[:-1], 1, d))
    J[..., 0, :2] = u
    return J


def ranging(a: str, b: str, range_m: float, sigma_m: float) -> Range:
    """A range (m) between two variables; ValueError unless sigma_m is positive."""
    if not sigma_m > 0:
        raise ValueError(f"a range's sigma must be positive, got {sigma_m}")
    return Range((a, b), float(range_m), float(sigma_m))
