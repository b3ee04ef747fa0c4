"""Random graphs of several vehicles, solved by us and by GTSAM."""

from __future__ import annotations

from functools import partial

import gtsam
import numpy as np

from engine.smoothing.composition import oplus
from engine.smoothing.graph import Betweens, Graph, Ranges, increments, priors


def random_graph(rng, vehicles=2, poses=20, dimension=2, range_every=3, prior_every=7, beacon=False):
    """Truth, graph and start of `vehicles` trajectories in the plane or SE(2), numbered in order of time.

    Returns the graph and the facts it was made of, for another solver: {"odometry": (i, j, z, R), "priors": (i, z,
    R), "ranges": (i, j, value, sigma)} with pose numbers k * vehicles + v, and one beacon after all poses.
    """
    d = dimension
    truth = np.zeros((poses, vehicles, d))
    truth[0, :, :2] = rng.uniform(-30, 30, (vehicles, 2)) + np.arange(vehicles)[:, None] * np.array([0.0, 120.0])
    facts = {"odometry": [], "priors": [], "ranges": []}
    reference = np.zeros_like(truth)
    R0 = np.diag([4.0, 4.0, 0.01][:d])
    for v in range(vehicles):
        reference[0, v] = truth[0, v] + rng.multivariate_normal(np.zeros(d), R0)
        facts["priors"].append((v, reference[0, v].copy(), R0))
    for k in range(1, poses):
        for v in range(vehicles):
            step = np.array([6.0, 1.0, 0.1])[:d] + rng.normal(size=d) * np.array([2.0, 2.0, 0.2])[:d]
            truth[k, v] = oplus(truth[k - 1, v], step)
            root = rng.normal(size=(d, d)) * 0.2 * np.array([1, 1, 0.1])[:d, None]
            R = root @ root.T + np.diag([0.02, 0.02, 1e-4][:d])
            z = step + rng.multivariate_normal(np.zeros(d), R)
            reference[k, v] = oplus(reference[k - 1, v], z)
            facts["odometry"].append(((k - 1) * vehicles + v, k * vehicles + v, z, R))
            if k % prior_every == v:
                fix = rng.multivariate_normal(truth[k, v, :2], 4.0 * np.eye(2))
                facts["priors"].append((k * vehicles + v, fix, 4.0 * np.eye(2)))
            if k % range_every == 0:
                other = (v + 1) % vehicles
                here, there = truth[k, v, :2], truth[k - 1, other, :2]
                value = np.linalg.norm(here - there) + rng.normal()
                facts["ranges"].append((k * vehicles + v, (k - 1) * vehicles + other, value, 1.0))
    start = reference.reshape(-1, d)
    if beacon:
        at = np.array([30.0, 80.0])
        facts["beacon"] = at + rng.normal(size=2) * 3
        for k in range(poses):
            value = np.linalg.norm(truth[k, 0, :2] - at) + rng.normal()
            facts["ranges"].append((k * vehicles, poses * vehicles, value, 1.0))
    return assemble(start, facts, d), facts


def assemble(start, facts, d):
    """The same facts as our graph."""
    count = len(start)
    reference = np.concatenate([start.ravel(), facts.get("beacon", np.empty(0))])

    def idx(poses, size):
        return np.asarray(poses)[:, None] * d + np.arange(size)

    gaussians, betweens = [], ()
    for size in (2, 3):
        mine = [p for p in facts["priors"] if len(p[1]) == size]
        if mine:
            i, z, R = (np.array(c) for c in zip(*mine))
            gaussians.append(priors(idx(i, size), z, R, reference))
    i, j, z, R = (np.array(c) for c in zip(*facts["odometry"]))
    if d == 2:
        gaussians.append(increments(idx(i, 2), idx(j, 2), z, R, reference))
    else:
        betweens = (Betweens(idx(i, 3), idx(j, 3), z, np.linalg.inv(R)),)
    i, j, value, sigma = (np.array(c) for c in zip(*facts["ranges"]))
    if "beacon" in facts:
        beacon = np.arange(2)[None] + count * d
        gaussians.append(priors(beacon, facts["beacon"][None], 25.0 * np.eye(2)[None], reference))
    ranges = (Ranges(idx(i, 2), idx(j, 2), value, sigma),)
    return Graph(reference, count * d, tuple(gaussians), betweens, ranges)


def relation_error(z, factor, values, jacobians):
    """W15 eq. (5) as a factor of GTSAM, whose own has the noise in the Lie algebra instead of added to z."""
    first, second = map(values.atPose2, factor.keys())
    h = first.between(second)
    if jacobians is not None:
        jacobians[0] = np.array([[-1.0, 0, h.y()], [0, -1.0, -h.x()], [0, 0, -1.0]])
        jacobians[1] = np.eye(3)
        jacobians[1][:2, :2] = h.rotation().matrix()
    e = np.array([h.x() - z[0], h.y() - z[1], h.theta() - z[2]])
    e[2] = np.arctan2(np.sin(e[2]), np.cos(e[2]))
    return e


def prior_error(z, factor, values, jacobians):
    """An additive belief of a pose as a factor of GTSAM."""
    x = values.atPose2(factor.keys()[0])
    if jacobians is not None:
        jacobians[0] = np.eye(3)
        jacobians[0][:2, :2] = x.rotation().matrix()
    return np.array([x.x() - z[0], x.y() - z[1], x.theta() - z[2]])


def gtsam_graph(facts, start, d):
    """The same facts in GTSAM, with its start values."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    noise = gtsam.noiseModel.Gaussian.Covariance
    for k, x in enumerate(start):
        values.insert(k, gtsam.Point2(*x) if d == 2 else gtsam.Pose2(*x))
    for i, j, z, R in facts["odometry"]:
        if d == 2:
            graph.add(gtsam.BetweenFactorPoint2(i, j, gtsam.Point2(*z), noise(R)))
        else:
            graph.add(gtsam.CustomFactor(noise(R), [i, j], partial(relation_error, z)))
    for i, z, R in facts["priors"]:
        if d == 2:
            graph.add(gtsam.PriorFactorPoint2(i, gtsam.Point2(*z), noise(R)))
        elif len(z) == 3:
            graph.add(gtsam.CustomFactor(noise(R), [i], partial(prior_error, z)))
        else:
            graph.add(gtsam.PoseTranslationPrior2D(i, gtsam.Pose2(z[0], z[1], 0.0), noise(R)))
    if "beacon" in facts:
        values.insert(len(start), gtsam.Point2(*facts["beacon"]))
        graph.add(gtsam.PriorFactorPoint2(len(start), gtsam.Point2(*facts["beacon"]), noise(25.0 * np.eye(2))))
    for i, j, value, sigma in facts["ranges"]:
        model = gtsam.noiseModel.Isotropic.Sigma(1, sigma)
        if d == 2:
            kind = gtsam.RangeFactor2
        else:
            kind = gtsam.RangeFactor2D if j == len(start) else gtsam.RangeFactorPose2
        graph.add(kind(i, j, float(value), model))
    return graph, values


def gtsam_solution(facts, start, d):
    """Positions and their marginal covariances in the world frame from GTSAM: {pose number: ((2,), (2, 2))}."""
    graph, values = gtsam_graph(facts, start, d)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-15)
    parameters.setAbsoluteErrorTol(1e-15)
    parameters.setMaxIterations(200)
    result = gtsam.LevenbergMarquardtOptimizer(graph, values, parameters).optimize()
    polish = gtsam.GaussNewtonParams()
    polish.setRelativeErrorTol(0.0)
    polish.setAbsoluteErrorTol(0.0)
    polish.setMaxIterations(60)
    result = gtsam.GaussNewtonOptimizer(graph, result, polish).optimize()
    marginals = gtsam.Marginals(graph, result)
    found = {}
    for k in range(len(start)):
        cov = marginals.marginalCovariance(k)
        if d == 2:
            found[k] = (np.asarray(result.atPoint2(k)), cov)
        else:
            pose = result.atPose2(k)
            T = pose.rotation().matrix()
            found[k] = (np.array([pose.x(), pose.y()]), T @ cov[:2, :2] @ T.T)
    return found
