"""A window of poses: exact for linear graphs, near the whole solution for ranges, and of bounded size."""

from __future__ import annotations

import numpy as np
import pytest

from engine.slam import range_only
from engine.slam.building import growths, name
from engine.slam.graph import Graph
from engine.slam.mission import fly
from engine.slam.solver import Solver
from tests.engine.slam.gaussians import chain, exact
from tests.engine.slam.missions import scenario


def test_the_newest_of_a_chain_are_as_certain_as_with_all_of_it():
    graph = chain(40, np.random.default_rng(1))
    means, covs = exact(graph)
    solver = Solver(4000, 2, lag=5)
    known: set[str] = set()
    for v, kind in graph.kinds.items():
        known.add(v)
        solver.extend({v: kind}, [f for f in graph.factors if v in f.variables and set(f.variables) <= known])
        assert len(solver.graph.kinds) <= 5 and len(solver.graph.factors) <= 6
    drawn = solver.beliefs()
    assert set(drawn) == set(graph.kinds), "what is gone is still told"
    for v in list(graph.kinds)[-5:]:
        assert (np.abs(drawn[v].mean(0) - means[v]) < 5.5 * np.sqrt(np.diag(covs[v]) / 4000)).all()
        np.testing.assert_allclose(np.cov(drawn[v].T), covs[v], atol=0.1 * np.trace(covs[v]))


def test_what_is_told_of_a_pose_that_goes_is_its_filtered_belief():
    graph = chain(12, np.random.default_rng(3))
    solver = Solver(4000, 4, lag=2)
    part = Graph()
    known: set[str] = set()
    then = {}
    for v, kind in graph.kinds.items():
        known.add(v)
        new = [f for f in graph.factors if v in f.variables and set(f.variables) <= known]
        part.add({v: kind}, new)
        solver.extend({v: kind}, new)
        then |= {u: moments[u] for moments in [exact(part)[0]] for u in solver._past.keys() - then.keys()}
    drawn = solver.beliefs()
    for v, mean in then.items():
        np.testing.assert_allclose(drawn[v].mean(0), mean, atol=0.15)


def test_ranges_find_the_beacon_through_a_window():
    flown = fly(scenario(duration_s=149.0, ranging={"count": 30}), [0])
    log = flown.log(0)
    found, sizes = {}, []
    for lag in (None, 30):
        solver = Solver(100, 5, lag=lag)
        for growth in growths(log, range_only.PLAN, flown.time_s, 0.0):
            solver.extend(growth.kinds, growth.factors)
            sizes.append(len(solver.graph.kinds))
        found[lag] = solver.beliefs()
    assert max(sizes[len(sizes) // 2 :]) <= 31, "thirty poses and the beacon"
    assert set(found[30]) == set(found[None])
    truth = flown.truth["beacon"][0, -1]
    for beliefs in found.values():
        spread = beliefs["beacon"].std(0)
        assert (np.abs(beliefs["beacon"].mean(0) - truth) < 4 * spread + 0.3).all() and spread.max() < 2
    last = name(log.poses - 1)
    assert np.linalg.norm(found[30][last].mean(0) - found[None][last].mean(0)) < 0.5


def test_a_window_of_one_is_refused():
    with pytest.raises(ValueError, match="at least 2"):
        Solver(lag=1)
