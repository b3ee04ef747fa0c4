"""A navigation mission ready for estimators: local logs as chains of links, and the events of the channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from engine.mission.log import Log
from engine.navigation.chains import Chain, chain, depth_at
from engine.registry import Outline


@dataclass(frozen=True)
class Launch:
    """Broadcast `index` leaves `vehicle`, whose depth then reads depth_m (trials or 1,); `audience` may hear it."""

    time_s: float
    index: int
    vehicle: int
    depth_m: np.ndarray
    audience: int


@dataclass(frozen=True)
class Arrival:
    """Broadcast `index` of `sender` reaches `vehicle`: slant_m (trials,), NaN where not heard; depth_m its own.

    Who sends when is the schedule's, known to all; `last` marks the broadcast's last possible arrival.
    """

    time_s: float
    index: int
    vehicle: int
    sender: int
    slant_m: np.ndarray
    depth_m: np.ndarray
    last: bool


@dataclass(frozen=True)
class Report:
    """Report time number `index`: everyone says where it is."""

    time_s: float
    index: int


Event = Launch | Arrival | Report


@dataclass(frozen=True)
class NavigationMission:
    """One block of trials: its log, a chain per vehicle, and the events in order of time.

    options {algorithm: {name: value}} is what the scenario asks of single algorithms.
    """

    log: Log
    chains: tuple[Chain, ...]
    events: tuple[Event, ...]
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def time_s(self) -> np.ndarray:
        return self.log.time_s

    @property
    def truth(self) -> dict[str, np.ndarray]:
        return self.log.truth

    @property
    def trials(self) -> int:
        return self.log.trials


def prepare(log: Log, options: Mapping[str, Mapping[str, Any]] | None = None) -> NavigationMission:
    """Compress every vehicle's log between the instants that concern it, and order the channel's events.

    At one instant, what was heard counts before what is said, and both before the report; but nothing is heard before
    it is said, be the log's times ever so coarse.
    """
    acoustics = log.acoustics
    events: list[tuple[float, int, int, Event]] = []
    audience = np.bincount(acoustics.broadcast, minlength=len(acoustics.tol_s)).tolist()
    last = {int(b): r for r, b in enumerate(acoustics.broadcast)}
    slant = acoustics.travel_time_s * log.sound_speed_mps
    for v, vehicle in enumerate(log.vehicles):
        mine = np.flatnonzero(acoustics.receiver == v)
        depth = depth_at(vehicle, acoustics.toa_s[mine])
        for n, r in enumerate(mine):
            b = int(acoustics.broadcast[r])
            sender = int(acoustics.sender[b])
            arrival = Arrival(float(acoustics.toa_s[r]), b, v, sender, slant[:, r], depth[:, n], last[b] == r)
            events.append((arrival.time_s, 0 if arrival.time_s > acoustics.tol_s[b] else 2, int(r), arrival))
        mine = np.flatnonzero(acoustics.sender == v)
        depth = depth_at(vehicle, acoustics.tol_s[mine])
        for n, b in enumerate(mine):
            launch = Launch(float(acoustics.tol_s[b]), int(b), v, depth[:, n], audience[b])
            events.append((launch.time_s, 1, int(b), launch))
    events += [(float(t), 3, k, Report(float(t), k)) for k, t in enumerate(log.time_s)]
    events.sort(key=lambda e: e[:3])
    ordered = tuple(e[3] for e in events if e[0] <= log.duration_s)

    chains = []
    for v, vehicle in enumerate(log.vehicles):
        own = [e.time_s for e in ordered if isinstance(e, Report) or e.vehicle == v]
        chains.append(chain(vehicle, np.unique(np.concatenate([[0.0], own])), log.trials))
    return NavigationMission(log, tuple(chains), ordered, options or {})


def fly_navigation(scenario, trials: Sequence[int]) -> NavigationMission:
    """Simulate or read a navigation scenario's mission for the given trial numbers and prepare it."""
    from engine.mission import fly

    return prepare(fly(scenario, trials), scenario.options)


def outline(mission: NavigationMission) -> Outline:
    """Vehicles, packets and fixes of the first trial."""
    log = mission.log
    names = [v.name for v in log.vehicles]
    events: list[dict] = []
    tol = {e.index: e.time_s for e in mission.events if isinstance(e, Launch)}
    for e in mission.events:
        if isinstance(e, Arrival):
            heard = bool(np.isfinite(e.slant_m[0]))
            events.append(
                {
                    "kind": "packet",
                    "from": names[e.sender],
                    "to": names[e.vehicle],
                    "tol_s": tol[e.index],
                    "toa_s": e.time_s,
                    "heard": heard,
                }
            )
    for v in log.vehicles:
        if v.fixes is not None and v.kind != "fixed":
            _, first = np.unique(np.floor(v.fixes.time_s), return_index=True)
            events += [{"kind": "fix", "subject": v.name, "time_s": float(t)} for t in v.fixes.time_s[first]]
    events.sort(key=lambda e: e["toa_s"] if e["kind"] == "packet" else e["time_s"])
    subjects = [
        {"name": v.name, "kind": v.kind, "depth_m": float(depth_at(v, np.zeros(1))[0, 0])} for v in log.vehicles
    ]
    return Outline(subjects, events)
