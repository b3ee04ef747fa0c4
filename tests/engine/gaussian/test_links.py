"""Links against a step-by-step Kalman filter, ours and FilterPy's, on random schedules."""

from __future__ import annotations

from functools import reduce

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.gaussian.forms import Moments, join, to_information, to_moments
from engine.gaussian.links import advance, compose, delta_information, measurement, prediction, update

SCHEDULES = st.tuples(st.integers(0, 2**32 - 1), st.lists(st.sampled_from("pvgb"), min_size=1, max_size=60))


def plant(dt: float, psd: float) -> tuple[np.ndarray, np.ndarray]:
    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt
    block = psd * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return F, np.kron(block, np.eye(2))


def spd(rng: np.random.Generator, n: int, floor: float = 0.05) -> np.ndarray:
    a = rng.normal(size=(n, n))
    return a @ a.T + floor * np.eye(n)


def random_steps(rng: np.random.Generator, kinds: list[str]) -> list[tuple]:
    """Predictions (p), velocity readings (v), fixes (g) and readings of everything (b)."""
    steps: list[tuple] = []
    for kind in kinds:
        if kind == "p":
            steps.append(("predict", *plant(rng.uniform(0.01, 20), rng.uniform(1e-3, 1))))
        else:
            H = {"v": np.eye(4)[2:], "g": np.eye(4)[:2], "b": rng.normal(size=(3, 4))}[kind]
            steps.append(("read", H, spd(rng, len(H)), rng.normal(size=len(H)) * 5))
    return steps


def to_link(step: tuple):
    return prediction(step[1], step[2]) if step[0] == "predict" else measurement(*step[1:])


@settings(deadline=None, max_examples=60)
@given(SCHEDULES)
def test_a_chain_of_links_equals_filterpy_step_by_step(schedule):
    """Links applied one by one, and composed into one, both equal an independent Kalman filter to 1e-9."""
    seed, kinds = schedule
    rng = np.random.default_rng(seed)
    steps = random_steps(rng, kinds)
    start = Moments(rng.normal(size=4), spd(rng, 4))

    judge = KalmanFilter(dim_x=4, dim_z=2)
    judge.x, judge.P = start.mean[:, None].copy(), start.cov.copy()
    ours = start
    for step in steps:
        ours = advance(ours, slice(0, 4), to_link(step))
        if step[0] == "predict":
            judge.predict(F=step[1], Q=step[2])
        else:
            judge.update(step[3][:, None], R=step[2], H=step[1])
    whole = advance(start, slice(0, 4), reduce(compose, map(to_link, steps)))

    scale = np.sqrt(np.diag(judge.P))
    for got in (ours, whole):
        np.testing.assert_allclose(got.mean, judge.x[:, 0], rtol=1e-9, atol=1e-9 * (scale.max() + abs(judge.x).max()))
        np.testing.assert_allclose(
            got.cov / np.outer(scale, scale), judge.P / np.outer(scale, scale), rtol=0, atol=1e-9
        )
        np.linalg.cholesky(got.cov)
        np.testing.assert_array_equal(got.cov, got.cov.T)


@settings(deadline=None, max_examples=40)
@given(SCHEDULES)
def test_composition_is_associative(schedule):
    seed, kinds = schedule
    rng = np.random.default_rng(seed)
    links = [to_link(s) for s in random_steps(rng, [*kinds, "v", "p", "g"])]
    left = reduce(compose, links)
    right = reduce(lambda later, earlier: compose(earlier, later), reversed(links[:-1]), links[-1])
    for name in ("A", "b", "C", "eta", "J"):
        a, b = getattr(left, name), getattr(right, name)
        np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-9 * max(1.0, np.abs(b).max()))


def test_a_link_moves_only_its_own_block_but_informs_the_correlated_rest():
    """A fix of one vehicle sharpens another that is correlated with it (W11 appendix, first closed form)."""
    sigma_a, sigma_b, rho, sigma_r = 3.0, 2.0, 0.6, 1.5
    P = np.array([[sigma_a**2, rho * sigma_a * sigma_b], [rho * sigma_a * sigma_b, sigma_b**2]])
    after = update(Moments(np.zeros(2), P), slice(0, 1), np.array([4.0 / sigma_r**2]), np.array([[1 / sigma_r**2]]))
    shrink = 1 - sigma_a**2 / (sigma_a**2 + sigma_r**2)
    expected = np.array(
        [
            [sigma_a**2 * shrink, P[0, 1] * shrink],
            [P[0, 1] * shrink, sigma_b**2 * (1 - rho**2 * sigma_a**2 / (sigma_a**2 + sigma_r**2))],
        ]
    )
    np.testing.assert_allclose(after.cov, expected, rtol=1e-12)


def test_delta_information_adds_to_the_start_as_the_link_says():
    """Start information plus a link's delta is the joint of start and end: W12 eq. (1)."""
    rng = np.random.default_rng(5)
    start = Moments(rng.normal(size=4), spd(rng, 4))
    link = reduce(compose, [to_link(s) for s in random_steps(rng, list("pvpgpvp"))])
    delta = delta_information(link)
    info = to_information(start)
    matrix, vector = delta.matrix.copy(), delta.vector.copy()
    matrix[4:, 4:] += info.matrix
    vector[4:] += info.vector
    both = to_moments(type(info)(vector, matrix))
    end = advance(start, slice(0, 4), link)
    np.testing.assert_allclose(both.mean[:4], end.mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(both.cov[:4, :4], end.cov, rtol=1e-8, atol=1e-10)


def test_trials_are_independent_rows_of_one_computation():
    rng = np.random.default_rng(8)
    F, Q = plant(2.0, 0.1)
    H, R = np.eye(4)[2:], spd(rng, 2)
    z = rng.normal(size=(5, 2))
    start = Moments(rng.normal(size=(5, 4)), np.stack([spd(rng, 4) for _ in range(5)]))
    together = advance(start, slice(0, 4), compose(prediction(F[None], Q[None]), measurement(H, R, z)))
    for t in range(5):
        alone = advance(
            Moments(start.mean[t], start.cov[t]), slice(0, 4), compose(prediction(F, Q), measurement(H, R, z[t]))
        )
        np.testing.assert_allclose(together.mean[t], alone.mean, rtol=1e-12)
        np.testing.assert_allclose(together.cov[t], alone.cov, rtol=1e-12)


def test_joining_is_independence():
    a, b = Moments(np.ones(2), np.eye(2)), Moments(np.zeros(3), 2 * np.eye(3))
    both = join(a, b)
    assert both.mean.tolist() == [1, 1, 0, 0, 0]
    assert np.all(both.cov[:2, 2:] == 0)


def test_information_of_a_singular_covariance_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        to_information(Moments(np.zeros(2), np.zeros((2, 2))))
