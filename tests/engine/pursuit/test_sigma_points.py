"""Sigma points against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.gaussian.forms import Moments
from engine.pursuit.sigma_points import gather, gauss_hermite, spread, unscented

RULES = [gauss_hermite, unscented, lambda n: unscented(n, 2.0)]


def gaussian(rng: np.random.Generator, n: int) -> Moments:
    root = rng.normal(size=(n, n)) * 10 ** rng.uniform(-2, 2)
    return Moments(rng.normal(size=n) * 10, root @ root.T + 1e-6 * np.eye(n))


@pytest.mark.parametrize("rule", RULES)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 4))
def test_points_give_back_the_mean_and_covariance_they_stand_for(rule, seed, n):
    belief = gaussian(np.random.default_rng(seed), n)
    back = gather(spread(belief, rule(n)), rule(n).weights)
    scale = np.abs(belief.cov).max()
    np.testing.assert_allclose(back.mean, belief.mean, atol=1e-9 * (np.sqrt(scale) + np.abs(belief.mean).max()))
    np.testing.assert_allclose(back.cov, belief.cov, atol=1e-9 * scale)


@pytest.mark.parametrize("rule", RULES)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 4))
def test_the_mean_of_a_quadratic_is_exact(rule, seed, n):
    """E x'Ax + b'x + c = tr(A P) + m'Am + b'm + c, whatever the rule."""
    rng = np.random.default_rng(seed)
    belief, A, b, c = gaussian(rng, n), rng.normal(size=(n, n)), rng.normal(size=n), rng.normal()
    x = spread(belief, rule(n))
    value = np.einsum("mi,ij,mj->m", x, A, x) + x @ b + c
    m = belief.mean
    exact = np.trace(A @ belief.cov) + m @ A @ m + b @ m + c
    size = np.abs(value).max() + abs(c)
    assert value @ rule(n).weights == pytest.approx(exact, abs=1e-9 * size)


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 4))
def test_the_hermite_rule_has_the_variance_of_a_quadratic_too(seed, n):
    """Var x'Ax = 2 tr(APAP) + 4 m'APAm for symmetric A: fourth moments, which the unscented points do not have."""
    rng = np.random.default_rng(seed)
    belief, A = gaussian(rng, n), rng.normal(size=(n, n))
    A = A + A.T
    rule = gauss_hermite(n)
    x = spread(belief, rule)
    value = np.einsum("mi,ij,mj->m", x, A, x)
    variance = (value - value @ rule.weights) ** 2 @ rule.weights
    AP, m = A @ belief.cov, belief.mean
    exact = 2 * np.trace(AP @ AP) + 4 * m @ AP @ A @ m
    assert variance == pytest.approx(exact, rel=1e-7)


def test_the_weights_are_those_of_the_literature_and_sum_to_one():
    """Julier and Uhlmann: 1 / 2(N+k) outside; Hermite: 1/6, 2/3, 1/6 at 0 and +-sqrt 3, on a grid of 3^N."""
    rule = unscented(3, 1.0)
    np.testing.assert_allclose(rule.weights, [0.25] + 6 * [0.125])
    line = gauss_hermite(1)
    np.testing.assert_allclose(line.nodes[:, 0], [-np.sqrt(3), 0, np.sqrt(3)])
    np.testing.assert_allclose(line.weights, [1 / 6, 2 / 3, 1 / 6])
    np.testing.assert_allclose(line.weights, np.array([0.2954, 1.1816, 0.2954]) / np.sqrt(np.pi), atol=1e-4)
    np.testing.assert_allclose(line.nodes[:, 0], np.sqrt(2) * np.array([-1.2247, 0, 1.2247]), atol=1e-4)
    for n in (1, 2, 3, 4):
        assert len(gauss_hermite(n).weights) == 3**n
        assert gauss_hermite(n).weights.sum() == pytest.approx(1.0) == unscented(n).weights.sum()


def test_a_singular_covariance_has_points_as_well():
    belief = Moments(np.zeros(2), np.array([[1.0, 1.0], [1.0, 1.0]]))
    back = gather(spread(belief, gauss_hermite(2)), gauss_hermite(2).weights)
    np.testing.assert_allclose(back.cov, belief.cov, atol=1e-12)


def test_an_impossible_kappa_is_refused():
    with pytest.raises(ValueError, match="kappa"):
        unscented(3, -3.0)
