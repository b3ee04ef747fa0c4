"""Steady states against the recursion run for long, closed forms, and SciPy's Riccati solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from engine.tracking import recursion, steady
from engine.tracking.model import make
from engine.tracking.rules import RULES

#: Constant velocity over 1 s, position seen.
F = np.array([[1.0, 1.0], [0.0, 1.0]])
Q = 0.1 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
SEES = np.array([[1.0, 0.0]])


def spd(rng: np.random.Generator, n: int) -> np.ndarray:
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.05 * np.eye(n)


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("name", [None, *RULES])
def test_the_steady_state_is_the_recursion_run_for_long(name, n):
    rng = np.random.default_rng(n)
    model = make(spd(rng, n), [spd(rng, n) for _ in range(3)], spd(rng, n), transition=0.9 * np.eye(n))
    rule = RULES[name] if name else None
    nodes, settled = steady.settle(model, rule)
    ran = recursion.history(model, rule, 400)[-1]
    assert settled
    scale = np.abs(ran.actual).max()
    np.testing.assert_allclose(nodes.believed, ran.believed, rtol=1e-8, atol=1e-8 * scale)
    np.testing.assert_allclose(nodes.actual, ran.actual, rtol=1e-8, atol=1e-8 * scale)


def test_a_single_sensor_and_the_central_filter_solve_the_riccati_equation():
    """A target of constant velocity, its position seen, against SciPy's solver."""
    R = [4.0, 9.0]
    model = make(Q, R, np.eye(2), transition=F, observations=[SEES, SEES])
    alone, settled = steady.settle(model, None)
    central, centrally = steady.settle_centrally(model)
    assert settled and centrally
    both = np.vstack([SEES, SEES])
    for P, H, noise in (
        (alone.actual_of(0), SEES, np.diag(R[:1])),
        (alone.actual_of(1), SEES, np.diag(R[1:])),
        (central, both, np.diag(R)),
    ):
        predicted = solve_discrete_are(F.T, H.T, Q, noise)
        updated = np.linalg.inv(np.linalg.inv(predicted) + H.T @ np.linalg.inv(noise) @ H)
        np.testing.assert_allclose(P, updated, rtol=1e-8)


@pytest.mark.parametrize("ratio", [1e-10, 1e-6, 1.0, 1e6])
def test_slow_targets_settle_as_surely_as_restless_ones(ratio):
    """RC eq. (5) and the naive's quadratic, over sixteen decades of Q / R, where iteration would need 1e5 rounds."""
    R1, R2 = 10.0, 20.0
    process = ratio * R1
    model = make(process, [R1, R2], 10.0)

    def single(R: float) -> float:
        return 2 * process * R / (process + np.sqrt(process**2 + 4 * process * R))

    assert steady.settle(model, None)[0].actual_of(0)[0, 0] == pytest.approx(single(R1), rel=1e-6)
    assert steady.settle_centrally(model)[0][0, 0] == pytest.approx(single(R1 * R2 / (R1 + R2)), rel=1e-6)
    naive, settled = steady.settle(model, RULES["naive_fusion"])
    P = naive.believed[0, 0, 0]
    assert settled
    assert pytest.approx(1 / R1 + 1 / R2 + 2 / (P + process), rel=1e-9) == 1 / P


def test_a_target_that_never_moves_has_no_steady_state():
    """Everybody's covariance shrinks for ever."""
    model = make(0.0, [10.0, 20.0], 10.0)
    for rule in (None, *RULES.values()):
        assert not steady.settle(model, rule)[1]


def test_naive_fusion_of_a_moving_target_can_grow_without_bound():
    """Too sure of itself, it stops listening: the errors of a target that drifts apart from it are not corrected."""
    model = make(1e-4 * np.eye(2), [10.0, 10.0], np.eye(2), transition=1.05 * F, observations=[SEES, SEES])
    alone, single = steady.settle(model, None)
    _, settled = steady.settle(model, RULES["naive_fusion"])
    ran = recursion.history(model, RULES["naive_fusion"], 400)
    assert single and not settled
    assert np.trace(ran[-1].actual_of(0)) > 1e3 * np.trace(alone.actual_of(0))
    assert np.trace(ran[-1].actual_of(0)) > 2 * np.trace(ran[-20].actual_of(0))


def test_a_map_is_its_cells_one_by_one():
    R = np.array([1.0, 5.0, 400.0])[:, None, None] * np.eye(2)
    turned = np.array([[4.0, 1.0], [1.0, 2.0]])
    whole = steady.settle(make(np.eye(2), [R, turned], np.eye(2)), RULES["covariance_intersection"])[0]
    for i in range(3):
        cell = steady.settle(make(np.eye(2), [R[i], turned], np.eye(2)), RULES["covariance_intersection"])[0]
        np.testing.assert_allclose(whole.actual[i], cell.actual, rtol=1e-8)


def test_equal_crossed_sensors_make_distributed_fusion_take_turns():
    """Two weights of equal volume: one number for both components prefers one sensor now and the other next."""
    R = np.diag([0.05, 0.05 / 9])
    c, s = np.cos(1.0), np.sin(1.0)
    turn = np.array([[c, -s], [s, c]])
    model = make(np.eye(2), [R, turn @ R @ turn.T], np.eye(2))
    rule = RULES["distributed_fusion"]
    assert not steady.settle(model, rule)[1]
    third, second, last = (nodes.believed[0] for nodes in recursion.history(model, rule, 300)[-3:])
    np.testing.assert_allclose(last, third, rtol=1e-6)
    assert np.abs(last - second).max() > 0.2 * last.max()
    assert steady.settle(model, RULES["state_vector_fusion"])[1]
