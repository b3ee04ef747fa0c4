"""Several sensors, one moving target: the linear model of RC eq. (1), extended to any F, H_i and dimension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Model:
    """x_k = F x_k-1 + w, w ~ N(0, Q); node i sees z_i = H_i x + v_i, v_i ~ N(0, R_i), all independent.

    F, Q (..., n, n); H a tuple of (m_i, n), R of (..., m_i, m_i); prior (..., n, n) is everyone's covariance at the
    start, around a common estimate. Leading axes are independent cases (a map's cells).
    """

    F: np.ndarray
    Q: np.ndarray
    H: tuple[np.ndarray, ...]
    R: tuple[np.ndarray, ...]
    prior: np.ndarray

    @property
    def nodes(self) -> int:
        return len(self.R)

    @property
    def size(self) -> int:
        return self.prior.shape[-1]


def make(
    process: float | np.ndarray,
    sensors: Sequence[float | np.ndarray],
    prior: float | np.ndarray,
    *,
    transition: np.ndarray | None = None,
    observations: Sequence[np.ndarray] | None = None,
) -> Model:
    """A model from variances or covariances; numbers mean one dimension.

    Raises ValueError, naming the argument, where a covariance is not symmetric, not positive definite (process and
    prior may be singular), not finite, or of another dimension than the rest; and with fewer than two sensors.
    """
    if len(sensors) < 2:
        raise ValueError(f"sensors: {len(sensors)} given; fusion needs at least 2")
    P = covariance("prior", prior, definite=False)
    n = P.shape[-1]
    Q = covariance("process", process, definite=False)
    if Q.shape[-1] != n:
        raise ValueError(f"process: {Q.shape[-1]} x {Q.shape[-1]}, but the prior is {n} x {n}")
    F = np.eye(n) if transition is None else np.asarray(transition, float)
    if F.shape[-2:] != (n, n):
        raise ValueError(f"transition: shape {F.shape}, but the prior is {n} x {n}")
    R = tuple(covariance(f"sensors[{i}]", r) for i, r in enumerate(sensors))
    H = tuple(np.atleast_2d(np.asarray(h, float)) for h in observations) if observations else (np.eye(n),) * len(R)
    if len(H) != len(R):
        raise ValueError(f"observations: {len(H)} given for {len(R)} sensors")
    for i, (h, r) in enumerate(zip(H, R)):
        if h.shape[-1] != n or h.shape[-2] != r.shape[-1]:
            raise ValueError(
                f"sensors[{i}]: noise {r.shape[-1]} x {r.shape[-1]} and observation {h.shape[-2]} x {h.shape[-1]} "
                f"do not fit a state of {n}"
            )
    return Model(F, Q, H, R, P)


def covariance(name: str, value: float | np.ndarray, *, definite: bool = True) -> np.ndarray:
    """A covariance (..., k, k) from a variance or a matrix; ValueError naming the argument where it is none."""
    matrix = np.asarray(value, float)
    if matrix.ndim == 0:
        matrix = matrix.reshape(1, 1)
    if matrix.ndim < 2 or matrix.shape[-1] != matrix.shape[-2]:
        raise ValueError(f"{name}: a covariance is square, this has shape {matrix.shape}")
    if not np.isfinite(matrix).all():
        raise ValueError(f"{name}: has entries that are not finite")
    scale = max(np.abs(matrix).max(), 1e-300)
    if np.abs(matrix - np.swapaxes(matrix, -1, -2)).max() > 1e-9 * scale:
        raise ValueError(f"{name}: is not symmetric")
    least = np.linalg.eigvalsh(matrix).min()
    if definite and least <= 0:
        raise ValueError(f"{name}: is not positive definite (smallest eigenvalue {least:.3g})")
    if not definite and least < -1e-12 * scale:
        raise ValueError(f"{name}: is negative (smallest eigenvalue {least:.3g})")
    return matrix
