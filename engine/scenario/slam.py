"""Scenarios of localization and mapping by sound: one vehicle, and beacons of which nobody knows the place."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import Fraction, Name, NotNegative, Point, Positive, ScenarioBase, Table, faults
from engine.scenario.navigation import MAX_VEHICLES
from engine.scenario.paths import Path
from engine.scenario.recording import CsvRecording, PyfgRecording, Simulated, SonarRecording
from engine.scenario.vehicles import Vehicle

#: Bounds on what one trial may produce.
MAX_POSES, MAX_RANGES, MAX_ARRAYS = 5000, 2000, 200
MAX_RECORD_SAMPLES = 65_536

Decibels = Annotated[float, Field(ge=-40, le=120)]
Speed = Annotated[float, Field(ge=1000, le=2000)]
Depth = Annotated[float, Field(gt=0, le=12_000)]
Frequency = Annotated[float, Field(gt=0, le=1e6)]


class Craft(Table):
    """Somebody under way at a constant depth: the vehicle with the hydrophone, or the beacon."""

    name: Name = Field(description="letters, digits, hyphen and underscore, a letter first")
    path: Path = Field(description="where it goes, or stays")
    depth_m: Depth = Field(1.5, description="depth of its hydrophone or source, m")


class Listener(Craft):
    """The vehicle with the hydrophone."""

    around_beacon: bool = Field(False, description="its path's coordinates are from the beacon, wherever that is then")


class SonarSettings(Table):
    """What is transmitted, how it is recorded, and how the receiver processes it."""

    low_hz: Frequency = Field(200.0, description="where the chirp starts, Hz")
    high_hz: Frequency = Field(2050.0, description="where it ends, Hz")
    chirp_samples: int = Field(1024, ge=16, le=MAX_RECORD_SAMPLES, description="its length")
    sampling_hz: Frequency = Field(37_500.0, description="samples per second")
    record_samples: int = Field(8000, ge=64, le=MAX_RECORD_SAMPLES, description="length of a record, from transmission")
    sound_speed_mps: Speed = Field(1481.0, description="what the receiver assumes, m/s")
    interval_s: Annotated[float, Field(ge=0.1, le=600)] = Field(1.0, description="between transmissions, and poses, s")
    phat: bool = Field(True, description="phase transform before the matched filter")
    floor: Annotated[float, Field(ge=0, lt=1)] = Field(0.8, description="quantile below which output counts as noise")
    weight: Literal["likelihood", "amplitude"] = Field(
        "likelihood", description="what a range density is made of: the output's likelihood, or its magnitude (C19)"
    )

    @model_validator(mode="after")
    def _sampled(self) -> SonarSettings:
        problems = []
        if self.high_hz <= self.low_hz:
            problems.append(Problem("high_hz", f"is not above low_hz ({self.low_hz:g})", "give a higher frequency"))
        if self.high_hz > self.sampling_hz / 2:
            problems.append(Problem("high_hz", "is above half the sampling rate", "sample faster"))
        if self.chirp_samples > self.record_samples:
            problems.append(Problem("chirp_samples", "is longer than a record", "record for longer"))
        if problems:
            raise faults(problems)
        return self


class SeaWall(Table):
    """A straight wall that echoes."""

    point_m: Point = Field(description="a point [x, y] on it, m")
    heading_deg: Annotated[float, Field(ge=-360, le=360)] = Field(description="along it, degrees from x")
    reflection: Annotated[float, Field(ge=-1, le=1)] = Field(0.6, description="part of the amplitude it reflects")


class WaterSettings(Table):
    """How the sound truly travels, and the noise; what the receiver does not know of."""

    snr_db: Decibels = Field(description="after the matched filter, of the direct path from reference_m, dB")
    snr_spread_db: Annotated[float, Field(ge=0, le=40)] = Field(0.0, description="standard deviation between records")
    reference_m: Positive = Field(75.0, description="the range that snr_db is for, m")
    sound_speed_mps: Speed = Field(1481.0, description="the true one, m/s")
    spreading: Annotated[float, Field(ge=0, le=4)] = Field(1.0, description="amplitude falls with range to this power")
    surface_reflection: Annotated[float, Field(ge=-1, le=1)] = Field(-0.5, description="of the surface's echo")
    walls: list[SeaWall] = Field([], max_length=16, description="walls that echo")
    motor_db: Decibels | None = Field(None, description="motor noise over the ambient at 1 kHz; none without it")
    clock_offset_s: Annotated[float, Field(ge=-1, le=1)] = Field(0.0, description="by which arrivals seem late, s")
    outlier_m: NotNegative = Field(0.0, description="by how much an outlier echo's way is longer, m")
    outlier_gain: Annotated[float, Field(ge=0, le=100)] = Field(0.0, description="its amplitude over the direct path's")


class OdometrySettings(Table):
    """How the vehicle's dead reckoning drifts between fixes."""

    drift_mps: NotNegative = Field(0.2, description="standard deviation of each interval's velocity per axis, m/s")
    sigma_m: Positive | None = Field(
        None, description="what estimators take for each increment's standard deviation; without it, the true one"
    )


class FixSettings(Table):
    """Position fixes at the start, the end and evenly between."""

    count: int = Field(2, ge=1, le=MAX_POSES, description="number of poses with a fix")
    sigma_m: Positive = Field(0.1, description="standard deviation per axis, m")


class RangingSettings(Table):
    """Ranges taken from single records, evenly over the mission."""

    count: int = Field(58, ge=0, le=MAX_RANGES, description="number of records used")
    every_s: Positive = Field(10.0, description="recorded missions: a range to each beacon once in so long, s")
    scale: Annotated[float, Field(ge=0.5, le=2.0)] = Field(
        1.0, description="recorded missions: metres read for each true metre, known from a calibration"
    )


class ArraySettings(Table):
    """Synthetic arrays of consecutive records, evenly over the mission unless it says where each starts."""

    count: int = Field(10, ge=0, le=MAX_ARRAYS, description="number of arrays")
    elements: int = Field(8, ge=2, le=16, description="records in each")
    starts: list[Annotated[int, Field(ge=0, le=MAX_POSES)]] | None = Field(
        None, max_length=MAX_ARRAYS, description="numbers of the poses at which arrays start, instead of count"
    )


def _which(value: Any) -> str:
    if isinstance(value, dict):
        return "simulated" if value.get("kind") == "simulated" else str(value.get("format", value.get("kind")))
    return getattr(value, "format", "simulated")


Mission = Annotated[
    Annotated[Simulated, Tag("simulated")]
    | Annotated[CsvRecording, Tag("csv")]
    | Annotated[PyfgRecording, Tag("pyfg")]
    | Annotated[SonarRecording, Tag("sonar")],
    Discriminator(_which, custom_error_type="mission", custom_error_message="is no known mission"),
]

#: What only a simulated mission says, and what only a recorded one does.
SIMULATED, RECORDED = ("vehicle", "beacon", "water"), ("vehicles",)


class SlamScenario(ScenarioBase):
    """A vehicle that locates beacons, and itself, by the sound it hears from them.

    A simulated mission has one vehicle and one beacon, and waveforms, and so has a recording of waveforms; a log of
    ranges has `vehicles` as a navigation scenario does, of which the fixed ones are the beacons.
    """

    family: Literal["slam"] = Field(description="kind of mission")
    mission: Mission = Field(Simulated(kind="simulated"), description="simulated, or where the recording is")
    vehicle: Listener | None = Field(None, description="who listens")
    beacon: Craft | None = Field(None, description="who sounds")
    water: WaterSettings | None = Field(None, description="sound and noise as they are")
    sonar: SonarSettings = Field(SonarSettings.model_validate({}), description="sound as the receiver takes it to be")
    odometry: OdometrySettings = Field(OdometrySettings.model_validate({}), description="drift between fixes")
    fixes: FixSettings = Field(FixSettings.model_validate({}), description="position fixes")
    ranging: RangingSettings = Field(RangingSettings.model_validate({}), description="which ranges are used")
    arrays: ArraySettings = Field(ArraySettings.model_validate({}), description="which synthetic arrays are used")
    vehicles: list[Vehicle] = Field([], max_length=MAX_VEHICLES, description="recorded missions: vehicle and beacons")
    outlier_share: Fraction = Field(0.0, description="recorded missions: share of ranges that may be grossly wrong")

    @property
    def poses(self) -> int:
        """Number of poses of a simulated mission."""
        return int((self.duration_s or 0.0) / self.sonar.interval_s + 1e-9) + 1

    @model_validator(mode="after")
    def _whole(self) -> SlamScenario:
        problems = list(_simulated(self) if isinstance(self.mission, Simulated) else _recorded(self))
        if problems:
            raise faults(problems)
        return self


def array_starts(scenario: SlamScenario, poses: int) -> list[int]:
    """Numbers of the poses, of so many, at which the synthetic arrays start, in order."""
    arrays = scenario.arrays
    if arrays.starts is not None:
        return sorted(arrays.starts)
    if arrays.count == 0:
        return []
    room = poses - arrays.elements
    return [round(k * room / max(1, arrays.count - 1)) for k in range(arrays.count)]


def _simulated(scenario: SlamScenario) -> Iterator[Problem]:
    for key in SIMULATED:
        if getattr(scenario, key) is None:
            yield Problem(key, "is missing", f"say so of the simulated {key}")
    if scenario.vehicles:
        yield Problem("vehicles", "is of recorded missions", "use vehicle and beacon")
    if scenario.vehicle and scenario.beacon and scenario.vehicle.name == scenario.beacon.name:
        yield Problem("beacon.name", f"is the vehicle's, {scenario.beacon.name!r}", "give it another")
    if scenario.duration_s is None:
        yield Problem("duration_s", "is missing", "say how long the simulated mission lasts, s")
        return
    poses = scenario.poses
    if not 2 <= poses <= MAX_POSES:
        remedy = f"keep duration_s / sonar.interval_s between 1 and {MAX_POSES - 1}"
        yield Problem("duration_s", f"makes {poses} poses", remedy)
        return
    yield from fitting(scenario, poses)


def fitting(scenario: SlamScenario, poses: int) -> Iterator[Problem]:
    """What asks for more fixes, ranges or arrays than so many poses have."""
    for key, count in (("fixes", scenario.fixes.count), ("ranging", scenario.ranging.count)):
        if count > poses:
            yield Problem(f"{key}.count", f"{count} are more than the {poses} poses", "ask for fewer")
    starts, elements = array_starts(scenario, poses), scenario.arrays.elements
    key = "arrays.starts" if scenario.arrays.starts is not None else "arrays.count"
    if any(b - a < elements for a, b in pairwise(starts)):
        yield Problem(key, f"arrays of {elements} elements overlap", "ask for fewer, or shorter ones")
    if starts and not 0 <= starts[0] <= starts[-1] <= poses - elements:
        yield Problem(key, f"an array at pose {starts[-1]} does not end within {poses} poses", "start it earlier")


def _recorded(scenario: SlamScenario) -> Iterator[Problem]:
    for key in SIMULATED:
        if getattr(scenario, key) is not None:
            yield Problem(key, "is of simulated missions", "leave it out")
    if isinstance(scenario.mission, SonarRecording):
        if scenario.vehicles:
            yield Problem("vehicles", "is of logs of ranges", "name the vehicle and the beacon under mission")
        return
    moving = [v.name for v in scenario.vehicles if v.kind != "fixed"]
    if len(moving) != 1:
        found = f"has {len(moving)} that move" + (f" ({', '.join(moving)})" if moving else "")
        yield Problem("vehicles", found, "give one vehicle, and its beacons as fixed ones")
    if len(moving) == len(scenario.vehicles):
        yield Problem("vehicles", "has no beacon", "give at least one of kind fixed")
