"""Marginals and conditionals of the two forms agree with each other and with the textbook."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.gaussian.forms import (
    Moments,
    augment,
    condition,
    drop,
    keep,
    marginal_information,
    to_information,
    to_moments,
)


def gaussian(seed: int, n: int) -> Moments:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    return Moments(rng.normal(size=n), a @ a.T + 0.1 * np.eye(n))


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 8), st.data())
def test_marginalizing_in_either_form_is_the_same(seed, n, data):
    stop = data.draw(st.integers(1, n - 1))
    joint = gaussian(seed, n)
    block = slice(0, stop)
    by_moments = keep(joint, block)
    by_information = to_moments(marginal_information(to_information(joint), block))
    np.testing.assert_allclose(by_information.mean, by_moments.mean, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(by_information.cov, by_moments.cov, rtol=1e-7, atol=1e-8)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 8), st.data())
def test_conditioning_keeps_the_block_of_the_information_matrix(seed, n, data):
    """The conditional's information matrix is the joint's own block (the dual of marginalizing)."""
    stop = data.draw(st.integers(1, n - 1))
    joint = gaussian(seed, n)
    value = np.arange(float(stop))
    rest = condition(joint, slice(0, stop), value)
    info = to_information(joint)
    np.testing.assert_allclose(np.linalg.inv(rest.cov), info.matrix[stop:, stop:], rtol=1e-6, atol=1e-7)
    vector = info.vector[stop:] - info.matrix[stop:, :stop] @ value
    np.testing.assert_allclose(rest.mean, np.linalg.solve(info.matrix[stop:, stop:], vector), rtol=1e-6, atol=1e-7)


def test_a_delayed_state_is_a_perfect_copy_until_dropped():
    joint = gaussian(3, 5)
    more = augment(joint, slice(1, 3))
    difference = np.zeros((2, 7))
    difference[:, 1:3], difference[:, 5:7] = np.eye(2), -np.eye(2)
    np.testing.assert_allclose(difference @ more.cov @ difference.T, 0, atol=1e-12)
    back = drop(more, slice(5, 7))
    np.testing.assert_array_equal(back.cov, joint.cov)
