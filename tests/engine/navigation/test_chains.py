"""Compressed chains against the same sensors filtered one sample at a time by FilterPy, and odometry by hand."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.gaussian.forms import Moments
from engine.gaussian.links import advance
from engine.mission.log import Fixes, Heading, InitialBelief, Odometry, VehicleLog, Velocity
from engine.navigation.chains import Chain, chain, integrate, latest_before, world_velocity

PSD = 0.02


def initial(trials: int, rng: np.random.Generator) -> InitialBelief:
    return InitialBelief(
        position_m=rng.normal(size=(trials, 2)),
        position_cov=np.array([[4.0, 0.5], [0.5, 2.0]]),
        velocity_mps=np.tile([1.0, 0.2], (trials, 1)),
        velocity_sigma_mps=0.3,
        heading_rad=np.full(trials, 0.4),
        heading_sigma_rad=0.05,
    )


def vehicle(rng: np.random.Generator, trials: int, *, fixes: int, readings: int) -> VehicleLog:
    time = np.sort(rng.uniform(0, 60, readings))
    heading_time = np.sort(rng.uniform(0, 60, 200))
    fix_time = np.sort(rng.uniform(0, 60, fixes))
    return VehicleLog(
        name="auv",
        kind="auv",
        initial=initial(trials, rng),
        acceleration_psd=PSD,
        range_sigma_m=1.0,
        velocity=Velocity(time, rng.normal([1.0, 0.0], 0.1, (trials, readings, 2)), 0.05, 0.08) if readings else None,
        heading=Heading(heading_time, rng.normal(0.4, 0.1, (trials, 200)), 0.035),
        fixes=Fixes(fix_time, rng.normal(size=(trials, fixes, 2)) * 5, np.tile(np.eye(2) * 9.0, (fixes, 1, 1)))
        if fixes
        else None,
    )


def step_by_step(log: VehicleLog, trial: int, until_s: float) -> KalmanFilter:
    """The plain way: one predict and one update a sample, in order of time, by FilterPy."""
    judge = KalmanFilter(dim_x=4, dim_z=2)
    judge.x = np.concatenate([log.initial.position_m[trial], log.initial.velocity_mps[trial]])[:, None]
    judge.P = np.zeros((4, 4))
    judge.P[:2, :2] = log.initial.position_cov
    judge.P[2:, 2:] = np.eye(2) * log.initial.velocity_sigma_mps**2
    samples = []
    if log.velocity is not None:
        z, R = world_velocity(log)
        samples += [(t, z[trial, n], R[trial, n], np.eye(4)[2:]) for n, t in enumerate(log.velocity.time_s)]
    if log.fixes is not None:
        samples += [
            (t, log.fixes.value[trial, n], log.fixes.cov[n], np.eye(4)[:2]) for n, t in enumerate(log.fixes.time_s)
        ]
    now = 0.0
    for time, z, R, H in [*sorted(samples, key=lambda s: s[0]), (until_s, None, None, None)]:
        if time > until_s:
            continue
        dt = time - now
        F = np.eye(4)
        F[0, 2] = F[1, 3] = dt
        Q = PSD * np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), np.eye(2))
        judge.predict(F=F, Q=Q)
        now = time
        if z is not None:
            judge.update(z[:, None], R=R, H=H)
    return judge


def follow(chain: Chain, steps: int) -> Moments:
    now = chain.initial
    for step in chain.steps[:steps]:
        now = advance(now, slice(None), step.at(now.mean))
    return now


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 80),
    st.integers(0, 20),
    st.lists(st.floats(0.5, 59.5), max_size=12, unique=True),
)
def test_a_compressed_chain_equals_filtering_every_sample(seed, readings, fixes, inner):
    """At every breakpoint, mean and covariance to 1e-9 relative, whatever the schedule."""
    rng = np.random.default_rng(seed)
    log = vehicle(rng, 2, fixes=fixes, readings=readings)
    breakpoints = np.array([0.0, *sorted(inner), 60.0])
    compressed = chain(log, breakpoints, 2)
    for k in (len(breakpoints) // 2, len(breakpoints) - 1):
        got = follow(compressed, k)
        for trial in range(2):
            judge = step_by_step(log, trial, breakpoints[k])
            scale = np.sqrt(np.diag(judge.P))
            np.testing.assert_allclose(got.mean[trial], judge.x[:, 0], rtol=1e-9, atol=1e-9 * scale.max())
            np.testing.assert_allclose(
                got.cov[trial] / np.outer(scale, scale), judge.P / np.outer(scale, scale), rtol=0, atol=1e-9
            )


def test_where_the_breakpoints_lie_does_not_matter():
    rng = np.random.default_rng(2)
    log = vehicle(rng, 3, fixes=8, readings=150)
    coarse = follow(chain(log, np.array([0.0, 60.0]), 3), 1)
    fine = follow(chain(log, np.linspace(0, 60, 241), 3), 240)
    np.testing.assert_allclose(fine.mean, coarse.mean, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(fine.cov, coarse.cov, rtol=1e-9, atol=1e-12)


def test_heading_noise_adds_a_part_across_the_velocity_and_keeps_the_mean():
    """Turned to the world frame, a million noisy headings average to the true velocity with the stated covariance."""
    rng = np.random.default_rng(4)
    n, sigma, heading = 1_000_000, np.radians(6.0), 0.7
    time = np.arange(n, dtype=float)
    truth = np.array([np.cos(heading), np.sin(heading)]) * 1.5
    body = np.array([1.5, 0.0]) + rng.normal(size=(1, n, 2)) * [0.05, 0.02]
    log = VehicleLog(
        "auv",
        "auv",
        initial(1, rng),
        PSD,
        1.0,
        velocity=Velocity(time, body, 0.05, 0.02),
        heading=Heading(time, heading + rng.normal(size=(1, n)) * sigma, sigma),
    )
    z, R = world_velocity(log)
    error = z[0] - truth
    standard_error = error.std(axis=0) / np.sqrt(n)
    assert np.all(np.abs(error.mean(axis=0)) < 4 * standard_error)
    np.testing.assert_allclose(np.cov(error.T), R[0].mean(axis=0), rtol=0.03, atol=2e-5)


def test_a_sensor_is_read_no_later_than_now():
    assert latest_before(np.array([1.0, 2.0, 3.0]), np.array([0.5, 2.0, 2.9, 9.0])).tolist() == [0, 1, 1, 2]


def test_velocities_without_a_heading_are_refused_by_name():
    rng = np.random.default_rng(0)
    log = VehicleLog("iver", "auv", initial(1, rng), PSD, 1.0, velocity=Velocity(np.ones(1), np.ones((1, 1, 2)), 1, 1))
    with pytest.raises(ValueError, match="iver"):
        chain(log, np.array([0.0, 2.0]), 1)


def test_odometry_composes_to_the_same_pose_wherever_it_is_cut():
    """Increments divided at arbitrary instants inside a straight or turning run end where they should."""
    rng = np.random.default_rng(1)
    time = np.arange(1.0, 41.0)
    value = np.concatenate([rng.normal([1.0, 0.0], 0.1, (1, 40, 2)), rng.normal(0, 0.05, (1, 40, 1))], axis=-1)
    odometry = Odometry(time, value, np.tile(np.diag([0.01, 0.01, 1e-4]), (40, 1, 1)))
    heading = np.concatenate([[0], np.cumsum(value[0, :, 2])])
    x = sum(
        np.array([np.cos(h) * d[0] - np.sin(h) * d[1], np.sin(h) * d[0] + np.cos(h) * d[1]])
        for h, d in zip(heading[:-1], value[0])
    )
    pose, cov = integrate(odometry, np.array([0.0, 40.0]))
    np.testing.assert_allclose(pose[0, 0], [*x, heading[-1]], rtol=1e-12)
    log = VehicleLog("robot", "auv", initial(1, rng), 0.0, 1.0, odometry=odometry)
    at_readings = np.concatenate([[0.0], np.sort(rng.choice(time, 7, replace=False)), [40.0]])
    whole, cut = (follow(chain(log, b, 1), len(b) - 1) for b in (np.array([0.0, 40.0]), np.unique(at_readings)))
    np.testing.assert_allclose(cut.mean, whole.mean, rtol=1e-10)
    np.testing.assert_allclose(cut.cov, whole.cov, rtol=1e-9)
    assert np.linalg.eigvalsh(cov[0, 0]).min() > 0


def test_an_odometry_link_is_the_numerical_derivative_of_the_motion():
    rng = np.random.default_rng(6)
    odometry = Odometry(np.array([1.0]), np.array([[[2.0, 0.3, 0.4]]]), np.diag([0.01, 0.02, 0.003])[None])
    log = VehicleLog("robot", "auv", initial(1, rng), 0.0, 1.0, odometry=odometry)
    step = chain(log, np.array([0.0, 1.0]), 1).steps[0]
    mean = np.array([[5.0, -2.0, 0.8]])

    def end(pose: np.ndarray) -> np.ndarray:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return pose + np.array([c * 2.0 - s * 0.3, s * 2.0 + c * 0.3, 0.4])

    link = step.at(mean)
    numeric = np.stack([(end(mean[0] + h) - end(mean[0] - h)) / 2e-6 for h in 1e-6 * np.eye(3)], axis=1)
    np.testing.assert_allclose(link.A[0], numeric, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(link.A[0] @ mean[0] + link.b[0], end(mean[0]), rtol=1e-12)


def test_a_fix_corrects_a_dead_reckoned_pose():
    """Odometry with a fix at its end equals predicting and then updating by hand."""
    rng = np.random.default_rng(7)
    odometry = Odometry(np.array([1.0, 2.0]), np.tile([1.0, 0.0, 0.1], (1, 2, 1)), np.tile(np.eye(3) * 0.01, (2, 1, 1)))
    bare = VehicleLog("robot", "auv", initial(1, rng), 0.0, 1.0, odometry=odometry)
    fix = Fixes(np.array([1.0]), np.array([[[3.0, 1.0]]]), np.eye(2)[None] * 0.5)
    fixed = VehicleLog("robot", "auv", bare.initial, 0.0, 1.0, odometry=odometry, fixes=fix)
    before = follow(chain(bare, np.array([0.0, 1.0]), 1), 1)
    H = np.eye(3)[:2]
    P, m = before.cov[0], before.mean[0]
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + 0.5 * np.eye(2))
    got = follow(chain(fixed, np.array([0.0, 1.0, 2.0]), 1), 1)
    np.testing.assert_allclose(got.mean[0], m + K @ (np.array([3.0, 1.0]) - m[:2]), rtol=1e-10)
    np.testing.assert_allclose(got.cov[0], P - K @ H @ P, rtol=1e-9, atol=1e-14)
    inside = follow(chain(fixed, np.array([0.0, 2.0]), 1), 1)
    cut = follow(chain(fixed, np.array([0.0, 1.0, 2.0]), 1), 2)
    assert np.all(np.linalg.eigvalsh(inside.cov[0]) > 0)
    np.testing.assert_allclose(inside.mean, cut.mean, atol=0.2)


def test_a_fixed_node_stays_and_is_sharpened_by_fixes():
    rng = np.random.default_rng(3)
    fixes = Fixes(np.array([5.0]), np.array([[[1.0, 1.0]]]), np.eye(2)[None])
    log = VehicleLog("beacon", "fixed", initial(1, rng), 0.0, 1.0, fixes=fixes)
    end = follow(chain(log, np.array([0.0, 10.0, 20.0]), 1), 2)
    information = np.linalg.inv(log.initial.position_cov) + np.eye(2)
    np.testing.assert_allclose(np.linalg.inv(end.cov[0]), information, rtol=1e-9)
