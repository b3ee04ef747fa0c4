"""Paths are smooth, keep their speed and go where they should."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from engine.mission.routes import lawnmower_corners, route
from engine.scenario.paths import Diamond, Drift, LawnMower, Loiter, Path, Station, Waypoints

LAWN = LawnMower(
    kind="lawnmower", start_m=[10, 20], line_length_m=100, spacing_m=20, lines=4, heading_deg=30, speed_mps=2
)
PATHS: list[Path] = [
    Waypoints(kind="waypoints", points_m=[[0, 0], [100, 0], [100, 80], [-50, 80]], speed_mps=1.5),
    Waypoints(kind="waypoints", points_m=[[0, 0], [60, 0], [30, 50]], speed_mps=1.5, turn_radius_m=5, repeat=True),
    LAWN,
    LAWN.model_copy(update={"turn_radius_m": 10.0, "spacing_m": -20.0}),
    Diamond(kind="diamond", center_m=[5, 5], radius_m=50, radius_y_m=80, speed_mps=1),
    Loiter(kind="loiter", center_m=[5, 5], radius_m=50, speed_mps=1, start_deg=70),
    Loiter(kind="loiter", center_m=[5, 5], radius_m=50, speed_mps=1, clockwise=True),
    Loiter(kind="loiter", center_m=[5, 5], radius_m=80, radius_y_m=20, rotation_deg=25, speed_mps=1.2),
    Loiter(kind="loiter", center_m=[5, 5], radius_m=20, radius_y_m=80, clockwise=True, start_deg=200, speed_mps=1.2),
    Drift(kind="drift", start_m=[3, 4], wander_m=30, velocity_mps=[0.1, -0.2]),
    Station(kind="station", position_m=[7, 8], heading_deg=90),
]


@pytest.mark.parametrize("path", PATHS, ids=lambda p: p.kind)
def test_velocity_is_the_rate_of_position_and_heading_its_direction(path):
    at = route(path, 1, "x")
    t = np.arange(0.05, 900, 0.1)
    h = 1e-4
    motion = at(t)
    rate = (at(t + h).position - at(t - h).position) / (2 * h)
    # In the step over which an open track ends, or a curve begins, the two differ.
    typical = np.quantile(np.linalg.norm(rate - motion.velocity, axis=-1), 0.98)
    assert typical < 1e-3
    speed = np.linalg.norm(motion.velocity, axis=-1, keepdims=True)
    along = np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=-1)
    np.testing.assert_allclose(speed * along, motion.velocity, atol=1e-9)
    assert np.abs(np.diff(motion.position, axis=0)).max() < 1.0
    assert np.abs(np.diff(motion.heading)).max() < 0.5


@pytest.mark.parametrize("path", [p for p in PATHS if hasattr(p, "speed_mps")], ids=lambda p: p.kind)
def test_a_vehicle_keeps_its_speed(path):
    motion = route(path, 1, "x")(np.arange(0, 150, 0.5))
    np.testing.assert_allclose(np.linalg.norm(motion.velocity, axis=-1), path.speed_mps, rtol=1e-12)
    step = np.linalg.norm(np.diff(motion.position, axis=0), axis=-1)
    assert step.max() <= path.speed_mps * 0.5 * (1 + 1e-5)


@example([(0, 0), (0, 1), (1, 0)], 1e-309, False)
@given(
    st.lists(st.tuples(st.integers(-50, 50), st.integers(-50, 50)), min_size=2, max_size=8),
    st.floats(0, 30),
    st.booleans(),
)
def test_any_waypoints_make_a_continuous_track(points, radius, repeat):
    points = [list(map(float, p)) for p in points]
    if all(p == points[0] for p in points):
        return
    path = Waypoints(kind="waypoints", points_m=points, speed_mps=1, turn_radius_m=radius, repeat=repeat)
    motion = route(path, 1, "x")(np.linspace(0, 500, 5001))
    assert np.isfinite(motion.position).all() and np.isfinite(motion.heading).all()
    np.testing.assert_allclose(motion.position[0], points[0], atol=1e-9)
    assert np.linalg.norm(np.diff(motion.position, axis=0), axis=-1).max() <= 0.1 + 1e-6


def test_a_turn_has_the_stated_radius():
    at = route(
        Waypoints(kind="waypoints", points_m=[[0, 0], [100, 0], [100, 100]], speed_mps=2, turn_radius_m=15), 1, "x"
    )
    t = np.arange(0, 60, 0.01)
    heading = at(t).heading
    rate = np.diff(heading) / 0.01
    np.testing.assert_allclose(rate.max(), 2 / 15, rtol=1e-6)
    np.testing.assert_allclose(heading[-1] - heading[0], np.pi / 2, atol=1e-12)
    turning = np.abs(rate - 2 / 15) < 1e-6
    center = np.array([85.0, 15.0])
    radius = np.linalg.norm(at(t[:-1][turning]).position - center, axis=-1)
    np.testing.assert_allclose(radius, 15, atol=0.02)


def test_at_its_last_waypoint_a_vehicle_stops():
    at = route(Waypoints(kind="waypoints", points_m=[[0, 0], [10, 0]], speed_mps=2), 1, "x")
    motion = at(np.array([4.0, 6.0, 600.0]))
    np.testing.assert_allclose(motion.position, [[8, 0], [10, 0], [10, 0]])
    np.testing.assert_allclose(motion.velocity, [[2, 0], [0, 0], [0, 0]])


def test_a_lawn_mower_covers_its_lines():
    corners = lawnmower_corners(LAWN.model_copy(update={"heading_deg": 0.0}))
    np.testing.assert_allclose(corners[:4], [[10, 20], [110, 20], [110, 40], [10, 40]])
    at = route(LAWN.model_copy(update={"heading_deg": 0.0, "turn_radius_m": 10.0}), 1, "x")
    seen = at(np.arange(0, 300, 0.25)).position
    for y in (20, 40, 60, 80):
        on = seen[np.abs(seen[:, 1] - y) < 1e-9]
        assert on[:, 0].min() < 25 and on[:, 0].max() > 95


def test_a_circle_is_one():
    at = route(Loiter(kind="loiter", center_m=[1, 2], radius_m=30, speed_mps=3, start_deg=90), 1, "x")
    t = np.linspace(0, 400, 999)
    angle = np.pi / 2 + 3 * t / 30
    expected = np.array([1, 2]) + 30 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    np.testing.assert_allclose(at(t).position, expected, atol=1e-9)
    np.testing.assert_allclose(at(t).heading, angle + np.pi / 2, atol=1e-9)


def test_an_ellipse_lies_on_its_curve():
    path = Loiter(kind="loiter", center_m=[1, 2], radius_m=80, radius_y_m=20, rotation_deg=40, speed_mps=2)
    p = route(path, 1, "x")(np.linspace(0, 900, 999)).position - [1, 2]
    a = np.radians(-40)
    u, v = np.cos(a) * p[:, 0] - np.sin(a) * p[:, 1], np.sin(a) * p[:, 0] + np.cos(a) * p[:, 1]
    np.testing.assert_allclose((u / 80) ** 2 + (v / 20) ** 2, 1, atol=1e-12)


def test_a_drift_is_the_seeds_own_and_as_wide_as_stated():
    path = Drift(kind="drift", start_m=[3, 4], wander_m=30, period_s=100)
    t = np.linspace(0, 200_000, 20_000)
    first, again, other = (route(path, seed, "x")(t).position for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 10
    np.testing.assert_allclose(first[0], [3, 4], atol=1e-9)
    np.testing.assert_allclose(first.std(axis=0), 30, rtol=0.05)
