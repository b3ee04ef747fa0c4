"""NEES, sigma and the verdict, against SciPy's distributions, plain linear algebra and drawn errors."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from engine.evaluation.consistency import judge, nees, nees_interval, sigma
from engine.tracks import Belief

TRIALS, TIMES = 60, 300
EXACT = np.zeros((1, 1, 2))


def covariances(rng: np.random.Generator, *shape: int) -> np.ndarray:
    a = rng.normal(size=(*shape, 2, 2))
    return a @ np.swapaxes(a, -1, -2) + 0.1 * np.eye(2)


def honest(seed: int, trials: int = TRIALS, times: int = TIMES) -> tuple[np.ndarray, Belief]:
    """A truth and a belief whose errors are drawn from the covariances it states."""
    rng = np.random.default_rng(seed)
    truth = rng.normal(scale=500.0, size=(1, times, 2))
    cov = covariances(rng, trials, times)
    error = np.linalg.cholesky(cov) @ rng.normal(size=(trials, times, 2, 1))
    return truth, Belief(truth + error[..., 0], cov)


def one(mean: list[float], cov: list[list[float]]) -> Belief:
    return Belief(np.array([[mean]], float), np.array([[cov]], float))


def test_nees_is_the_quadratic_form_of_the_error():
    truth, belief = honest(1, trials=4, times=5)
    error = belief.mean - truth
    expected = np.einsum("mti,mtij,mtj->mt", error, np.linalg.inv(belief.cov), error)
    np.testing.assert_allclose(nees(truth, belief), expected, rtol=1e-10)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-np.pi, np.pi))
def test_nees_and_sigma_do_not_depend_on_the_axes(seed, angle):
    truth, belief = honest(seed, trials=2, times=3)
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    turned = Belief(belief.mean @ R.T, R @ belief.cov @ R.T)
    np.testing.assert_allclose(nees(truth @ R.T, turned), nees(truth, belief), rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(sigma(turned), sigma(belief), rtol=1e-9)


@given(st.floats(1e-6, 1e6))
def test_sigma_of_a_circular_belief_is_its_standard_deviation(sigma_m):
    belief = one([0, 0], (sigma_m**2 * np.eye(2)).tolist())
    np.testing.assert_allclose(sigma(belief), [[sigma_m]], rtol=1e-12)


def test_sigma_of_an_ellipse_is_the_geometric_mean_of_its_half_axes():
    np.testing.assert_allclose(sigma(one([0, 0], [[16.0, 0.0], [0.0, 1.0]])), [[2.0]])


def test_a_long_thin_ellipse_keeps_its_nees():
    """Half-axes of 10 km and 1 cm on the diagonal: one standard deviation along each makes 2."""
    along, across = np.array([1.0, 1.0]) / np.sqrt(2), np.array([1.0, -1.0]) / np.sqrt(2)
    cov = 1e8 * np.outer(along, along) + 1e-4 * np.outer(across, across)
    value = nees(EXACT, one((1e4 * along + 1e-2 * across).tolist(), cov.tolist()))
    np.testing.assert_allclose(value, [[2.0]], rtol=1e-3)


@pytest.mark.parametrize(
    "cov",
    [
        [[0.0, 0.0], [0.0, 0.0]],
        [[1.0, 1.0], [1.0, 1.0]],
        [[1.0, 2.0], [2.0, 1.0]],
        [[-1.0, 0.0], [0.0, -1.0]],
        [[np.nan, 0.0], [0.0, 1.0]],
    ],
)
def test_a_covariance_that_is_not_positive_definite_is_infinitely_overconfident(cov):
    value = nees(EXACT, one([1.0, 0.5], cov))
    assert value == np.inf
    verdict = judge(value)
    assert verdict.name == "overconfident"
    assert "not positive definite" in verdict.sentence


def test_an_estimate_that_is_not_finite_is_infinitely_overconfident():
    assert nees(EXACT, one([np.nan, 0.0], [[1.0, 0.0], [0.0, 1.0]])) == np.inf


def test_exact_knowledge_that_is_right_leaves_nothing_to_test():
    assert np.isnan(nees(EXACT, one([0.0, 0.0], [[0.0, 0.0], [0.0, 0.0]])))


@pytest.mark.parametrize("trials", [1, 10, 100])
def test_the_interval_holds_95_percent_of_the_trial_average(trials):
    low, high = nees_interval(trials)
    law = chi2(2 * trials)
    np.testing.assert_allclose([law.cdf(low * trials), law.sf(high * trials)], 0.025, rtol=1e-9)


def test_honest_errors_are_judged_consistent():
    verdict = judge(nees(*honest(2)))
    assert (verdict.name, verdict.consistent) == ("consistent", True)
    # A chi-square variable of 2 dof has the standard deviation 2; their mean has 2 over the root of n.
    assert abs(verdict.anees - 2.0) < 4 * 2.0 / np.sqrt(TRIALS * TIMES)


def test_covariances_stated_too_small_are_judged_overconfident():
    truth, belief = honest(3)
    verdict = judge(nees(truth, Belief(belief.mean, 0.5 * belief.cov)))
    assert (verdict.name, verdict.consistent) == ("overconfident", False)
    assert verdict.sentence.startswith("Overconfident: over 60 trials")


def test_covariances_stated_too_large_are_judged_conservative_and_not_inconsistent():
    truth, belief = honest(4)
    verdict = judge(nees(truth, Belief(belief.mean, 2.0 * belief.cov)))
    assert (verdict.name, verdict.consistent) == ("conservative", True)


@pytest.mark.parametrize(("bad", "name"), [(10, "consistent"), (11, "overconfident")])
def test_a_tenth_of_the_times_may_be_above_the_bound(bad, name):
    value = np.full((5, 100), 2.0)
    value[:, :bad] = 50.0
    assert judge(value).name == name


@pytest.mark.parametrize(("low", "name"), [(50, "consistent"), (51, "conservative")])
def test_half_of_the_times_may_be_below_the_bound(low, name):
    value = np.full((5, 100), 2.0)
    value[:, :low] = 0.01
    assert judge(value).name == name


def test_times_without_a_reference_do_not_count():
    truth, belief = honest(5)
    truth[:, ::3] = np.nan
    small = np.where((np.arange(TIMES) % 3 == 0)[:, None, None], 1e-6, 1.0) * belief.cov
    verdict = judge(nees(truth, Belief(belief.mean, small)))
    assert verdict.name == "consistent"


def test_a_time_is_judged_by_the_trials_that_have_a_reference_there():
    """Few trials scatter widely: bounds of all sixty would call the honest estimator overconfident."""
    truth, belief = honest(6)
    truth = np.broadcast_to(truth, belief.mean.shape).copy()
    truth[2:] = np.nan
    assert judge(nees(truth, belief)).name == "consistent"


def test_without_any_reference_there_is_no_verdict():
    verdict = judge(np.full((3, 4), np.nan))
    assert (verdict.name, verdict.consistent) == ("no reference", None)
    assert np.isnan(verdict.anees)
