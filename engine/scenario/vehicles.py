"""A vehicle of a navigation scenario: its path, its sensors, and what it believes at the start."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import Coordinate, Fraction, Interval, Name, NotNegative, Point, Table, faults
from engine.scenario.paths import Path

Rate = Annotated[float, Field(gt=0, le=1000)]
Sigma = Annotated[float, Field(gt=0, le=1e5)]
Degrees = Annotated[float, Field(gt=0, le=180)]


class Initial(Table):
    """What the vehicle believes of itself at the start: one sigma per axis.

    A simulated mission draws the belief around the truth; a recorded one takes it from the reference unless
    a position (and heading, velocity) is stated here.
    """

    position_sigma_m: Sigma = Field(description="of each horizontal axis, m")
    velocity_sigma_mps: Annotated[float, Field(gt=0, le=100)] = Field(0.1, description="of each axis, m/s")
    heading_sigma_deg: Degrees = Field(5.0, description="of the heading of a vehicle that integrates odometry, degrees")
    position_m: Point | None = Field(None, description="recorded missions: believed position [x, y], m")
    velocity_mps: Annotated[list[Coordinate], Field(min_length=2, max_length=2)] | None = Field(
        None, description="recorded missions: believed velocity [x, y], m/s"
    )
    heading_deg: Coordinate | None = Field(
        None, description="recorded missions: believed heading, degrees counter-clockwise from x"
    )


class Dvl(Table):
    """Doppler velocity log: body-frame velocity over ground."""

    rate_hz: Rate = Field(3.0, description="readings per second")
    along_sigma_mps: Sigma = Field(description="noise forward, m/s")
    cross_sigma_mps: Sigma = Field(description="noise to the left, m/s")


class Ahrs(Table):
    """Attitude and heading reference: absolute heading."""

    rate_hz: Rate = Field(25.0, description="readings per second")
    sigma_deg: Degrees = Field(description="noise, degrees")


class DepthSensor(Table):
    """Pressure depth."""

    rate_hz: Rate = Field(2.0, description="readings per second")
    sigma_m: Sigma = Field(description="noise, m")


class Gps(Table):
    """Position fixes: always for a craft at the surface, during its surfacings for an AUV."""

    rate_hz: Rate = Field(1.0, description="fixes per second")
    sigma_m: Sigma = Field(description="noise of each axis, m")
    outages: list[Interval] = Field([], max_length=1000, description="stretches without fixes")


class Modem(Table):
    """Acoustic modem with a synchronized clock: one-way travel times."""

    range_sigma_m: Sigma = Field(description="noise of a range it measures, m")
    outlier_rate: Fraction = Field(0.0, description="fraction of ranges that are grossly wrong (echoes)")
    outlier_sigma_m: NotNegative = Field(0.0, description="size of a gross error, m; always too long, as echoes are")


class OdometryNoise(Table):
    """Noise of a pose increment: forward and left in metres, turn in degrees."""

    forward_sigma_m: NotNegative = Field(0.0, description="forward, m")
    left_sigma_m: NotNegative = Field(0.0, description="to the left, m")
    turn_sigma_deg: NotNegative = Field(0.0, description="turn, degrees")


class OdometrySensor(Table):
    """Pose increments of a recorded mission; the variances of the parts that apply add up."""

    per_reading: OdometryNoise | None = Field(None, description="of every increment")
    per_sqrt_m: OdometryNoise | None = Field(None, description="grows with the square root of the metres driven")
    per_sqrt_s: OdometryNoise | None = Field(None, description="grows with the square root of the seconds passed")


class Sensors(Table):
    """What a vehicle carries; what is left out it does not have."""

    dvl: Dvl | None = None
    heading: Ahrs | None = None
    depth: DepthSensor | None = None
    gps: Gps | None = None
    modem: Modem | None = None
    odometry: OdometrySensor | None = None


class Vehicle(Table):
    """An AUV, a surface craft or a fixed node."""

    name: Name = Field(description="letters, digits, hyphen and underscore, a letter first")
    kind: Literal["auv", "surface", "fixed"] = Field(description="auv, surface or fixed")
    depth_m: Annotated[float, Field(ge=0, le=12_000)] = Field(0.0, description="depth when not surfaced, m")
    acceleration_psd: Annotated[float, Field(gt=0, le=1e4)] = Field(
        0.01, description="how freely the motion model lets the velocity change, m^2/s^3"
    )
    path: Path | None = Field(None, description="where it goes; a recorded mission needs none")
    initial: Initial
    surfacings: list[Interval] = Field([], max_length=1000, description="when an AUV is at the surface")
    sensors: Sensors = Field(Sensors())

    @model_validator(mode="after")
    def _makes_sense(self) -> Vehicle:
        problems = []
        if self.surfacings and self.kind != "auv":
            problems.append(Problem("surfacings", f"{self.name!r} is no AUV and does not surface", "leave it out"))
        if self.kind == "surface" and self.depth_m:
            problems.append(Problem("depth_m", f"{self.name!r} is a surface craft", "leave it out, or make it an auv"))
        if self.kind == "fixed" and self.sensors.gps and self.depth_m:
            problems.append(Problem("sensors.gps", f"no GPS reaches {self.depth_m:g} m down", "leave it out"))
        if self.kind == "fixed" and self.path is not None and self.path.kind != "station":
            problems.append(
                Problem("path.kind", f"{self.name!r} is fixed", "use a station, or another kind of vehicle")
            )
        if self.sensors.dvl and self.sensors.heading is None:
            problems.append(
                Problem(
                    "sensors.heading", f"{self.name!r} has a DVL but no heading to turn it by", "add a heading sensor"
                )
            )
        if problems:
            raise faults(problems)
        return self
