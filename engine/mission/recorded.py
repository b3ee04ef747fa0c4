"""Recorded missions: a person's own CSV files, mapped to sensors by the scenario.

An example, a vehicle with a compass and a Doppler log that ranges two moored beacons::

    schema = 1
    title = "Harbour trial, 3 May"
    family = "navigation"
    algorithms = ["dead_reckoning", "cekf", "nekf"]

    [mission]
    kind = "recorded"
    format = "csv"
    log = "harbour"                       # folder beside this file, or in COOPNAV_TEST_DATA

    [[mission.velocity]]
    vehicle = "auv"
    file = "dvl.csv"
    time = "unix_ms"
    time_unit = "ms"
    forward = "u"
    right = "v"

    [[mission.heading]]
    vehicle = "auv"
    file = "compass.csv"
    time = "unix_ms"
    time_unit = "ms"
    heading = "hdg"
    unit = "deg"
    convention = "compass"                # clockwise from north

    [[mission.ranges]]
    file = "modem.csv"
    time = "unix_ms"
    time_unit = "ms"
    receiver = "auv"
    sender_column = "beacon"
    names = { "17" = "north", "18" = "south" }
    travel_time = "owtt_ms"
    travel_time_unit = "ms"

    [[vehicles]]
    name = "auv"
    kind = "auv"
    initial = { position_m = [12.0, -4.0], position_sigma_m = 3.0 }
    [vehicles.sensors]
    dvl = { along_sigma_mps = 0.05, cross_sigma_mps = 0.05 }
    heading = { sigma_deg = 2.0 }
    modem = { range_sigma_m = 1.0 }

    [[vehicles]]
    name = "north"
    kind = "fixed"
    initial = { position_m = [80.0, 120.0], position_sigma_m = 0.5 }
    sensors = { modem = { range_sigma_m = 1.0 } }

    (and "south" likewise)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from engine.mission.log import Depth, Fixes, Heading, Log, Odometry, Velocity
from engine.mission.logs import log_folder
from engine.mission.pyfg import read_pyfg
from engine.mission.recording import (
    Course,
    Reception,
    Recording,
    Sensed,
    assemble,
    first_instant,
    odometry_cov,
)
from engine.mission.tables import PER_SECOND, Sheet, sheet, stacked
from engine.scenario.navigation import NavigationScenario
from engine.scenario.recording import CsvRecording, OdometryFile, RangesFile, VelocityFile
from engine.scenario.vehicles import Vehicle


def read(scenario: NavigationScenario, trials: Sequence[int], logs: Sequence[Path | str] = ()) -> Log:
    """The log of a recorded mission, the same in every trial. Raises ScenarioError for what cannot be read."""
    folder = log_folder(scenario, logs)
    if isinstance(scenario.mission, CsvRecording):
        recording = read_csv(scenario, scenario.mission, folder)
    else:
        recording = read_pyfg(scenario, folder)
    return assemble(scenario, recording, trials)


def read_csv(scenario: NavigationScenario, mission: CsvRecording, folder: Path) -> Recording:
    """All the files that a scenario maps."""
    opened: dict[str, Sheet] = {}

    def open_(file: str, key: str) -> Sheet:
        if file not in opened:
            opened[file] = sheet(folder / file, key)
        return replace(opened[file], key=key)

    vehicles = {v.name: v for v in scenario.vehicles}
    parts: dict[str, dict] = {name: {} for name in vehicles}

    for i, source in enumerate(mission.odometry):
        rows = open_(source.file, f"mission.odometry[{i}]")
        parts[source.vehicle]["odometry"] = _odometry(rows, source, vehicles[source.vehicle])
    for i, source in enumerate(mission.heading):
        rows = open_(source.file, f"mission.heading[{i}]")
        sensor = vehicles[source.vehicle].sensors.heading
        assert sensor is not None
        value = angles(rows.numbers(source.heading), source.unit, source.convention)
        parts[source.vehicle]["heading"] = Heading(
            rows.times(source.time, source.time_unit), value[None], float(np.radians(sensor.sigma_deg))
        )
    for i, source in enumerate(mission.velocity):
        rows = open_(source.file, f"mission.velocity[{i}]")
        parts[source.vehicle] |= _velocity(rows, source, vehicles[source.vehicle])
    for i, source in enumerate(mission.depth):
        rows = open_(source.file, f"mission.depth[{i}]")
        sensor = vehicles[source.vehicle].sensors.depth
        assert sensor is not None
        value = rows.numbers(source.depth) * (1.0 if source.positive == "down" else -1.0)
        parts[source.vehicle]["depth"] = Depth(rows.times(source.time, source.time_unit), value[None], sensor.sigma_m)
    for i, source in enumerate(mission.fixes):
        rows = open_(source.file, f"mission.fixes[{i}]")
        value = stacked(rows, [source.x, source.y])
        if source.cov is not None:
            cov = _symmetric(rows, stacked(rows, source.cov), source.cov)
        else:
            sensor = vehicles[source.vehicle].sensors.gps
            assert sensor is not None
            cov = np.tile(np.eye(2) * sensor.sigma_m**2, (len(value), 1, 1))
        parts[source.vehicle]["fixes"] = Fixes(rows.times(source.time, source.time_unit), value[None], cov)

    nodes: dict[str, np.ndarray] = {}
    for i, source in enumerate(mission.nodes):
        rows = open_(source.file, f"mission.nodes[{i}]")
        for label, place in zip(rows.text(source.name), stacked(rows, [source.x, source.y])):
            name = source.names.get(label, label)
            if name in vehicles:
                nodes[name] = place

    receptions: list[Reception] = []
    for i, source in enumerate(mission.ranges):
        rows = open_(source.file, f"mission.ranges[{i}]")
        receptions += _ranges(rows, source, scenario, len(receptions))

    reference: dict[str, Course] = {}
    for i, source in enumerate(mission.truth):
        rows = open_(source.file, f"mission.truth[{i}]")
        heading = None
        if source.heading is not None:
            heading = angles(rows.numbers(source.heading), source.heading_unit, source.convention)
        reference[source.vehicle] = Course(
            rows.times(source.time, source.time_unit), stacked(rows, [source.x, source.y]), heading, source.max_gap_s
        )

    sensed = {name: Sensed(**own) for name, own in parts.items()}
    start = mission.start_s if mission.start_s is not None else first_instant(sensed, receptions, reference)
    return Recording(sensed, receptions, nodes, reference, start)


def angles(value: np.ndarray, unit: str, convention: str) -> np.ndarray:
    """Headings in radians counter-clockwise from x, from degrees and compass headings where they are such."""
    value = np.radians(value) if unit == "deg" else value
    return np.pi / 2 - value if convention == "compass" else value


def _odometry(rows: Sheet, source: OdometryFile, vehicle: Vehicle) -> Odometry:
    time_s = rows.times(source.time, source.time_unit)
    forward = rows.numbers(source.forward)
    left = rows.numbers(source.left) if source.left is not None else np.zeros_like(forward)
    turn = rows.numbers(source.turn) * (1.0 if source.turn_positive == "left" else -1.0)
    turn = np.radians(turn) if source.turn_unit == "deg" else turn
    if source.cov is not None:
        cov = _symmetric(rows, stacked(rows, source.cov), source.cov)
    else:
        first = time_s[1] - time_s[0] if len(time_s) > 1 else 1.0
        dt = np.diff(time_s, prepend=time_s[0] - first)
        noise = vehicle.sensors.odometry
        assert noise is not None
        cov = odometry_cov(noise, forward, left, dt)
    return Odometry(time_s, np.stack([forward, left, turn], axis=-1)[None], cov)


def _velocity(rows: Sheet, source: VelocityFile, vehicle: Vehicle) -> dict:
    sensor = vehicle.sensors.dvl
    assert sensor is not None
    time_s = rows.times(source.time, source.time_unit)
    if source.east is not None and source.north is not None:
        value = stacked(rows, [source.east, source.north])
        along_x = Heading(time_s[:1], np.zeros((1, 1)), 0.0)
        return {
            "velocity": Velocity(time_s, value[None], sensor.along_sigma_mps, sensor.cross_sigma_mps),
            "heading": along_x,
        }
    assert source.forward is not None
    forward = rows.numbers(source.forward)
    if source.left is not None:
        left = rows.numbers(source.left)
    elif source.right is not None:
        left = -rows.numbers(source.right)
    else:
        left = np.zeros_like(forward)
    value = np.stack([forward, left], axis=-1)
    return {"velocity": Velocity(time_s, value[None], sensor.along_sigma_mps, sensor.cross_sigma_mps)}


def _symmetric(rows: Sheet, upper: np.ndarray, columns: Sequence[str]) -> np.ndarray:
    """Covariances (N, n, n) from upper triangles by rows (N, n(n+1)/2); each must be one."""
    n = 2 if upper.shape[1] == 3 else 3
    cov = np.empty((len(upper), n, n))
    i, j = np.triu_indices(n)
    cov[:, i, j] = cov[:, j, i] = upper
    wrong = np.flatnonzero(np.linalg.eigvalsh(cov)[:, 0] < -1e-12 * np.abs(cov).max(axis=(1, 2)))
    if wrong.size:
        raise rows.fault(int(wrong[0]), columns[0], "is of no covariance", "give variances and covariances, not sigmas")
    return cov


def _ranges(rows: Sheet, source: RangesFile, scenario: NavigationScenario, offset: int) -> list[Reception]:
    """One reception a row; `offset` keeps the broadcasts of several files apart."""
    if source.sort:
        rows = rows.sorted_by(source.time)
    toa = rows.times(source.time, source.time_unit, repeats=True)
    count = len(toa)
    speed = scenario.network.sound_speed_mps
    column = source.range or source.travel_time or ""
    measured = rows.numbers(column, empty=source.broadcast is not None)
    wrong = np.flatnonzero(measured <= 0)
    if wrong.size:
        raise rows.fault(int(wrong[0]), column, f"{measured[wrong[0]]:g} is no range", "leave out the row")
    travel = measured / speed if source.range is not None else measured
    if source.range is None and source.travel_time_unit != "s":
        travel = travel / PER_SECOND[source.travel_time_unit]
    tol = toa - travel
    if source.tol is not None:
        tol = rows.numbers(source.tol)
        tol = tol / PER_SECOND[source.time_unit] if source.time_unit != "s" else tol
        early = np.flatnonzero(tol > toa)
        if early.size:
            message = f"{tol[early[0]]:.17g} s is after its arrival at {toa[early[0]]:.17g} s"
            raise rows.fault(int(early[0]), source.tol, message, "give both on one clock, or leave the column out")
    senders = _who(rows, source, source.sender, source.sender_column, scenario)
    receivers = _who(rows, source, source.receiver, source.receiver_column, scenario)
    numbers = rows.text(source.broadcast) if source.broadcast is not None else [str(i) for i in range(count)]
    order: dict[str, int] = {}
    launched: dict[int, tuple[str, float]] = {}
    found = []
    for i in range(count):
        sender, receiver = senders[i], receivers[i]
        if sender is None or receiver is None:
            continue
        if receiver == "" and source.broadcast is None:
            raise rows.fault(i, source.receiver_column or "", "is empty", "name who measured the range")
        if not sender:
            raise rows.fault(i, source.sender_column or "", "is empty", "name who sent")
        if sender == receiver:
            raise rows.fault(
                i, source.sender_column or source.receiver_column or "", f"{sender!r} hears itself", "drop it"
            )
        number = offset + order.setdefault(numbers[i], len(order))
        if launched.setdefault(number, (sender, tol[i])) != (sender, tol[i]):
            message = f"broadcast {numbers[i][:40]!r} has another sender or time of launch above"
            raise rows.fault(i, source.broadcast or "", message, "number every broadcast once")
        found.append(Reception(number, sender, float(tol[i]), receiver or None, float(toa[i]), float(travel[i])))
    return found


def _who(
    rows: Sheet, source: RangesFile, name: str | None, column: str | None, scenario: NavigationScenario
) -> list[str | None]:
    """The vehicle of every row; None for one to ignore, "" where the cell is empty."""
    if name is not None or column is None:
        return [name] * len(rows.rows)
    known = set(scenario.names)
    found: list[str | None] = []
    for i, label in enumerate(rows.text(column)):
        who = source.names.get(label, label)
        if label in source.ignore:
            found.append(None)
        elif who in known or not label:
            found.append(who if label else "")
        else:
            raise rows.fault(
                i, column, f"{label[:40]!r} is no vehicle of the scenario", "add it under names, or under ignore"
            )
    return found
