"""A pursuit ready for its estimators: the target's track, and the chances of the water drawn beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from engine.gaussian.forms import Moments
from engine.mission.reports import report_times
from engine.mission.streams import normals, uniforms
from engine.pursuit.formation import FORMATIONS
from engine.pursuit.helm import Craft
from engine.pursuit.recorded import Log, read
from engine.pursuit.target import Motion, wander
from engine.registry import Outline
from engine.scenario.pursuit import PursuitScenario


@dataclass(frozen=True)
class Chances:
    """What the water does in every cycle c, by trial: jitter_s (trials, C) of the ping, noise_m (trials, C, V) of its
    arrivals, pings (trials, C, V) and messages (trials, C, slots, V) that get through, by receiver."""

    jitter_s: np.ndarray
    noise_m: np.ndarray
    pings: np.ndarray
    messages: np.ndarray
    shore: np.ndarray


@dataclass(frozen=True)
class PursuitMission:
    """One block of trials. target (trials, S, d+1) at steps of step_s; first is the common belief at the start.

    time_s (T,) are the report times; a simulated mission has chances, a recorded one its log.
    """

    scenario: PursuitScenario
    time_s: np.ndarray
    truth: dict[str, np.ndarray]
    names: tuple[str, ...]
    motion: Motion
    target: np.ndarray
    first: Moments
    chances: Chances | None = None
    log: Log | None = None
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def dimensions(self) -> int:
        return self.scenario.dimensions

    @property
    def trials(self) -> int:
        return self.first.mean.shape[0]

    @property
    def offsets(self) -> np.ndarray:
        """Where the vehicles ought to be, relative to the target, (V, 2) m."""
        formation = self.scenario.formation
        assert formation is not None
        if formation.kind == "custom":
            return np.array(formation.offsets_m, dtype=float)
        assert formation.length_m is not None
        return FORMATIONS[formation.kind](formation.length_m)

    @property
    def craft(self) -> Craft:
        handling = self.scenario.handling
        speeds = np.array([v.max_speed_mps for v in self.scenario.vehicles])
        turn = np.radians(handling.turn_rate_dps)
        return Craft(speeds, turn, handling.station_speed_mps, handling.speed_lag_s)

    @property
    def depths_m(self) -> np.ndarray:
        return np.array([v.depth_m for v in self.scenario.vehicles])

    def starts(self) -> np.ndarray:
        """Where the vehicles start, (trials, V, 2) m: in formation on what is believed of the target, or as stated."""
        places = self.first.mean[:, None, :2] + self.offsets
        for i, vehicle in enumerate(self.scenario.vehicles):
            if vehicle.start_m is not None:
                places[:, i] = vehicle.start_m
        return places

    def target_at(self, moment_s: np.ndarray | float) -> np.ndarray:
        """The target's position (trials, d) at a moment, the same or one for each trial."""
        share = np.clip(np.asarray(moment_s, float) / self.scenario.step_s, 0.0, self.target.shape[1] - 1)
        n = np.minimum(share.astype(int), self.target.shape[1] - 2)
        trial = np.arange(self.trials)
        before, after = self.target[trial, n, :-1], self.target[trial, n + 1, :-1]
        return before + np.expand_dims(share - n, -1) * (after - before)


def subject(name: str) -> str:
    """The target as one vehicle knows it."""
    return f"target-{name}"


def fly(scenario: PursuitScenario, trials: Sequence[int]) -> PursuitMission:
    """The mission of a block of trials, given by their absolute numbers."""
    target = scenario.target
    motion = Motion(target.speed_mps, target.turn_psd, target.drift_psd)
    if scenario.mission is not None:
        return _recorded(scenario, motion)
    assert scenario.duration_s is not None
    seed, d, V = scenario.seed, scenario.dimensions, len(scenario.vehicles)
    steps = int(np.ceil(scenario.duration_s / scenario.step_s - 1e-9)) + int(np.ceil(3.0 / scenario.step_s))
    start = np.zeros((len(trials), d + 1))
    start[:, :2] = target.start_m
    start[:, 2:-1] = target.depth_m
    any_way = 2 * np.pi * uniforms(seed, trials, "target", "heading", (1,))[:, 0]
    start[:, -1] = any_way if target.heading_deg is None else np.radians(target.heading_deg)
    track = wander(
        motion,
        start,
        scenario.step_s,
        normals(seed, trials, "target", "turn", (steps,)),
        normals(seed, trials, "target", "drift", (steps, d)),
    )
    sigma = np.append(np.full(d, scenario.initial.position_sigma_m), np.radians(scenario.initial.heading_sigma_deg))
    first = start + sigma * normals(seed, trials, "target", "belief", (d + 1,))
    cov = np.broadcast_to(np.diag(sigma**2), (len(trials), d + 1, d + 1))

    network, C = scenario.network, int(np.ceil(scenario.duration_s / scenario.cycle_s - 1e-9))
    chances = Chances(
        target.ping_jitter_s * normals(seed, trials, "target", "clock", (C,)),
        network.range_sigma_m * normals(seed, trials, "network", "arrivals", (C, V)),
        uniforms(seed, trials, "network", "pings", (C, V)) >= network.ping_loss,
        uniforms(seed, trials, "network", "messages", (C, V + 1, V)) >= network.loss,
        uniforms(seed, trials, "shore", "messages", (C, V)) >= network.loss,
    )
    time_s = report_times(scenario.duration_s, scenario.report_interval_s)
    names = tuple(v.name for v in scenario.vehicles)
    mission = PursuitMission(
        scenario, time_s, {}, names, motion, track, Moments(first, cov), chances, options=scenario.options
    )
    at = np.stack([mission.target_at(t)[:, :2] for t in time_s], axis=1)
    return replace(mission, truth={subject(name): at for name in names})


def _recorded(scenario: PursuitScenario, motion: Motion) -> PursuitMission:
    log, d = read(scenario), scenario.dimensions
    truth = {"target": log.truth[None]}
    truth |= {name: np.broadcast_to(p[:2], (1, len(log.time_s), 2)) for name, p in zip(log.names, log.places)}
    mean, sigma = np.zeros((1, d + 1)), np.full(d + 1, scenario.initial.position_sigma_m)
    mean[:, :d] = log.places[:, :d].mean(axis=0)
    sigma[-1] = np.radians(scenario.initial.heading_sigma_deg)
    first = Moments(mean, np.diag(sigma**2)[None])
    return PursuitMission(
        scenario,
        log.time_s,
        truth,
        log.names,
        motion,
        np.zeros((1, 0, 1)),
        first,
        log=log,
        options=scenario.options,
    )


def outline(mission: PursuitMission) -> Outline:
    """The vehicles and the target as each of them knows it; who hears whom depends on the architecture."""
    if mission.log is not None:
        depths = zip(mission.names, mission.log.places[:, 2])
        receivers = [{"name": name, "kind": "fixed", "depth_m": float(z)} for name, z in depths]
        return Outline([{"name": "target", "kind": "target", "depth_m": 0.0}, *receivers], [])
    vehicles = [{"name": v.name, "kind": "surface", "depth_m": v.depth_m} for v in mission.scenario.vehicles]
    depth = mission.scenario.target.depth_m
    targets = [
        {"name": subject(name), "kind": "target", "depth_m": depth, "label": "" if n else "target"}
        for n, name in enumerate(mission.names)
    ]
    return Outline([*vehicles, *targets], [])
