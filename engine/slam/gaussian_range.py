"""The same ranges for a solver that has one mode: least squares from one guess of each beacon's place."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.slam.bayes_tree import tree
from engine.slam.building import Plan, growths, name
from engine.slam.elimination import order
from engine.slam.factors.factor import Factor
from engine.slam.factors.heard import Heard
from engine.slam.factors.prior import prior
from engine.slam.factors.range import Range, ranging
from engine.slam.graph import Graph
from engine.slam.log import SlamLog, thinned
from engine.slam.mission import SlamMission
from engine.slam.propagation import Points, Propagation, down
from engine.slam.run import Moment, Options, over_trials
from engine.slam.variables import POINT2

#: How little is said of a beacon beforehand, m, and the standard deviation of a strongest peak's range, m.
FAR_M, PEAK_SIGMA_M = 500.0, 0.5
#: Gauss-Newton steps, halved where they do not help, and the step (m) that ends them.
STEPS, HALVINGS, SETTLED_M = 40, 6, 1e-4

PLAN = Plan("ranges")


def solve(log: SlamLog, mission: SlamMission, trial: int) -> Iterator[Moment]:
    """A batch solution after each group of ranges, each begun where the last one ended."""
    options = Options.model_validate(dict(mission.options.get("gaussian_range", {})))
    log = thinned(log, options.measurements)
    rng = np.random.default_rng(np.random.SeedSequence([mission.scenario.seed, trial]))
    graph, points = Graph(), Points()
    everything = list(growths(log, PLAN, mission.time_s, mission.scenario.outlier_share))
    total, done = sum(g.measurements for g in everything), 0
    for growth in everything:
        factors = [_unimodal(f) for f in growth.factors]
        for v, kind in growth.kinds.items():
            if v in mission.beacons:
                heard = next(f for f in factors if isinstance(f, Range) and f.variables[1] == v)
                at = points.values[heard.variables[0]][:, :2] + [[heard.range_m, 0.0]]
                factors.append(prior(v, POINT2, at[0], FAR_M**2 * np.eye(2)))
                points.set(v, at)
                continue
            source = next(f for f in factors if v in f.determined and (len(f.variables) == 1 or f.variables[1] == v))
            values = [points.values.get(u, np.zeros((1, kind.dim))) for u in source.variables]
            points.set(v, source.sample(len(source.variables) - 1, values, np.zeros(1), rng))
        graph.add(growth.kinds, factors)
        done += growth.measurements
        draws = _settle(graph, points, options.kernels, rng)
        beacons = {b: draws[b] for b in mission.beacons if b in draws}
        poses = np.stack([draws[name(k)][:, :2] for k in range(log.poses)]) if done == total else None
        track = np.stack([draws[name(k)][:, :2].mean(0) for k in range(growth.pose + 1)])
        here, share = draws[name(growth.pose)][:, :2], done / total if total else 1.0
        yield Moment(growth.pose, here, track, beacons, share, poses)


def _unimodal(factor: Factor) -> Factor:
    """A range of several peaks as its likeliest one."""
    if not isinstance(factor, Heard):
        return factor
    best = int(np.argmax(factor.log_odds))
    a, b = factor.variables
    return ranging(a, b, float(factor.range_m[best]), max(float(factor.sigma_m[best]), PEAK_SIGMA_M))


def _settle(graph: Graph, points: Points, draws: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Gauss-Newton to a minimum, in which points are left; draws (draws, d) of the Gaussian there."""
    scopes = [f.variables for f in graph.factors]
    grown = tree(scopes, order(list(graph.kinds), scopes))
    propagation, nothing = Propagation(), frozenset[str]()

    def cost() -> float:
        return -sum(float(f.log_density(*(points.values[v] for v in f.variables))[0]) for f in graph.factors)

    now = cost()
    for _ in range(STEPS):
        start = dict(points.values)
        mean = down(graph, grown, propagation.up(graph, grown, points, nothing), nothing, 1, None)
        for halving in range(HALVINGS):
            for v, value in start.items():
                points.set(v, value + 0.5**halving * (mean[v] - value))
            if (new := cost()) <= now:
                break
        else:
            for v, value in start.items():
                points.set(v, value)
            break
        now = new
        if max(np.abs(points.values[v] - start[v]).max() for v in start) < SETTLED_M:
            break
    return down(graph, grown, propagation.up(graph, grown, points, nothing), nothing, draws, rng)


run = over_trials(solve)
