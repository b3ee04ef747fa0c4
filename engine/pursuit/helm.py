"""How a vehicle gets to its waypoint and stays there (C19 section 2.3.1 and Fig. 2-11), for any number at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: The heading loop's 30 % overshoot and 4 s rise time, as damping and natural frequency (rad/s) of a second order.
DAMPING = -np.log(0.3) / np.hypot(np.pi, np.log(0.3))
NATURAL = (np.pi - np.arccos(DAMPING)) / (4.0 * np.sqrt(1.0 - DAMPING**2))


@dataclass(frozen=True)
class Craft:
    """What a vehicle can do, and the radii of its behaviours (C19: lead 15 m, capture 4 m, station 5 and 10 m)."""

    max_speed_mps: np.ndarray
    turn_rate_rps: float
    station_speed_mps: float
    speed_lag_s: float
    lead_m: float = 15.0
    capture_m: float = 4.0
    station_inner_m: float = 5.0
    station_outer_m: float = 10.0


@dataclass(frozen=True)
class Fleet:
    """place (..., 2) m, heading (...,) rad, turning rad/s, speed m/s; the waypoint, the one before, and whether it
    was reached and is being kept."""

    place: np.ndarray
    heading: np.ndarray
    turning: np.ndarray
    speed: np.ndarray
    waypoint: np.ndarray
    previous: np.ndarray
    keeping: np.ndarray


def at_rest(place: np.ndarray) -> Fleet:
    """Vehicles at their waypoints (..., 2), heading north."""
    zeros = np.zeros(place.shape[:-1])
    return Fleet(place, zeros + 0.5 * np.pi, zeros, zeros, place, place, np.ones(place.shape[:-1], bool))


def send(fleet: Fleet, waypoint: np.ndarray, which: np.ndarray) -> Fleet:
    """New waypoints (..., 2) for the vehicles named by which (...,)."""
    chosen = which[..., None]
    return Fleet(
        fleet.place,
        fleet.heading,
        fleet.turning,
        fleet.speed,
        np.where(chosen, waypoint, fleet.waypoint),
        np.where(chosen, fleet.waypoint, fleet.previous),
        fleet.keeping & ~which,
    )


def sail(fleet: Fleet, craft: Craft, h: float) -> Fleet:
    """h seconds on: steer at the lead point on the trackline, then at the waypoint, then keep station."""
    to_go = fleet.waypoint - fleet.place
    distance = np.hypot(to_go[..., 0], to_go[..., 1])
    keeping = fleet.keeping | (distance < craft.capture_m)
    aim = np.where((keeping | (distance < craft.lead_m))[..., None], to_go, _lead(fleet, craft) - fleet.place)
    wanted_speed = np.where(
        ~keeping | (distance > craft.station_outer_m),
        craft.max_speed_mps,
        np.where(distance > craft.station_inner_m, np.minimum(craft.station_speed_mps, craft.max_speed_mps), 0.0),
    )
    wanted = np.where(wanted_speed > 0, np.arctan2(aim[..., 1], aim[..., 0]), fleet.heading)
    error = np.remainder(fleet.heading - wanted + np.pi, 2 * np.pi) - np.pi
    (a, b), (c, d) = _response(h)
    turn = np.clip(a * error + b * fleet.turning - error, -craft.turn_rate_rps * h, craft.turn_rate_rps * h)
    turning = np.clip(c * error + d * fleet.turning, -craft.turn_rate_rps, craft.turn_rate_rps)
    speed = wanted_speed + (fleet.speed - wanted_speed) * np.exp(-h / craft.speed_lag_s)
    course, way = fleet.heading + 0.5 * turn, 0.5 * (fleet.speed + speed) * h
    place = fleet.place + way[..., None] * np.stack([np.cos(course), np.sin(course)], axis=-1)
    return Fleet(place, fleet.heading + turn, turning, speed, fleet.waypoint, fleet.previous, keeping)


def _lead(fleet: Fleet, craft: Craft) -> np.ndarray:
    """The point lead_m ahead on the line from the previous waypoint to this one, not beyond it."""
    leg = fleet.waypoint - fleet.previous
    length = np.hypot(leg[..., 0], leg[..., 1])
    along = leg / np.maximum(length, 1e-9)[..., None]
    done = np.einsum("...i,...i->...", fleet.place - fleet.previous, along)
    return fleet.previous + np.clip(done + craft.lead_m, 0.0, length)[..., None] * along


def _response(h: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """The heading loop's exact transition of (error, rate) over h seconds."""
    damped = NATURAL * np.sqrt(1.0 - DAMPING**2)
    decay, c, s = np.exp(-DAMPING * NATURAL * h), np.cos(damped * h), np.sin(damped * h)
    ratio = DAMPING * NATURAL / damped
    return (
        (decay * (c + ratio * s), decay * s / damped),
        (-decay * NATURAL**2 * s / damped, decay * (c - ratio * s)),
    )
