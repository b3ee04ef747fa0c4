"""How much cheaper chains of links are than filtering every sample, against FilterPy in the same run."""

from __future__ import annotations

import time

import numpy as np
from filterpy.kalman import KalmanFilter

from engine import runner
from engine.mission import fly
from engine.mission.log import Heading, InitialBelief, VehicleLog, Velocity
from engine.navigation.chains import chain, world_velocity
from engine.navigation.mission import prepare
from engine.registry import algorithms, silent
from engine.scenario import library, toml

SIX = ("dead_reckoning", "cekf", "nekf", "interleaved_update", "deif", "mdeif")


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


def test_the_centralized_filter_against_one_run_sample_by_sample():
    """Topology C, 100 trials: our CEKF with its chains, and all six estimators, against FilterPy at every reading."""
    scenario = toml.override(library.find("walls2011-topology-c"), {"trials": 100})
    logs = [fly(scenario, block) for block in runner.blocks(100)]
    start = time.perf_counter()
    missions = [prepare(log) for log in logs]
    for mission in missions:
        algorithms()["cekf"].run(mission, silent)
    ours = time.perf_counter() - start
    start = time.perf_counter()
    for name in SIX[:1] + SIX[2:]:
        for mission in missions:
            algorithms()[name].run(mission, silent)
    six = ours + time.perf_counter() - start

    judge = KalmanFilter(12, 2)
    judge.H = np.eye(12)[2:4]
    F = np.eye(12)
    F[[0, 1, 4, 5, 8, 9], [2, 3, 6, 7, 10, 11]] = 1 / 3
    Q, R = np.eye(12) * 1e-3, np.eye(2) * 0.0025
    samples = 5000
    start = time.perf_counter()
    for _ in range(samples):
        judge.predict(F=F, Q=Q)
        judge.update(np.zeros((2, 1)), R=R)
    each = (time.perf_counter() - start) / samples
    readings = sum(len(s.time_s) for v in logs[0].vehicles for s in (v.velocity, v.fixes) if s is not None)
    theirs = each * 100 * readings
    print(
        f"\ncentralized EKF, 100 trials, {readings} readings each: {ours:.2f} s; FilterPy at {each * 1e6:.0f} us ",
        end="",
    )
    print(f"a reading {theirs:.0f} s: {theirs / ours:.0f} times. All six estimators {six:.1f} s: ", end="")
    print(f"{theirs / six:.0f} times (wanted: 100)")
