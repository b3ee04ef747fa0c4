"""A graph that grows as packets arrive and is solved again after each, starting from what was known before.

All factors are kept summed up as linearized; one that later packets refine is taken out and put back. Since unknowns
come in order of time, what a packet changes is near the end: the Cholesky factor is taken up again at the first unknown
that changed, the latest ranges and pose factors are linearized anew, and everything is, once in a while (the idea of
incremental smoothing, Kaess et al. 2008, in a band).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import get_lapack_funcs, solve_triangular

from engine.smoothing.band import Factor, NotPositiveDefinite, System
from engine.smoothing.graph import Betweens, Ranges

dpbtrf, dpbtrs, dtbtrs, dpotrf = get_lapack_funcs(("pbtrf", "pbtrs", "tbtrs", "potrf"), dtype=np.float64)

#: Gauss-Newton steps after each packet, and the step (m) that ends them sooner.
STEPS, SETTLED_M = 3, 1e-2
#: How many of the latest unknowns are solved for each time, and after how many packets all of them are.
TAIL, WHOLE_EVERY = 96, 64
#: Borders are numbered from here while the number of banded unknowns still grows.
BORDER = 1 << 40


class Rows:
    """A growing array of rows."""

    def __init__(self, *shape: int, dtype: type = float) -> None:
        self.data, self.count = np.zeros((16, *shape), dtype), 0

    def add(self, row: np.ndarray | float) -> None:
        if self.count == len(self.data):
            self.data = np.concatenate([self.data, np.zeros_like(self.data)])
        self.data[self.count] = row
        self.count += 1

    @property
    def all(self) -> np.ndarray:
        return self.data[: self.count]


class Growing:
    """One trial's graph: unknowns appended in order of time, a border of m unknowns known from the start.

    scale, where set, is the border unknown by which all ranges are too long. changed is the first unknown whose part of
    the Cholesky factor [L; U] and of its forward solution y is out of date. first holds, for every unknown, the first
    one it is tied to: a single pose tied to one long ago widens the band there, and nowhere else (Cholesky's factor
    fills no row further than it reaches).
    """

    def __init__(self, border: np.ndarray, scale: int | None = None) -> None:
        m = self.m = len(border)
        self.n, self.width = 0, 1
        self.reference, self.x, self.first = np.zeros(64), np.zeros(64), np.arange(64)
        self.border_reference, self.border_x = border.copy(), border.copy()
        self.constant = System.zero(64, m, self.width)
        self.kept: dict[tuple, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self.scale = scale
        k = 4 if scale is None else 5
        self.range_idx, self.range_z, self.range_sigma = Rows(k, dtype=int), Rows(), Rows()
        self.range_matrix, self.range_vector = Rows(k, k), Rows(k)
        self.pose_idx, self.pose_z, self.pose_information = Rows(6, dtype=int), Rows(3), Rows(3, 3)
        self.pose_matrix, self.pose_vector = Rows(6, 6), Rows(6)
        self.L, self.y, self.U = np.zeros((self.width + 1, 64)), np.zeros(64), np.zeros((m, 64))
        self.changed = 0
        self.solves = 0
        self.tail: tuple[int, Factor] | None = None

    def append(self, start: np.ndarray) -> np.ndarray:
        """A new variable with a first guess (k,): its unknowns."""
        k = len(start)
        while self.n + k > len(self.x):
            self._enlarge()
        idx = np.arange(self.n, self.n + k)
        self.reference[idx] = self.x[idx] = start
        self.n += k
        return idx

    def _enlarge(self) -> None:
        more = len(self.x)
        self.reference, self.x = (np.concatenate([a, np.zeros(more)]) for a in (self.reference, self.x))
        self.first = np.concatenate([self.first, np.arange(more, 2 * more)])
        c = self.constant
        c.band = np.pad(c.band, ((0, 0), (0, more)))
        c.border = np.pad(c.border, ((0, 0), (0, more)))
        c.rhs = np.concatenate([c.rhs[:more], np.zeros(more), c.rhs[more:]])
        self.L, self.U = (np.pad(a, ((0, 0), (0, more))) for a in (self.L, self.U))
        self.y = np.concatenate([self.y, np.zeros(more)])

    def values(self, idx: np.ndarray) -> np.ndarray:
        """The present estimate of unknowns."""
        return np.where(idx < BORDER, self.x[np.minimum(idx, self.n - 1 if self.n else 0)], self._of_border(idx))

    def _of_border(self, idx: np.ndarray) -> np.ndarray:
        return self.border_x[np.maximum(idx - BORDER, 0)] if self.m else np.zeros(idx.shape)

    def displacement(self, idx: np.ndarray, mean: np.ndarray) -> np.ndarray:
        """How far a mean of unknowns lies from their reference."""
        inside = idx < BORDER
        reference = np.where(inside, self.reference[np.where(inside, idx, 0)], 0.0)
        if self.m:
            reference = np.where(inside, reference, self.border_reference[np.where(inside, 0, idx - BORDER)])
        return mean - reference

    def set(self, key: tuple, idx: np.ndarray, matrix: np.ndarray, vector: np.ndarray) -> None:
        """Put in a factor exp(-1/2 d' matrix d + d' vector) of displacements, instead of the one with that key."""
        old = self.kept.get(key)
        if old is not None:
            self._add(old[0], -old[1], -old[2])
        self.kept[key] = (idx, matrix, vector)
        self._add(idx, matrix, vector)

    def _add(self, idx: np.ndarray, matrix: np.ndarray, vector: np.ndarray) -> None:
        self._add_all(idx[None], matrix[None], vector[None])

    def _add_all(self, idx: np.ndarray, matrix: np.ndarray, vector: np.ndarray) -> None:
        """Add blocks (F, k, k) and (F, k) at unknowns idx (F, k)."""
        c = self.constant
        inside = idx < BORDER
        if inside.any():
            first, last = np.where(inside, idx, BORDER).min(axis=1), np.where(inside, idx, -1).max(axis=1)
            self._widen(int((last - first).max()))
            self.changed = min(self.changed, int(first.min()))
            np.minimum.at(self.first, np.where(inside, idx, first[:, None]), first[:, None])
        cap = c.band.shape[1]
        p, q = np.tril_indices(idx.shape[1])
        at = np.where(inside, idx, idx - BORDER + cap)
        row, column = np.maximum(at[:, p], at[:, q]).ravel(), np.minimum(at[:, p], at[:, q]).ravel()
        value = matrix[:, p, q].ravel()
        if self.m:
            band = row < cap
            corner = column >= cap
            edge = ~band & ~corner
            np.add.at(c.border, (row[edge] - cap, column[edge]), value[edge])
            np.add.at(c.corner, (row[corner] - cap, column[corner] - cap), value[corner])
            row, column, value = row[band], column[band], value[band]
        np.add.at(c.band, (row - column, column), value)
        np.add.at(c.rhs, at.ravel(), vector.ravel())

    def _widen(self, width: int) -> None:
        if width > self.width:
            more = ((0, width - self.width), (0, 0))
            self.constant.band, self.L = np.pad(self.constant.band, more), np.pad(self.L, more)
            self.width = width

    def add_between(self, first: np.ndarray, second: np.ndarray, z: np.ndarray, information: np.ndarray) -> None:
        """An SE(2) relation between two poses."""
        self.pose_idx.add(np.concatenate([first, second]))
        self._touch(np.concatenate([first, second]))
        self.pose_z.add(z)
        self.pose_information.add(information)
        self.pose_matrix.add(np.zeros((6, 6)))
        self.pose_vector.add(np.zeros(6))

    def add_range(self, receiver: np.ndarray, sender: np.ndarray, value: float, sigma: float) -> None:
        """A range between two positions."""
        scale = [] if self.scale is None else [self.scale]
        self.range_idx.add(np.concatenate([receiver, sender, scale]).astype(int))
        self._touch(np.concatenate([receiver, sender]))
        self.range_z.add(value)
        self.range_sigma.add(sigma)
        k = len(self.range_idx.data[0])
        self.range_matrix.add(np.zeros((k, k)))
        self.range_vector.add(np.zeros(k))

    def _touch(self, idx: np.ndarray) -> None:
        """Take the factor up again no later than at these unknowns, so that what is new there is linearized."""
        self.changed = min(self.changed, int(idx.min()))

    def solve(self, steps: int = STEPS) -> None:
        """Gauss-Newton steps from the present estimate; NotPositiveDefinite where something is undetermined."""
        self.solves += 1
        whole = self.solves % WHOLE_EVERY == 0
        p = max(0, min(self.changed, self.n - TAIL))
        for step in range(steps):
            since = 0 if whole and step == 0 else p
            self._linearize(since)
            if self._step(min(since, self.changed)) < SETTLED_M:
                break

    def settle(self, steps: int = STEPS) -> None:
        """Gauss-Newton steps with everything linearized anew, for the smoothed estimate of all there is."""
        for _ in range(steps):
            self._linearize(0)
            if self._step(0) < SETTLED_M:
                break

    def _linearize(self, p: int) -> None:
        """Linearize anew, at the present estimate, the factors all of whose unknowns are not before p."""
        z = np.concatenate([self.x[: self.n], self.border_x])
        if self.range_z.count:
            mine = self._latest(self.range_idx, p)
            idx = self._dense(self.range_idx.all[mine])
            at = None if self.scale is None else self.scale - BORDER + self.n
            ranges = Ranges(idx[:, :2], idx[:, 2:4], self.range_z.all[mine], self.range_sigma.all[mine], at)
            new = ranges.linearize(z, np.ones(len(mine)))
            self._replace(self.range_idx, self.range_matrix, self.range_vector, mine, idx, z, *new)
        if self.pose_z.count:
            mine = self._latest(self.pose_idx, p)
            idx = self.pose_idx.all[mine]
            betweens = Betweens(idx[:, :3], idx[:, 3:], self.pose_z.all[mine], self.pose_information.all[mine])
            new = betweens.linearize(z)
            self._replace(self.pose_idx, self.pose_matrix, self.pose_vector, mine, idx, z, *new)

    def _latest(self, rows: Rows, p: int) -> np.ndarray:
        """Numbers of the factors without unknowns before p, and of those not linearized yet."""
        if p == 0:
            return np.arange(rows.count)
        recent = rows.all[max(0, rows.count - TAIL) :]
        return np.flatnonzero((recent >= p).all(axis=1)) + max(0, rows.count - TAIL)

    def _dense(self, idx: np.ndarray) -> np.ndarray:
        return np.where(idx < BORDER, idx, idx - BORDER + self.n)

    def _replace(
        self,
        rows: Rows,
        matrices: Rows,
        vectors: Rows,
        mine: np.ndarray,
        idx: np.ndarray,
        z: np.ndarray,
        matrix: np.ndarray,
        vector: np.ndarray,
    ) -> None:
        """Put new linearizations in the place of the old; right-hand sides count from the reference."""
        if not mine.size:
            return
        reference = np.concatenate([self.reference[: self.n], self.border_reference])
        vector = vector + (matrix @ (z - reference)[idx][..., None])[..., 0]
        self._add_all(rows.all[mine], matrix - matrices.all[mine], vector - vectors.all[mine])
        matrices.all[mine], vectors.all[mine] = matrix, vector

    def _step(self, p: int) -> float:
        """Factorize from unknown p on, and solve for the unknowns from there; the largest move."""
        n, m, w, c = self.n, self.m, self.width, self.constant
        cap = c.band.shape[1]
        first = self.first[p:n]
        w = min(w, int((np.arange(p, n) - np.maximum(first, p)).max(initial=0)))
        band, rhs, border = c.band[: w + 1, p:n].copy(order="F"), c.rhs[p:n].copy(), c.border[:, p:n].copy()
        start = min(int(first.min(initial=p)), p)
        if start < p:
            # The columns just before p reach into the tail: D is their part of the factor.
            row, column = p + np.arange(np.flatnonzero(first < p)[-1] + 1), np.arange(start, p)
            offset = row[:, None] - column
            D = np.where(first[: len(row), None] <= column, self.L[np.minimum(offset, self.width), column], 0.0)
            low = np.tril(D @ D.T)
            i, j = np.tril_indices(len(row))
            band[i - j, j] -= low[i, j]
            rhs[: len(row)] -= D @ self.y[column]
            border[:, : len(row)] -= self.U[:, column] @ D.T
        L, info = dpbtrf(band, lower=1)
        if info:
            raise NotPositiveDefinite(f"unknown {p + info} is not determined")
        y, _ = dtbtrs(L, rhs, uplo="L")
        y = y.ravel()
        back = y
        W, root, outer = np.zeros((n - p, 0)), np.zeros((0, 0)), np.zeros(0)
        if m:
            U = dtbtrs(L, border.T, uplo="L")[0].T
            S, info = dpotrf(c.corner - np.tril(self.U[:, :p] @ self.U[:, :p].T + U @ U.T), lower=1)
            if info:
                raise NotPositiveDefinite(f"unknown {info} of the border is not determined")
            root = np.tril(S)
            left = c.rhs[cap:] - self.U[:, :p] @ self.y[:p] - U @ y
            outer = solve_triangular(root, solve_triangular(root, left, lower=True), lower=True, trans=1)
            back = y - U.T @ outer
            W = dtbtrs(L, U.T, uplo="L", trans="T")[0]
            self.U[:, p:n] = U
        inner = dtbtrs(L, back, uplo="L", trans="T")[0].ravel()
        self.L[: w + 1, p:n], self.y[p:n] = L, y
        self.changed = n
        new = self.reference[p:n] + inner
        moved = np.abs(new - self.x[p:n]).max(initial=0.0)
        self.x[p:n] = new
        if m:
            self.border_x = self.border_reference + outer
        self.tail = (p, Factor(L, W, root))
        return float(moved)

    def covariance(self, idx: np.ndarray) -> np.ndarray:
        """The covariance of a few of the latest unknowns or the border (k, k), as of the last solve."""
        assert self.tail is not None
        p, factor = self.tail
        size = factor.L.shape[1]
        at = np.where(idx < BORDER, idx - p, idx - BORDER + size)
        if (at < 0).any():
            self._step(0)
            return self.covariance(idx)
        inside = at < size
        unit = np.zeros((size, len(at)))
        unit[at[inside], np.flatnonzero(inside)] = 1.0
        cov = np.where(inside[:, None], dpbtrs(factor.L, unit, lower=1)[0][np.where(inside, at, 0)], 0.0)
        if self.m:
            rows = np.where(inside[:, None], -factor.W[np.where(inside, at, 0)], 0.0)
            rows[~inside, at[~inside] - size] = 1.0
            half = solve_triangular(factor.S, rows.T, lower=True)
            cov += half.T @ half
        return cov
