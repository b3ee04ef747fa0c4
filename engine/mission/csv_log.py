"""A log as CSV files and a scenario that maps them: what `coopnav log` writes, and any recorded mission may look like.

The first trial is written. Numbers are written so that they read back exactly, hence the scenario in the folder
gives every estimator the same answer as the log itself.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from engine.mission.log import Log, VehicleLog
from engine.scenario import toml
from engine.scenario.navigation import NavigationScenario

_COV2 = ["xx_m2", "xy_m2", "yy_m2"]
_COV3 = ["forward2", "forward_left", "forward_turn", "left2", "left_turn", "turn2"]


def write(log: Log, scenario: NavigationScenario, directory: Path | str) -> Path:
    """Write the first trial of a log into a folder, made where missing, and return its scenario.toml.

    Raises FileExistsError where the folder already has a scenario.toml.
    """
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / "scenario.toml"
    if target.exists():
        raise FileExistsError(f"{target} exists already")
    mission: dict = {"kind": "recorded", "format": "csv", "log": ".", "start_s": 0.0}
    vehicles = []
    for vehicle, described in zip(log.vehicles, scenario.vehicles):
        for kind, entry in _sensors(folder, vehicle):
            mission.setdefault(kind, []).append(entry)
        vehicles.append(_vehicle(vehicle, described))
    for name, position in log.truth.items():
        entry = _truth(folder, name, log.time_s, position[0])
        if entry is not None:
            mission.setdefault("truth", []).append(entry)
    if log.acoustics.tol_s.size:
        mission["ranges"] = [_ranges(folder, log)]
    target.write_text(_scenario(log, scenario, mission, vehicles), encoding="utf-8")
    return target


def _scenario(log: Log, scenario: NavigationScenario, mission: dict, vehicles: list[dict]) -> str:
    """The scenario that reads the files back; losses and silences are in the log already, claims are not kept."""
    plain = toml.plain(scenario)
    kept = {k: plain[k] for k in ("schema", "title", "source", "family", "seed", "algorithms", "options") if k in plain}
    network = {k: v for k, v in plain.get("network", {}).items() if k not in ("links", "loss", "silences", "tdma")}
    data = kept | {
        "summary": f"The first trial of {scenario.title!r}, written as CSV."[:4000],
        "duration_s": log.duration_s,
        "trials": 1,
        "mission": mission,
        "vehicles": vehicles,
        "network": network,
    }
    if scenario.report_interval_s is not None:
        data["report_interval_s"] = scenario.report_interval_s
    return toml.dumps(toml.validate(data))


def _vehicle(log: VehicleLog, described) -> dict:
    plain = described.model_dump(exclude_none=True, exclude_defaults=True)
    plain = {k: v for k, v in plain.items() if k not in ("path", "surfacings")}
    plain["initial"] = plain["initial"] | {
        "position_m": log.initial.position_m[0].tolist(),
        "velocity_mps": log.initial.velocity_mps[0].tolist(),
        "heading_deg": degrees_of(float(log.initial.heading_rad[0])),
    }
    return plain


def degrees_of(radians: float) -> float:
    """The degrees whose radians are exactly these, where there are such; else the nearest."""
    nearest = math.degrees(radians)
    above = below = nearest
    for _ in range(16):
        for candidate in (above, below):
            if float(np.radians(candidate)) == radians:
                return candidate
        above, below = math.nextafter(above, math.inf), math.nextafter(below, -math.inf)
    return nearest


def _table(folder: Path, name: str, header: Sequence[str], columns: Sequence[Iterable]) -> str:
    with open(folder / name, "w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(header)
        rows.writerows(zip(*columns, strict=True))
    return name


def _sensors(folder: Path, vehicle: VehicleLog):
    """Write a vehicle's readings; yields (kind, its entry of the recorded mission) of each file."""
    name = vehicle.name

    def file(kind: str, header: Sequence[str], time_s: np.ndarray, *columns: np.ndarray) -> dict:
        made = _table(folder, f"{name}-{kind}.csv", ["t_s", *header], [time_s.tolist(), *(c.tolist() for c in columns)])
        return {"vehicle": name, "file": made, "time": "t_s"}

    velocity, heading = vehicle.velocity, vehicle.heading
    in_world_frame = heading is not None and heading.sigma_rad == 0.0
    if velocity is not None:
        frame = ("east", "north") if in_world_frame else ("forward", "left")
        header = [f"{f}_mps" for f in frame]
        entry = file("velocity", header, velocity.time_s, velocity.value[0, :, 0], velocity.value[0, :, 1])
        yield "velocity", entry | dict(zip(frame, header))
    if heading is not None and not in_world_frame:
        yield "heading", file("heading", ["heading_rad"], heading.time_s, heading.value[0]) | {"heading": "heading_rad"}
    if vehicle.odometry is not None:
        o = vehicle.odometry
        header = ["forward_m", "left_m", "turn_rad"]
        upper = [o.cov[:, i, j] for i, j in zip(*np.triu_indices(3))]
        entry = file("odometry", [*header, *_COV3], o.time_s, *o.value[0].T, *upper)
        yield "odometry", entry | dict(zip(("forward", "left", "turn"), header)) | {"cov": _COV3}
    if vehicle.depth is not None:
        yield "depth", file("depth", ["depth_m"], vehicle.depth.time_s, vehicle.depth.value[0]) | {"depth": "depth_m"}
    if vehicle.fixes is not None:
        f = vehicle.fixes
        upper = [f.cov[:, i, j] for i, j in zip(*np.triu_indices(2))]
        entry = file("fixes", ["x_m", "y_m", *_COV2], f.time_s, *f.value[0].T, *upper)
        yield "fixes", entry | {"x": "x_m", "y": "y_m", "cov": _COV2}


def _truth(folder: Path, name: str, time_s: np.ndarray, position: np.ndarray) -> dict | None:
    """The reference at the report times; None where there is none at any."""
    known = np.isfinite(position).all(axis=-1)
    if not known.any():
        return None
    columns = [time_s[known].tolist(), *position[known].T.tolist()]
    made = _table(folder, f"{name}-truth.csv", ["t_s", "x_m", "y_m"], columns)
    gap = 1.5 * float(np.max(np.diff(time_s))) if len(time_s) > 1 else 1.0
    return {"vehicle": name, "file": made, "time": "t_s", "x": "x_m", "y": "y_m", "max_gap_s": gap}


def _ranges(folder: Path, log: Log) -> dict:
    """Every possible reception, without travel time where nothing was heard; an unheard broadcast has no receiver."""
    a = log.acoustics
    names = [v.name for v in log.vehicles]
    rows = []
    for r, b in enumerate(a.broadcast.tolist()):
        heard = a.travel_time_s[0, r]
        travel = float(heard) if np.isfinite(heard) else ""
        rows.append((b, float(a.tol_s[b]), float(a.toa_s[r]), names[a.sender[b]], names[a.receiver[r]], travel))
    for b in np.setdiff1d(np.arange(len(a.tol_s)), a.broadcast).tolist():
        rows.append((b, float(a.tol_s[b]), float(a.tol_s[b]), names[a.sender[b]], "", ""))
    rows.sort(key=lambda row: row[2])
    header = ["broadcast", "tol_s", "toa_s", "sender", "receiver", "travel_time_s"]
    return {
        "file": _table(folder, "ranges.csv", header, list(zip(*rows))),
        "time": "toa_s",
        "tol": "tol_s",
        "broadcast": "broadcast",
        "sender_column": "sender",
        "receiver_column": "receiver",
        "travel_time": "travel_time_s",
    }
