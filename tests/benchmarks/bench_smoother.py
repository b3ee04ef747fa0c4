"""Build, solve and marginals of one vehicle on a two-vehicle range graph, against GTSAM in the same run."""

from __future__ import annotations

import time

import gtsam
import numpy as np

from engine.smoothing.graph import Graph, Ranges, increments, priors
from engine.smoothing.smoother import smooth

POSES, RANGE_EVERY, PRIOR_EVERY = 1000, 5, 200
ODOMETRY = np.diag([0.09, 0.04])
FIX = np.diag([4.0, 4.0])


def facts(seed: int = 0):
    """Two vehicles side by side: odometry (2, POSES - 1, 2), ranges, fixes of the first, and the dead reckoning."""
    rng = np.random.default_rng(seed)
    t = np.arange(POSES)
    truth = np.stack(
        [np.stack([t * 1.5, 60 * np.sin(t / 80)], -1), np.stack([t * 1.5 + 40, 150 + 50 * np.cos(t / 60)], -1)]
    )
    odometry = np.diff(truth, axis=1) + rng.multivariate_normal(np.zeros(2), ODOMETRY, (2, POSES - 1))
    ranged = np.arange(0, POSES, RANGE_EVERY)
    ranges = np.linalg.norm(truth[0, ranged] - truth[1, ranged], axis=-1) + rng.normal(size=len(ranged))
    fixed = np.arange(0, POSES, PRIOR_EVERY)
    fixes = truth[0, fixed] + rng.multivariate_normal(np.zeros(2), FIX, len(fixed))
    first = np.stack([fixes[0], truth[1, 0]])
    reckoned = np.concatenate([first[:, None], first[:, None] + np.cumsum(odometry, axis=1)], axis=1)
    return odometry, ranged, ranges, fixed, fixes, reckoned


def ours(odometry, ranged, ranges, fixed, fixes, reckoned):
    reference = reckoned.transpose(1, 0, 2).ravel()
    pose = (np.arange(POSES)[:, None] * 2 + np.arange(2))[..., None] * 2 + np.arange(2)
    z = odometry.transpose(1, 0, 2).reshape(-1, 2)
    R = np.broadcast_to(ODOMETRY, (len(z), 2, 2))
    graph = Graph(
        reference,
        reference.size,
        (
            increments(pose[:-1].reshape(-1, 2), pose[1:].reshape(-1, 2), z, R, reference),
            priors(pose[fixed, 0], fixes, np.broadcast_to(FIX, (len(fixed), 2, 2)), reference),
            priors(pose[:1, 1], reckoned[1, :1], FIX[None], reference),
        ),
        ranges=(Ranges(pose[ranged, 0], pose[ranged, 1], ranges, np.ones(len(ranges))),),
    )
    solution = smooth(graph)
    cov = solution.inverse().blocks(pose[:, 0])
    return solution.x.reshape(POSES, 2, 2)[:, 0], cov


def theirs(odometry, ranged, ranges, fixed, fixes, reckoned):
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    key = [[gtsam.symbol(c, k) for k in range(POSES)] for c in "ab"]
    step = gtsam.noiseModel.Gaussian.Covariance(ODOMETRY)
    fix = gtsam.noiseModel.Gaussian.Covariance(FIX)
    metre = gtsam.noiseModel.Isotropic.Sigma(1, 1.0)
    for v in range(2):
        for k in range(POSES):
            values.insert(key[v][k], reckoned[v, k])
        for k in range(POSES - 1):
            graph.add(gtsam.BetweenFactorPoint2(key[v][k], key[v][k + 1], odometry[v, k], step))
    for k, value in zip(ranged, ranges):
        graph.add(gtsam.RangeFactor2(key[0][k], key[1][k], value, metre))
    for k, value in zip(fixed, fixes):
        graph.add(gtsam.PriorFactorPoint2(key[0][k], value, fix))
    graph.add(gtsam.PriorFactorPoint2(key[1][0], reckoned[1, 0], fix))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    marginals = gtsam.Marginals(graph, result)
    mean = np.array([result.atPoint2(k) for k in key[0]])
    return mean, np.array([marginals.marginalCovariance(k) for k in key[0]])


def best_of(runs: int, solve, given):
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        answer = solve(*given)
        times.append(time.perf_counter() - start)
    return min(times), answer


def test_build_solve_and_marginals_of_one_vehicle():
    """1000 poses each, a range every 5 poses, a prior every 200: to equal error, five times faster."""
    given = facts()
    mine, (mean, cov) = best_of(10, ours, given)
    other, (their_mean, their_cov) = best_of(3, theirs, given)
    # GTSAM stops at its own tolerance, some millimetres from the optimum.
    np.testing.assert_allclose(mean, their_mean, atol=0.01)
    np.testing.assert_allclose(cov, their_cov, rtol=1e-3, atol=1e-4)
    print(f"\nsmoother: {mine * 1e3:.1f} ms, GTSAM {other * 1e3:.1f} ms, {other / mine:.1f} times faster (wanted: 5)")
    assert other / mine >= 5
