"""What any recording gives, whatever its format, and how it becomes a log.

Who believes what at the start: the position that the scenario states for the vehicle (`initial.position_m`), else the
reference's, else its first fix; a fixed node's surveyed place. The heading of a vehicle that integrates odometry:
`initial.heading_deg`, else the reference's heading, else the direction of the reference's first metre. From then on
nothing of the reference is used but to score.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from engine.mission.channel import heard
from engine.mission.log import (
    AcousticLog,
    Depth,
    Fixes,
    Heading,
    InitialBelief,
    Log,
    Odometry,
    VehicleLog,
    Velocity,
)
from engine.mission.reports import report_times
from engine.mission.streams import uniforms
from engine.mission.vehicle import within
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.models import MAX_DURATION_S
from engine.scenario.navigation import MAX_RECEPTIONS, MAX_REPORTS, NavigationScenario
from engine.scenario.paths import Station
from engine.scenario.vehicles import OdometrySensor, Vehicle


@dataclass(frozen=True)
class Sensed:
    """One vehicle's own readings, with the leading trial axis of length 1."""

    velocity: Velocity | None = None
    heading: Heading | None = None
    odometry: Odometry | None = None
    depth: Depth | None = None
    fixes: Fixes | None = None


@dataclass(frozen=True)
class Course:
    """A reference trajectory: time_s (N,), position (N, 2) m and, where known, heading (N,) rad."""

    time_s: np.ndarray
    position: np.ndarray
    heading: np.ndarray | None
    max_gap_s: float


@dataclass(frozen=True)
class Reception:
    """A broadcast (its number, sender, time of launch) as one receiver measured it; travel_time_s NaN if not heard.

    A broadcast that nobody could hear has no receiver.
    """

    broadcast: int
    sender: str
    tol_s: float
    receiver: str | None
    toa_s: float
    travel_time_s: float


@dataclass(frozen=True)
class Recording:
    """A recording with times in seconds of its own clock; `start_s` of that clock is time zero of the mission."""

    sensed: dict[str, Sensed]
    receptions: list[Reception]
    nodes: dict[str, np.ndarray]
    reference: dict[str, Course]
    start_s: float
    notes: tuple[str, ...] = field(default=())


def first_instant(sensed: dict[str, Sensed], receptions: Sequence[Reception], reference: dict[str, Course]) -> float:
    """Time zero where nobody states one: the earliest reading, or the reference just before it.

    An increment of odometry began before its reading: at the reference just before it, else as long before as the
    next reading comes after.
    """
    times = [float(r.tol_s) for r in receptions]
    for name, own in sensed.items():
        times += [float(s.time_s[0]) for s in _sensors(own) if s is not own.odometry]
        if own.odometry is not None:
            t = own.odometry.time_s
            mine = {name: reference[name]} if name in reference else {}
            before = _before(mine, float(t[0]), strictly=True)
            times.append(before if before is not None else float(2 * t[0] - t[1]) if len(t) > 1 else float(t[0]))
    times += [] if times else [float(c.time_s[0]) for c in reference.values()]
    if not times:
        raise ScenarioError([Problem("mission", "nothing is recorded", "map at least one file")])
    before = _before(reference, min(times), strictly=False)
    return min(times) if before is None else before


def _before(reference: dict[str, Course], time_s: float, *, strictly: bool) -> float | None:
    """The last instant of any reference before (or at) a time, if not longer before than the reference's gaps."""
    found = []
    for course in reference.values():
        k = int(np.searchsorted(course.time_s, time_s, side="left" if strictly else "right")) - 1
        if k >= 0 and time_s - course.time_s[k] <= course.max_gap_s:
            found.append(float(course.time_s[k]))
    return max(found, default=None)


def _sensors(own: Sensed):
    return [s for s in (own.velocity, own.heading, own.odometry, own.depth, own.fixes) if s is not None]


def assemble(scenario: NavigationScenario, recording: Recording, trials: Sequence[int]) -> Log:
    """The log of a recording: times from its start, cut to the scenario's duration, with the scenario's links and loss.

    Losses that the scenario asks for come on top of the recorded ones and differ between trials; all else is the same
    in every trial. Raises ScenarioError where a belief at the start has nothing to stand on.
    """
    start = recording.start_s
    ends = [float(s.time_s[-1]) for own in recording.sensed.values() for s in _sensors(own)]
    ends += [r.toa_s for r in recording.receptions]
    last = max(ends, default=start) - start
    duration = scenario.duration_s if scenario.duration_s is not None else last
    if not 0 < duration <= MAX_DURATION_S:
        message = f"the recording spans {duration:g} s"
        raise ScenarioError([Problem("duration_s", message, "check start_s and the unit of the time columns")])
    if scenario.report_interval_s is not None and duration / scenario.report_interval_s > MAX_REPORTS:
        message = f"{scenario.report_interval_s:g} s gives {duration / scenario.report_interval_s:.3g} reports"
        raise ScenarioError([Problem("report_interval_s", message, f"give at least {duration / MAX_REPORTS:g} s")])
    time_s = report_times(duration, scenario.report_interval_s)
    reference = {n: replace(c, time_s=c.time_s - start) for n, c in recording.reference.items()}
    notes = list(recording.notes)
    if last > duration:
        notes.append(f"the recording goes on for {last - duration:.0f} s after the mission's end")

    vehicles = []
    for i, vehicle in enumerate(scenario.vehicles):
        own = _cut(recording.sensed.get(vehicle.name, Sensed()), start, duration)
        if own.velocity is not None and own.heading is None:
            message = f"{vehicle.name!r} has body velocities but no heading to turn them by"
            raise ScenarioError([Problem("mission.heading", message, "map its headings, or world velocities")])
        belief = _believe(i, vehicle, own, recording.nodes.get(vehicle.name), reference.get(vehicle.name))
        vehicles.append(
            VehicleLog(
                name=vehicle.name,
                kind=vehicle.kind,
                initial=belief,
                acceleration_psd=vehicle.acceleration_psd,
                range_sigma_m=vehicle.sensors.modem.range_sigma_m if vehicle.sensors.modem is not None else 1.0,
                depth_m=vehicle.depth_m,
                velocity=own.velocity,
                heading=own.heading,
                odometry=own.odometry,
                depth=own.depth,
                fixes=own.fixes,
            )
        )
    return Log(
        duration_s=duration,
        trials=len(trials),
        time_s=time_s,
        truth={n: interpolate(c, time_s)[None] for n, c in reference.items()},
        vehicles=tuple(vehicles),
        acoustics=_acoustics(scenario, recording.receptions, start, duration, trials),
        sound_speed_mps=scenario.network.sound_speed_mps,
        sound_speed_sigma_mps=scenario.network.sound_speed_sigma_mps,
        gate_sigma=scenario.network.gate_sigma,
        notes=tuple(notes),
    )


def _cut(own: Sensed, start: float, duration: float) -> Sensed:
    """Readings within the mission, on its clock, with what the start and the end need of their neighbours."""
    kept = {}
    for name in ("velocity", "heading", "odometry", "depth", "fixes"):
        sensor = getattr(own, name)
        if sensor is None:
            continue
        time_s = sensor.time_s - start
        first = int(np.searchsorted(time_s, 0.0, side="left"))
        last = int(np.searchsorted(time_s, duration, side="right"))
        if first == last == len(time_s) or (first == last and name != "odometry"):
            continue
        if name == "heading" and time_s[first] > 0:
            # The heading in force at the start is the last one before it.
            first = max(first - 1, 0)
        if name == "odometry":
            # The increment over the end is needed up to there.
            last = min(last + 1, len(time_s))
        inside = slice(first, last)
        parts = {"time_s": time_s[inside], "value": sensor.value[:, inside]}
        if hasattr(sensor, "cov"):
            parts["cov"] = sensor.cov[inside]
        if name == "odometry" and first > 0 and time_s[first] > 0 > time_s[first - 1]:
            # Of the increment over the start, only what comes after it.
            share = time_s[first] / (time_s[first] - time_s[first - 1])
            parts["value"], parts["cov"] = parts["value"].copy(), parts["cov"].copy()
            parts["value"][:, 0] *= share
            parts["cov"][0] *= share
        kept[name] = replace(sensor, **parts)
    return Sensed(**kept)


def interpolate(course: Course, time_s: np.ndarray) -> np.ndarray:
    """Reference positions (T, 2) at the given times; NaN outside the reference and in gaps longer than it allows."""
    t = course.time_s
    found = np.stack([np.interp(time_s, t, course.position[:, i]) for i in range(2)], axis=-1)
    after = np.clip(np.searchsorted(t, time_s, side="left"), 0, len(t) - 1)
    before = np.clip(np.searchsorted(t, time_s, side="right") - 1, 0, len(t) - 1)
    found[(time_s < t[0]) | (time_s > t[-1]) | (t[after] - t[before] > course.max_gap_s)] = np.nan
    return found


def odometry_cov(noise: OdometrySensor, forward: np.ndarray, left: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """Covariance (N, 3, 3) of increments from their length and duration, the stated variances added up."""
    metres = np.hypot(forward, left)
    cov = np.zeros((len(forward), 3, 3))
    for part, amount in ((noise.per_reading, np.ones_like(dt)), (noise.per_sqrt_m, metres), (noise.per_sqrt_s, dt)):
        if part is None:
            continue
        sigma = np.array([part.forward_sigma_m, part.left_sigma_m, np.radians(part.turn_sigma_deg)])
        cov += np.diag(sigma**2) * amount[:, None, None]
    return cov


def _believe(
    i: int, vehicle: Vehicle, own: Sensed, surveyed: np.ndarray | None, course: Course | None
) -> InitialBelief:
    """What a vehicle believes at the start of a recording (see the top of this file)."""
    initial, key = vehicle.initial, f"vehicles[{i}].initial"
    if initial.position_m is not None:
        position = np.array(initial.position_m, dtype=float)
    elif surveyed is not None:
        position = surveyed
    elif course is not None:
        position = course.position[max(np.searchsorted(course.time_s, 0.0, side="right") - 1, 0)]
    elif own.fixes is not None:
        position = own.fixes.value[0, 0]
    elif isinstance(vehicle.path, Station):
        position = np.array(vehicle.path.position_m, dtype=float)
    else:
        message = f"nothing says where {vehicle.name!r} is at the start"
        raise ScenarioError([Problem(f"{key}.position_m", message, "state it, or map its reference, fixes or node")])
    if initial.velocity_mps is not None:
        velocity = np.array(initial.velocity_mps, dtype=float)
    elif course is not None and vehicle.kind != "fixed":
        velocity = _early_velocity(course)
    else:
        velocity = np.zeros(2)
    heading = 0.0
    if initial.heading_deg is not None:
        heading = float(np.radians(initial.heading_deg))
    elif own.odometry is not None:
        found = _early_heading(course)
        if found is None:
            message = f"nothing says where {vehicle.name!r}, which integrates odometry, heads at the start"
            raise ScenarioError([Problem(f"{key}.heading_deg", message, "state it, or map a reference with headings")])
        heading = found
    return InitialBelief(
        position_m=position[None],
        position_cov=np.eye(2) * initial.position_sigma_m**2,
        velocity_mps=velocity[None],
        velocity_sigma_mps=initial.velocity_sigma_mps,
        heading_rad=np.array([heading]),
        heading_sigma_rad=float(np.radians(initial.heading_sigma_deg)),
    )


def _early_velocity(course: Course) -> np.ndarray:
    k = max(int(np.searchsorted(course.time_s, 0.0, side="right")) - 1, 0)
    if k + 1 >= len(course.time_s):
        return np.zeros(2)
    return (course.position[k + 1] - course.position[k]) / (course.time_s[k + 1] - course.time_s[k])


def _early_heading(course: Course | None) -> float | None:
    """The reference's heading at the start, or the direction of its first metre; None where there is neither."""
    if course is None:
        return None
    k = max(int(np.searchsorted(course.time_s, 0.0, side="right")) - 1, 0)
    if course.heading is not None:
        return float(course.heading[k])
    ahead = course.position[k:] - course.position[k]
    far = np.flatnonzero(np.linalg.norm(ahead, axis=1) >= 1.0)
    return float(np.arctan2(ahead[far[0], 1], ahead[far[0], 0])) if far.size else None


def _acoustics(
    scenario: NavigationScenario, receptions: Sequence[Reception], start: float, duration: float, trials: Sequence[int]
) -> AcousticLog:
    """The channel's history on the mission's clock, without what lies outside the mission or the scenario's links."""
    index = {name: i for i, name in enumerate(scenario.names)}
    allowed = None if scenario.network.links == "all" else {tuple(pair) for pair in scenario.network.links}
    inside = [r for r in receptions if r.tol_s >= start and r.toa_s - start <= duration]
    if len(inside) > MAX_RECEPTIONS:
        message = f"{len(inside)} ranges are too many"
        raise ScenarioError([Problem("duration_s", message, f"at most {MAX_RECEPTIONS}: shorten the mission")])
    launches = sorted({r.broadcast: r for r in inside}.values(), key=lambda r: (r.tol_s, r.broadcast))
    number = {r.broadcast: n for n, r in enumerate(launches)}
    mine = [r for r in inside if r.receiver is not None and (allowed is None or (r.sender, r.receiver) in allowed)]
    mine.sort(key=lambda r: (r.toa_s, number[r.broadcast]))
    sender = np.array([index[r.sender] for r in launches], dtype=int)
    tol = np.array([r.tol_s - start for r in launches])
    broadcast = np.array([number[r.broadcast] for r in mine], dtype=int)
    receiver = np.array([index[r.receiver] for r in mine if r.receiver is not None], dtype=int)
    travel = np.tile([r.travel_time_s for r in mine], (len(trials), 1))
    toa = np.array([r.toa_s - start for r in mine])
    travel[~_through(scenario, sender, tol, broadcast, receiver, toa, travel, trials)] = np.nan
    return AcousticLog(sender, tol, broadcast, receiver, toa, travel)


def _through(scenario, sender, tol, broadcast, receiver, toa, travel, trials) -> np.ndarray:
    """Which recorded receptions (trials, R) survive the loss that the scenario adds."""
    loss = scenario.network.loss_model
    got = np.ones(travel.shape, dtype=bool)
    got[:, within(scenario.network.silences, toa)] = False
    if scenario.network.loss == 0:
        return got
    distance = np.nan_to_num(travel[0] * scenario.network.sound_speed_mps)
    for r, name in enumerate(scenario.names):
        chance = uniforms(scenario.seed, trials, name, "ranging chances", (len(tol), 3))
        for s, other in enumerate(scenario.names):
            mine = (receiver == r) & (sender[broadcast] == s)
            if mine.any():
                b = broadcast[mine]
                turn = np.cumsum(sender == s)[b] - 1
                got[:, mine] = heard(loss, (other, name), turn, tol[b], distance[mine], chance[:, b])
    return got
