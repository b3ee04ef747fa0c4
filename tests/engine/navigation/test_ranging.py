"""Range updates against closed forms and the textbook EKF."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.gaussian.forms import Moments
from engine.navigation.ranging import horizontal_range, update_range

A, B = slice(0, 2), slice(2, 4)


def test_a_range_builds_correlation_between_independent_vehicles():
    """The two-robot example of W11's appendix, by its closed form, along the line of sight."""
    a, b, r = 2.0, 3.0, 1.0
    joint = Moments(np.array([[0.0, 0.0, 10.0, 0.0]]), np.diag([a**2, a**2, b**2, b**2])[None])
    after, _ = update_range(joint, A, B, np.array([10.0]), r)
    along = np.ix_([0, 2], [0, 2])
    expected = np.array([[a**2 * (b**2 + r**2), a**2 * b**2], [a**2 * b**2, b**2 * (a**2 + r**2)]])
    np.testing.assert_allclose(after.cov[0][along], expected / (a**2 + b**2 + r**2), rtol=1e-12)
    np.testing.assert_allclose(np.diag(after.cov[0])[[1, 3]], [a**2, b**2], rtol=1e-12)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_range_update_equals_filterpys_extended_kalman_filter(seed):
    rng = np.random.default_rng(seed)
    mean = rng.normal(size=4) * 50
    root = rng.normal(size=(4, 4))
    cov = root @ root.T + 0.1 * np.eye(4)
    z = np.linalg.norm(mean[A] - mean[B]) + rng.normal()
    after, seen = update_range(Moments(mean[None], cov[None]), A, B, np.array([z]), 0.7)

    def jacobian(x):
        u = (x[:2, 0] - x[2:, 0]) / np.linalg.norm(x[:2, 0] - x[2:, 0])
        return np.concatenate([u, -u])[None]

    judge = ExtendedKalmanFilter(4, 1)
    judge.x, judge.P, judge.R = mean[:, None].copy(), cov.copy(), np.array([[0.49]])
    judge.update(np.array([[z]]), jacobian, lambda x: np.array([[np.linalg.norm(x[:2, 0] - x[2:, 0])]]))
    np.testing.assert_allclose(after.mean[0], judge.x[:, 0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(after.cov[0], judge.P, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(seen.variance[0], judge.S[0, 0], rtol=1e-9)


def test_what_was_not_heard_leaves_the_trial_as_it_was():
    joint = Moments(np.array([[0.0, 0, 10, 0]] * 2), np.stack([np.eye(4)] * 2))
    after, seen = update_range(joint, A, B, np.array([np.nan, 12.0]), 1.0)
    np.testing.assert_array_equal(after.mean[0], joint.mean[0])
    np.testing.assert_array_equal(after.cov[0], joint.cov[0])
    assert np.isnan(seen.value[0]) and not seen.accepted[0] and seen.accepted[1]
    assert after.mean[1, 0] < 0


def test_the_gate_refuses_an_echo_and_says_so():
    joint = Moments(np.array([[0.0, 0, 100, 0]]), np.eye(4)[None])
    after, seen = update_range(joint, A, B, np.array([160.0]), 1.0, gate_sigma=4.0)
    np.testing.assert_array_equal(after.mean, joint.mean)
    assert seen.value[0] == 60.0 and not seen.accepted[0]


def test_two_vehicles_in_one_place_learn_nothing_from_a_range():
    joint = Moments(np.zeros((1, 4)), np.eye(4)[None])
    after, seen = update_range(joint, A, B, np.array([1.0]), 1.0)
    np.testing.assert_array_equal(after.cov, joint.cov)
    assert np.isfinite(after.mean).all() and not seen.accepted[0]


def test_ranges_to_known_beacons_reveal_a_wrong_sound_speed():
    """Every range 5 % long, beacons known: the scale state finds the 5 %, its sigma covers what is left."""
    rng = np.random.default_rng(3)
    beacons = np.array([[0.0, 0], [200, 0], [0, 200], [200, 200.0]])
    here = np.array([70.0, 110.0])
    cov = np.diag([25.0, 25, 0.1**2])
    state = Moments(np.array([[72.0, 108.0, 0.0]]), cov[None])
    for beacon in np.tile(beacons, (20, 1)):
        joint = Moments(
            np.concatenate([state.mean, beacon[None]], axis=-1),
            np.block([[state.cov[0], np.zeros((3, 2))], [np.zeros((2, 3)), 1e-8 * np.eye(2)]])[None],
        )
        z = 1.05 * np.linalg.norm(here - beacon) + rng.normal() * 0.5
        joint, _ = update_range(joint, slice(0, 2), slice(3, 5), np.array([z]), 0.5, scale=slice(2, 3))
        state = Moments(joint.mean[:, :3], joint.cov[:, :3, :3])
    error = state.mean[0] - [*here, 0.05]
    assert error @ np.linalg.solve(state.cov[0], error) < 16.3  # chi-square, 3 degrees of freedom, 99.9 %
    assert abs(error[2]) < 0.003


def test_a_slant_range_is_projected_by_the_depth_difference():
    got = horizontal_range(np.array([50.0, 30.0, np.nan]), np.array([30.0, 40.0, 0.0]))
    assert got[0] == 40.0 and np.isnan(got[1:]).all()
