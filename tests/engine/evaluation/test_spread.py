"""Percentiles over trials and innovations over time."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy.stats import chi2

from engine.evaluation.spread import errors, percentiles, surprise
from engine.tracks import Belief, Innovations

SHARES = (0.05, 0.5, 0.95)


@given(arrays(float, array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.floats(-1e6, 1e6)))
def test_percentiles_are_numpys(value: np.ndarray):
    expected = np.percentile(value, [5, 50, 95], axis=0)
    np.testing.assert_allclose(percentiles(value, SHARES), expected, rtol=1e-9, atol=1e-6)


def test_what_is_not_finite_does_not_count():
    rng = np.random.default_rng(1)
    value = rng.normal(size=(8, 5))
    holed = value.copy()
    holed[2, 1], holed[5, 1], holed[:, 3] = np.nan, np.inf, np.nan
    found = percentiles(holed, SHARES)
    np.testing.assert_allclose(found[:, 1], np.percentile(np.delete(value[:, 1], [2, 5]), [5, 50, 95]))
    np.testing.assert_allclose(found[:, 4], np.percentile(value[:, 4], [5, 50, 95]))
    assert np.isnan(found[:, 3]).all()


def test_errors_are_distances_and_unknown_without_a_reference():
    belief = Belief(np.array([[[3.0, 4.0], [1.0, 1.0]]]), np.broadcast_to(np.eye(2), (1, 2, 2, 2)))
    truth = np.array([[[0.0, 0.0], [np.nan, np.nan]]])
    np.testing.assert_array_equal(errors(truth, belief), [[5.0, np.nan]])
    assert np.isnan(errors(None, belief)).all()


def test_white_innovations_stay_within_their_bounds():
    rng = np.random.default_rng(2)
    time_s = np.linspace(0.0, 100.0, 400)
    variance = rng.uniform(0.5, 4.0, size=(20, 400))
    value = rng.normal(size=(20, 400)) * np.sqrt(variance)
    found = surprise(Innovations(time_s, value, variance, np.ones((20, 400), bool)), 0.0, 100.0, 50)
    assert len(found.time_s) == 50
    np.testing.assert_allclose(found.time_s, np.arange(1, 100, 2))
    np.testing.assert_allclose(found.low, chi2.ppf(0.025, 160) / 160)
    within = (found.low < found.value) & (found.value < found.high)
    assert within.mean() > 0.85, "95 % are expected"


def test_refused_and_unheard_ranges_do_not_count():
    nan = np.nan
    seen = Innovations(
        np.array([1.0, 2.0, 11.0, 21.0]),
        np.array([[2.0, 9.0, nan, nan], [nan, 0.0, 3.0, nan]]),
        np.ones((2, 4)),
        np.array([[True, False, False, False], [False, True, True, False]]),
    )
    found = surprise(seen, 0.0, 30.0, 3)
    np.testing.assert_allclose(found.time_s, [5.0, 15.0])
    np.testing.assert_allclose(found.value, [(4.0 + 0.0) / 2, 9.0])
    np.testing.assert_allclose(found.refused, [1 / 3, 0.0])
