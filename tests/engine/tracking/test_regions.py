"""The maps against the paper's inequality, the recursions, and each other."""

from __future__ import annotations

import numpy as np
import pytest

from engine.tracking import analysis, regions, steady
from engine.tracking.model import make
from engine.tracking.rules import RULES

GRID = np.geomspace(0.05, 60, 400)


def test_equation_18_is_the_map_on_every_cell():
    """The printed inequality, for r1 <= r2, on a grid of 400 x 400; its boundary has no cell on it."""
    r1, r2 = GRID[:, None], GRID[None, :]
    low, high = np.minimum(r1, r2), np.maximum(r1, r2)
    printed = (high > 1) & (low + high + 3 * low * high <= high**2)
    np.testing.assert_array_equal(regions.one_step(r1, r2).dangerous, printed)


def test_the_boundaries_divide_the_maps():
    r1 = np.geomspace(0.1, 20, 25)
    for boundary, figures in (
        (regions.one_step_boundary, regions.one_step),
        (regions.asymptotic_boundary, regions.asymptotic),
    ):
        edge = boundary(r1)
        inside = edge > r1 * (1 + 1e-6)
        assert inside.sum() > 10
        assert not figures(r1, edge * (1 - 1e-6)).dangerous[inside].any()
        assert figures(r1, edge * (1 + 1e-6)).dangerous.all()


@pytest.mark.parametrize("r", [(1.0, 1.5), (10.0, 20.0), (0.2, 7.0), (5.0, 5.0)])
def test_the_asymptotic_map_is_the_recursion_run_to_its_end(r):
    model = make(1.0, list(r), 1.0)
    told = regions.asymptotic(*r)
    naive = steady.settle(model, RULES["naive_fusion"])[0]
    assert told.naive == pytest.approx(naive.actual_of(0)[0, 0], rel=1e-9)
    assert told.naive_believed == pytest.approx(naive.believed[0, 0, 0], rel=1e-9)
    optimal = steady.settle(model, RULES["state_vector_fusion"])[0]
    assert told.distributed == pytest.approx(optimal.actual_of(0)[0, 0], rel=1e-9)
    alone = steady.settle(model, None)[0]
    assert told.single == pytest.approx(min(alone.actual_of(i)[0, 0] for i in range(2)), rel=1e-9)


def test_the_two_operating_points_of_figure_6_lie_on_their_sides():
    assert not regions.asymptotic(1.0, 1.5).dangerous
    assert regions.asymptotic(10.0, 20.0).dangerous


def test_the_central_filter_is_never_worse_than_the_distributed_one():
    """Fig. 4, whose caption is inverted: CF / DF is at most one, everywhere."""
    figures = regions.one_step(GRID[:, None], GRID[None, :])
    assert np.all(figures.central <= figures.distributed * (1 + 1e-12))
    assert np.all(figures.distributed <= figures.single * (1 + 1e-12))


def test_round_ellipses_are_the_one_dimensional_map_twice():
    r1, r2 = np.array([0.5, 2.0, 8.0]), np.array([3.0, 9.0, 9.0])
    turned = regions.turned(r1, r2, elongation=1.0, angle_rad=0.7)
    flat = regions.asymptotic(r1, r2)
    np.testing.assert_allclose(turned.naive**2, flat.naive, rtol=1e-6)
    np.testing.assert_array_equal(turned.dangerous, flat.dangerous)


def test_crossed_ellipses_make_naive_fusion_safer():
    """Sensors that see along different axes share less: the dangerous region shrinks as they turn apart."""
    r = np.geomspace(0.2, 20, 12)
    shares = [
        regions.turned(r[:, None], r[None], elongation=3.0, angle_rad=a).dangerous.mean() for a in (0.0, np.pi / 2)
    ]
    assert shares[1] < shares[0]
    with pytest.raises(ValueError, match="elongation"):
        regions.turned(r, r, elongation=0.5, angle_rad=0.0)


def test_an_operating_point_is_analysed_from_every_side():
    told = analysis.analyse(1.0, [10.0, 20.0], 10.0, steps=40, trials=4000)
    assert "worse than one sensor alone here, after 3 steps" in told["verdict"]
    assert told["weights"]["optimal_weight"] == pytest.approx(1 / 3)
    assert min(told["weights"]["distributed"]) == pytest.approx(told["weights"]["optimal"], rel=1e-3)
    assert told["steady"]["naive_fusion"]["actual"] == pytest.approx(3.9123, rel=1e-6)
    for history in told["histories"].values():
        inside = [low <= a <= high for (low, high), a in zip(history["monte_carlo_interval"], history["actual"])]
        assert np.mean(inside) > 0.8
    safe = analysis.analyse(10.0, [10.0, 15.0], 10.0, trials=10)
    assert safe["verdict"].startswith("You may")


@pytest.mark.parametrize(
    "wrong", [{"steps": 0}, {"steps": 10**6}, {"trials": 0}, {"trials": 20_000, "steps": 500}, {"sensors": [1.0] * 99}]
)
def test_an_analysis_is_bounded_in_size(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        analysis.analyse(**{"process": 1.0, "sensors": [1.0, 2.0], "prior": 1.0, **wrong})


@pytest.mark.parametrize("r", [(1e-6, 1e6), (1e6, 2e6), (1e-6, 2e-6), (1e5, 2.0)])
def test_the_asymptotic_map_holds_at_its_far_corners(r):
    model = make(1.0, list(r), 1.0)
    told = regions.asymptotic(*r)
    for figure, rule in (("distributed", "distributed_fusion"), ("naive", "naive_fusion")):
        nodes, settled = steady.settle(model, RULES[rule])
        assert settled
        assert getattr(told, figure) == pytest.approx(nodes.actual_of(0)[0, 0], rel=1e-8)
    believed = steady.settle(model, RULES["covariance_intersection"])[0].believed[0, 0, 0]
    assert told.intersection == pytest.approx(believed, rel=1e-8)


def test_a_map_of_many_decades_is_between_central_filter_and_single_sensor_everywhere():
    r = np.geomspace(1e-6, 1e6, 400)
    told = regions.asymptotic(r[:, None], r[None, :])
    assert np.all(told.central <= told.distributed * (1 + 1e-12))
    assert np.all(told.distributed <= told.single * (1 + 1e-12))
    P = told.distributed
    np.testing.assert_allclose(P, regions._distributed(P + 1, r[:, None], r[None, :])[0], rtol=1e-10)


@pytest.mark.parametrize("steps", [1, None])
def test_in_two_dimensions_intersection_costs_and_state_vector_fusion_pays(steps):
    """Central <= state vector fusion <= single; crossed sensors let covariance intersection gain as well."""
    r = np.geomspace(0.2, 20, 8)
    told = regions.turned(r[:, None], r[None], elongation=4.0, angle_rad=np.pi / 2, steps=steps)
    assert np.all(told.central <= told.distributed * (1 + 1e-9))
    assert np.all(told.distributed <= told.single * (1 + 1e-9))
    assert np.all(told.intersection <= told.single * (1 + 1e-9))
    assert np.diagonal(told.intersection / told.single).max() < 0.95
    assert np.all(told.naive_believed < told.naive)
    with pytest.raises(ValueError, match="steps"):
        regions.turned(r, r, elongation=2.0, angle_rad=0.0, steps=3)


@pytest.mark.parametrize("process", [0.0, 1e-9, 1e9])
def test_extreme_targets_are_analysed_too(process):
    told = analysis.analyse(process, [10.0, 20.0], 0.0, steps=5, trials=10)
    assert (told["steady"]["naive_fusion"] is None) == (process == 0)
    assert all(np.isfinite(h["actual"]).all() for h in told["histories"].values())


@pytest.mark.parametrize("kind", ["one_step", "asymptotic"])
def test_a_chart_of_nearly_round_sensors_is_the_one_dimensional_chart(kind):
    axis = np.geomspace(0.1, 40, 20)
    flat = regions.chart(kind, axis)
    turned = regions.chart(kind, axis, elongation=1 + 1e-9, angle_rad=1.0)
    assert flat["dangerous"] == turned["dangerous"]
    for name in flat["ratios"]:
        if name != "intersection_to_single":  # equal sensors are mixed in one dimension only where exactly equal
            np.testing.assert_allclose(flat["ratios"][name], turned["ratios"][name], rtol=1e-4)
    for r1, told, found in zip(axis, flat["boundary"], turned["boundary"]):
        assert (found is None and told > axis[-1]) or found == pytest.approx(max(told, r1), rel=0.02)


def test_a_charts_boundary_divides_its_cells():
    axis = np.geomspace(0.1, 40, 24)
    told = regions.chart("asymptotic", axis, elongation=3.0, angle_rad=0.6)
    dangerous = np.array(told["dangerous"], bool)
    np.testing.assert_array_equal(dangerous, dangerous.T)
    for column, edge in enumerate(told["boundary"]):
        safe = axis[column:][~dangerous[column:, column]]
        assert (edge is None) == (safe.size == axis.size - column)
        if edge is not None:
            assert np.all(dangerous[axis > edge * (1 + 1e-9), column])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("sideways", [1, 2]), "kind"),
        (("one_step", [1]), "axis"),
        (("one_step", [0, 2]), "axis"),
        (("one_step", [2, 1]), "axis"),
        (("one_step", [1, np.inf]), "axis"),
        (("one_step", [1, np.nan]), "axis"),
    ],
)
def test_a_chart_refuses_what_it_cannot_draw(arguments, words):
    with pytest.raises(ValueError, match=words):
        regions.chart(*arguments)
