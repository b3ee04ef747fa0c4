"""The motion model against the stochastic differential equation it stands for."""

from __future__ import annotations

import numpy as np
import pytest

from engine.gaussian.forms import Moments
from engine.pursuit.sigma_points import gauss_hermite
from engine.pursuit.target import Motion, jitter, predict, wander, wandering


def walked(motion: Motion, start: np.ndarray, seconds: float, step_s: float, seed: int = 1) -> np.ndarray:
    rng, T = np.random.default_rng(seed), round(seconds / step_s)
    n = len(start)
    states = wander(motion, start, step_s, rng.standard_normal((n, T)), rng.standard_normal((n, T, 2)))
    return states[:, -1]


@pytest.mark.parametrize("psd", [1e-4, 0.01, 0.1])
def test_a_displacement_has_the_moments_of_many_walks(psd):
    """20 000 walks in steps of 0.4 s; five standard errors."""
    motion, T = Motion(1.2, psd), 28.0
    end = walked(motion, np.zeros((20_000, 3)), T, 0.4)
    exact = wandering(motion, T)
    n = len(end)
    assert end[:, 0].mean() == pytest.approx(exact.ahead_m, abs=5 * end[:, 0].std() / np.sqrt(n) + 1e-3)
    assert end[:, 1].var() == pytest.approx(exact.aside_m2, rel=0.05)
    assert end[:, 0].var() == pytest.approx(exact.ahead_m2, rel=0.1, abs=0.05)
    assert np.cov(end[:, 1], end[:, 2])[0, 1] == pytest.approx(exact.aside_turn_m, rel=0.05)


def test_the_series_and_the_exact_moments_meet():
    motion = Motion(1.0, 2e-3 / 28.0)
    below, above = wandering(motion, 28.0 * (1 - 1e-9)), wandering(motion, 28.0 * (1 + 1e-9))
    np.testing.assert_allclose(below.ahead_m, above.ahead_m, rtol=1e-6)
    np.testing.assert_allclose(below.aside_m2, above.aside_m2, rtol=3e-3)
    np.testing.assert_allclose(below.aside_turn_m, above.aside_turn_m, rtol=3e-3)


def test_a_prediction_has_the_moments_of_many_walks_from_its_belief():
    motion, rng = Motion(1.0, 0.01), np.random.default_rng(3)
    belief = Moments(np.array([5.0, -3.0, 0.7]), np.diag([1.0, 2.0, 0.1]))
    start = belief.mean + rng.standard_normal((40_000, 3)) * np.sqrt(np.diag(belief.cov))
    end = walked(motion, start, 28.0, 0.5)
    after = predict(belief, motion, 28.0, gauss_hermite)
    np.testing.assert_allclose(after.mean, end.mean(axis=0), atol=0.15)
    np.testing.assert_allclose(after.cov, np.cov(end.T), atol=0.06 * np.abs(after.cov).max())


def test_a_target_that_does_not_turn_goes_straight():
    after = predict(Moments(np.zeros(3), 1e-12 * np.eye(3)), Motion(2.0, 0.0), 10.0, gauss_hermite)
    np.testing.assert_allclose(after.mean, [20.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(after.cov, 0.0, atol=1e-9)


def test_the_clocks_jitter_blurs_along_the_heading():
    belief = Moments(np.array([0.0, 0.0, 0.5]), np.diag([1.0, 1.0, 1e-12]))
    u = np.array([np.cos(0.5), np.sin(0.5)])
    np.testing.assert_allclose(jitter(belief, Motion(1.5, 0.01), 0.2), 0.09 * np.outer(u, u), atol=1e-12)
