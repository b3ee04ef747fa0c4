import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from engine.acoustics.density import draw, floored


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
        drawn = draw(np.tile(row, (4000, 1)), rng)
        assert kstest(np.interp(drawn, edges, [0.0, *np.cumsum(row)]), "uniform").pvalue > 1e-3


def test_each_row_is_drawn_from_its_own_density():
    assert np.all(np.abs(draw(np.eye(7), np.random.default_rng(2)) - np.arange(7)) <= 0.5)
