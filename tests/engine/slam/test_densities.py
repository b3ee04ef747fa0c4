"""Kernel densities and their products against exact mixtures."""

from __future__ import annotations

from itertools import product as combinations

import numpy as np
import pytest

from engine.slam.densities import Kde, contour_levels, fit, from_gaussian
from engine.slam.products import product


def exact_product(factors: list[Kde]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (M,), means (M, d) and variances (M, d) of the product of mixtures, every combination multiplied out."""
    weights, means, variances = [], [], []
    for labels in combinations(*(range(len(f.points)) for f in factors)):
        mean, var, log = factors[0].points[labels[0]], np.square(factors[0].bandwidth), 0.0
        for f, label in zip(factors[1:], labels[1:], strict=True):
            v = np.square(f.bandwidth)
            log += -0.5 * (np.square(mean - f.points[label]) / (var + v) + np.log(var + v)).sum()
            mean = (mean / var + f.points[label] / v) / (1 / var + 1 / v)
            var = 1 / (1 / var + 1 / v)
        weights.append(log)
        means.append(mean)
        variances.append(var)
    w = np.exp(np.array(weights) - max(weights))
    return w / w.sum(), np.array(means), np.array(variances)


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("dim", [1, 2])
def test_draws_from_a_product_have_the_exact_mixtures_distribution(count: int, dim: int):
    rng = np.random.default_rng(10 * count + dim)
    factors = [Kde(rng.normal(scale=2.0, size=(6, dim)), rng.uniform(0.6, 1.2, dim)) for _ in range(count)]
    weights, means, variances = exact_product(factors)
    mean = weights @ means
    cov = weights @ (variances + np.square(means - mean))
    drawn = product(factors, 8000, rng)
    assert (np.abs(drawn.mean(0) - mean) < 0.1 * np.sqrt(cov)).all()
    np.testing.assert_allclose(drawn.var(0), cov, rtol=0.12)
    edges = np.linspace(mean[0] - 4 * cov[0] ** 0.5, mean[0] + 4 * cov[0] ** 0.5, 25)
    middle = 0.5 * (edges[1:] + edges[:-1])
    normal = np.exp(-0.5 * np.square(middle[:, None] - means[:, 0]) / variances[:, 0]) / np.sqrt(variances[:, 0])
    true = (normal * weights).sum(1)
    found = np.histogram(drawn[:, 0], edges)[0]
    assert 0.5 * np.abs(found / found.sum() - true / true.sum()).sum() < 0.08


def test_two_modes_far_apart_are_both_visited():
    """What fine labels alone cannot do: kernels of one mode never see the other's."""
    places = np.concatenate([np.full((50, 1), -20.0), np.full((50, 1), 20.0)])
    jitter = np.random.default_rng(0).normal(size=(2, 100, 1))
    drawn = product(
        [Kde(places + jitter[0], np.array([0.5])), Kde(places + jitter[1], np.array([0.5]))],
        2000,
        np.random.default_rng(1),
    )
    assert 0.4 < (drawn > 0).mean() < 0.6
    assert (np.abs(np.abs(drawn) - 20) < 6).all()


def test_the_bandwidth_of_a_gaussian_is_near_the_rule_for_gaussians():
    found = [fit(np.random.default_rng(s).normal(size=(300, 1))).bandwidth[0] for s in range(20)]
    assert np.median(found) == pytest.approx(1.06 * 300**-0.2, rel=0.35)


def test_the_bandwidth_of_two_modes_does_not_grow_with_their_distance():
    rng = np.random.default_rng(3)
    near, far = rng.normal(size=(150, 2)), rng.normal(size=(150, 2)) + [400.0, 0.0]
    assert fit(np.vstack([near, far])).bandwidth.max() < 1.5


def test_a_density_integrates_to_one_and_its_mode_is_the_higher_peak():
    rng = np.random.default_rng(4)
    kde = fit(np.concatenate([rng.normal(-4, 1, (140, 1)), rng.normal(5, 1, (60, 1))]))
    x = np.linspace(-15, 15, 3001)[:, None]
    assert np.trapezoid(np.exp(kde.log_density(x)), x[:, 0]) == pytest.approx(1.0, abs=1e-3)
    assert kde.mode[0] == pytest.approx(-4, abs=0.8)


def test_the_divergence_tells_two_modes_from_one():
    rng = np.random.default_rng(5)
    one = rng.normal(size=(300, 2))
    two = one + np.where(rng.random(300) < 0.5, -6, 6)[:, None]
    assert from_gaussian(fit(one), rng) < 0.15 < 0.4 < from_gaussian(fit(two), rng)


def test_contours_hold_the_masses_they_name():
    rng = np.random.default_rng(6)
    kde = fit(rng.normal(size=(800, 2)))
    levels = contour_levels(kde)
    at = kde.sample(4000, rng)
    held = [(np.exp(kde.log_density(at)) > level).mean() for level in levels]
    np.testing.assert_allclose(held, [0.2, 0.4, 0.6, 0.8], atol=0.06)


def test_an_angle_on_both_sides_of_the_cut_is_one_mode():
    angles = np.random.default_rng(7).normal(np.pi, 0.1, (200, 1))
    kde = fit((angles + np.pi) % (2 * np.pi) - np.pi, angles=(0,))
    assert abs(abs(kde.mode[0]) - np.pi) < 0.1


def test_kernels_that_fell_into_two_places_can_be_compared_with_a_gaussian():
    rng = np.random.default_rng(8)
    for _ in range(50):
        points = np.tile(rng.uniform(-100, 100, 2), (100, 1))
        points[: rng.integers(30, 70)] += rng.uniform(-30, 30, 2)
        assert 0.0 < from_gaussian(fit(points), rng) < np.inf
    assert from_gaussian(fit(np.tile([12.3, -4.7], (100, 1))), rng) < 0.1, "one place"
