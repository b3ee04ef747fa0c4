"""Direct observation of a variable (PriorPoint2, PriorPose2, PriorDynPoint2; C19 eqs. 4.125, 4.128)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.slam.factors.factor import Factor, whitener
from engine.slam.variables import Kind


@dataclass(frozen=True)
class Prior(Factor):
    """Gaussian with mean (d,) and whitening matrix W (d, d) on a variable of some kind."""

    kind: Kind
    mean: np.ndarray
    W: np.ndarray

    def residual(self, *values: np.ndarray) -> np.ndarray:
        return self.kind.difference(values[0], self.mean) @ self.W.T

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        return self.mean + rng.standard_normal((*strata.shape, self.kind.dim)) @ np.linalg.inv(self.W).T

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        return self.residual(*values), [self.W]


def prior(variable: str, kind: Kind, mean: np.ndarray, cov: np.ndarray) -> Prior:
    """A Gaussian prior with mean (d,) and covariance (d, d)."""
    return Prior((variable,), kind, np.asarray(mean, float), whitener(cov), linear=True, determines=True)
