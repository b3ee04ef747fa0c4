"""One simulated vehicle: its true voyage, and what its own sensors make of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from engine.mission.log import Depth, Fixes, Heading, InitialBelief, VehicleLog, Velocity
from engine.mission.routes import Route, route
from engine.mission.streams import measured, normals
from engine.scenario.vehicles import Interval, Vehicle

#: How fast an AUV comes up to the surface and goes down again, m/s.
CLIMB_MPS = 0.5


@dataclass(frozen=True)
class Voyage:
    """The truth about one vehicle: its scenario, its route, and the seed of everything random about it."""

    vehicle: Vehicle
    route: Route
    seed: int

    def surfaced(self, time_s: np.ndarray) -> np.ndarray:
        """Whether its modem is out of the water: an AUV during its surfacings."""
        return within(self.vehicle.surfacings, time_s)

    def depth(self, time_s: np.ndarray) -> np.ndarray:
        """True depth, m: down at its depth, at the surface during surfacings, on the way before and after."""
        depth = np.full(np.shape(time_s), self.vehicle.depth_m)
        for s in self.vehicle.surfacings:
            away = np.maximum(np.maximum(s.start_s - time_s, time_s - s.end_s), 0.0)
            depth = np.minimum(depth, CLIMB_MPS * away)
        return depth

    def position(self, time_s: np.ndarray) -> np.ndarray:
        """True position (..., 3) m: east, north, down."""
        return np.concatenate([self.route(time_s).position, self.depth(time_s)[..., None]], axis=-1)


def within(intervals: Sequence[Interval], time_s: np.ndarray) -> np.ndarray:
    """Whether times lie in any of the intervals, ends included."""
    inside = np.zeros(np.shape(time_s), dtype=bool)
    for i in intervals:
        inside |= (time_s >= i.start_s) & (time_s <= i.end_s)
    return inside


def voyage(vehicle: Vehicle, seed: int) -> Voyage:
    """The voyage of a scenario's vehicle, which has a path."""
    if vehicle.path is None:
        raise ValueError(f"vehicle {vehicle.name!r} has no path to simulate")
    return Voyage(vehicle, route(vehicle.path, seed, vehicle.name), seed)


def ticks(rate_hz: float, duration_s: float) -> np.ndarray:
    """Times of readings from the start to the end of the mission, s."""
    return np.arange(int(np.floor(duration_s * rate_hz * (1 + 1e-12))) + 1) / rate_hz


def sense(voyage: Voyage, duration_s: float, trials: Sequence[int]) -> VehicleLog:
    """What the vehicle's own sensors read in each trial."""
    vehicle, sensors = voyage.vehicle, voyage.vehicle.sensors

    def read(purpose: str, truth: np.ndarray, sigma: np.ndarray | float) -> np.ndarray:
        return measured(truth, sigma, voyage.seed, trials, vehicle.name, purpose)

    velocity = heading = depth = fixes = None
    if (dvl := sensors.dvl) is not None:
        t = ticks(dvl.rate_hz, duration_s)
        value = read("dvl", body_velocity(voyage.route, t), np.array([dvl.along_sigma_mps, dvl.cross_sigma_mps]))
        velocity = Velocity(t, value, dvl.along_sigma_mps, dvl.cross_sigma_mps)
    if sensors.heading is not None:
        t = ticks(sensors.heading.rate_hz, duration_s)
        sigma = float(np.radians(sensors.heading.sigma_deg))
        heading = Heading(t, read("heading", voyage.route(t).heading, sigma), sigma)
    if sensors.depth is not None:
        t = ticks(sensors.depth.rate_hz, duration_s)
        depth = Depth(t, read("depth", voyage.depth(t), sensors.depth.sigma_m), sensors.depth.sigma_m)
    if sensors.gps is not None:
        t = ticks(sensors.gps.rate_hz, duration_s)
        received = voyage.surfaced(t) if vehicle.kind == "auv" else np.ones(t.shape, dtype=bool)
        received &= ~within(sensors.gps.outages, t)
        if received.any():
            # Drawn for the whole mission, so that a longer surfacing changes no other fix.
            value = read("gps", voyage.route(t).position, sensors.gps.sigma_m)[:, received]
            cov = np.tile(np.eye(2) * sensors.gps.sigma_m**2, (int(received.sum()), 1, 1))
            fixes = Fixes(t[received], value, cov)

    return VehicleLog(
        name=vehicle.name,
        kind=vehicle.kind,
        initial=believe(voyage, trials),
        acceleration_psd=vehicle.acceleration_psd,
        range_sigma_m=sensors.modem.range_sigma_m if sensors.modem is not None else 1.0,
        depth_m=vehicle.depth_m,
        velocity=velocity,
        heading=heading,
        depth=depth,
        fixes=fixes,
    )


def body_velocity(route: Route, time_s: np.ndarray) -> np.ndarray:
    """True velocity forward and to the left (N, 2), m/s."""
    motion = route(time_s)
    c, s = np.cos(motion.heading), np.sin(motion.heading)
    vx, vy = motion.velocity[..., 0], motion.velocity[..., 1]
    return np.stack([c * vx + s * vy, c * vy - s * vx], axis=-1)


def believe(voyage: Voyage, trials: Sequence[int]) -> InitialBelief:
    """What the vehicle believes at the start: the truth and an error of the stated sigmas, drawn for each trial."""
    initial = voyage.vehicle.initial
    start = voyage.route(np.zeros(1))
    error = normals(voyage.seed, trials, voyage.vehicle.name, "initial", (5,))
    heading_sigma = np.radians(initial.heading_sigma_deg)
    return InitialBelief(
        position_m=start.position[0] + initial.position_sigma_m * error[:, :2],
        position_cov=np.eye(2) * initial.position_sigma_m**2,
        velocity_mps=start.velocity[0] + initial.velocity_sigma_mps * error[:, 2:4],
        velocity_sigma_mps=initial.velocity_sigma_mps,
        heading_rad=start.heading[0] + heading_sigma * error[:, 4],
        heading_sigma_rad=float(heading_sigma),
    )
