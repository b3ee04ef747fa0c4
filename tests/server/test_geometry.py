"""Metres to the scene."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.scenes.footage import Track, at
from server.scenes.geometry import (
    CORNERS,
    DASHES,
    SPAN,
    UNSEEN,
    Chart,
    chart,
    compass,
    dashes,
    ellipses,
    essential,
    radius,
    round_length,
    scale_bar,
    segments,
)
from server.scenes.trail import trail

UNIT = Chart((0.0, 0.0), 1.0, 1.0)


@given(st.floats(0.1, 50), st.floats(0.1, 50), st.floats(-0.95, 0.95))
def test_the_ellipse_is_the_95_percent_contour(sx: float, sy: float, rho: float):
    """Every corner has the squared Mahalanobis distance 5.991, the chi-square quantile for two degrees."""
    cov = np.array([[sx * sx, rho * sx * sy], [rho * sx * sy, sy * sy]])
    drawn = ellipses(UNIT, np.array([[3.0, -2.0]]), np.array([[cov[0, 0], cov[0, 1], cov[1, 1]]]), 0.0)
    corners = drawn[0, :, 0, :2] - np.array([3.0, -2.0])
    distance = np.einsum("ki,ij,kj->k", corners, np.linalg.inv(cov), corners)
    np.testing.assert_allclose(distance, 5.991464547107979, rtol=1e-6)
    assert drawn.shape == (1, CORNERS, 2, 3)


@pytest.mark.parametrize("sigma", [1, 2, 3])
def test_an_ellipse_of_some_sigmas_is_that_many_times_as_large(sigma: int):
    ring = ellipses(UNIT, np.zeros((1, 2)), np.array([[4.0, 0.0, 4.0]]), 0.0, radius(sigma))
    np.testing.assert_allclose(np.linalg.norm(ring[0, :, 0, :2], axis=-1), 2.0 * sigma)


def test_the_scale_is_as_long_as_it_says_and_north_is_up():
    where = chart(np.array([[0.0, 0.0], [730.0, 100.0]]), 0.0)
    bar, length_m = scale_bar(where)
    assert length_m == 100
    assert np.ptp(bar[0, :, 0]) == pytest.approx(length_m * where.scale)
    tail, head = compass()[0]
    assert head[0] == tail[0] and head[1] > tail[1]


def test_depths_are_stretched_as_asked():
    points = np.array([[0.0, 0.0], [1000.0, 0.0]])
    assert chart(points, 20.0, stretch=3.0).stretch == 3.0
    assert chart(points, 20.0).stretch == pytest.approx(3.5)


def test_an_ellipse_that_is_not_finite_is_left_out():
    drawn = ellipses(UNIT, np.zeros((3, 2)), np.array([[1.0, 0, 1], [np.nan, 0, 1], [1, 0, np.inf]]), 0.0)
    assert len(drawn) == 1


def test_a_mission_fills_the_scene_and_depth_goes_down():
    where = chart(np.array([[100.0, 0.0], [1100.0, 400.0], [np.nan, 1e9]]), deepest_m=20.0)
    corners = where.place(np.array([[100.0, 0.0], [1100.0, 400.0]]), depth_m=20.0)
    np.testing.assert_allclose(corners[:, 0], [-SPAN / 2, SPAN / 2])
    np.testing.assert_allclose(corners[:, 2], -0.7)
    assert chart(np.zeros((0, 2)), 0.0).scale == SPAN / 1000


def test_segments_leave_gaps_where_nothing_is_known():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [np.nan, 0, 0], [3, 0, 0], [4, 0, 0]])
    assert segments(line).tolist() == [[[0, 0, 0], [1, 0, 0]], [[3, 0, 0], [4, 0, 0]]]


def test_half_of_a_dashed_line_is_drawn_in_dashes_of_one_length():
    line = np.linspace([0.0, 0, 0], [10.0, 0, 0], 801)
    drawn = dashes(line)
    assert len(drawn) == pytest.approx(400, abs=10)
    gaps = np.diff(drawn[:, 0, 0])
    assert np.count_nonzero(gaps > 0.05) == pytest.approx(39, abs=1)
    assert gaps.max() < 0.15 and len(dashes(line[:1])) == 0


def test_a_dash_round_a_corner_turns_with_it():
    drawn = dashes(np.array([[0.0, 0, 0], [0.07, 0, 0], [0.07, 9.0, 0]]))
    np.testing.assert_allclose(drawn[:2], [[[0, 0, 0], [0.07, 0, 0]], [[0.07, 0, 0], [0.07, 0.055, 0]]], atol=1e-12)
    length = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=-1)
    assert length[:2].sum() == pytest.approx(SPAN / 80) and length[2:-1] == pytest.approx(SPAN / 80)
    long = dashes(np.array([[0.0, 0, 0], [1000.0, 0, 0]]))
    assert len(long) == DASHES / 2 and np.ptp(long[..., 0]) == pytest.approx(1000 * (1 - 1 / DASHES))


def away(points: np.ndarray, line: np.ndarray) -> float:
    """The largest distance of any of the points from a line through others."""
    start, way = line[:-1], np.diff(line, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    share = np.clip(((points[:, None] - start) * way).sum(axis=-1) / square, 0.0, 1.0)
    return float(np.linalg.norm(points[:, None] - start - share[..., None] * way, axis=-1).min(axis=1).max())


@given(st.integers(0, 2**32 - 1), st.integers(2, 300), st.floats(1e-4, 0.5))
def test_what_a_line_is_drawn_without_nobody_sees(seed: int, count: int, rough: float):
    line = np.cumsum(np.random.default_rng(seed).normal(0.0, rough, (count, 3)), axis=0)
    needed = essential(line, count)
    assert needed[0] == 0 and needed[-1] == count - 1 and np.all(np.diff(needed) > 0)
    assert away(line, line[needed]) <= UNSEEN * (1 + 1e-9)
    few = essential(line, max(2, len(needed) // 2))
    assert len(few) == max(2, len(needed) // 2) and few[0] == 0 and few[-1] == count - 1
    assert np.isin(few, needed).all()


def test_a_straight_course_needs_its_corners_alone():
    corners = np.array([[0.0, 0, 0], [4, 0, 0], [4, 1, 0], [0, 1, 0]])
    course = np.concatenate([np.linspace(a, b, 100, endpoint=False) for a, b in pairwise(corners)] + [corners[-1:]])
    assert essential(course, 600).tolist() == [0, 100, 200, 300]
    course[150] = np.nan
    assert essential(course, 600).tolist() == [0, 100, 149, 150, 151, 200, 300], "and the ends of a gap"
    assert [essential(course[:n], 600).tolist() for n in range(3)] == [[], [0], [0, 1]]


def test_a_trail_is_cut_off_at_the_moment_and_small_ellipses_have_half_the_corners():
    time_s = np.arange(101.0)
    mean = np.stack([time_s / 10, np.where(time_s < 50, 0.0, (time_s - 50) / 10)], axis=1)
    cov = np.where(time_s < 50, 0.01, 0.25)[:, None] * [1.0, 0.0, 1.0]
    made = trail(UNIT, Track(time_s, {"auv": mean}, {"auv": cov}), "auv", 0.0, 1.0, reports=101, most=(50, 3))
    line, rings = made.until(75.0, np.array([7.5, 2.5, 0.0]))
    np.testing.assert_allclose(line, [[[0, 0, 0], [5, 0, 0]], [[5, 0, 0], [7.5, 2.5, 0]]])
    assert len(rings) == CORNERS // 2 + CORNERS, "the first, small, and the second"
    np.testing.assert_allclose(np.linalg.norm(rings[: CORNERS // 2, 0, :2], axis=-1), 0.1)
    np.testing.assert_allclose(rings[: CORNERS // 2, 1], np.roll(rings[: CORNERS // 2, 0], -1, axis=0), atol=1e-12)
    assert len(made.until(100.0, np.zeros(3))[1]) == CORNERS // 2 + 2 * CORNERS


@pytest.mark.parametrize(("metres", "round_"), [(1.0, 1), (1.9, 1), (4.99, 2), (50, 50), (73, 50), (999, 500)])
def test_grid_cells_are_round_lengths(metres: float, round_: float):
    assert round_length(metres) == pytest.approx(round_)


def test_positions_between_reports_are_interpolated_and_held_at_the_ends():
    time_s, rows = np.array([0.0, 10.0]), np.array([[0.0, 0.0], [10.0, 20.0]])
    assert at(time_s, rows, 5.0).tolist() == [5.0, 10.0]
    assert at(time_s, rows, -1.0).tolist() == [0.0, 0.0]
    assert at(time_s, rows, 99.0).tolist() == [10.0, 20.0]
    assert np.isnan(at(np.zeros(0), np.zeros((0, 2)), 1.0)).all()


def test_a_track_that_a_pane_is_drawn_from_stays_whole_as_estimates_arrive():
    """Panes are drawn in other threads: whatever they hold has a mean and a covariance for each of its times."""
    news = {"time_s": [0.0, 1.0], "mean": {"auv": [[0, 0], [1, None]]}, "cov": {"auv": [[1, 0, 1], [2, 0, 2]]}}
    first = Track().grown(news)
    second = first.grown(news | {"time_s": [2.0, 3.0]})
    for track, rows in ((first, 2), (second, 4)):
        assert len(track.time_s) == len(track.mean["auv"]) == len(track.cov["auv"]) == rows
    np.testing.assert_array_equal(second.mean["auv"][:2], first.mean["auv"])
    np.testing.assert_array_equal(at(second.time_s, second.cov["auv"], 2.5), [1.5, 0, 1.5])
