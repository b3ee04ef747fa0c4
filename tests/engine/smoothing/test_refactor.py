"""The three closest factors to a Gaussian over two poses: exact where they can be, optimal and consistent elsewhere."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from engine.smoothing.composition import between_jacobians
from engine.smoothing.refactor import Refactored, divergence, refactor

PLANE = np.concatenate([-np.eye(2), np.eye(2)], axis=1)[None]


def chain_information(rng, steps: int, isotropic: bool) -> np.ndarray:
    """Information over the two ends of a chain with odometry everywhere and a prior at every pose."""
    H = np.zeros((2 * steps + 2,) * 2)
    for k in range(steps + 1):
        at = slice(2 * k, 2 * k + 2)
        H[at, at] += np.eye(2) * rng.uniform(0.05, 1.0) if isotropic else spd(rng, 0.3)
    for k in range(steps):
        at = slice(2 * k, 2 * k + 4)
        L = np.eye(2) * rng.uniform(0.5, 5.0) if isotropic else spd(rng, 4.0)
        H[at, at] += np.kron([[1, -1], [-1, 1]], L)
    ends = [0, 1, 2 * steps, 2 * steps + 1]
    return np.linalg.inv(np.linalg.inv(H)[np.ix_(ends, ends)])


def spd(rng, scale: float) -> np.ndarray:
    """Strongly anisotropic: along and across a random track."""
    a = rng.uniform(0, np.pi)
    T = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    return scale * T @ np.diag([1.0, rng.uniform(0.02, 0.3)]) @ T.T


def test_isotropic_chains_are_represented_exactly():
    """A Kron-reduced grounded Laplacian keeps its structure."""
    rng = np.random.default_rng(0)
    target = np.stack([chain_information(rng, steps, True) for steps in range(2, 22)])
    for consistent in (False, True):
        joint = refactor(target, PLANE, consistent=consistent).joint(PLANE)
        assert divergence(target, joint).max() < 1e-9


def test_anisotropic_chains_reach_the_minimum_that_a_general_optimizer_finds():
    """Over Cholesky factors of the three informations, by BFGS from several starts."""
    rng = np.random.default_rng(1)
    target = np.stack([chain_information(rng, 6, False) for _ in range(6)])
    joint = refactor(target, PLANE).joint(PLANE)
    ours = divergence(target, joint)

    def factors(theta):
        roots = np.zeros((3, 2, 2))
        roots[:, [0, 1, 1], [0, 0, 1]] = theta.reshape(3, 3)
        X = roots @ roots.transpose(0, 2, 1)
        return Refactored(X[0][None], X[1][None], X[2][None])

    for k in range(6):

        def cost(theta, k=k):
            M = factors(theta).joint(PLANE)[0]
            sign, log_det = np.linalg.slogdet(M)
            return np.trace(np.linalg.solve(target[k], M)) - log_det if sign > 0 else 1e6

        best = min(
            (minimize(cost, rng.normal(size=9), method="BFGS", options={"gtol": 1e-9}) for _ in range(6)),
            key=lambda r: r.fun,
        )
        theirs = divergence(target[k], factors(best.x).joint(PLANE)[0])
        assert ours[k] <= theirs + 1e-6
        assert abs(ours[k] - theirs) < 1e-5
    assert ours.max() > 1e-3


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), steps=st.integers(1, 12))
def test_with_the_constraint_the_approximation_is_never_more_certain(seed, steps):
    target = chain_information(np.random.default_rng(seed), steps, False)[None]
    joint = refactor(target, PLANE, consistent=True).joint(PLANE)
    assert np.linalg.eigvalsh(target - joint).min() >= -1e-9 * np.abs(target).max()
    assert np.linalg.eigvalsh(joint).min() > 0
    assert divergence(target, joint)[0] < 1.0


def test_poses_in_se2_are_refactored_by_their_own_jacobian():
    """A target made of the three factors in SE(2) is given back exactly."""
    rng = np.random.default_rng(2)
    J = np.concatenate(between_jacobians(np.array([1.0, 2.0, 0.3]), np.array([9.0, 5.0, 0.8])), axis=-1)[None]
    made = []
    for scale in (0.3, 0.2, 5.0):
        root = rng.normal(size=(1, 3, 3))
        made.append(scale * (root @ root.transpose(0, 2, 1) + np.eye(3)))
    target = Refactored(*made).joint(J)
    found = refactor(target, J)
    assert divergence(target, found.joint(J))[0] < 1e-9
