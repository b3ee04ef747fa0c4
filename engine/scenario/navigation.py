"""Scenarios of cooperative navigation: vehicles, their network, and whether they are simulated or recorded."""

from __future__ import annotations

import math
from collections import Counter
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import Positive, ScenarioBase, faults
from engine.scenario.network import FixedLoss, Network, RecordedLoss
from engine.scenario.recording import CsvRecording, PyfgRecording, Simulated
from engine.scenario.vehicles import Vehicle

#: Bounds on what one trial may produce, so that no scenario can eat a machine's memory.
MAX_VEHICLES = 64
MAX_SAMPLES = 3_000_000
MAX_RECEPTIONS = 50_000
MAX_REPORTS = 20_000
DEFAULT_REPORTS = 720


def _which(value: Any) -> str:
    if isinstance(value, dict):
        return "simulated" if value.get("kind") == "simulated" else str(value.get("format", value.get("kind")))
    return getattr(value, "format", "simulated")


Mission = Annotated[
    Annotated[Simulated, Tag("simulated")]
    | Annotated[CsvRecording, Tag("csv")]
    | Annotated[PyfgRecording, Tag("pyfg")],
    Discriminator(
        _which,
        custom_error_type="mission",
        custom_error_message="is no known mission",
    ),
]


class NavigationScenario(ScenarioBase):
    """Vehicles that range each other by one-way travel times."""

    family: Literal["navigation"] = Field(description="kind of mission")
    report_interval_s: Positive | None = Field(
        None, description="time between reports, s; without it there are about 720 of them"
    )
    vehicles: list[Vehicle] = Field(
        min_length=1, max_length=MAX_VEHICLES, description="everyone with a modem or a name"
    )
    network: Network = Field(Network.model_validate({}), description="who hears whom")
    mission: Mission = Field(Simulated(kind="simulated"), description="simulated, or where the recording is")

    @property
    def names(self) -> list[str]:
        """The vehicles' names in order."""
        return [v.name for v in self.vehicles]

    @model_validator(mode="after")
    def _makes_sense(self) -> NavigationScenario:
        problems = list(_names(self)) + list(_network(self))
        if isinstance(self.mission, Simulated):
            problems += list(_simulated(self))
        else:
            problems += list(_recorded(self))
        if self.duration_s is not None and self.report_interval_s is not None:
            reports = self.duration_s / self.report_interval_s
            if not 1 <= reports <= MAX_REPORTS:
                problems.append(
                    Problem(
                        "report_interval_s",
                        f"{self.report_interval_s:g} s gives {reports:.3g} reports",
                        f"give between {self.duration_s / MAX_REPORTS:g} and {self.duration_s:g} s",
                    )
                )
        if problems:
            raise faults(problems)
        return self


def _names(scenario: NavigationScenario):
    """Vehicles named twice."""
    for name, count in Counter(n.lower() for n in scenario.names).items():
        if count > 1:
            last = max(i for i, n in enumerate(scenario.names) if n.lower() == name)
            yield Problem(
                f"vehicles[{last}].name", f"there are {count} vehicles named {scenario.names[last]!r}", "rename one"
            )


def _unknown(scenario: NavigationScenario, key: str, name: str):
    if name not in scenario.names:
        yield Problem(key, f"there is no vehicle named {name!r}", f"name one of: {', '.join(scenario.names)}")


def _network(scenario: NavigationScenario):
    """Links, slots and losses of vehicles that are not there or cannot speak."""
    network = scenario.network
    simulated = isinstance(scenario.mission, Simulated)
    mute = {v.name for v in scenario.vehicles if v.sensors.modem is None}
    if network.links != "all":
        for i, (sender, receiver) in enumerate(network.links):
            key = f"network.links[{i}]"
            yield from _unknown(scenario, key, sender)
            yield from _unknown(scenario, key, receiver)
            if sender == receiver:
                yield Problem(key, f"{sender!r} is linked to itself", "name two vehicles")
            for name in sorted({sender, receiver} & mute):
                yield Problem(key, f"{name!r} has no modem", "give it sensors.modem, or leave the link out")
    if network.tdma is not None:
        for i, slot in enumerate(network.tdma.slots):
            key = f"network.tdma.slots[{i}]"
            yield from _unknown(scenario, f"{key}.vehicle", slot.vehicle)
            if slot.vehicle in mute:
                yield Problem(f"{key}.vehicle", f"{slot.vehicle!r} has no modem", "give it sensors.modem")
            if slot.at_s >= network.tdma.cycle_s:
                yield Problem(
                    f"{key}.at_s", f"{slot.at_s:g} s is outside the cycle of {network.tdma.cycle_s:g} s", "give less"
                )
            if slot in network.tdma.slots[:i]:
                yield Problem(key, f"{slot.vehicle!r} sends twice at {slot.at_s:g} s", "leave one out")
        if not simulated:
            yield Problem("network.tdma", "a recorded mission has its own broadcasts", "leave it out")
    if isinstance(network.loss, RecordedLoss | FixedLoss):
        for i, heard in enumerate(network.loss.links):
            yield from _unknown(scenario, f"network.loss.links[{i}].sender", heard.sender)
            yield from _unknown(scenario, f"network.loss.links[{i}].receiver", heard.receiver)


def _simulated(scenario: NavigationScenario):
    """What a simulation needs, and what it would cost."""
    if scenario.duration_s is None:
        yield Problem("duration_s", "is missing", "say how long the simulated mission lasts, s")
        return
    samples = 0.0
    for i, vehicle in enumerate(scenario.vehicles):
        if vehicle.path is None:
            yield Problem(f"vehicles[{i}].path", "is missing", "say where the simulated vehicle goes, or stays")
        if vehicle.sensors.odometry is not None:
            yield Problem(
                f"vehicles[{i}].sensors.odometry", "odometry is of recorded missions", "use dvl and heading instead"
            )
        for key in ("position_m", "velocity_mps", "heading_deg"):
            if getattr(vehicle.initial, key) is not None:
                yield Problem(
                    f"vehicles[{i}].initial.{key}", "a simulated belief is drawn around the truth", "leave it out"
                )
        for sensor in (vehicle.sensors.dvl, vehicle.sensors.heading, vehicle.sensors.depth, vehicle.sensors.gps):
            samples += scenario.duration_s * sensor.rate_hz if sensor is not None else 0.0
    if samples > MAX_SAMPLES:
        yield Problem(
            "duration_s",
            f"{samples:.3g} sensor readings a trial are too many",
            f"at most {MAX_SAMPLES:g}: shorten the mission or lower the sensors' rates",
        )
    tdma = scenario.network.tdma
    if tdma is not None:
        broadcasts = math.ceil(scenario.duration_s / tdma.cycle_s) * len(tdma.slots)
        receptions = broadcasts * (len(scenario.vehicles) - 1)
        if receptions > MAX_RECEPTIONS:
            yield Problem(
                "network.tdma.cycle_s",
                f"up to {receptions:.3g} receptions a trial are too many",
                f"at most {MAX_RECEPTIONS:g}: shorten the mission or lengthen the cycle",
            )


def _recorded(scenario: NavigationScenario):
    """Mappings of vehicles that are not there, and noise that nobody states."""
    mission = scenario.mission
    by_name = {v.name: (i, v) for i, v in enumerate(scenario.vehicles)}

    def needs(key: str, name: str, sensor: str, why: str):
        found = by_name.get(name)
        if found is not None and getattr(found[1].sensors, sensor) is None:
            yield Problem(f"vehicles[{found[0]}].sensors.{sensor}", f"{key} gives it {why}", "state the sensor's noise")

    if isinstance(mission, PyfgRecording):
        for key, name in mission.robots.items():
            yield from _unknown(scenario, f"mission.robots.{key}", name)
        for key, name in mission.nodes.items():
            yield from _unknown(scenario, f"mission.nodes.{key}", name)
            if name in by_name and by_name[name][1].kind != "fixed":
                yield Problem(f"mission.nodes.{key}", f"{name!r} is not a fixed vehicle", 'give it kind = "fixed"')
        if mission.moving_beacon is not None:
            yield from _unknown(scenario, "mission.moving_beacon", mission.moving_beacon)
        if mission.landmarks != "off":
            for i, name in enumerate(mission.landmarks):
                yield from _unknown(scenario, f"mission.landmarks[{i}]", name)
        return
    assert isinstance(mission, CsvRecording)
    for kind, sensor in (
        ("odometry", "odometry"),
        ("velocity", "dvl"),
        ("heading", "heading"),
        ("depth", "depth"),
        ("fixes", "gps"),
        ("truth", None),
    ):
        seen: set[str] = set()
        for i, source in enumerate(getattr(mission, kind)):
            key = f"mission.{kind}[{i}]"
            yield from _unknown(scenario, f"{key}.vehicle", source.vehicle)
            if source.vehicle in seen:
                yield Problem(f"{key}.vehicle", f"{source.vehicle!r} has another {kind} file", "join the files")
            seen.add(source.vehicle)
            if sensor is not None and getattr(source, "cov", None) is None:
                yield from needs(key, source.vehicle, sensor, f"{kind} readings")
    for i, source in enumerate(mission.ranges):
        key = f"mission.ranges[{i}]"
        for end in ("sender", "receiver"):
            if getattr(source, end) is not None:
                yield from _unknown(scenario, f"{key}.{end}", getattr(source, end))
        for label, name in source.names.items():
            yield from _unknown(scenario, f"{key}.names.{label}", name)
    for i, source in enumerate(mission.nodes):
        for label, name in source.names.items():
            yield from _unknown(scenario, f"mission.nodes[{i}].names.{label}", name)
