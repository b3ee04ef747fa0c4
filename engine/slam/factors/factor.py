"""What every factor of the graph answers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

#: Step of the numerical differentiation of a residual (m, m/s or rad).
STEP = 1e-5


@dataclass(frozen=True)
class Factor:
    """A measurement of some variables; values are arrays (..., d), one for each of `variables`, in that order.

    A subclass gives `residual`, whitened, so that the density of the values is exp(-|residual|^2 / 2), and `sample`.
    `linear` promises a constant Jacobian; `determines` that any one variable follows from the others (a prior,
    odometry), as it does not from a range; `costly` that it should not be asked about thousands of places.
    """

    variables: tuple[str, ...]
    linear: bool = field(default=False, kw_only=True)
    determines: bool = field(default=False, kw_only=True)
    costly: bool = field(default=False, kw_only=True)

    @property
    def determined(self) -> tuple[str, ...]:
        """The variables that follow from the others."""
        return self.variables if self.determines else ()

    def residual(self, *values: np.ndarray) -> np.ndarray:
        """The whitened residual (..., k)."""
        raise NotImplementedError

    def sample(
        self, towards: int, values: list[np.ndarray], strata: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Draws (..., d) of variable `towards` given the others (approximate convolution, C19 eq. 4.102).

        strata (...,) in [0, 1) orders the draws along the factor's most ambiguous direction, so that a caller can
        spread them evenly; values[towards] is not read.
        """
        raise NotImplementedError

    def log_density(self, *values: np.ndarray) -> np.ndarray:
        """Log of the density (...,), up to a constant."""
        return -0.5 * np.square(self.residual(*values)).sum(-1)

    def log_proposal(self, towards: int, values: list[np.ndarray]) -> np.ndarray | None:
        """Log density (...,) with which `sample` draws variable `towards`, where that is not this factor's own."""
        return None

    def taken(self, kept: np.ndarray) -> Factor:
        """This factor for the kernels (N,) that are kept, numbers that may repeat; most are the same for all."""
        return self

    def linearize(self, *values: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Residual (..., k) and its Jacobians [(..., k, d)], by central differences unless a subclass knows them."""
        e = self.residual(*values)
        jacobians = []
        for i, value in enumerate(values):
            columns = []
            for j in range(value.shape[-1]):
                step = np.zeros(value.shape[-1])
                step[j] = STEP
                ahead = self.residual(*values[:i], value + step, *values[i + 1 :])
                behind = self.residual(*values[:i], value - step, *values[i + 1 :])
                columns.append((ahead - behind) / (2 * STEP))
            jacobians.append(np.stack(columns, axis=-1))
        return e, jacobians


def whitener(cov: np.ndarray) -> np.ndarray:
    """W (d, d) with W cov W' = 1; ValueError unless cov is positive definite."""
    try:
        return np.linalg.inv(np.linalg.cholesky(np.asarray(cov, dtype=float)))
    except np.linalg.LinAlgError:
        raise ValueError(f"a factor's covariance must be positive definite, got {np.asarray(cov).tolist()}") from None
