"""Where naive fusion is dangerous: maps over the two sensors' noise, in one dimension, and for turned ellipses in two.

Axes are normalized as in RC: r_i = R_i / (P + Q) for one step (eq. 18, Fig. 5), r_i = R_i / Q for the steady state
(Fig. 7). Dangerous: the naive estimate is actually worse than the better sensor alone (eq. 17).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.tracking import recursion, steady
from engine.tracking.covariance_intersection import covariance_intersection
from engine.tracking.model import Model
from engine.tracking.naive_fusion import naive_fusion
from engine.tracking.recursion import Rule
from engine.tracking.state_vector_fusion import state_vector_fusion

#: Newton or bisection steps that the slowest cell may take, and the relative step that counts as arrived.
MOST, STILL = 100, 1e-13


@dataclass(frozen=True)
class Figures:
    """Error variances per cell, in units of the normalizing variance: actual ones, and what the naive believes."""

    single: np.ndarray
    central: np.ndarray
    distributed: np.ndarray
    naive: np.ndarray
    naive_believed: np.ndarray

    @property
    def intersection(self) -> np.ndarray:
        """What covariance intersection of two numbers believes: it keeps the better one.

        It also has no more than that, except where both are as good: then it takes the mean.
        """
        return self.single

    @property
    def dangerous(self) -> np.ndarray:
        """Where the naive estimate is worse than the better sensor alone (RC eq. 17)."""
        return self.naive > self.single


def one_step(r1: np.ndarray, r2: np.ndarray) -> Figures:
    """After one step from a known prior, P + Q = 1 (RC section 4.1); r1, r2 broadcast."""
    r1, r2 = np.broadcast_arrays(np.asarray(r1, float), np.asarray(r2, float))
    best, S = np.minimum(r1, r2), 1 / r1 + 1 / r2
    M = np.ones_like(r1)
    lost, noise = _naive_mixing(M, r1, r2)
    return Figures(
        single=best / (1 + best),
        central=1 / (1 + S),
        distributed=_distributed(M, r1, r2)[0],
        naive=(1 - lost) ** 2 + noise,
        naive_believed=1 / (S + 2),
    )


def asymptotic(r1: np.ndarray, r2: np.ndarray) -> Figures:
    """In the steady state, Q = 1 (RC section 4.2); r1, r2 broadcast.

    All but the distributed are in closed form: single, central and what the naive believes solve a quadratic (RC eq. 5;
    for the naive 1/P = S + 2/(P + 1) with S the sum of 1/r_i), the naive's actual variance a linear equation.
    """
    r1, r2 = np.broadcast_arrays(np.asarray(r1, float), np.asarray(r2, float))
    single, naive, believed = _steady_naive(r1, r2)
    central = _steady_single(1 / (1 / r1 + 1 / r2))
    return Figures(single, central, _steady_distributed(r1, r2, central, single), naive, believed)


def _steady_single(r: np.ndarray) -> np.ndarray:
    """RC eq. (5), written without the difference of nearly equal numbers."""
    return 2 * r / (1 + np.sqrt(1 + 4 * r))


def _steady_naive(r1: np.ndarray, r2: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Steady variance of the better sensor alone, actual and believed one of naive fusion."""
    S = 1 / r1 + 1 / r2
    believed = 2 / (S + 1 + np.sqrt((S + 1) ** 2 + 4 * S))
    lost, noise = _naive_mixing(believed + 1, r1, r2)
    actual = ((1 - lost) ** 2 + noise) / (lost * (2 - lost))
    return _steady_single(np.minimum(r1, r2)), actual, believed


def _steady_distributed(r1: np.ndarray, r2: np.ndarray, central: np.ndarray, single: np.ndarray) -> np.ndarray:
    """The P for which a round of optimal distributed fusion gives P again.

    By Newton's method between the central filter, which it never beats, and the better sensor alone, which always
    beats it; a step that would leave that interval is a bisection of it instead, so every cell converges.
    """
    low, high = central.copy(), single.copy()
    P = 0.5 * (low + high)
    for _ in range(MOST):
        after, slope = _distributed(P + 1, r1, r2)
        low, high = np.where(after >= P, P, low), np.where(after <= P, P, high)
        newton = P + (after - P) / (1 - slope)
        next_P = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
        moved = np.abs(next_P - P)
        P = next_P
        if np.all(moved <= STILL * P):
            break
    return P


def _naive_mixing(M: np.ndarray, r1: np.ndarray, r2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The part of the prior's error that naive fusion removes, and the variance the sensors add (RC eq. 15)."""
    K1, K2 = M / (M + r1), M / (M + r2)
    P1, P2 = r1 * K1, r2 * K2
    weight = P1 / (P1 + P2)
    lost = (1 - weight) * K1 + weight * K2
    return lost, ((1 - weight) * K1) ** 2 * r1 + (weight * K2) ** 2 * r2


def _distributed(M: np.ndarray, r1: np.ndarray, r2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Optimal distributed fusion of one round, weight r1 / (r1 + r2) (RC eq. 8), and its derivative by M.

    With K_i = M u_i, u_i = 1 / (M + r_i), both weighted gains have the factor r = r1 r2 / (r1 + r2).
    """
    u1, u2 = 1 / (M + r1), 1 / (M + r2)
    r = r1 / (r1 + r2) * r2
    mixed, noise = u1 + u2, u1**2 / r1 + u2**2 / r2
    slope = mixed**2 - 2 * M * mixed * (u1**2 + u2**2) + 2 * M * noise - 2 * M**2 * (u1**3 / r1 + u2**3 / r2)
    return r**2 * (M * mixed**2 + M**2 * noise), r**2 * slope


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

    def dangerous(r2: np.ndarray) -> np.ndarray:
        single, naive, _ = _steady_naive(r1, r2)
        return naive > single

    low, high = r1.copy(), np.full_like(r1, largest)
    ever = dangerous(high)
    for _ in range(64):
        middle = np.sqrt(low * high)
        bad = dangerous(middle)
        low, high = np.where(bad, low, middle), np.where(bad, middle, high)
    return np.where(ever, high, np.nan)


@dataclass(frozen=True)
class Turned:
    """Sizes of actual errors (fourth roots of det of 2 x 2 covariances) per cell; the naive's belief beside them.

    NaN where a fuser has no steady state.
    """

    single: np.ndarray
    central: np.ndarray
    distributed: np.ndarray
    naive: np.ndarray
    naive_believed: np.ndarray
    intersection: np.ndarray

    @property
    def dangerous(self) -> np.ndarray:
        """Where the naive estimate is worse than the better sensor alone, or grows without bound."""
        return ~(self.naive <= self.single)


def turned(r1: np.ndarray, r2: np.ndarray, *, elongation: float, angle_rad: float, steps: int | None = None) -> Turned:
    """The same question in two dimensions: ellipses of axes ratio `elongation` (>= 1), angle_rad between them.

    r1, r2 are the variances along each sensor's long axis, normalized by the process noise (steps None: the steady
    state) or by the predicted prior (steps 1). The single sensor is the one with the smaller volume; distributed is
    state vector fusion. ValueError where the elongation is below one or steps is anything else.
    """
    if not elongation >= 1:
        raise ValueError(f"elongation: {elongation:g}; the ratio of the long axis to the short one is at least 1")
    if steps not in (None, 1):
        raise ValueError(f"steps: {steps}; give 1 for one step or None for the steady state")
    r1, r2 = np.broadcast_arrays(np.asarray(r1, float), np.asarray(r2, float))
    shape = np.diag([1.0, 1 / elongation**2])
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([[c, -s], [s, c]])
    R = (r1[..., None, None] * shape, r2[..., None, None] * (turn @ shape @ turn.T))
    eye = np.eye(2)
    process, prior = (np.zeros((2, 2)), eye) if steps == 1 else (eye, eye)
    model = Model(eye, process, (eye, eye), R, prior)

    def after(rule: Rule | None) -> tuple[np.ndarray, np.ndarray]:
        """Sizes of actual errors and of beliefs, (..., node)."""
        if steps == 1:
            nodes = recursion.history(model, rule, 1)[-1]
            settled = np.ones(r1.shape, bool)
        else:
            nodes, settled = steady.settle(model, rule)
        actual = np.stack([_size(nodes.actual_of(i), settled) for i in range(2)], axis=-1)
        return actual, np.stack([_size(nodes.believed[..., i, :, :], settled) for i in range(2)], axis=-1)

    if steps == 1:
        central = _size(recursion.central(model, prior), np.ones(r1.shape, bool))
    else:
        central = _size(*steady.settle_centrally(model))
    naive, believed = after(naive_fusion)
    return Turned(
        single=after(None)[0].min(axis=-1),
        central=central,
        distributed=after(state_vector_fusion)[0][..., 0],
        naive=naive[..., 0],
        naive_believed=believed[..., 0],
        intersection=after(covariance_intersection)[0][..., 0],
    )


def _size(cov: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fourth root of det of (..., 2, 2); NaN where not known."""
    return np.where(known, np.linalg.det(np.where(known[..., None, None], cov, np.eye(2))), np.nan) ** 0.25


def chart(kind: str, axis: np.ndarray, *, elongation: float = 1.0, angle_rad: float = 0.0) -> dict[str, Any]:
    """A map over axis x axis in JSON's own types: rows are r2, columns r1; None where there is no value.

    kind: "one_step" or "asymptotic". Sensors with round ellipses make the one-dimensional map; others the same with
    square roots of determinants for variances. boundary: the r2 >= r1 above which naive fusion is dangerous, for each
    r1 of the axis; for turned ellipses interpolated between cells, at the first crossing. Raises ValueError, naming
    the argument, for an unknown kind, an axis that does not rise from above zero, or an impossible ellipse.
    """
    if kind not in ("one_step", "asymptotic"):
        raise ValueError(f"kind: {kind!r}; give 'one_step' or 'asymptotic'")
    axis = np.asarray(axis, float)
    if axis.ndim != 1 or axis.size < 2 or not (axis[0] > 0 and np.all(np.diff(axis) > 0) and np.isfinite(axis[-1])):
        raise ValueError("axis: give at least two finite values above zero, rising")
    one = kind == "one_step"
    if elongation == 1:
        figures = (one_step if one else asymptotic)(axis[None, :], axis[:, None])
        boundary, power = (one_step_boundary if one else asymptotic_boundary)(axis), 1
    else:
        steps = 1 if one else None
        figures = turned(axis[None, :], axis[:, None], elongation=elongation, angle_rad=angle_rad, steps=steps)
        boundary, power = _crossing(axis, figures.naive / figures.single), 2
    ratios = {
        "naive_to_single": figures.naive / figures.single,
        "central_to_distributed": figures.central / figures.distributed,
        "naive_believed_to_actual": figures.naive_believed / figures.naive,
        "intersection_to_single": figures.intersection / figures.single,
    }
    return {
        "kind": kind,
        "axis": axis.tolist(),
        "dangerous": figures.dangerous.astype(int).tolist(),
        "boundary": _plain(boundary),
        "ratios": {name: _plain(np.round(ratio**power, 6)) for name, ratio in ratios.items()},
    }


def _crossing(axis: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """Where each column of ratio, from the diagonal on, first exceeds one: interpolated in logarithms, else NaN."""
    worse = ~(ratio <= 1)
    worse[np.tri(axis.size, k=-1, dtype=bool).T] = False
    edge = np.full(axis.size, np.nan)
    for column in np.flatnonzero(worse.any(axis=0)):
        row = int(np.argmax(worse[:, column]))
        below, above = np.log(ratio[max(row - 1, 0), column]), np.log(ratio[row, column])
        if row == column or not np.isfinite(above):
            edge[column] = axis[row]
        else:
            part = -below / (above - below)
            edge[column] = axis[row - 1] * (axis[row] / axis[row - 1]) ** part
    return edge


def _plain(values: np.ndarray) -> list[Any]:
    """Nested lists with None for what is not finite."""
    told = values.astype(object)
    told[~np.isfinite(values)] = None
    return told.tolist()
