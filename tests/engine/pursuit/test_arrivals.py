"""Updates with differences of arrival times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.gaussian.forms import Moments
from engine.pursuit.arrivals import differences, update
from engine.pursuit.formation import inner, line, outer
from engine.pursuit.sigma_points import gauss_hermite, unscented

SIGMA = 0.2


def prior(sd_m: float = 3.0, heading: float = 0.4) -> Moments:
    return Moments(np.array([1.0, -2.0, heading]), np.diag([sd_m**2, 1.5 * sd_m**2, 0.1]))


def heard_from(places: np.ndarray, source: np.ndarray, rng: np.random.Generator, clock_m: float = 0.0) -> np.ndarray:
    distance = np.linalg.norm(places - source, axis=-1)
    return clock_m + distance + SIGMA * rng.standard_normal(distance.shape)


def everyone(n: int) -> np.ndarray:
    return np.ones(n, bool)


@given(st.floats(-0.4, 0.4), st.integers(0, 2**32 - 1))
def test_the_targets_clock_does_not_matter(jitter_s, seed):
    """Arrivals count from the start of the cycle, so their differences keep their digits: 1e-9 m."""
    places = inner(90.0)
    arrivals = heard_from(places, np.array([3.0, 1.0]), np.random.default_rng(seed))
    plain, _ = update(prior(), arrivals, everyone(3), places, SIGMA, gauss_hermite)
    late, _ = update(prior(), arrivals + 1500.0 * jitter_s, everyone(3), places, SIGMA, gauss_hermite)
    np.testing.assert_allclose(late.mean, plain.mean, atol=1e-9, rtol=0)
    np.testing.assert_allclose(late.cov, plain.cov, atol=1e-9, rtol=0)


@pytest.mark.parametrize("rule", [gauss_hermite, unscented])
def test_it_does_not_matter_against_which_arrival_the_others_are_taken(rule):
    """Differences share an arrival and its noise; treated as correlated, any choice gives the same."""
    places, rng = outer(90.0), np.random.default_rng(4)
    arrivals = heard_from(places, np.array([3.0, 1.0]), rng)
    first, _ = update(prior(), arrivals, everyone(3), places, SIGMA, rule)
    for order in ([1, 2, 0], [2, 1, 0]):
        other, _ = update(prior(), arrivals[order], everyone(3), places[order], SIGMA, rule)
        np.testing.assert_allclose(other.mean, first.mean, atol=1e-9)
        np.testing.assert_allclose(other.cov, first.cov, atol=1e-9)


def test_a_lost_arrival_is_as_if_there_were_no_such_receiver():
    places, rng = inner(90.0), np.random.default_rng(5)
    arrivals = heard_from(places, np.array([3.0, 1.0]), rng)
    for lost in range(3):
        left = [i for i in range(3) if i != lost]
        heard = everyone(3)
        heard[lost] = False
        spoilt = np.where(heard, arrivals, np.nan)
        masked, surprise = update(prior(), spoilt, heard, places, SIGMA, gauss_hermite)
        cut, alone = update(prior(), arrivals[left], everyone(2), places[left], SIGMA, gauss_hermite)
        np.testing.assert_allclose(masked.mean, cut.mean, atol=1e-12)
        np.testing.assert_allclose(masked.cov, cut.cov, atol=1e-12)
        assert surprise.dof == alone.dof == 1
        assert surprise.nis == pytest.approx(alone.nis)


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_arrivals_tell_nothing(count):
    heard = np.arange(3) < count
    after, surprise = update(prior(), np.array([70.0, np.nan, np.nan]), heard, inner(90.0), SIGMA, gauss_hermite)
    np.testing.assert_allclose(after.mean, prior().mean, atol=1e-12)
    np.testing.assert_allclose(after.cov, prior().cov, atol=1e-12)
    assert surprise.dof == 0 and surprise.nis == 0


def test_trials_that_heard_different_receivers_go_through_one_call():
    places, rng = inner(90.0), np.random.default_rng(6)
    heard = np.array([[1, 1, 1], [0, 1, 1], [1, 0, 1], [0, 0, 1]], bool)
    arrivals = heard_from(places, np.array([3.0, 1.0]), rng)
    many = Moments(np.tile(prior().mean, (4, 1)), np.tile(prior().cov, (4, 1, 1)))
    together, _ = update(many, np.tile(arrivals, (4, 1)), heard, places[None], SIGMA, gauss_hermite)
    for t in range(4):
        alone, _ = update(prior(), arrivals, heard[t], places, SIGMA, gauss_hermite)
        np.testing.assert_allclose(together.mean[t], alone.mean, atol=1e-12)
        np.testing.assert_allclose(together.cov[t], alone.cov, atol=1e-12)


GEOMETRIES = [
    (inner(90.0), (2.0, 1.0)),
    (inner(90.0), (-3.0, 2.0)),
    (inner(60.0), (3.5, 1.0)),
    (outer(90.0), (2.0, 1.0)),
    (outer(90.0), (-2.0, -5.0)),
    (outer(150.0), (0.0, 3.0)),
    (line(75.0), (2.0, 1.0)),
    (line(75.0), (-3.0, -4.0)),
    (np.array([[60.0, 0.0], [-60.0, 10.0], [0.0, 80.0]]), (4.0, -3.0)),
    (np.array([[40.0, 40.0], [-90.0, 0.0], [20.0, -70.0]]), (1.0, 2.0)),
]


@pytest.mark.parametrize("number", range(10))
def test_the_update_agrees_with_a_million_particles(number):
    """Importance sampling from the prior, likelihood with the clock's offset integrated out over a flat prior.

    Mean within 0.2 of a posterior sigma, every covariance entry within 15 % of the sigmas' product.
    """
    places, source = GEOMETRIES[number]
    rng, belief = np.random.default_rng(number), prior()
    arrivals = heard_from(places, np.array(source), rng, clock_m=37.0)
    after, _ = update(belief, arrivals, everyone(3), places, SIGMA, gauss_hermite, iterations=3)

    x = belief.mean + rng.standard_normal((1_000_000, 3)) * np.sqrt(np.diag(belief.cov))
    left = arrivals - np.linalg.norm(x[:, None, :2] - places, axis=-1)
    left -= left.mean(axis=1, keepdims=True)
    log = -0.5 * np.einsum("ni,ni->n", left, left) / SIGMA**2
    w = np.exp(log - log.max())
    w /= w.sum()
    mean = w @ x
    cov = (x - mean).T @ (w[:, None] * (x - mean))
    sigma = np.sqrt(np.diag(cov))
    assert 1 / (w @ w) > 500
    assert (np.abs(after.mean - mean) < 0.2 * sigma).all()
    assert (np.abs(after.cov - cov) < 0.15 * np.outer(sigma, sigma)).all()


@given(st.integers(0, 2**32 - 1), st.sampled_from([gauss_hermite, unscented]), st.integers(1, 3))
def test_singular_geometries_leave_beliefs_finite_and_definite(seed, rule, iterations):
    """Vehicles on a line, in one point, on top of the target; sigmas from millimetres to kilometres."""
    rng = np.random.default_rng(seed)
    ahead = rng.normal(size=2)
    shapes = [
        np.outer([-50.0, 0.0, 70.0], ahead),
        np.tile(ahead, (3, 1)),
        np.zeros((3, 2)),
        np.outer([0.0, 1e-9, 1e9], ahead),
    ]
    places = shapes[rng.integers(len(shapes))]
    sd = 10 ** rng.uniform(-3, 3)
    belief = Moments(np.array([0.0, 0.0, 0.3]), np.diag([sd**2, sd**2, 0.5]))
    after, surprise = update(belief, heard_from(places, np.zeros(2), rng), everyone(3), places, SIGMA, rule, iterations)
    assert np.isfinite(after.mean).all() and np.isfinite(after.cov).all() and np.isfinite(surprise.nis)
    assert np.linalg.eigvalsh(after.cov).min() > 0


def test_in_space_four_receivers_find_the_depth():
    places = np.array([[90.0, 0.0, 0.0], [-45.0, 78.0, 30.0], [-45.0, -78.0, 5.0], [10.0, 5.0, 60.0]])
    source, rng = np.array([4.0, -3.0, 22.0]), np.random.default_rng(8)
    belief = Moments(np.array([0.0, 0.0, 20.0, 0.1]), np.diag([25.0, 25.0, 25.0, 1.0]))
    after, _ = update(belief, heard_from(places, source, rng), everyone(4), places, SIGMA, gauss_hermite, 3)
    assert np.linalg.norm(after.mean[:3] - source) < 4 * np.sqrt(np.trace(after.cov[:3, :3]))
    assert np.trace(after.cov[:3, :3]) < 1.0


def test_differences_are_to_the_first_arrival_that_was_heard():
    z, used, reference = differences(np.array([np.nan, 5.0, 8.0]), np.array([False, True, True]))
    assert reference == 1
    np.testing.assert_array_equal(used, [False, False, True])
    np.testing.assert_array_equal(z, [0.0, 0.0, 3.0])
