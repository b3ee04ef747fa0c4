"""Refactoring: the odometry and priors over two poses that come closest to a given Gaussian (W15 section IV-B).

The chain between two launches induces a Gaussian with information Lambda over both poses, which priors on the two and
one odometry factor between them can in general only approximate. The factors are those that minimize
tr(M Sigma) - ln det M over their informations X_f >= 0, M = sum J_f' X_f J_f: eq. (16), where the paper prints R for
R^-1 in the determinant. It is convex; solved by Newton steps on a log barrier, in all trials at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import symmetric, transpose

#: The barrier's weights, from far inside the cone of positive matrices to its edge.
_BARRIER = tuple(10.0**-k for k in range(0, 12))
_NEWTON_STEPS = 8
_EDGE = 1e-12
#: A matrix whose condition is worse than the inverse of this is on the edge of the cone.
_SINGULAR = 1e-14


@dataclass(frozen=True)
class Refactored:
    """Informations (..., d, d) of the prior on the first pose, the prior on the second, the odometry between."""

    first: np.ndarray
    second: np.ndarray
    odometry: np.ndarray

    def joint(self, J: np.ndarray) -> np.ndarray:
        """The information (..., 2d, 2d) they make together, with odometry Jacobian J (..., d, 2d)."""
        M = transpose(J) @ self.odometry @ J
        d = J.shape[-2]
        M[..., :d, :d] += self.first
        M[..., d:, d:] += self.second
        return M


def refactor(Lambda: np.ndarray, J: np.ndarray, *, consistent: bool = False) -> Refactored:
    """The closest three factors to information Lambda (N, 2d, 2d), which must be positive definite.

    J (N or 1, d, 2d) is the Jacobian of the odometry by both poses. With `consistent` the approximation is never more
    certain than the target: M <= Lambda.
    """
    N, n = Lambda.shape[:2]
    d = n // 2
    J = np.broadcast_to(J, (N, d, n))
    # In coordinates whitened by the target the problem is as well conditioned as it can be.
    G = np.linalg.cholesky(Lambda)
    back = transpose(np.linalg.inv(G))
    eye = np.eye(n)
    maps = [np.broadcast_to(eye[:d], (N, d, n)) @ back, np.broadcast_to(eye[d:], (N, d, n)) @ back, J @ back]
    basis = _symmetric_basis(d)
    P = len(basis)
    E = np.concatenate([transpose(m)[:, None] @ basis @ m[:, None] for m in maps], axis=1)
    # Start strictly inside: everything so small that M <= 3/4.
    size = np.stack([np.linalg.norm(m, ord=2, axis=(-2, -1)) ** 2 for m in maps], axis=1)
    theta = np.repeat(0.25 / size, P, axis=1) * np.tile([float(i == j) for i, j in _upper(d)], 3)
    trace = np.trace(E, axis1=-2, axis2=-1)

    def parts(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        M = np.einsum("np,npij->nij", theta, E)
        X = np.einsum("nfp,pij->nfij", theta.reshape(N, 3, P), basis)
        return symmetric(M), X

    def value(theta: np.ndarray, t: float) -> np.ndarray:
        M, X = parts(theta)
        f = (trace * theta).sum(-1) - _log_det(M) - t * _log_det(X).sum(-1)
        return f - t * _log_det(eye - M) if consistent else f

    for t in _BARRIER:
        for _ in range(_NEWTON_STEPS):
            M, X = parts(theta)
            ME = np.linalg.solve(M[:, None], E)
            XB = np.linalg.inv(X)[:, :, None] @ basis
            gradient = trace - np.trace(ME, axis1=-2, axis2=-1)
            gradient = gradient - t * np.trace(XB, axis1=-2, axis2=-1).reshape(N, 3 * P)
            H = np.einsum("npij,nqji->npq", ME, ME)
            own = np.einsum("nfpij,nfqji->nfpq", XB, XB)
            for f in range(3):
                H[:, f * P : (f + 1) * P, f * P : (f + 1) * P] += t * own[:, f]
            if consistent:
                DE = np.linalg.solve((eye - M)[:, None], E)
                gradient = gradient + t * np.trace(DE, axis1=-2, axis2=-1)
                H = H + t * np.einsum("npij,nqji->npq", DE, DE)
            scale = np.sqrt(np.diagonal(H, axis1=-2, axis2=-1))
            H = H / (scale[:, :, None] * scale[:, None, :]) + _EDGE * np.eye(3 * P)
            step = -np.linalg.solve(H, (gradient / scale)[..., None])[..., 0] / scale
            decrement = -(gradient * step).sum(-1)
            now = value(theta, t)
            length = np.ones(N)
            for _ in range(40):
                after = value(theta + length[:, None] * step, t)
                worse = ~(after <= now - 0.1 * length * decrement + 1e-12)
                if not worse.any():
                    break
                length[worse] *= 0.5
            else:
                length[worse] = 0.0
            theta = theta + length[:, None] * step
            if decrement.max() < 1e-9:
                break
    _, X = parts(theta)
    return Refactored(X[:, 0], X[:, 1], X[:, 2])


def divergence(p: np.ndarray, q: np.ndarray, difference: np.ndarray | None = None) -> np.ndarray:
    """Kullback-Leibler divergence of N^-1(q) from N^-1(p), informations (..., n, n), means apart by (..., n)."""
    ratio = np.linalg.solve(p, q)
    spread = np.trace(ratio, axis1=-2, axis2=-1) - p.shape[-1] - np.linalg.slogdet(ratio)[1]
    if difference is not None:
        spread = spread + (difference * (q @ difference[..., None])[..., 0]).sum(-1)
    return 0.5 * spread


def _upper(d: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(d) for j in range(i, d)]


def _symmetric_basis(d: int) -> np.ndarray:
    basis = np.zeros((d * (d + 1) // 2, d, d))
    for k, (i, j) in enumerate(_upper(d)):
        basis[k, i, j] = basis[k, j, i] = 1.0
    return basis


def _log_det(matrix: np.ndarray) -> np.ndarray:
    """Logarithm of the determinant, minus infinity where the matrix is not positive definite."""
    values = np.linalg.eigvalsh(matrix)
    inside = values[..., 0] > _SINGULAR * np.abs(values[..., -1])
    return np.where(inside, np.log(np.where(values > 0, values, 1.0)).sum(-1), -np.inf)
