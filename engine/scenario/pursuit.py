"""Scenarios of acoustic pursuit: vehicles keep formation on a target they know only by its pings (C19 chapter 3)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import (
    Coordinate,
    Fraction,
    Name,
    Point,
    Positive,
    ScenarioBase,
    Table,
    faults,
)
from engine.scenario.recording import Column, FileName, FolderName

#: Bounds on what one trial may produce.
MAX_VEHICLES, MAX_CYCLES, MAX_STEPS = 32, 20_000, 200_000
#: Places in the formations that have a name.
TRIANGLE = 3

Depth = Annotated[float, Field(ge=0, le=12_000)]
Speed = Annotated[float, Field(ge=0, le=100)]


class Target(Table):
    """A nonholonomic target: constant speed, white turn rate (C19 eq. 3.1); it pings by a clock of its own."""

    speed_mps: Speed = Field(1.0, description="along its heading, m/s")
    turn_psd: Annotated[float, Field(ge=0, le=10)] = Field(0.01, description="of its turn rate, rad^2/s")
    drift_psd: Annotated[float, Field(ge=0, le=1e4)] = Field(
        0.0, description="of a random walk of its position on top, m^2/s"
    )
    ping_jitter_s: Annotated[float, Field(ge=0, le=2)] = Field(
        0.2, description="spread of its transmission times about the schedule, s"
    )
    start_m: Point = Field([0.0, 0.0], description="where it starts [x, y], m")
    heading_deg: Coordinate | None = Field(
        None, description="where it heads at the start, counter-clockwise from x; without it any way, by trial"
    )
    depth_m: Depth = Field(0.0, description="its depth at the start, m")


class Belief(Table):
    """What everybody believes of the target at the start, one sigma, drawn around the truth."""

    position_sigma_m: Annotated[float, Field(gt=0, le=1e4)] = Field(10.0, description="of each axis, m")
    heading_sigma_deg: Annotated[float, Field(gt=0, le=360)] = Field(60.0, description="of its heading, degrees")


class Formation(Table):
    """Where the vehicles want to be, relative to the target."""

    kind: Literal["inner", "outer", "line", "custom"] = Field(description="inner, outer, line or custom")
    length_m: Annotated[float, Field(gt=0, le=1e5)] | None = Field(
        None, description="mean distance from the target, m; custom: leave it out"
    )
    offsets_m: list[Point] = Field([], max_length=MAX_VEHICLES, description="custom: [x, y] of each vehicle, m")

    @model_validator(mode="after")
    def _one_shape(self) -> Formation:
        if self.kind == "custom" and (not self.offsets_m or self.length_m is not None):
            raise faults([Problem("offsets_m", "is what a custom formation is made of", "give it, and no length_m")])
        if self.kind != "custom" and (self.offsets_m or self.length_m is None):
            raise faults([Problem("length_m", f"is the size of formation {self.kind!r}", "give it, and no offsets_m")])
        return self


class Vehicle(Table):
    """A pursuer that knows where it is; one with max_speed_mps = 0 stays where it starts."""

    name: Name = Field(description="letters, digits, hyphen and underscore, a letter first")
    max_speed_mps: Speed = Field(1.5, description="its transit speed, m/s")
    start_m: Point | None = Field(None, description="where it starts [x, y], m; without it in formation")
    depth_m: Depth = Field(0.0, description="its depth, m")


class Handling(Table):
    """How the vehicles handle; the radii are those of C19 Fig. 2-11."""

    turn_rate_dps: Annotated[float, Field(gt=0, le=360)] = Field(30.0, description="fastest turn, degrees/s")
    station_speed_mps: Speed = Field(0.5, description="speed back to a station that is near, m/s")
    speed_lag_s: Annotated[float, Field(gt=0, le=1000)] = Field(3.0, description="time constant of the speed, s")


class Network(Table):
    """The slots of the acoustic channel: the target's, each vehicle's in order, the shore's where there is one."""

    slot_s: Annotated[float, Field(ge=0.5, le=600)] = Field(7.0, description="length of a slot, s")
    message_s: Annotated[float, Field(gt=0, le=600)] = Field(5.0, description="of which sending takes, s")
    loss: Fraction = Field(0.0, description="fraction of messages lost, every receiver by itself")
    ping_loss: Fraction = Field(0.0, description="fraction of the target's pings lost, every receiver by itself")
    sound_speed_mps: Annotated[float, Field(ge=1000, le=2000)] = Field(1500.0, description="m/s")
    range_sigma_m: Annotated[float, Field(gt=0, le=1e4)] = Field(
        0.2, description="noise of an arrival time, times sound speed, m (C19: R = 0.04 m^2)"
    )

    @model_validator(mode="after")
    def _fits(self) -> Network:
        if self.message_s > self.slot_s:
            raise faults([Problem("message_s", f"is longer than a slot ({self.slot_s:g} s)", "keep it below slot_s")])
        return self


class Recorded(Table):
    """Recorded arrival times at fixed receivers, as CSV files without headers in one folder."""

    kind: Literal["recorded"]
    log: FolderName = Field(description='name of the folder; "." is the scenario file\'s own')
    arrivals: FileName = Field(description="arrival times, s: a row for each receiver, a column for each ping")
    receivers: FileName = Field(description="positions of the receivers, m: columns x, y and depth")
    names: list[Name] = Field([], max_length=MAX_VEHICLES, description="names of the receivers, in order of the rows")
    track: FileName | None = Field(None, description="reference track: a CSV file with a header")
    track_time: Column = Field("top", description="its column of the time of the ping, s")
    track_x: Column = Field("x", description="its column of x, m")
    track_y: Column = Field("y", description="its column of y, m")
    track_count: Column | None = Field(None, description="its column of how many receivers a position rests on")
    track_least: int = Field(0, ge=0, description="positions that rest on fewer receivers are not scored against")
    origin_s: float = Field(0.0, description="time in the track that is zero in the arrivals, s")
    origin_m: Point = Field([0.0, 0.0], description="[x, y] in the track that is the receivers' origin, m")


class PursuitScenario(ScenarioBase):
    """Vehicles that pursue a target by differences of its pings' arrival times."""

    family: Literal["pursuit"] = Field(description="kind of mission")
    mission: Recorded | None = Field(None, description="a recording; without it the mission is simulated")
    target: Target = Field(Target.model_validate({}), description="the target")
    initial: Belief = Field(Belief.model_validate({}), description="what is believed of the target at the start")
    formation: Formation | None = Field(None, description="the formation of a simulated mission")
    vehicles: list[Vehicle] = Field([], max_length=MAX_VEHICLES, description="the pursuers, in order of their slots")
    handling: Handling = Field(Handling.model_validate({}), description="how they handle")
    network: Network = Field(Network.model_validate({}), description="the acoustic channel")
    dimensions: Literal[2, 3] = Field(2, description="of the target's position: 3 estimates its depth too")
    step_s: Annotated[float, Field(gt=0, le=5)] = Field(1.0, description="step of the simulation, s")
    report_interval_s: Positive | None = Field(None, description="time between reports, s; without it 720 reports")

    @property
    def cycle_s(self) -> float:
        """Length of a cycle of the schedule without a shore station, s."""
        return self.network.slot_s * (len(self.vehicles) + 1)

    @model_validator(mode="after")
    def _whole(self) -> PursuitScenario:
        problems = list(_recorded(self) if self.mission is not None else _simulated(self))
        if problems:
            raise faults(problems)
        return self


def _recorded(scenario: PursuitScenario) -> Iterator[Problem]:
    if scenario.vehicles or scenario.formation is not None:
        key = "vehicles" if scenario.vehicles else "formation"
        yield Problem(key, "a recorded mission has its receivers from the log", "leave it out")
    assert scenario.mission is not None
    yield from _repeated("mission.names", scenario.mission.names)


def _simulated(scenario: PursuitScenario) -> Iterator[Problem]:
    if scenario.formation is None:
        yield Problem("formation", "is missing", "add the table [formation] with its kind")
        return
    if scenario.duration_s is None:
        yield Problem("duration_s", "is missing", "say how long to pursue, s")
    elif scenario.duration_s / scenario.step_s > MAX_STEPS:
        yield Problem("step_s", "makes too many steps", f"keep duration_s / step_s below {MAX_STEPS}")
    elif scenario.duration_s / scenario.cycle_s > MAX_CYCLES:
        yield Problem("network.slot_s", "makes too many cycles", f"keep them below {MAX_CYCLES}")
    places, vehicles = len(scenario.formation.offsets_m) or TRIANGLE, len(scenario.vehicles)
    if places != vehicles or vehicles < scenario.dimensions:
        yield Problem(
            "vehicles",
            f"{vehicles} are given, and the formation has {places} places",
            f"give one for each place, at least {scenario.dimensions}",
        )
    yield from _repeated("vehicles", [v.name for v in scenario.vehicles])


def _repeated(key: str, names: list[str]) -> Iterator[Problem]:
    for name, count in Counter(names).items():
        if count > 1:
            yield Problem(key, f"{count} of them are named {name!r}", "give every one its own name")
