import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from engine.acoustics.density import draw, floored, noise_power


@given(st.lists(st.floats(-10, 1e6), min_size=1, max_size=50), st.floats(0, 0.99))
def test_a_density_sums_to_one_and_is_never_negative(weight, floor):
    density = floored(np.array(weight), floor)
    assert density.shape == (len(weight),)
    assert np.all(density >= 0) and abs(density.sum() - 1) < 1e-9


def test_what_is_below_the_quantile_is_gone_and_the_rest_keeps_its_order():
    weight = np.random.default_rng(0).permutation(100).astype(float)
    density = floored(weight, 0.8)
    np.testing.assert_array_equal(density > 0, weight > 80)
    np.testing.assert_allclose(density[weight > 80], (weight[weight > 80] - 80) / (weight[weight > 80] - 80).sum())


def test_draws_follow_the_density():
    rng = np.random.default_rng(1)
    density = floored(rng.random((3, 40)), 0.5)
    edges = np.arange(41) - 0.5
    for row in density:
        drawn = draw(np.tile(row, (4000, 1)), rng.random(4000))
        assert kstest(np.interp(drawn, edges, [0.0, *np.cumsum(row)]), "uniform").pvalue > 1e-3


def test_quantiles_in_order_give_bins_in_order():
    density = floored(np.random.default_rng(3).random(30), 0.0)
    places = draw(np.tile(density, (100, 1)), np.linspace(0, 0.999, 100))
    assert np.all(np.diff(places) > 0) and places[0] == -0.5


def test_the_noise_is_measured_beside_the_signal():
    rng = np.random.default_rng(4)
    filtered = np.sqrt(0.5 * 3.0) * (rng.normal(size=(200, 4000)) + 1j * rng.normal(size=(200, 4000)))
    filtered[:, 1000:1020] += 100.0
    assert noise_power(filtered).mean() == pytest.approx(3.0, rel=0.02)


def test_each_row_is_drawn_from_its_own_density():
    assert np.all(np.abs(draw(np.eye(7), np.random.default_rng(2).random(7)) - np.arange(7)) <= 0.5)


def test_several_draws_share_a_density():
    density = floored(np.random.default_rng(5).random((6, 30)), 0.2)
    u = np.random.default_rng(6).random((6, 9))
    together = draw(density[:, None], u)
    np.testing.assert_array_equal(together, np.stack([draw(density, column) for column in u.T], axis=-1))
