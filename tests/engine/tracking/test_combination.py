"""The combination behind state vector and distributed fusion, against maximum likelihood and a general minimizer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from engine.tracking import recursion
from engine.tracking.combination import best_weights, combined
from engine.tracking.distributed_fusion import distributed_fusion
from engine.tracking.model import make
from engine.tracking.state_vector_fusion import state_vector_fusion


def joint_covariance(rng: np.random.Generator, N: int, n: int) -> np.ndarray:
    root = rng.normal(size=(N * n, N * n)) * 10 ** rng.uniform(-0.5, 0.5, (N * n, 1))
    return (root @ root.T + 1e-3 * np.eye(N * n)).reshape(N, n, N, n)


def own(joint: np.ndarray) -> np.ndarray:
    """Each estimate's own covariance, (N, n, n)."""
    return np.einsum("aiak->aik", joint)


@settings(deadline=None, max_examples=200)
@given(st.integers(0, 2**32 - 1), st.integers(2, 4), st.integers(1, 3))
def test_state_vector_fusion_is_maximum_likelihood_of_all_estimates_at_once(seed, N, n):
    """RC eq. (12)-(13) for N estimates: P_f^-1 is the sum of the blocks of the joint covariance's inverse."""
    joint = joint_covariance(np.random.default_rng(seed), N, n)
    information = np.linalg.inv(joint.reshape(N * n, N * n)).reshape(N, n, N, n)
    P = np.linalg.inv(np.einsum("aibk->ik", information))
    fused = state_vector_fusion(own(joint), joint)
    scale = np.abs(P).max()
    np.testing.assert_allclose(fused.believed, P, rtol=1e-6, atol=1e-8 * scale)
    told = np.einsum("ij,ajbk->bik", P, information)
    np.testing.assert_allclose(combined(told, joint), fused.believed, rtol=1e-6, atol=1e-8 * scale)
    np.testing.assert_allclose(fused.weights.sum(axis=0), np.eye(n), atol=1e-9)


def test_estimates_that_are_the_same_fuse_to_themselves():
    """A singular joint covariance: three nodes that share one estimate."""
    P = np.array([[4.0, 1.0], [1.0, 2.0]])
    joint = np.broadcast_to(P[None, :, None, :], (3, 2, 3, 2))
    np.testing.assert_allclose(combined(best_weights(joint), joint), P, rtol=1e-12)


def test_two_of_three_estimates_may_be_the_same():
    """A copy of the first adds nothing: the fusion of the other two, by the information form."""
    A, B = np.array([[4.0, 1.0], [1.0, 2.0]]), np.array([[1.0, 0.2], [0.2, 9.0]])
    joint = np.zeros((3, 2, 3, 2))
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        joint[i, :, j, :] = A
    joint[2, :, 2, :] = B
    fused = state_vector_fusion(own(joint), joint)
    np.testing.assert_allclose(fused.believed, np.linalg.inv(np.linalg.inv(A) + np.linalg.inv(B)), rtol=1e-9)


@pytest.mark.parametrize("seed", range(25))
def test_distributed_fusion_finds_the_smallest_volume(seed):
    """Against a general minimizer from many starts; the volume has several valleys in more than one dimension."""
    rng = np.random.default_rng(seed)
    N, n = int(rng.integers(2, 5)), int(rng.integers(2, 4))
    joint = joint_covariance(rng, N, n)

    def log_volume(w: np.ndarray) -> float:
        w = np.r_[1 - w.sum(), w]
        return float(np.linalg.slogdet(np.einsum("a,aibk,b->ik", w, joint, w))[1])

    least = min(minimize(log_volume, rng.normal(size=N - 1), method="BFGS").fun for _ in range(10))
    found = np.linalg.slogdet(distributed_fusion(own(joint), joint).believed)[1]
    assert found <= least + 1e-8


def test_of_two_valleys_distributed_fusion_takes_the_deeper():
    """Crossed ellipses: mixing them evenly is the worst of all; each alone is near a valley."""
    P1, P2 = np.diag([1.0, 100.0]), np.diag([90.0, 1.0])
    for first, second in ((P1, P2), (P2, P1)):
        joint = np.zeros((2, 2, 2, 2))
        joint[0, :, 0, :], joint[1, :, 1, :] = first, second
        w = np.linspace(-0.5, 1.5, 200_001)[:, None, None]
        least = np.linalg.det((1 - w) ** 2 * first + w**2 * second).min()
        found = np.linalg.det(distributed_fusion(own(joint), joint).believed)
        assert found == pytest.approx(least, rel=1e-8)
        assert found < np.linalg.det((first + second) / 4) / 3


def test_three_sensors_one_dimension_distributed_is_state_vector_fusion_and_optimal():
    """P = Q = R1 = 10, R2 = 15, R3 = 20: 4.875 by maximum likelihood; folding two by two would reach 4.8783 only."""
    model = make(10.0, [10.0, 15.0, 20.0], 10.0)
    seen, _ = recursion.observe(model, recursion.predict(model, recursion.start(model)))
    for rule in (distributed_fusion, state_vector_fusion):
        assert rule(seen.believed, seen.actual).believed[0, 0] == pytest.approx(4.875, rel=1e-12)
