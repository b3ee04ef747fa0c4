"""The log: what each vehicle's sensors and modem saw, whether simulated or recorded.

Frame: local level, x east and y north in metres, headings in radians counter-clockwise from x.
A leading trial axis of length 1 means the reading is the same in every trial.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Velocity:
    """Body-frame velocity over ground (DVL): value (trials, N, 2) forward and left m/s at time_s (N,).

    along_sigma_mps and cross_sigma_mps are the sensor's stated noise.
    """

    time_s: np.ndarray
    value: np.ndarray
    along_sigma_mps: float
    cross_sigma_mps: float


@dataclass(frozen=True)
class Heading:
    """Absolute heading (AHRS): value (trials, N) rad at time_s (N,), stated noise sigma_rad."""

    time_s: np.ndarray
    value: np.ndarray
    sigma_rad: float


@dataclass(frozen=True)
class Odometry:
    """Body-frame pose increments since the previous reading (or the start, for the first).

    value (trials, N, 3): forward m, left m, turn rad; cov (N, 3, 3) of each increment.
    """

    time_s: np.ndarray
    value: np.ndarray
    cov: np.ndarray


@dataclass(frozen=True)
class Depth:
    """Pressure depth: value (trials, N) m, positive down, at time_s (N,), stated noise sigma_m."""

    time_s: np.ndarray
    value: np.ndarray
    sigma_m: float


@dataclass(frozen=True)
class Fixes:
    """Absolute positions (GPS): value (trials, N, 2) m at time_s (N,), cov (N, 2, 2) m^2."""

    time_s: np.ndarray
    value: np.ndarray
    cov: np.ndarray


@dataclass(frozen=True)
class InitialBelief:
    """What a vehicle believes of itself at time zero, drawn around the truth in a simulated mission.

    position_m (trials, 2), position_cov (2, 2); velocity_mps (trials, 2) world frame with velocity_sigma_mps;
    heading_rad (trials,) with heading_sigma_rad, used by vehicles that integrate odometry.
    """

    position_m: np.ndarray
    position_cov: np.ndarray
    velocity_mps: np.ndarray
    velocity_sigma_mps: float
    heading_rad: np.ndarray
    heading_sigma_rad: float


@dataclass(frozen=True)
class VehicleLog:
    """Everything one vehicle sensed by itself.

    kind: "auv", "surface" or "fixed". acceleration_psd (m^2/s^3) drives the constant-velocity plant of W11
    eq. (2); a fixed node has none. A vehicle with `odometry` is estimated as a pose (x, y, heading), one
    without as (x, y, vx, vy), a fixed node as (x, y). depth_m is the depth to assume where no sensor reads it.
    """

    name: str
    kind: str
    initial: InitialBelief
    acceleration_psd: float
    range_sigma_m: float
    depth_m: float = 0.0
    velocity: Velocity | None = None
    heading: Heading | None = None
    odometry: Odometry | None = None
    depth: Depth | None = None
    fixes: Fixes | None = None


@dataclass(frozen=True)
class AcousticLog:
    """The channel's history: B broadcasts, and R possible receptions of them in order of arrival.

    sender (B,) and receiver (R,) index Log.vehicles in order; tol_s (B,) ascending; broadcast (R,) says which
    broadcast a reception is of; toa_s (R,) is its nominal arrival (for ordering events and choosing the
    receiver's state), ascending. travel_time_s (trials, R) is what the receiver measured against its
    synchronized clock, NaN in the trials in which nothing was heard.
    """

    sender: np.ndarray
    tol_s: np.ndarray
    broadcast: np.ndarray
    receiver: np.ndarray
    toa_s: np.ndarray
    travel_time_s: np.ndarray


@dataclass(frozen=True)
class Log:
    """One block of trials: every vehicle's readings, the channel's history, and the truth kept for scoring.

    trials counts the block's trials. time_s (T,) are the report times; truth maps a vehicle to its positions
    (trials or 1, T, 2) there, NaN rows where the reference has none, and misses vehicles without any
    reference. sound_speed_mps turns travel times into ranges; sound_speed_sigma_mps > 0 says how far it may
    be wrong, and estimators then estimate it. gate_sigma, where set, refuses ranges whose innovation exceeds
    that many standard deviations.
    """

    duration_s: float
    trials: int
    time_s: np.ndarray
    truth: dict[str, np.ndarray]
    vehicles: tuple[VehicleLog, ...]
    acoustics: AcousticLog
    sound_speed_mps: float
    sound_speed_sigma_mps: float = 0.0
    gate_sigma: float | None = None
    notes: tuple[str, ...] = field(default=())

    def index(self, name: str) -> int:
        """The position of a vehicle in `vehicles`; ValueError where there is none of that name."""
        for i, vehicle in enumerate(self.vehicles):
            if vehicle.name == name:
                return i
        raise ValueError(f"no vehicle named {name!r} in the log")
