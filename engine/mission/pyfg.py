"""Recorded missions in PyFG, the text format of range-aided SLAM.

Poses are `VERTEX_SE2 t KEY x y theta`, the first letter of a key its robot; points `VERTEX_XY KEY x y`, with
`VERTEX_XY:PRIOR t KEY x y` + covariance where they were measured; odometry `EDGE_SE2 t FROM TO dx dy dtheta` +
covariance; ranges `EDGE_RANGE t FROM TO range variance`; sightings `EDGE_SE2_XY t FROM TO dx dy` + covariance.
Covariances are upper triangles by rows. Some files leave the edges' times at zero, so all times are the poses'.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np

from engine.mission.log import Fixes, Odometry
from engine.mission.recording import Course, Reception, Recording, Sensed, first_instant, odometry_cov
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.navigation import NavigationScenario
from engine.scenario.recording import PyfgRecording

#: A fix from sightings is taken where its larger standard deviation stays below this, m.
USEFUL_FIX_M = 1.0
MAX_LINES = 5_000_000


@dataclass
class Graph:
    """The file's content: poses key -> (t, x, y, theta), points key -> (x, y), and the edges in the file's order."""

    poses: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    points: dict[str, np.ndarray] = field(default_factory=dict)
    priors: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    odometry: list[tuple[str, str, np.ndarray, np.ndarray]] = field(default_factory=list)
    ranges: list[tuple[str, str, float]] = field(default_factory=list)
    sightings: list[tuple[str, str, np.ndarray, np.ndarray]] = field(default_factory=list)


def read_pyfg(scenario: NavigationScenario, folder: Path) -> Recording:
    """The recording in a PyFG file. Raises ScenarioError for what cannot be read or belongs to no vehicle."""
    mission = scenario.mission
    assert isinstance(mission, PyfgRecording)
    graph = parse(folder / mission.file)
    robot = {key: mission.robots.get(key[0]) for key in graph.poses}
    for key, name in robot.items():
        if name is None:
            _fail(
                "mission.robots", f"{mission.file} has poses of robot {key[0]!r}", f"name its vehicle: {key[0]} = ..."
            )
    present = {key[0] for key in graph.poses}
    for letter in mission.robots:
        if letter not in present:
            _fail(f"mission.robots.{letter}", f"{mission.file} has no poses of {letter!r}", f"it has {sorted(present)}")

    sensed, reference = {}, {}
    for letter, name in mission.robots.items():
        sensed[name] = Sensed(odometry=_odometry(scenario, graph, letter, name))
        poses = np.array([graph.poses[k] for k in _in_time(graph, letter)])
        if mission.reference != "none":
            reference[name] = Course(poses[:, 0], poses[:, 1:3], poses[:, 3], mission.max_gap_s)
    nodes = {name: _point(graph, key, mission) for key, name in mission.nodes.items()}

    receptions, beacon, repeats = _receptions(scenario, graph, mission)
    if mission.moving_beacon is not None:
        sensed[mission.moving_beacon] = Sensed(fixes=_beacon_fixes(graph, beacon, mission))
    notes = [f"{repeats} ranges stand in the file twice and are used once"] if repeats else []
    if mission.reference == "own_navigation":
        notes.append("the reference is the vehicle's own navigation, no independent truth: its errors prove nothing")
    if mission.landmarks != "off":
        for name in mission.landmarks:
            fixes = _landmark_fixes(graph, {k for k, n in robot.items() if n == name})
            if fixes is None:
                _fail("mission.landmarks", f"{name!r} sees no two landmarks at once", "leave it out")
            sensed[name] = Sensed(odometry=sensed[name].odometry, fixes=fixes)
            notes.append(f"{name} takes {len(fixes.time_s)} sightings of known landmarks as position fixes")
    return Recording(sensed, receptions, nodes, reference, first_instant(sensed, receptions, reference), tuple(notes))


def _fail(key: str, message: str, remedy: str) -> NoReturn:
    raise ScenarioError([Problem(key, message, remedy)])


# --- the file ------------------------------------------------------------------------------------------------------

_NUMBERS = {
    "VERTEX_SE2": (1, [1, 3, 4, 5]),
    "VERTEX_XY": (0, [2, 3]),
    "VERTEX_XY:PRIOR": (1, [3, 4, 5, 6, 7]),
    "EDGE_SE2": (1, list(range(4, 13))),
    "EDGE_RANGE": (1, [4]),
    "EDGE_SE2_XY": (1, [4, 5, 6, 7, 8]),
}


def parse(path: Path) -> Graph:
    """Read a PyFG file; lines of other kinds are passed over. Raises ScenarioError with the line at fault."""
    graph = Graph()
    for number, words in _lines(path):
        kind = words[0]
        if kind not in _NUMBERS:
            continue
        try:
            values = [float(words[i]) for i in _NUMBERS[kind][1]]
        except (ValueError, IndexError):
            _fail("mission.file", f"{path.name} line {number}: this is no complete {kind}", "correct or drop the line")
        if not all(map(math.isfinite, values)):
            _fail("mission.file", f"{path.name} line {number}: a number is not finite", "correct or drop the line")
        match kind:
            case "VERTEX_SE2":
                if words[2] in graph.poses:
                    _fail("mission.file", f"{path.name} line {number}: pose {words[2]} again", "give every pose once")
                graph.poses[words[2]] = (values[0], values[1], values[2], values[3])
            case "VERTEX_XY":
                graph.points[words[1]] = np.array(values)
            case "VERTEX_XY:PRIOR":
                graph.priors[words[2]] = (np.array(values[:2]), _full(values[2:], 2))
            case "EDGE_SE2":
                graph.odometry.append((words[2], words[3], np.array(values[:3]), _full(values[3:], 3)))
            case "EDGE_RANGE":
                if values[0] <= 0:
                    _fail("mission.file", f"{path.name} line {number}: {values[0]:g} is no range", "drop the line")
                graph.ranges.append((words[2], words[3], values[0]))
            case "EDGE_SE2_XY":
                graph.sightings.append((words[2], words[3], np.array(values[:2]), _full(values[2:], 2)))
    if not graph.poses:
        _fail("mission.file", f"{path.name} has no poses (VERTEX_SE2)", "check that it is a PyFG file")
    return graph


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    try:
        with open(path, encoding="utf-8") as file:
            for number, line in enumerate(file, start=1):
                if number > MAX_LINES:
                    _fail("mission.file", f"{path.name} has more than {MAX_LINES} lines", "cut the log")
                words = line.split()
                if words:
                    yield number, words
    except UnicodeDecodeError:
        _fail("mission.file", f"{path.name} is not text", "check that it is a PyFG file")
    except OSError as error:
        _fail("mission.file", f"{path.name} cannot be read: {error.strerror}", "check the file")


def _full(upper: list[float], n: int) -> np.ndarray:
    cov = np.empty((n, n))
    i, j = np.triu_indices(n)
    cov[i, j] = cov[j, i] = upper
    return cov


def _point(graph: Graph, key: str, mission: PyfgRecording) -> np.ndarray:
    if key not in graph.points:
        _fail(
            f"mission.nodes.{key}", f"{mission.file} has no point {key!r}", f"it has {', '.join(sorted(graph.points))}"
        )
    return graph.points[key]


# --- readings ------------------------------------------------------------------------------------------------------


def _in_time(graph: Graph, letter: str) -> list[str]:
    """The keys of a robot's poses in order of time."""
    return sorted((k for k in graph.poses if k[0] == letter), key=lambda k: graph.poses[k][0])


def _odometry(scenario: NavigationScenario, graph: Graph, letter: str, name: str) -> Odometry | None:
    """A robot's increments from pose to pose; noise as its scenario states it, else the file's covariances, scaled.

    Relative poses between any others (loop closures) are no odometry and not used.
    """
    mission = scenario.mission
    assert isinstance(mission, PyfgRecording)
    between = {e[:2]: e for e in graph.odometry if e[0][0] == letter}
    for pair in between:
        for key in pair:
            if key not in graph.poses:
                _fail(
                    "mission.file", f"{mission.file}: odometry from {pair[0]} to {pair[1]} lacks pose {key}", "add it"
                )
    keys = _in_time(graph, letter)
    edges = []
    for start, end in pairwise(keys):
        if (start, end) not in between:
            _fail("mission.file", f"{mission.file}: there is no odometry from {start} to the next pose {end}", "add it")
        edges.append(between[start, end])
    if not edges:
        return None
    begin, time_s = (np.array([graph.poses[k][0] for k in ks]) for ks in (keys[:-1], keys[1:]))
    if np.any(time_s <= begin):
        k = int(np.argmax(time_s <= begin))
        _fail("mission.file", f"{mission.file}: poses {keys[k]} and {keys[k + 1]} are at the same time", "drop one")
    value = np.stack([e[2] for e in edges])
    vehicle = next(v for v in scenario.vehicles if v.name == name)
    if vehicle.sensors.odometry is not None:
        cov = odometry_cov(vehicle.sensors.odometry, value[:, 0], value[:, 1], time_s - begin)
    else:
        cov = np.stack([e[3] for e in edges]) * mission.odometry_cov_scale
    return Odometry(time_s, value[None], cov)


def _receptions(
    scenario: NavigationScenario, graph: Graph, mission: PyfgRecording
) -> tuple[list[Reception], list[tuple[float, str]], int]:
    """Every range as a broadcast heard by its observer, (time of launch, point) of those from the moving beacon, and
    how many lines only repeat another: the same distance from the same pose to the same place."""
    speed = scenario.network.sound_speed_mps
    found, beacon = [], []
    seen: set[tuple] = set()
    for observer, target, distance in graph.ranges:
        if observer not in graph.poses:
            _fail("mission.file", f"{mission.file}: a range is measured from {observer}, which is no pose", "drop it")
        place = tuple(graph.points[target]) if target in graph.points else target
        if (observer, place, distance) in seen:
            continue
        seen.add((observer, place, distance))
        toa = graph.poses[observer][0]
        tol = toa - distance / speed
        if target in graph.poses:
            sender = mission.robots[target[0]]
        elif target in mission.nodes:
            sender = mission.nodes[target]
        elif target in graph.priors and mission.moving_beacon is not None:
            sender = mission.moving_beacon
            beacon.append((tol, target))
        else:
            key = "moving_beacon" if target in graph.priors else f"nodes.{target}"
            _fail(f"mission.{key}", f"{mission.file} has ranges to {target}, which is no vehicle's", "name its vehicle")
        receiver = mission.robots[observer[0]]
        if receiver != sender:
            found.append(Reception(len(found), sender, tol, receiver, toa, distance / speed))
    return found, beacon, len(graph.ranges) - len(seen)


def _beacon_fixes(graph: Graph, launches: list[tuple[float, str]], mission: PyfgRecording) -> Fixes:
    """The moving beacon's measured positions, each at the time of the launch it was measured for."""
    if not launches:
        _fail("mission.moving_beacon", f"{mission.file} has no ranges to points with a prior", "leave it out")
    launches = sorted(launches)
    once = [k for k in range(len(launches)) if k == 0 or launches[k][0] > launches[k - 1][0]]
    launches = [launches[k] for k in once]
    time_s = np.array([t for t, _ in launches])
    value = np.stack([graph.priors[key][0] for _, key in launches])
    return Fixes(time_s, value[None], np.stack([graph.priors[key][1] for _, key in launches]))


def _landmark_fixes(graph: Graph, poses: set[str]) -> Fixes | None:
    """Position fixes from two or more known landmarks seen at once, which need no heading; None without any."""
    seen: dict[str, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = defaultdict(list)
    for pose, landmark, offset, cov in graph.sightings:
        if pose in poses and landmark in graph.points:
            seen[pose].append((graph.points[landmark], offset, cov))
    fixes = []
    for pose, sightings in seen.items():
        fix = resect(*(np.stack(column) for column in zip(*sightings))) if len(sightings) > 1 else None
        if fix is not None:
            fixes.append((graph.poses[pose][0], *fix))
    if not fixes:
        return None
    fixes.sort(key=lambda f: f[0])
    time_s, value, cov = (np.array(column) for column in zip(*fixes))
    return Fixes(time_s, value[None], cov)


def resect(landmarks: np.ndarray, offsets: np.ndarray, cov: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Own position (2,) and covariance (2, 2) from offsets (N, 2) in the body frame to known landmarks (N, 2).

    Weighted least squares over x, y and heading from the closed-form alignment (Umeyama 1991), the heading
    marginalized out. None where the geometry leaves the position worse than USEFUL_FIX_M.
    """
    a, b = landmarks - landmarks.mean(0), offsets - offsets.mean(0)
    cross = b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0]
    theta = math.atan2(float(cross.sum()), float((a * b).sum()))
    weight = np.linalg.inv(cov)
    position = landmarks.mean(0) - _rotation(theta) @ offsets.mean(0)
    information = np.zeros((3, 3))
    for _ in range(10):
        R = _rotation(theta)
        e = (landmarks - position) @ R - offsets
        J = np.zeros((len(e), 2, 3))
        J[:, :, :2] = -R.T
        turned = (landmarks - position) @ R
        J[:, 0, 2], J[:, 1, 2] = turned[:, 1], -turned[:, 0]
        information = np.einsum("nik,nij,njl->kl", J, weight, J)
        if np.linalg.cond(information) > 1e12:
            return None
        step = np.linalg.solve(information, -np.einsum("nik,nij,nj->k", J, weight, e))
        position, theta = position + step[:2], theta + float(step[2])
    found = np.linalg.inv(information)[:2, :2]
    return (position, found) if np.linalg.eigvalsh(found)[-1] < USEFUL_FIX_M**2 else None


def _rotation(theta: float) -> np.ndarray:
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])
