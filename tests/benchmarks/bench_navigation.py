"""How much cheaper chains of links are than filtering every sample, against FilterPy in the same run."""

from __future__ import annotations

import time

import numpy as np
from filterpy.kalman import KalmanFilter

from engine.mission.log import Heading, InitialBelief, VehicleLog, Velocity
from engine.navigation.chains import chain, world_velocity


def two_hours(trials: int) -> VehicleLog:
    rng = np.random.default_rng(0)
    at = np.arange(1, 7200 * 3 + 1) / 3.0
    heading_at = np.arange(1, 7200 * 25 + 1) / 25.0
    return VehicleLog(
        name="auv",
        kind="auv",
        initial=InitialBelief(np.zeros((trials, 2)), np.eye(2), np.zeros((trials, 2)), 0.5, np.zeros(trials), 0.0),
        acceleration_psd=0.01,
        range_sigma_m=1.0,
        velocity=Velocity(at, rng.normal([1.0, 0.0], 0.05, (trials, len(at), 2)), 0.05, 0.05),
        heading=Heading(heading_at, rng.normal(0.3, 0.035, (trials, len(heading_at))), 0.035),
    )


def test_local_filtering_per_trial_and_sample():
    """Two hours of DVL at 3 Hz: 50 trials compressed to links, against one trial step by step in FilterPy."""
    trials, log = 50, two_hours(50)
    breakpoints = np.unique(np.concatenate([np.arange(0, 7201, 10.0), np.random.default_rng(1).uniform(0, 7200, 800)]))
    chain(log, breakpoints, trials)
    start = time.perf_counter()
    chain(log, breakpoints, trials)
    ours = (time.perf_counter() - start) / (trials * len(log.velocity.time_s))

    z, R = world_velocity(log)
    judge = KalmanFilter(4, 2)
    judge.H = np.eye(4)[2:]
    F = np.eye(4)
    F[0, 2] = F[1, 3] = 1 / 3
    Q = 0.01 * np.kron(np.array([[1 / 81, 1 / 18], [1 / 18, 1 / 3]]), np.eye(2))
    samples = 5000
    start = time.perf_counter()
    for n in range(samples):
        judge.predict(F=F, Q=Q)
        judge.update(z[0, n][:, None], R=R[0, n])
    theirs = (time.perf_counter() - start) / samples
    print(f"\nlocal filtering, per trial and sample: {ours * 1e6:.3f} us, FilterPy {theirs * 1e6:.1f} us, ", end="")
    print(f"{theirs / ours:.0f} times cheaper (wanted: 50)")
    assert theirs / ours >= 50
