"""Where naive fusion is dangerous: maps over the two sensors' noise, in one dimension, and for turned ellipses in two.

Axes are normalized as in RC: r_i = R_i / (P + Q) for one step (eq. 18, Fig. 5), r_i = R_i / Q for the steady state
(Fig. 7). Dangerous: the naive estimate is actually worse than the better sensor alone (eq. 17).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.tracking import recursion
from engine.tracking.model import Model
from engine.tracking.naive_fusion import naive_fusion

#: Iterations of a fixed point that the slowest cell may take, and the relative change that counts as standing still.
MOST, STILL = 4000, 1e-14


@dataclass(frozen=True)
class Figures:
    """Error variances per cell, in units of the normalizing variance: actual ones, and what the naive believes."""

    single: np.ndarray
    central: np.ndarray
    distributed: np.ndarray
    naive: np.ndarray
    naive_believed: np.ndarray

    @property
    def dangerous(self) -> np.ndarray:
        """Where the naive estimate is worse than the better sensor alone (RC eq. 17)."""
        return self.naive > self.single


def one_step(r1: np.ndarray, r2: np.ndarray) -> Figures:
    """After one step from a known prior, P + Q = 1 (RC section 4.1); r1, r2 broadcast."""
    r1, r2 = np.broadcast_arrays(np.asarray(r1, float), np.asarray(r2, float))
    best, S = np.minimum(r1, r2), 1 / r1 + 1 / r2
    alpha, noise = _naive_mixing(np.ones_like(r1), r1, r2)
    return Figures(
        single=1 / (1 + 1 / best),
        central=1 / (1 + S),
        distributed=_distributed(np.ones_like(r1), r1, r2),
        naive=alpha**2 + noise,
        naive_believed=1 / (S + 2),
    )


def asymptotic(r1: np.ndarray, r2: np.ndarray) -> Figures:
    """In the steady state, Q = 1 (RC section 4.2); r1, r2 broadcast.

    Single, central and naive beliefs solve a quadratic (RC eq. 5; for the naive, 1/P = S + 2/(P + 1) with S the sum of
    1/r_i), the naive's actual variance a linear equation; the optimal distributed one is iterated, a contraction.
    """
    r1, r2 = np.broadcast_arrays(np.asarray(r1, float), np.asarray(r2, float))
    best, S = np.minimum(r1, r2), 1 / r1 + 1 / r2
    single = (-1 + np.sqrt(1 + 4 * best)) / 2
    central = (-1 + np.sqrt(1 + 4 / S)) / 2
    believed = (-(S + 1) + np.sqrt((S + 1) ** 2 + 4 * S)) / (2 * S)
    alpha, noise = _naive_mixing(believed + 1, r1, r2)
    naive = (alpha**2 + noise) / (1 - alpha**2)
    distributed = central.copy()
    for _ in range(MOST):
        after = _distributed(distributed + 1, r1, r2)
        moved = np.abs(after - distributed).max() / after.max()
        distributed = after
        if moved < STILL:
            break
    return Figures(single, central, distributed, naive, believed)


def _naive_mixing(M: np.ndarray, r1: np.ndarray, r2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The part of the prior's error that stays in the naive estimate, and the variance the sensors add (RC eq. 15)."""
    K1, K2 = M / (M + r1), M / (M + r2)
    P1, P2 = r1 * K1, r2 * K2
    weight = P1 / (P1 + P2)
    alpha = (1 - weight) * (1 - K1) + weight * (1 - K2)
    return alpha, ((1 - weight) * K1) ** 2 * r1 + (weight * K2) ** 2 * r2


def _distributed(M: np.ndarray, r1: np.ndarray, r2: np.ndarray) -> np.ndarray:
    """Optimal distributed fusion of one round, weight r1 / (r1 + r2) (RC eq. 8)."""
    K1, K2 = M / (M + r1), M / (M + r2)
    weight = r1 / (r1 + r2)
    alpha = (1 - weight) * (1 - K1) + weight * (1 - K2)
    return alpha**2 * M + ((1 - weight) * K1) ** 2 * r1 + (weight * K2) ** 2 * r2


def one_step_boundary(r1: np.ndarray) -> np.ndarray:
    """The r2 >= r1 above which one naive step is dangerous: r2^2 = r1 + r2 + 3 r1 r2 (RC eq. 18)."""
    r1 = np.asarray(r1, float)
    b = 1 + 3 * r1
    return (b + np.sqrt(b**2 + 4 * r1)) / 2


def asymptotic_boundary(r1: np.ndarray, largest: float = 1e6) -> np.ndarray:
    """The r2 >= r1 above which naive fusion is dangerous in the steady state, by bisection.

    It is r1 itself where even equal sensors are too poor, and NaN where it would lie beyond `largest`.
    """
    r1 = np.asarray(r1, float)
    low, high = r1.copy(), np.full_like(r1, largest)
    ever = asymptotic(r1, high).dangerous
    for _ in range(200):
        middle = np.sqrt(low * high)
        bad = asymptotic(r1, middle).dangerous
        low, high = np.where(bad, low, middle), np.where(bad, middle, high)
    return np.where(ever, high, np.nan)


@dataclass(frozen=True)
class Turned:
    """Areas (fourth roots of det of 2 x 2 covariances) per cell for sensors with turned error ellipses."""

    single: np.ndarray
    naive: np.ndarray

    @property
    def dangerous(self) -> np.ndarray:
        return self.naive > self.single


def turned(r1: np.ndarray, r2: np.ndarray, *, elongation: float, angle_rad: float, steps: int | None = None) -> Turned:
    """The same question in two dimensions: ellipses of axes ratio `elongation` (>= 1), angle_rad between them.

    r1, r2 are the variances along each sensor's long axis, normalized by the process noise (steps None: the steady
    state) or by the predicted prior (steps 1). The single sensor is the one with the smaller volume.
    """
    if elongation < 1:
        raise ValueError(f"elongation: {elongation:g}; the ratio of the long axis to the short one is at least 1")
    r1, r2 = np.broadcast_arrays(np.asarray(r1, float), np.asarray(r2, float))
    shape = np.diag([1.0, 1 / elongation**2])
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[c, -s], [s, c]])
    R = (r1[..., None, None] * shape, r2[..., None, None] * (turn @ shape @ turn.T))
    eye = np.eye(2)
    process, prior = (np.zeros((2, 2)), eye) if steps == 1 else (eye, eye)
    model = Model(eye, process, (eye, eye), R, prior)

    def after(rule: recursion.Rule | None) -> recursion.Nodes:
        if steps == 1:
            return recursion.history(model, rule, 1)[-1]
        return recursion.settle(model, rule, tolerance=1e-9, most=400)[0]

    alone = after(None)
    volume = np.stack([np.linalg.det(alone.actual_of(i)) for i in range(2)]).min(axis=0)
    naive = np.linalg.det(after(naive_fusion).actual_of(0))
    return Turned(volume**0.25, naive**0.25)
