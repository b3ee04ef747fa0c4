"""Symmetric positive definite systems that are banded but for a border, as trajectories in order of time are.

The matrix is [[A, B'], [B, D]]: A (n, n) banded, B (m, n) and D (m, m) a border of the few unknowns that everything
else sees (fixed nodes, the sound speed). Solved by banded Cholesky and a Schur complement; the part of the inverse
inside the band comes by recursion backwards through the factor, never by inverting anything large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs, solve_triangular

from engine.gaussian.forms import transpose

dpbtrf, dpbtrs, dpotrf = get_lapack_funcs(("pbtrf", "pbtrs", "potrf"), dtype=np.float64)
(dsbmv,) = get_blas_funcs(("sbmv",), dtype=np.float64)

#: Narrower bands are still worked on in blocks of this size, against call overhead.
SMALLEST_BLOCK = 12


class NotPositiveDefinite(ValueError):
    """The system does not determine all its unknowns."""


@dataclass(frozen=True)
class Pattern:
    """Where dense blocks over unknowns idx (F, m) go in band and border storage.

    n unknowns are banded with half-bandwidth `width`, m come after them in the border. Building it once per group
    of blocks makes assembling a matter of one weighted count.
    """

    n: int
    m: int
    width: int
    band: np.ndarray
    in_band: np.ndarray
    border: np.ndarray
    in_border: np.ndarray
    corner: np.ndarray
    in_corner: np.ndarray
    flat: np.ndarray

    @classmethod
    def of(cls, idx: np.ndarray, n: int, m: int, width: int) -> Pattern:
        p, q = np.tril_indices(idx.shape[1])
        i, j = idx[:, p], idx[:, q]
        row, column = np.maximum(i, j).ravel(), np.minimum(i, j).ravel()
        if m == 0:
            everything = np.arange(row.size)
            none = np.empty(0, int)
            return cls(n, m, width, (row - column) * n + column, everything, none, none, none, none, idx)
        in_band = np.flatnonzero(row < n)
        in_border = np.flatnonzero((row >= n) & (column < n))
        in_corner = np.flatnonzero(column >= n)
        return cls(
            n,
            m,
            width,
            (row[in_band] - column[in_band]) * n + column[in_band],
            in_band,
            (row[in_border] - n) * n + column[in_border],
            in_border,
            (row[in_corner] - n) * m + column[in_corner] - n,
            in_corner,
            idx,
        )


@dataclass
class System:
    """Storage of one system: band (width + 1, n) with band[r - c, c], border (m, n), corner (m, m) lower, rhs."""

    band: np.ndarray
    border: np.ndarray
    corner: np.ndarray
    rhs: np.ndarray

    @classmethod
    def zero(cls, n: int, m: int, width: int) -> System:
        return cls(np.zeros((width + 1, n)), np.zeros((m, n)), np.zeros((m, m)), np.zeros(n + m))

    def add(self, pattern: Pattern, matrix: np.ndarray, vector: np.ndarray) -> None:
        """Add blocks (F, k, k) and right-hand sides (F, k) at the unknowns of a pattern."""
        k = matrix.shape[-1]
        p, q = np.tril_indices(k)
        value = matrix[:, p, q].ravel()
        n, m, height = pattern.n, pattern.m, pattern.width + 1
        inner = value if m == 0 else value[pattern.in_band]
        self.band += np.bincount(pattern.band, inner, height * n).reshape(height, n)
        if m:
            self.border += np.bincount(pattern.border, value[pattern.in_border], m * n).reshape(m, n)
            self.corner += np.bincount(pattern.corner, value[pattern.in_corner], m * m).reshape(m, m)
        self.rhs += np.bincount(pattern.flat.ravel(), vector.ravel(), n + m)

    def copy(self) -> System:
        return System(self.band.copy(), self.border.copy(), self.corner.copy(), self.rhs.copy())

    def times(self, x: np.ndarray) -> np.ndarray:
        """The matrix times a vector (n + m,)."""
        n, m = self.band.shape[1], len(self.corner)
        inner = dsbmv(self.band.shape[0] - 1, 1.0, self.band, x[:n], lower=1) if n else np.zeros(0)
        if not m:
            return inner
        corner = np.tril(self.corner) + np.tril(self.corner, -1).T
        return np.concatenate([inner + x[n:] @ self.border, self.border @ x[:n] + corner @ x[n:]])

    def damped(self, amount: float) -> System:
        """The system with its diagonal raised by a fraction of itself (Levenberg and Marquardt)."""
        damped = self.copy()
        damped.band[0] *= 1 + amount
        damped.corner[np.diag_indices(len(damped.corner))] *= 1 + amount
        return damped


@dataclass(frozen=True)
class Factor:
    """Cholesky factor of a system: L (width + 1, n) of the band, W = A^-1 B' (n, m), S the lower factor of the border's
    Schur complement (m, m)."""

    L: np.ndarray
    W: np.ndarray
    S: np.ndarray


def half_bandwidth(groups: list[np.ndarray], n: int) -> int:
    """The half-bandwidth that blocks over unknowns idx (F, m) need; those from n on are in the border."""
    width = 0
    for idx in groups:
        if idx.size:
            inside = idx < n
            last = np.where(inside, idx, -1).max(axis=1)
            first = np.where(inside, idx, n).min(axis=1)
            width = max(width, int((last - first).max()))
    return width


def factorize(system: System) -> Factor:
    """Banded Cholesky with border; NotPositiveDefinite where the system leaves something undetermined."""
    L, info = dpbtrf(system.band, lower=1)
    if info != 0:
        raise NotPositiveDefinite(f"unknown {info} is not determined")
    m = len(system.corner)
    if m == 0:
        return Factor(L, np.zeros((L.shape[1], 0)), np.zeros((0, 0)))
    W, _ = dpbtrs(L, system.border.T, lower=1)
    S, info = dpotrf(system.corner - np.tril(system.border @ W), lower=1)
    if info != 0:
        raise NotPositiveDefinite(f"unknown {info} of the border is not determined")
    return Factor(L, W, np.tril(S))


def solve(factor: Factor, system: System) -> np.ndarray:
    """The solution (n + m,) of the factorized system for its right-hand side."""
    n = factor.L.shape[1]
    inner, _ = dpbtrs(factor.L, system.rhs[:n], lower=1)
    if not factor.S.size:
        return inner
    rest = system.rhs[n:] - system.border @ inner
    outer = solve_triangular(factor.S, solve_triangular(factor.S, rest, lower=True), lower=True, trans=1)
    return np.concatenate([inner - factor.W @ outer, outer])


class BandInverse:
    """The entries of the inverse that lie in the band, and all of the border's.

    With the factor in blocks at least as wide as the band, L_k on the diagonal and M_k below it,
    Sigma_k = L_k^-T (I + M_k' Sigma_(k+1) M_k) L_k^-1 and Sigma_(k+1,k) = -Sigma_(k+1) M_k L_k^-1 (Takahashi, Fagan
    and Chen 1973); down to `first`, the earliest unknown asked for.
    """

    def __init__(self, factor: Factor, first: int = 0) -> None:
        self.factor = factor
        n = factor.L.shape[1]
        b = self.size = max(factor.L.shape[0] - 1, SMALLEST_BLOCK)
        count = self.count = -(-n // b)
        self.start = min(max(first, 0) // b, count - 1)
        used = slice(self.start * b, n)
        K = count - self.start
        padded = np.zeros((2 * b, K * b))
        padded[: factor.L.shape[0], : n - used.start] = factor.L[:, used]
        padded[0, n - used.start :] = 1.0
        blocks = padded.reshape(2 * b, K, b)
        r, c = np.meshgrid(np.arange(b), np.arange(b), indexing="ij")
        low = np.where(r >= c, r - c, 2 * b - 1)
        diagonal = blocks[low, :, c].transpose(2, 0, 1)
        below = np.where(r <= c, b + r - c, 2 * b - 1)
        under = blocks[below, :, c].transpose(2, 0, 1)[:-1]
        inverse = np.linalg.inv(diagonal)
        G = under @ inverse[:-1]
        own = transpose(inverse) @ inverse
        self.diagonal = np.empty_like(own)
        now = self.diagonal[-1] = own[-1]
        Gt = transpose(G)
        for k in range(K - 2, -1, -1):
            now = Gt[k] @ now @ G[k] + own[k]
            self.diagonal[k] = now
        self.below = -(self.diagonal[1:] @ G)
        m = factor.S.shape[0]
        half = solve_triangular(factor.S, np.eye(m), lower=True) if m else np.zeros((0, 0))
        self.corner = half.T @ half

    def blocks(self, idx: np.ndarray) -> np.ndarray:
        """Covariances (F, k, k) of groups of unknowns idx (F, k), each within the band or in the border."""
        n, m = self.factor.W.shape
        i, j = idx[:, :, None], idx[:, None, :]
        row, column = np.broadcast_arrays(np.maximum(i, j), np.minimum(i, j))
        inside = row < n
        r, c = np.where(inside, row, 0), np.where(inside, column, 0)
        R, C = r // self.size - self.start, c // self.size - self.start
        if (C[inside] < 0).any() or (R - C)[inside].max(initial=0) > 1:
            raise ValueError("a covariance outside the band of the computed inverse")
        a, b = r % self.size, c % self.size
        same = self.diagonal[np.maximum(R, 0), a, b]
        if len(self.below):
            same = np.where(R == C, same, self.below[np.clip(C, 0, len(self.below) - 1), a, b])
        if m == 0:
            return same
        W = self._border_rows(idx)
        return np.where(inside, same, 0.0) + np.einsum("fia,ab,fjb->fij", W, self.corner, W)

    def _border_rows(self, idx: np.ndarray) -> np.ndarray:
        """How unknowns idx (F, k) hang on the border: rows of -W, or of the identity for the border's own."""
        n, m = self.factor.W.shape
        inside = idx < n
        rows = -self.factor.W[np.where(inside, idx, 0)]
        return np.where(inside[..., None], rows, np.eye(m)[np.where(inside, 0, idx - n)])
