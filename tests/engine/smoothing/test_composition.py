"""Composition and decomposition of relations: laws for all inputs, Jacobians by differentiation, drawn errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from engine.smoothing.composition import Relation, between, between_jacobians, compose, decompose, jacobians, oplus

SEED = st.integers(0, 2**32 - 1)


def relations(dimension: int, seed: int, count: int, scale: float = 1.0) -> list[Relation]:
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(count):
        root = rng.normal(size=(dimension, dimension)) * 0.1 * scale
        z = rng.normal(size=dimension) * np.array([50.0, 50.0, 2.0])[:dimension]
        out.append(Relation(z, root @ root.T + 1e-4 * np.eye(dimension)))
    return out


def derivative(f, at: np.ndarray) -> np.ndarray:
    return np.stack([approx_fprime(at, lambda x, k=k: f(x)[k], 1e-6) for k in range(at.size)])


@pytest.mark.parametrize("dimension", [2, 3])
@given(seed=SEED)
def test_decomposition_inverts_composition_exactly(dimension, seed):
    ij, jk = relations(dimension, seed, 2)
    back = decompose(ij, compose(ij, jk))
    np.testing.assert_allclose(back.z, jk.z, atol=1e-9)
    np.testing.assert_allclose(back.R, jk.R, atol=1e-9 * (1 + np.abs(compose(ij, jk).R).max()))


@pytest.mark.parametrize("dimension", [2, 3])
@given(seed=SEED)
def test_composition_is_associative_with_covariances(dimension, seed):
    a, b, c = relations(dimension, seed, 3)
    left, right = compose(compose(a, b), c), compose(a, compose(b, c))
    np.testing.assert_allclose(left.z, right.z, atol=1e-9)
    np.testing.assert_allclose(left.R, right.R, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
@given(seed=SEED)
def test_jacobians_agree_with_numerical_differentiation(dimension, seed):
    a, b = (r.z for r in relations(dimension, seed, 2))
    J1, J2 = jacobians(a, b)
    np.testing.assert_allclose(J1, derivative(lambda x: oplus(x, b), a), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(J2, derivative(lambda x: oplus(a, x), b), rtol=1e-4, atol=1e-4)
    Jf, Js = between_jacobians(a, b)
    np.testing.assert_allclose(Jf, derivative(lambda x: between(x, b), a), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(Js, derivative(lambda x: between(a, x), b), rtol=1e-4, atol=1e-4)


def test_the_composed_covariance_is_that_of_drawn_errors():
    """First order in small noise: 200 000 noisy pairs of relations, composed one by one."""
    rng = np.random.default_rng(5)
    ij, jk = relations(3, 3, 2, scale=0.05)
    n = 200_000
    drawn = oplus(
        ij.z + rng.multivariate_normal(np.zeros(3), ij.R * 1e-2, n),
        jk.z + rng.multivariate_normal(np.zeros(3), jk.R * 1e-2, n),
    )
    said = compose(Relation(ij.z, ij.R * 1e-2), Relation(jk.z, jk.R * 1e-2)).R
    np.testing.assert_allclose(np.cov(drawn.T), said, rtol=0.03, atol=0.01 * np.abs(said).max())


def test_in_the_plane_composition_is_addition():
    a, b = relations(2, 8, 2)
    whole = compose(a, b)
    np.testing.assert_array_equal(whole.z, a.z + b.z)
    np.testing.assert_allclose(whole.R, a.R + b.R)
