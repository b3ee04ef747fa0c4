"""Factors: Jacobians by numerical differentiation, draws that satisfy their residuals, peaks of a density."""

from __future__ import annotations

import numpy as np
import pytest

from engine.slam.factors.dynamic_odometry import dynamic_odometry
from engine.slam.factors.factor import Factor
from engine.slam.factors.heard import heard, peaks, reading
from engine.slam.factors.odometry import displacement, pose_odometry
from engine.slam.factors.prior import prior
from engine.slam.factors.range import ranging
from engine.slam.variables import DYN_POINT2, POINT2, POSE2

COV4 = np.diag([0.2, 0.3, 0.1, 0.4])
FACTORS: list[tuple[Factor, tuple[int, ...]]] = [
    (prior("a", POSE2, np.array([1.0, 2.0, 0.3]), np.diag([0.2, 0.1, 0.05])), (3,)),
    (displacement("a", "b", DYN_POINT2, np.array([1.0, 0.5, 0.1, 0.0]), COV4), (4, 4)),
    (pose_odometry("a", "b", np.array([1.0, 0.2, 0.4]), np.diag([0.1, 0.2, 0.05])), (3, 3)),
    (dynamic_odometry("a", "b", np.array([1.0, 0.5, 0.0, 0.0]), COV4, 2.0, 0.3), (4, 4)),
    (ranging("a", "b", 20.0, 0.5), (3, 2)),
    (reading("a", "b", 20.0, 0.5, 3.0, 0.1), (2, 2)),
]


@pytest.mark.parametrize(("factor", "dims"), FACTORS, ids=lambda x: type(x).__name__)
def test_jacobians_are_those_of_the_residual(factor: Factor, dims: tuple[int, ...]):
    rng = np.random.default_rng(1)
    values = [rng.normal(scale=0.5, size=(5, d)) + (i * np.eye(d)[0] * 18) for i, d in enumerate(dims)]
    e, J = factor.linearize(*values)
    numeric_e, numeric_J = Factor.linearize(factor, *values)
    np.testing.assert_allclose(e, numeric_e)
    for analytic, numeric in zip(J, numeric_J, strict=True):
        np.testing.assert_allclose(np.broadcast_to(analytic, numeric.shape), numeric, atol=1e-5)


@pytest.mark.parametrize(("factor", "dims"), FACTORS[:3], ids=lambda x: type(x).__name__)
def test_draws_leave_whitened_residuals(factor: Factor, dims: tuple[int, ...]):
    rng = np.random.default_rng(2)
    values = [np.tile(rng.normal(size=d), (4000, 1)) for d in dims]
    for towards in range(len(dims)):
        filled = list(values)
        filled[towards] = factor.sample(towards, values, np.zeros(4000), rng)
        e = factor.residual(*filled)
        np.testing.assert_allclose(e.mean(0), 0.0, atol=0.08)
        np.testing.assert_allclose(np.cov(e.T), np.eye(e.shape[1]), atol=0.1)


def two_peaks() -> tuple[np.ndarray, np.ndarray]:
    r = np.arange(0.0, 100.0, 0.04)
    density = np.exp(-0.5 * np.square((r - 40) / 0.3)) + 0.5 * np.exp(-0.5 * np.square((r - 52) / 0.4))
    return r, density / density.sum()


def test_peaks_of_a_density_are_its_direct_path_and_its_echo():
    centre, sigma, mass = peaks(*two_peaks())
    np.testing.assert_allclose(centre[:2], [40, 52], atol=0.05)
    np.testing.assert_allclose(sigma[:2], [0.3, 0.4], rtol=0.05)
    np.testing.assert_allclose(mass[:2], np.array([0.3, 0.2]) / 0.5, rtol=0.05)


def test_a_range_is_explained_by_the_peak_it_is_near_or_by_none():
    factor = heard("a", "b", *two_peaks(), slack_m=1.0, doubt=0.05)
    beacon = np.zeros((3, 2))
    pose = np.array([[40.1, 0.0], [52.2, 0.0], [80.0, 0.0]])
    e, J = factor.linearize(pose, beacon)
    np.testing.assert_allclose(e[:, 0], [0.1 / 0.3, 0.2 / 0.4, 0.0], atol=0.1)
    assert (np.abs(J[0][:2, 0, 0]) > 2).all() and (J[0][2] == 0).all()
    assert e[2, 1] > e[1, 1] > e[0, 1] == 0, "an echo is less likely than the direct path, a wrong range less than both"


def test_a_covariance_that_is_none_is_refused():
    with pytest.raises(ValueError, match="positive definite"):
        prior("a", POINT2, np.zeros(2), np.array([[1.0, 2.0], [2.0, 1.0]]))
    with pytest.raises(ValueError, match="positive"):
        ranging("a", "b", 10.0, 0.0)
