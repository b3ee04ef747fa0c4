"""Fusion rules against the paper's figures, Monte Carlo, Stone Soup and laws that hold for all inputs."""

from __future__ import annotations

import datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.types.detection import GaussianDetection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.updater.chernoff import ChernoffUpdater

from engine.tracking import recursion, simulate, steady
from engine.tracking.covariance_intersection import covariance_intersection
from engine.tracking.model import Model, make
from engine.tracking.rules import RULES

#: Steady states of RC Fig. 6, by (Q, R1, R2): believed and actual variance of the naive, then the others.
STEADY = {
    (10, 10, 15): {"single": 6.180340, "central": 4.219544, "df": 4.780442, "naive": (3.135529, 5.074373)},
    (1, 10, 20): {"single": 2.701562, "central": 2.129956, "df": 2.428719, "naive": (0.788475, 3.912300)},
}


def spd(rng: np.random.Generator, n: int) -> np.ndarray:
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.05 * np.eye(n)


def central_steady(model: Model) -> float:
    P = model.prior
    for _ in range(500):
        P = recursion.central(model, P)
    return float(P[0, 0])


def test_one_step_of_figure_3():
    """P = Q = R1 = 10, R2 = 15: weight 0.4, single 6.666667, central 4.615385, distributed 5.142857."""
    model = make(10.0, [10.0, 15.0], 10.0)
    fused = recursion.history(model, RULES["distributed_fusion"], 1)[1]
    seen, _ = recursion.observe(model, recursion.predict(model, recursion.start(model)))
    weights = RULES["distributed_fusion"](seen.believed, seen.actual).weights
    assert weights[1, 0, 0] == pytest.approx(0.4, rel=1e-6)
    assert fused.actual_of(0)[0, 0] == pytest.approx(5.142857, rel=1e-6)
    assert recursion.history(model, None, 1)[1].actual_of(0)[0, 0] == pytest.approx(6.666667, rel=1e-6)
    assert recursion.central(model, model.prior)[0, 0] == pytest.approx(4.615385, rel=1e-6)


@pytest.mark.parametrize("point", STEADY)
def test_steady_states_of_figure_6(point):
    q, r1, r2 = point
    model, told = make(float(q), [float(r1), float(r2)], 10.0), STEADY[point]
    naive, settled = steady.settle(model, RULES["naive_fusion"])
    assert settled.all()
    assert naive.believed[0, 0, 0] == pytest.approx(told["naive"][0], rel=1e-6)
    assert naive.actual_of(0)[0, 0] == pytest.approx(told["naive"][1], rel=1e-6)
    optimal, _ = steady.settle(model, RULES["distributed_fusion"])
    assert optimal.actual_of(1)[0, 0] == pytest.approx(told["df"], rel=1e-6)
    assert steady.settle(model, None)[0].actual_of(0)[0, 0] == pytest.approx(told["single"], rel=1e-6)
    assert central_steady(model) == pytest.approx(told["central"], rel=1e-6)


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("name", [None, *RULES])
def test_monte_carlo_stays_in_its_interval_of_the_closed_form(name, n):
    """10,000 trials, three sensors: the mean square error at the last step, per component, at 99.9 %."""
    rng = np.random.default_rng(7)
    model = make(spd(rng, n), [spd(rng, n) for _ in range(3)], spd(rng, n), transition=np.eye(n) * 0.95)
    rule = RULES[name] if name else None
    draws = simulate.draw(model, 6, 10_000, rng)
    told = recursion.history(model, rule, 6)[-1]
    errors = simulate.estimate(model, draws, rule).mean[:, -1] - draws.target[:, -1, None]
    low, high = chi2.ppf([0.0005, 0.9995], 10_000) / 10_000
    for node in range(3):
        ratio = (errors[:, node] ** 2).mean(axis=0) / np.diag(told.actual_of(node))
        assert np.all((ratio > low) & (ratio < high)), ratio


def test_the_central_filter_is_what_the_trials_say():
    rng = np.random.default_rng(8)
    model = make(spd(rng, 2), [spd(rng, 2), spd(rng, 2)], spd(rng, 2))
    draws = simulate.draw(model, 5, 10_000, rng)
    errors = simulate.estimate_centrally(model, draws).mean[:, -1, 0] - draws.target[:, -1]
    P = model.prior
    for _ in range(5):
        P = recursion.central(model, P)
    low, high = chi2.ppf([0.0005, 0.9995], 10_000) / 10_000
    ratio = (errors**2).mean(axis=0) / np.diag(P)
    assert np.all((ratio > low) & (ratio < high))


@settings(deadline=None, max_examples=100)
@given(st.floats(0.01, 100), st.floats(0.01, 100), st.floats(0.01, 100), st.floats(0.01, 100))
def test_in_one_dimension_state_vector_fusion_is_the_optimal_distributed_fusion(q, r1, r2, p):
    """With the weight of RC eq. 8, R1 / (R1 + R2), whatever the prior."""
    model = make(q, [r1, r2], p)
    one, two = (recursion.history(model, RULES[name], 4)[-1] for name in ("state_vector_fusion", "distributed_fusion"))
    np.testing.assert_allclose(one.actual, two.actual, rtol=1e-9)
    seen, _ = recursion.observe(model, recursion.predict(model, recursion.start(model)))
    weight = RULES["distributed_fusion"](seen.believed, seen.actual).weights[1, 0, 0]
    assert weight == pytest.approx(r1 / (r1 + r2), rel=1e-6)


@settings(deadline=None, max_examples=1000)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_covariance_intersection_is_never_overconfident_whatever_the_correlation(seed, n):
    """For any joint covariance of two errors, CI's believed covariance minus the actual one is not negative."""
    rng = np.random.default_rng(seed)
    joint = spd(rng, 2 * n)
    actual = joint.reshape(2, n, 2, n)
    believed = np.stack([joint[:n, :n], joint[n:, n:]])
    fused = covariance_intersection(believed, actual)
    so = np.einsum("aij,ajbk,blk->il", fused.weights, actual, fused.weights)
    assert np.linalg.eigvalsh(fused.believed - so).min() > -1e-9 * np.linalg.eigvalsh(so).max()
    np.testing.assert_allclose(fused.weights.sum(axis=0), np.eye(n), atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3), st.integers(2, 4), st.sampled_from(sorted(RULES)))
def test_no_rule_but_the_naive_is_overconfident_in_closed_loop(seed, n, nodes, name):
    """Random models, ten rounds: every rule's believed covariance covers the actual one; the naive's never does."""
    rng = np.random.default_rng(seed)
    model = make(spd(rng, n), [spd(rng, n) for _ in range(nodes)], spd(rng, n))
    last = recursion.history(model, RULES[name], 10)[-1]
    gap = np.linalg.eigvalsh(last.believed[0] - last.actual_of(0))
    scale = np.linalg.eigvalsh(last.actual_of(0)).max()
    if name == "naive_fusion":
        assert gap.min() < -1e-9 * scale
        assert np.linalg.det(last.believed[0]) < np.linalg.det(last.actual_of(0))
    else:
        assert gap.min() > -1e-8 * scale
    sound = np.linalg.eigvalsh(last.actual.reshape(nodes * n, nodes * n)).min()
    assert sound > -1e-8 * scale


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(2, 3))
def test_optimal_fusions_lie_between_the_central_filter_and_a_single_sensor(seed, nodes):
    rng = np.random.default_rng(seed)
    model = make(spd(rng, 2), [spd(rng, 2) for _ in range(nodes)], spd(rng, 2))
    P = recursion.central(model, model.prior)
    alone = recursion.history(model, None, 1)[1]
    vector, scalar, ci = (
        np.linalg.det(recursion.history(model, RULES[name], 1)[1].actual_of(0))
        for name in ("state_vector_fusion", "distributed_fusion", "covariance_intersection")
    )
    best = min(np.linalg.det(alone.actual_of(i)) for i in range(nodes))
    assert np.linalg.det(P) * (1 - 1e-9) <= vector <= scalar * (1 + 1e-9)
    assert scalar <= best * (1 + 1e-9) and vector <= ci * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_covariance_intersection_agrees_with_stone_soups_chernoff_updater(seed):
    """The same omega in Stone Soup, which weights the detection (our second track) by it, gives the same posterior."""
    rng = np.random.default_rng(seed)
    # Crossed ellipses, so that the best omega is not at an end, where Stone Soup divides by zero.
    P1, P2 = np.diag([9.0, 1.0]) + 0.3 * spd(rng, 2), np.diag([1.0, 6.0]) + 0.3 * spd(rng, 2)
    x1, x2 = rng.normal(size=(2, 2))
    fused = covariance_intersection(np.stack([P1, P2]), np.zeros((2, 2, 2, 2)))
    ours = fused.weights[0] @ x1 + fused.weights[1] @ x2
    omega_of_second = np.linalg.solve(fused.believed @ np.linalg.inv(P2), fused.weights[1])[0, 0]
    model = LinearGaussian(ndim_state=2, mapping=(0, 1), noise_covar=P2)
    now = datetime.datetime(2026, 1, 1)
    updater = ChernoffUpdater(measurement_model=model, omega=float(omega_of_second))
    prediction = GaussianStatePrediction(x1[:, None], P1, timestamp=now)
    detection = GaussianDetection(x2[:, None], P2, timestamp=now, measurement_model=model)
    hypothesis = SingleHypothesis(prediction, detection)
    posterior = updater.update(hypothesis)
    np.testing.assert_allclose(np.asarray(posterior.covar, float), fused.believed, rtol=1e-6)
    np.testing.assert_allclose(np.asarray(posterior.state_vector, float)[:, 0], ours, rtol=1e-6, atol=1e-9)


def test_estimates_are_fused_only_when_they_arrive():
    """Who hears nobody keeps its own estimate; who hears somebody fuses; SVF stays consistent through the misses."""
    rng = np.random.default_rng(3)
    model = make(np.eye(2), [np.eye(2) * 4, np.eye(2) * 9], np.eye(2))
    trials, steps = 4000, 8
    heard = rng.random((trials, steps, 2, 2)) < 0.4
    draws = simulate.draw(model, steps, trials, rng)
    answer = simulate.estimate(model, draws, RULES["state_vector_fusion"], heard)
    errors = answer.mean[:, -1, 0] - draws.target[:, -1]
    nees = np.einsum("ti,tij,tj->t", errors, np.linalg.inv(answer.believed[:, -1, 0]), errors)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * trials) / trials
    assert low < nees.mean() < high
    nothing = simulate.estimate(model, draws, RULES["naive_fusion"], np.zeros((trials, steps, 2, 2), bool))
    alone = simulate.estimate(model, draws, None)
    np.testing.assert_allclose(nothing.mean, alone.mean, rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1.0, [1.0], 1.0), "sensors: 1 given"),
        ((1.0, [1.0, -1.0], 1.0), r"sensors\[1\]: is not positive definite"),
        ((1.0, [1.0, 0.0], 1.0), r"sensors\[1\]: is not positive definite"),
        ((-1.0, [1.0, 1.0], 1.0), "process: is negative"),
        ((1.0, [1.0, np.nan], 1.0), r"sensors\[1\]: has entries that are not finite"),
        ((np.eye(2), [np.eye(2), [[1, 2], [0, 1]]], np.eye(2)), r"sensors\[1\]: is not symmetric"),
        ((np.eye(2), [np.eye(2), np.eye(3)], np.eye(2)), r"sensors\[1\]: noise 3 x 3"),
        ((np.eye(2), [np.eye(2), np.ones((2, 2))], np.eye(2)), r"sensors\[1\]: is not positive definite"),
        ((1.0, [np.eye(2), np.eye(2)], np.eye(2)), "process: 1 x 1, but the prior is 2 x 2"),
        ((1.0, [1.0, 1.0], np.ones((2, 3))), "prior: a covariance is square"),
    ],
)
def test_covariances_that_are_none_are_refused_by_name(arguments, words):
    with pytest.raises(ValueError, match=words):
        make(*arguments)


def test_sensors_of_parts_of_the_state_fuse_to_the_whole():
    """Two nodes, each seeing one of two components: the central filter's covariance by the information form."""
    model = make(np.eye(2), [1.0, 2.0], np.eye(2), observations=[np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])])
    P = recursion.central(model, model.prior)
    np.testing.assert_allclose(np.linalg.inv(P), np.eye(2) / 2 + np.diag([1.0, 0.5]), rtol=1e-12)
