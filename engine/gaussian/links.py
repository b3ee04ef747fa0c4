"""Links: all a vehicle predicted and sensed by itself between two instants, as one Gaussian element.

A link says `x_e | x_s ~ N(A x_s + b, C)` and `p(z | x_s) ~ exp(-1/2 x_s' J x_s + x_s' eta)`. It is the
associative element of Sarkka and Garcia-Fernandez (2021), W12's delta information and W15's link in one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.gaussian.forms import Information, Moments, apply, symmetric, transpose


@dataclass(frozen=True)
class Link:
    """Transition A (..., n, n), b (..., n), C (..., n, n) and likelihood eta (..., n), J (..., n, n) of the start."""

    A: np.ndarray
    b: np.ndarray
    C: np.ndarray
    eta: np.ndarray
    J: np.ndarray

    def at(self, mean: np.ndarray) -> Link:
        """This link linearized at a start state: itself, since it is linear."""
        return self


def prediction(F: np.ndarray, Q: np.ndarray) -> Link:
    """The link of a plain prediction x_e = F x_s + w, w ~ N(0, Q)."""
    zero = np.zeros_like(F)
    return Link(F, zero[..., 0], Q, zero[..., 0], zero)


def measurement(H: np.ndarray, R: np.ndarray, z: np.ndarray) -> Link:
    """The link of a linear measurement z (..., m) = H x + v, v ~ N(0, R): no motion, only a likelihood."""
    HtRinv = transpose(np.linalg.solve(R, H))
    J = HtRinv @ H
    eta = apply(HtRinv, z)
    eye = np.broadcast_to(np.eye(J.shape[-1]), J.shape)
    return Link(eye, np.zeros_like(eta), np.zeros_like(J), eta, J)


def compose(i: Link, j: Link) -> Link:
    """The link of i followed by j (Sarkka and Garcia-Fernandez 2021, Lemma 8)."""
    M = np.linalg.inv(np.eye(i.A.shape[-1]) + i.C @ j.J)
    AM = j.A @ M
    MtA = M @ i.A
    AiMt = transpose(MtA)
    return Link(
        A=j.A @ MtA,
        b=apply(AM, i.b + apply(i.C, j.eta)) + j.b,
        C=symmetric(AM @ i.C @ transpose(j.A) + j.C),
        eta=apply(AiMt, j.eta - apply(j.J, i.b)) + i.eta,
        J=symmetric(AiMt @ j.J @ i.A + i.J),
    )


def update(joint: Moments, block: slice, eta: np.ndarray, J: np.ndarray) -> Moments:
    """Multiply a joint Gaussian by the likelihood exp(-1/2 x' J x + x' eta) of one block.

    With W = P_:s (I + J P_ss)^-1 the gain is W and the covariance falls by W J P_s:.
    """
    Ps = joint.cov[..., :, block]
    Pss = Ps[..., block, :]
    # (I + J P_ss) transposed, since W is solved for from the right.
    W = transpose(np.linalg.solve(np.eye(Pss.shape[-1]) + Pss @ J, transpose(Ps)))
    mean = joint.mean + apply(W, eta - apply(J, joint.mean[..., block]))
    return Moments(mean, symmetric(joint.cov - W @ J @ transpose(Ps)))


def move(joint: Moments, block: slice, A: np.ndarray, b: np.ndarray, C: np.ndarray) -> Moments:
    """Carry one block of a joint Gaussian through x_e = A x_s + b + w, w ~ N(0, C)."""
    mean = joint.mean.copy()
    mean[..., block] = apply(A, joint.mean[..., block]) + b
    rows = A @ joint.cov[..., block, :]
    cov = joint.cov.copy()
    cov[..., block, :] = rows
    cov[..., :, block] = transpose(rows)
    cov[..., block, block] = symmetric(rows[..., :, block] @ transpose(A) + C)
    return Moments(mean, cov)


def advance(joint: Moments, block: slice, link: Link) -> Moments:
    """Apply a link to one block of a joint Gaussian: its likelihood first, then its transition."""
    if link.J.any():
        joint = update(joint, block, link.eta, link.J)
    return move(joint, block, link.A, link.b, link.C)


def delta_information(link: Link) -> Information:
    """The joint information a link adds over (end, start): W12 eq. (1), the packet of the DEIF.

    Blocks C^-1 (end), -C^-1 A, and J + A' C^-1 A (start); C must be invertible.
    """
    n = link.A.shape[-1]
    L = np.linalg.inv(link.C)
    LA = L @ link.A
    trials = np.broadcast_shapes(LA.shape[:-2], link.b.shape[:-1], link.J.shape[:-2])
    matrix = np.empty((*trials, 2 * n, 2 * n))
    matrix[..., :n, :n] = L
    matrix[..., :n, n:] = -LA
    matrix[..., n:, :n] = -transpose(LA)
    matrix[..., n:, n:] = link.J + transpose(link.A) @ LA
    vector = np.empty((*trials, 2 * n))
    Lb = apply(L, link.b)
    vector[..., :n] = Lb
    vector[..., n:] = link.eta - apply(transpose(link.A), Lb)
    return Information(vector, symmetric(matrix))


def from_delta(delta: Information) -> Link:
    """The link whose delta information over (end, start) is given: the inverse of `delta_information`."""
    n = delta.vector.shape[-1] // 2
    end, start = slice(0, n), slice(n, 2 * n)
    C = symmetric(np.linalg.inv(delta.matrix[..., end, end]))
    A = -C @ delta.matrix[..., end, start]
    b = apply(C, delta.vector[..., end])
    cross = delta.matrix[..., start, end]
    return Link(
        A=A,
        b=b,
        C=C,
        eta=delta.vector[..., start] - apply(cross, b),
        J=symmetric(delta.matrix[..., start, start] + cross @ A),
    )
