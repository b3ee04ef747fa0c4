"""Composition and decomposition of relative poses with their covariances, in R^2 and SE(2) (W15 section IV-A).

A pose in R^2 is (x, y), one in SE(2) is (x, y, heading); which of the two is told by the length of the last axis.
Leading axes are independent relations. In R^2 the operators are plus and minus; in SE(2) they are the compounding
of Smith, Self and Cheeseman (1990). Headings are not wrapped: a relation may turn by more than once round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import apply, symmetric, transpose


@dataclass(frozen=True)
class Relation:
    """A measured relative pose z (..., d) with the covariance R (..., d, d) of its additive noise, d = 2 or 3."""

    z: np.ndarray
    R: np.ndarray


def oplus(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """first (+) second (..., d): the pose reached by `second` from `first` (W15 eq. 7)."""
    if first.shape[-1] == 2:
        return first + second
    moved = apply(turning(first[..., 2]), second[..., :2])
    return np.concatenate([first[..., :2] + moved, first[..., 2:] + second[..., 2:]], axis=-1)


def ominus(pose: np.ndarray) -> np.ndarray:
    """The inverse relation (-) pose (..., d)."""
    if pose.shape[-1] == 2:
        return -pose
    back = apply(transpose(turning(pose[..., 2])), -pose[..., :2])
    return np.concatenate([back, -pose[..., 2:]], axis=-1)


def between(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(-) first (+) second (..., d): where `second` lies as seen from `first` (W15 eq. 5)."""
    return oplus(ominus(first), second)


def jacobians(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """J1, J2 (..., d, d) of first (+) second by its first and by its second argument (W15 eq. 8)."""
    d = first.shape[-1]
    lead = np.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    J1, J2 = (np.broadcast_to(np.eye(d), (*lead, d, d)).copy() for _ in range(2))
    if d == 3:
        T = turning(first[..., 2])
        moved = apply(T, second[..., :2])
        J1[..., 0, 2], J1[..., 1, 2] = -moved[..., 1], moved[..., 0]
        J2[..., :2, :2] = T
    return J1, J2


def between_jacobians(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Jacobians (..., d, d) of (-) first (+) second by `first` and by `second`."""
    d = first.shape[-1]
    lead = np.broadcast_shapes(first.shape[:-1], second.shape[:-1])
    Jf, Js = (np.broadcast_to(sign * np.eye(d), (*lead, d, d)).copy() for sign in (-1.0, 1.0))
    if d == 3:
        back = transpose(turning(first[..., 2]))
        seen = apply(back, second[..., :2] - first[..., :2])
        Jf[..., :2, :2] = -back
        Jf[..., 0, 2], Jf[..., 1, 2] = seen[..., 1], -seen[..., 0]
        Js[..., :2, :2] = back
    return Jf, Js


def compose(ij: Relation, jk: Relation) -> Relation:
    """The relation i to k from i to j and j to k, to first order in the noise (W15 eq. 6-9)."""
    J1, J2 = jacobians(ij.z, jk.z)
    return Relation(oplus(ij.z, jk.z), symmetric(J1 @ ij.R @ transpose(J1) + J2 @ jk.R @ transpose(J2)))


def decompose(ij: Relation, ik: Relation) -> Relation:
    """The relation j to k from i to j and i to k: the exact inverse of `compose` (W15 eq. 10-11)."""
    z = between(ij.z, ik.z)
    J1, J2 = jacobians(ij.z, z)
    inner = ik.R - J1 @ ij.R @ transpose(J1)
    back = np.linalg.inv(J2)
    return Relation(z, symmetric(back @ inner @ transpose(back)))


def turning(heading: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 2, 2) by headings (...,)."""
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
