"""The batch smoother against GTSAM on the same graphs, and what it does with outliers and bad starts."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.smoothing.ambiguity import likeliest, starts
from engine.smoothing.band import NotPositiveDefinite
from engine.smoothing.graph import Graph, Ranges, increments, priors
from engine.smoothing.growing import BORDER, Growing
from engine.smoothing.smoother import smooth

sys.path.insert(0, str(Path(__file__).parent))
from graphlab import gtsam_solution, random_graph


@pytest.mark.parametrize("seed", range(50))
def test_gtsam_agrees_on_means_and_marginals(seed):
    """Two or three vehicles, in the plane or in SE(2), every fifth with a beacon of uncertain position."""
    rng = np.random.default_rng(seed)
    d = 2 + seed // 2 % 2
    vehicles = 2 + seed % 2
    graph, facts = random_graph(rng, vehicles=vehicles, dimension=d, beacon=seed % 5 == 0)
    ours = smooth(graph, settled=1e-9)
    assert ours.status == "converged"
    idx = np.arange(20 * vehicles)[:, None] * d + np.arange(2)
    cov = ours.inverse().blocks(idx)
    for k, (mean, P) in gtsam_solution(facts, graph.reference[: graph.banded].reshape(-1, d), d).items():
        np.testing.assert_allclose(ours.x[idx[k]], mean, atol=1e-6)
        np.testing.assert_allclose(cov[k], P, rtol=1e-6, atol=1e-6 * np.abs(P).max())


def test_gross_range_errors_are_refused_whatever_the_start():
    """A tenth of the ranges 30 to 200 m too long: refused to the last one, the answer as without them."""
    rng = np.random.default_rng(7)
    graph, _ = random_graph(rng, vehicles=2, poses=60, range_every=1)
    clean = smooth(graph)
    group = graph.ranges[0]
    bad = rng.random(len(group.value)) < 0.1
    value = group.value + np.where(bad, rng.uniform(30, 200, len(bad)), 0)
    spoilt = replace(graph, ranges=(replace(group, value=value),))
    found = smooth(spoilt, gate_sigma=4.0)
    assert not found.weights[0][bad].any()
    assert found.weights[0][~bad].mean() > 0.98
    assert np.abs(found.x - clean.x).max() < 2.0
    assert np.abs(smooth(spoilt).x - clean.x).max() > 10.0


@pytest.mark.parametrize("bend", [0.0, 0.6])
def test_a_node_on_either_side_of_a_track_is_found_or_the_doubt_is_reported(bend):
    """Ranges to a node of unknown position, started on the wrong side: a bent track decides, a straight one cannot."""
    rng = np.random.default_rng(3)
    poses, d = 40, 2
    along = np.arange(poses) * 10.0
    truth = np.stack([along, bend * 150 * np.sin(along / 120)], -1)
    node = np.array([180.0, 120.0])
    idx = np.arange(poses * d).reshape(poses, d)
    z = np.diff(truth, axis=0) + rng.normal(size=(poses - 1, 2)) * 0.1
    reference = np.concatenate([np.concatenate([truth[:1], truth[0] + np.cumsum(z, 0)]).ravel(), [180.0, -120.0]])
    R = np.tile(0.01 * np.eye(2), (poses - 1, 1, 1))
    there = np.array([poses * d, poses * d + 1])
    value = np.linalg.norm(truth - node, axis=1) + rng.normal(size=poses)
    graph = Graph(
        reference,
        poses * d,
        (
            increments(idx[:-1], idx[1:], z, R, reference),
            priors(idx[:1], truth[:1], 0.01 * np.eye(2)[None], reference),
            priors(there[None], np.array([[180.0, -20.0]]), 1e6 * np.eye(2)[None], reference),
        ),
        ranges=(Ranges(idx, np.tile(there, (poses, 1)), value, np.ones(poses)),),
    )
    alone = smooth(graph)
    assert np.linalg.norm(alone.x[there] - node) > 40
    judged = likeliest(graph, starts(graph, [there], reference))
    if bend:
        assert np.linalg.norm(judged.solution.x[there] - node) < 3.0 and judged.rival_m is None
    else:
        assert judged.rival_m is not None and abs(judged.rival_m - 240) < 20


def test_what_nothing_determines_is_an_error_that_says_so():
    graph, _ = random_graph(np.random.default_rng(0))
    with pytest.raises(NotPositiveDefinite):
        smooth(replace(graph, gaussians=graph.gaussians[1:], ranges=()))


def test_an_incremental_solution_ends_where_the_batch_does():
    """The same two-vehicle graph, with a node of uncertain position in the border, fed pose by pose."""
    rng = np.random.default_rng(9)
    graph, facts = random_graph(rng, vehicles=2, poses=80, beacon=True)
    growing = Growing(facts["beacon"])
    beacon = np.array([BORDER, BORDER + 1])
    growing.set(("beacon",), beacon, np.eye(2) / 25.0, np.zeros(2))
    for k in range(160):
        idx = growing.append(graph.reference[2 * k : 2 * k + 2])
        for n, (i, z, R) in enumerate(facts["priors"]):
            if i == k:
                L = np.linalg.inv(R)
                growing.set(("prior", n), idx, L, L @ growing.displacement(idx, z))
        for i, j, z, R in facts["odometry"]:
            if j == k:
                both = np.concatenate([np.arange(2) + 2 * i, idx])
                made = increments(both[None, :2], both[None, 2:], z[None], R[None], growing.reference)
                growing.set(("odometry", k), both, made.matrix[0], made.vector[0])
        for i, j, value, sigma in facts["ranges"]:
            if i == k:
                growing.add_range(idx, beacon if j == 160 else np.arange(2) + 2 * j, value, sigma)
        growing.solve()
    batch = smooth(graph)
    latest = np.arange(316, 320)
    np.testing.assert_allclose(growing.values(latest), batch.x[latest], atol=0.05)
    np.testing.assert_allclose(growing.values(beacon), batch.x[320:], atol=0.05)
    wanted = batch.inverse().blocks(latest[None])[0]
    np.testing.assert_allclose(growing.covariance(latest), wanted, rtol=0.02, atol=0.02 * np.abs(wanted).max())


def long_chain(count: int = 80) -> tuple[Growing, np.ndarray]:
    """A solved incremental chain of SE(2) poses 5 m apart along x, many more unknowns than are solved for each time."""
    growing = Growing(np.empty(0))
    information = np.diag([100.0, 100.0, 1e4])
    poses = [growing.append(np.zeros(3))]
    growing.set(("start",), poses[0], information, np.zeros(3))
    for k in range(1, count):
        poses.append(growing.append(np.array([5.0 * k, 0.0, 0.0])))
        growing.add_between(poses[-2], poses[-1], np.array([5.0, 0.0, 0.0]), information)
        growing.solve()
    return growing, np.array(poses)


def test_a_pose_tied_to_one_long_ago_is_determined_at_once():
    """A sender silent for hundreds of unknowns is heard again: its launch hangs on its last one by odometry alone."""
    growing, poses = long_chain()
    idx = growing.append(np.array([3.0, 1.0, 0.2]))
    growing.add_between(poses[0], idx, np.array([3.0, 1.0, 0.2]), np.diag([4.0, 4.0, 100.0]))
    growing.solve()
    np.testing.assert_allclose(growing.values(idx), [3.0, 1.0, 0.2], atol=1e-6)
    # Covariances of composed relations, W15 eq. (9), with the first pose's own.
    turned = np.array([[1, 0, -1.0], [0, 1, 3.0], [0, 0, 1]])
    expected = turned @ np.diag([0.01, 0.01, 1e-4]) @ turned.T + np.diag([0.25, 0.25, 0.01])
    np.testing.assert_allclose(growing.covariance(idx), expected, rtol=1e-6, atol=1e-9)


def test_a_range_to_a_pose_long_ago_counts_at_once():
    growing, poses = long_chain()
    before = growing.covariance(poses[-1][:2])
    distance = float(np.linalg.norm(growing.values(poses[-1])[:2])) + 1.0
    growing.add_range(poses[-1][:2], poses[0][:2], distance, 0.1)
    growing.solve()
    after = growing.covariance(poses[-1][:2])
    assert after[0, 0] < 0.1 * before[0, 0]
    assert abs(growing.values(poses[-1])[0] - distance) < 0.2
