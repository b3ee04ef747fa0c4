"""A vehicle's chain of steps as unknowns and factors of a graph (W15 eq. 1).

A vehicle with velocities is a chain of x, y, vx, vy under linear links; one with odometry a chain of SE(2) poses; a
fixed node a single position, kept in the border. Everything between two breakpoints is one factor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import apply, symmetric, transpose
from engine.gaussian.links import Link
from engine.navigation.chains import Chain, OdometryStep, OdometrySteps, Step
from engine.smoothing.composition import oplus
from engine.smoothing.graph import Betweens, Gaussians, priors

#: Added to the variances of every step (m^2, m^2/s^2), so that one much shorter than the motion model's noise does
#: not spoil the conditioning: 1000 steps of it are worth one centimetre.
STEP_FLOOR = 1e-7
#: The same for headings (rad^2).
TURN_FLOOR = 1e-10


@dataclass(frozen=True)
class Links:
    """Linear steps of all trials, stacked: A, C, J (K, w, n, n), b, eta (K, w, n); w is trials or 1."""

    A: np.ndarray
    b: np.ndarray
    C: np.ndarray
    eta: np.ndarray
    J: np.ndarray

    def of(self, trial: int) -> Link:
        """One trial's steps, leading axis K."""
        parts = (self.A, self.b, self.C, self.eta, self.J)
        return Link(*(p[:, min(trial, p.shape[1] - 1)] for p in parts))


def stacked(steps: Sequence[Step], trials: int) -> Links:
    """The links of linear steps."""
    links = [step.at(np.empty(0)) for step in steps]
    return Links(*(np.stack([_led(getattr(s, name), trials) for s in links]) for name in ("A", "b", "C", "eta", "J")))


def _led(array: np.ndarray, trials: int) -> np.ndarray:
    return np.broadcast_to(array, (trials, *array.shape[1:])) if array.shape[0] not in (1, trials) else array


def pieces(step: Step) -> tuple[OdometryStep, ...]:
    """The pieces of an odometry step: one, or several where fixes divide it."""
    if isinstance(step, OdometrySteps):
        return step.steps
    assert isinstance(step, OdometryStep)
    return (step,)


def link_factors(link: Link, first: np.ndarray, second: np.ndarray, reference: np.ndarray) -> Gaussians:
    """Linear links (K, ...) between unknowns first (K, n) and second (K, n)."""
    n = link.A.shape[-1]
    L = symmetric(np.linalg.inv(link.C + STEP_FLOOR * np.eye(n)))
    LA = L @ link.A
    matrix = np.empty((len(L), 2 * n, 2 * n))
    matrix[:, :n, :n] = symmetric(link.J + transpose(link.A) @ LA)
    matrix[:, :n, n:] = -transpose(LA)
    matrix[:, n:, :n] = -LA
    matrix[:, n:, n:] = L
    push = apply(L, apply(link.A, reference[first]) + link.b - reference[second])
    vector = np.concatenate(
        [link.eta - apply(link.J, reference[first]) - apply(transpose(link.A), push), push], axis=-1
    )
    return Gaussians(np.concatenate([first, second], axis=1), matrix, vector)


def row(array: np.ndarray, trial: int) -> np.ndarray:
    """One trial of an array whose leading axis is trials or 1."""
    return array[min(trial, array.shape[0] - 1)]


@dataclass(frozen=True)
class PoseChain:
    """An odometry vehicle's poses in one trial: increments between consecutive ones, fixes at some.

    at (K + 1,) says which pose belongs to each breakpoint.
    """

    poses: np.ndarray
    at: np.ndarray
    z: np.ndarray
    information: np.ndarray
    fixed: np.ndarray
    fixes: np.ndarray
    fix_cov: np.ndarray


def pose_chain(chain: Chain, trial: int) -> PoseChain:
    """The chain's odometry in one trial, from its believed start."""
    start = row(chain.initial.mean, trial)
    poses, at, z, R, fixed, fixes, fix_cov = [start], [0], [], [], [], [], []
    for step in chain.steps:
        for piece in pieces(step):
            z.append(row(piece.increment, trial))
            R.append(row(piece.cov, trial))
            poses.append(oplus(poses[-1], z[-1]))
            if piece.fix is not None and piece.fix_cov is not None:
                fixed.append(len(poses) - 1)
                fixes.append(row(piece.fix, trial))
                fix_cov.append(piece.fix_cov)
        at.append(len(poses) - 1)
    return PoseChain(
        np.array(poses),
        np.array(at),
        np.array(z),
        pose_information(np.array(R)),
        np.array(fixed, int),
        np.array(fixes).reshape(-1, 2),
        np.array(fix_cov).reshape(-1, 2, 2),
    )


def pose_information(R: np.ndarray) -> np.ndarray:
    """Information (..., 3, 3) of pose increments with covariance R, which may be none where nothing moved."""
    return symmetric(np.linalg.inv(R + np.diag([STEP_FLOOR, STEP_FLOOR, TURN_FLOOR])))


def pose_factors(
    chain: PoseChain, idx: np.ndarray, reference: np.ndarray
) -> tuple[tuple[Gaussians, ...], tuple[Betweens, ...]]:
    """The factors of a pose chain whose poses are the unknowns idx (N, 3)."""
    gaussians: tuple[Gaussians, ...] = ()
    if len(chain.fixed):
        gaussians = (priors(idx[chain.fixed, :2], chain.fixes, chain.fix_cov, reference),)
    betweens = (Betweens(idx[:-1], idx[1:], chain.z, chain.information),) if len(chain.z) else ()
    return gaussians, betweens
