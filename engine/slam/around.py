"""For each kernel a mixture of Gaussians over a beacon's place, from which it can be drawn anew and weighed."""

from __future__ import annotations

import numpy as np

from engine.slam.factors.factor import Factor
from engine.slam.propagation import Points

#: Candidates per kernel when a beacon is drawn anew, and the Newton steps that refine them.
CANDIDATES, REFINEMENTS = 16, 3


class Around:
    """For each kernel a mixture of Gaussians over a beacon's place, about refined draws of one factor.

    Its widths come from the factors' information there, bounded by the draws' own spacing; sources and noise are
    the same whenever it is made with the same seed, so that it can be evaluated for the way back.
    """

    def __init__(
        self,
        beacon: str,
        source: Factor,
        factors: list[Factor],
        points: Points,
        kernels: int,
        rng: np.random.Generator,
    ) -> None:
        M = CANDIDATES
        strata = (np.arange(M) + rng.random((kernels, 1))) / M
        others = {v: points.values[v][:, None] for f in (source, *factors) for v in f.variables if v != beacon}

        def values(f: Factor, at: np.ndarray) -> list[np.ndarray]:
            size = at.shape[:-1]
            return [
                at if v == beacon else np.broadcast_to(others[v], (*size, others[v].shape[-1])) for v in f.variables
            ]

        where = source.variables.index(beacon)
        blank = np.zeros((kernels, M, points.values[beacon].shape[-1]))
        at = source.sample(where, values(source, blank), strata, rng)
        apart = np.sqrt(np.square(np.roll(at, 1, axis=1) - at).sum(-1)).mean(-1)[:, None, None, None]
        slack = np.eye(at.shape[-1]) / np.square(np.maximum(apart, 1e-6))
        log = np.zeros(at.shape[:-1])
        P = np.broadcast_to(slack, (*at.shape, at.shape[-1]))
        for step in range(REFINEMENTS + 1):
            Lam, eta = np.zeros((*at.shape, at.shape[-1])), np.zeros(at.shape)
            log = np.zeros(at.shape[:-1])
            for f in factors:
                e, J = f.linearize(*values(f, at))
                Jb = J[f.variables.index(beacon)]
                Lam = Lam + np.einsum("...ki,...kj->...ij", Jb, Jb)
                eta = eta - np.einsum("...ki,...k->...i", Jb, e)
                log = log - 0.5 * np.square(e).sum(-1)
            P = Lam + slack
            if step < REFINEMENTS:
                at = at + np.linalg.solve(P, eta[..., None])[..., 0]
        self._mean, self._P = at, P
        self._log_det = 0.5 * np.linalg.slogdet(P)[1]
        log = log - self._log_det
        log = log - log.max(-1, keepdims=True)
        # A little of every candidate: modes the poses of today speak against must stay within reach.
        self._weight = 0.9 * np.exp(log) / np.exp(log).sum(-1, keepdims=True) + 0.1 / M

    def draw(self, rng: np.random.Generator) -> np.ndarray:
        N = len(self._mean)
        chosen = (np.cumsum(self._weight, axis=1) < rng.random((N, 1))).sum(1).clip(0, self._weight.shape[1] - 1)
        mean, P = self._mean[np.arange(N), chosen], self._P[np.arange(N), chosen]
        half = np.linalg.inv(np.linalg.cholesky(P))
        return mean + np.einsum("nij,ni->nj", half, rng.standard_normal(mean.shape))

    def log_density(self, at: np.ndarray) -> np.ndarray:
        d = at[:, None] - self._mean
        z = -0.5 * np.einsum("nmi,nmij,nmj->nm", d, self._P, d) + self._log_det + np.log(self._weight)
        top = z.max(-1, keepdims=True)
        return top[:, 0] + np.log(np.exp(z - top).sum(-1))
