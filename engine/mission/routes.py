"""Where a vehicle truly is, where it heads and how fast it moves, at any time: the paths of a scenario made flesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engine.mission.streams import stream
from engine.scenario.paths import Diamond, Drift, LawnMower, Loiter, Path, Station, Waypoints


@dataclass(frozen=True)
class Motion:
    """Position (..., 2) m, velocity (..., 2) m/s and unwrapped heading (...) rad; headings follow the travel."""

    position: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray


#: What a path becomes: times (...) s to motion.
Route = Callable[[np.ndarray], Motion]


def route(path: Path, seed: int, name: str) -> Route:
    """The route along a scenario's path; `seed` and the vehicle's name decide how a drifting one wanders."""
    match path:
        case Waypoints():
            track = rounded(np.array(path.points_m), path.turn_radius_m, closed=path.repeat)
            return along(track, path.speed_mps)
        case LawnMower():
            return along(rounded(lawnmower_corners(path), path.turn_radius_m, closed=True), path.speed_mps)
        case Diamond():
            x, y = path.radius_m, path.radius_y_m or path.radius_m
            corners = np.array(path.center_m) + np.array([[x, 0], [0, y], [-x, 0], [0, -y]])
            return along(rounded(corners, path.turn_radius_m, closed=True), path.speed_mps)
        case Loiter():
            return circle(path) if path.radius_y_m is None else ellipse(path, path.radius_y_m)
        case Drift():
            return wander(path, stream(seed, 0, name, "drift"))
        case Station():
            return station(path)


# --- straight legs and arcs ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Track:
    """Pieces of constant curvature end to end: where each starts (K,) along the track, its start pose, its curvature.

    A closed track goes on from `length` at `loop_from`, turned by `turning` rad more each time round.
    """

    start: np.ndarray
    position: np.ndarray
    heading: np.ndarray
    curvature: np.ndarray
    length: float
    loop_from: float | None
    turning: float


#: A corner cut by less is not cut, m.
SHARPEST_M = 1e-9


def lawnmower_corners(path: LawnMower) -> np.ndarray:
    """Ends of the lines (2 lines, 2) in order of travel."""
    a = np.radians(path.heading_deg)
    ahead, aside = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
    corners = []
    for n in range(path.lines):
        near = np.array(path.start_m) + n * path.spacing_m * aside
        ends = [near, near + path.line_length_m * ahead]
        corners += ends if n % 2 == 0 else ends[::-1]
    return np.array(corners)


def rounded(points: np.ndarray, radius: float, *, closed: bool) -> Track:
    """Legs through points (N, 2), every corner rounded by an arc that fits between the middles of its legs.

    A closed track starts at the first point, cuts that corner like the others when it comes round, and goes on.
    Where the way leads straight back, or an arc would be shorter than anything, the heading turns on the spot.
    """
    if closed:
        points = np.concatenate([points, points[:1]])
    moves = np.any(np.diff(points, axis=0) != 0, axis=1)
    points = points[np.concatenate([[True], moves])]
    if closed:
        points = np.concatenate([points, points[1:2]])
    leg = np.diff(points, axis=0)
    lengths = np.linalg.norm(leg, axis=1)
    course = np.arctan2(leg[:, 1], leg[:, 0])
    turn = (np.diff(course) + np.pi) % (2 * np.pi) - np.pi
    half = np.tan(np.minimum(np.abs(turn), np.pi - 1e-6) / 2)
    cut = np.minimum(radius * half, 0.5 * np.minimum(lengths[:-1], lengths[1:]))
    cut[(np.abs(turn) > np.pi - 1e-6) | (cut < SHARPEST_M)] = 0.0

    pieces: list[tuple[float, np.ndarray, float, float]] = []
    s, heading, into = 0.0, float(course[0]), 0.0
    for k in range(len(leg)):
        ahead = leg[k] / lengths[k]
        last = k == len(leg) - 1
        straight = lengths[k] - into - (0.0 if last else cut[k])
        if not (last and closed):
            pieces.append((s, points[k] + into * ahead, heading, 0.0))
            s += straight
        if last:
            break
        if cut[k] > 0:
            r = cut[k] / half[k]
            pieces.append((s, points[k + 1] - cut[k] * ahead, heading, float(np.sign(turn[k]) / r)))
            s += r * abs(turn[k])
        heading += float(turn[k])
        into = cut[k]
    start, position, headings, curvature = (np.array(column) for column in zip(*pieces))
    return Track(start, position, headings, curvature, s, into if closed else None, heading - float(course[0]))


def along(track: Track, speed: float) -> Route:
    """Travel a track at constant speed: round and round where it is closed, else to its end."""

    def at(time_s: np.ndarray) -> Motion:
        s = speed * np.asarray(time_s, dtype=float)
        moving = np.full(s.shape, speed)
        laps = np.zeros(s.shape)
        if track.loop_from is None:
            moving = np.where(s >= track.length, 0.0, speed)
            s = np.minimum(s, track.length)
        else:
            lap = track.length - track.loop_from
            laps = np.maximum(np.floor((s - track.loop_from) / lap), 0.0)
            s = s - laps * lap
        k = np.maximum(np.searchsorted(track.start, s, side="right") - 1, 0)
        ds, curvature, heading = s - track.start[k], track.curvature[k], track.heading[k]
        half = 0.5 * curvature * ds
        chord = (ds * np.sinc(half / np.pi))[..., None]
        position = track.position[k] + chord * _unit(heading + half)
        heading = heading + curvature * ds
        return Motion(position, moving[..., None] * _unit(heading), heading + laps * track.turning)

    return at


def _unit(angle: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


# --- round shapes --------------------------------------------------------------------------------------------------


def circle(path: Loiter) -> Route:
    """Round a circle for ever."""
    side = -1.0 if path.clockwise else 1.0
    angle = np.radians(path.start_deg + path.rotation_deg)
    start = np.array(path.center_m) + path.radius_m * np.array([np.cos(angle), np.sin(angle)])
    one = np.zeros(1)
    lap = 2 * np.pi * path.radius_m
    track = Track(
        one, start[None], one + angle + side * np.pi / 2, one + side / path.radius_m, lap, 0.0, side * 2 * np.pi
    )
    return along(track, path.speed_mps)


def ellipse(path: Loiter, radius_y: float) -> Route:
    """Round an ellipse for ever, its arc length tabulated."""
    side = -1.0 if path.clockwise else 1.0
    u = np.radians(path.start_deg) + side * np.linspace(0, 2 * np.pi, 8193)
    middle = 0.5 * (u[1:] + u[:-1])
    speed_u = np.hypot(path.radius_m * np.sin(middle), radius_y * np.cos(middle))
    arc = np.concatenate([[0.0], np.cumsum(speed_u * np.abs(np.diff(u)))])
    c, s = np.cos(np.radians(path.rotation_deg)), np.sin(np.radians(path.rotation_deg))
    turn = np.array([[c, -s], [s, c]])

    def at(time_s: np.ndarray) -> Motion:
        travelled = path.speed_mps * np.asarray(time_s, dtype=float)
        laps = np.floor(travelled / arc[-1])
        a = np.interp(travelled - laps * arc[-1], arc, u)
        position = np.stack([path.radius_m * np.cos(a), radius_y * np.sin(a)], axis=-1)
        tangent = side * np.stack([-path.radius_m * np.sin(a), radius_y * np.cos(a)], axis=-1) @ turn.T
        tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
        # The tangent's direction runs less than a right angle ahead of or behind the turned parameter.
        steady = a + side * np.pi / 2 + np.radians(path.rotation_deg)
        off = np.arctan2(tangent[..., 1], tangent[..., 0]) - steady
        heading = steady + (off + np.pi) % (2 * np.pi) - np.pi + laps * side * 2 * np.pi
        return Motion(np.array(path.center_m) + position @ turn.T, path.speed_mps * tangent, heading)

    return at


# --- slow craft ----------------------------------------------------------------------------------------------------

_WAVES = 6


def wander(path: Drift, rng: np.random.Generator) -> Route:
    """A mean velocity and six sinusoids per axis of random phase, periods from `period_s` to six times that."""
    omega = 2 * np.pi / (path.period_s * (1 + 5 * rng.random((_WAVES, 2))))
    phase = 2 * np.pi * rng.random((_WAVES, 2))
    amplitude = path.wander_m * np.sqrt(2 / _WAVES)

    def at(time_s: np.ndarray) -> Motion:
        t = np.asarray(time_s, dtype=float)[..., None]
        position = np.array(path.start_m) + np.array(path.velocity_mps) * t
        velocity = np.broadcast_to(np.array(path.velocity_mps), position.shape).copy()
        for w, p in zip(omega, phase):
            position += amplitude * (np.sin(w * t + p) - np.sin(p))
            velocity += amplitude * w * np.cos(w * t + p)
        heading = np.arctan2(velocity[..., 1], velocity[..., 0])
        return Motion(position, velocity, np.unwrap(heading) if heading.ndim else heading)

    return at


def station(path: Station) -> Route:
    """At one place for ever."""

    def at(time_s: np.ndarray) -> Motion:
        shape = np.shape(time_s)
        position = np.broadcast_to(np.array(path.position_m, dtype=float), (*shape, 2))
        return Motion(position, np.zeros((*shape, 2)), np.full(shape, np.radians(path.heading_deg)))

    return at
