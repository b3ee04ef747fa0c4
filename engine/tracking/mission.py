"""A tracking mission: one target's tracks, the nodes' measurements, and which packets got through."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.mission.streams import normals, uniforms
from engine.registry import Outline, Progress
from engine.scenario.tracking import Ellipse, TrackingScenario
from engine.tracking import simulate
from engine.tracking.model import Model, make
from engine.tracking.recursion import Rule
from engine.tracking.simulate import Draws, Estimates
from engine.tracks import Belief, PacketCount, Tracks

#: What a packet of one estimate holds, as it is exchanged here: 2 for the mean, 3 for the covariance, not rounded.
FLOATS = 5
BYTES = FLOATS * np.dtype(float).itemsize


@dataclass(frozen=True)
class TrackingMission:
    """One block of trials; the nodes' estimates of the target are the subjects, `target-NODE`."""

    model: Model
    draws: Draws
    heard: np.ndarray | None
    names: tuple[str, ...]
    time_s: np.ndarray

    @property
    def subjects(self) -> list[str]:
        return [f"target-{name}" for name in self.names]

    @property
    def truth(self) -> dict[str, np.ndarray]:
        return dict.fromkeys(self.subjects, self.draws.target)


def fly(scenario: TrackingScenario, trials: Sequence[int]) -> TrackingMission:
    """Simulate a tracking scenario for the given trial numbers."""
    eye = np.eye(2)
    model = make(
        scenario.target.process_variance_m2 * eye,
        [_noise(s.ellipse) if s.ellipse is not None else (s.variance_m2 or 0.0) * eye for s in scenario.sensors],
        scenario.target.prior_variance_m2 * eye,
    )
    steps, seed, N = scenario.steps, scenario.seed, len(scenario.sensors)
    draws = simulate.shape(
        model,
        normals(seed, trials, "target", "prior", (2,)),
        normals(seed, trials, "target", "process", (steps, 2)),
        tuple(normals(seed, trials, s.name, "noise", (steps, 2)) for s in scenario.sensors),
    )
    heard = None
    if scenario.network.loss > 0:
        heard = uniforms(seed, trials, "network", "loss", (steps, N, N)) >= scenario.network.loss
    time = scenario.step_s * np.arange(steps + 1)
    return TrackingMission(model, draws, heard, tuple(s.name for s in scenario.sensors), time)


def _noise(ellipse: Ellipse) -> np.ndarray:
    c, s = np.cos(np.radians(ellipse.angle_deg)), np.sin(np.radians(ellipse.angle_deg))
    turn = np.array([[c, -s], [s, c]])
    return turn @ np.diag([ellipse.along_m2, ellipse.across_m2]) @ turn.T


def outline(mission: TrackingMission) -> Outline:
    """The nodes' targets; what was heard is nobody's ray, since the nodes' places do not matter."""
    return Outline([{"name": s, "kind": "target", "depth_m": 0.0} for s in mission.subjects], [])


def run(mission: TrackingMission, progress: Progress, rule: Rule | None) -> Tracks:
    """One fuser over a block of trials."""
    answer = simulate.estimate(mission.model, mission.draws, rule, mission.heard)
    progress(1.0, _first_trial(mission, answer))
    trials, steps = mission.draws.z[0].shape[:2]
    N = len(mission.names)
    if rule is None:
        return _tracks(mission, answer, PacketCount())
    sent = trials * steps * N
    received = (
        sent * (N - 1) if mission.heard is None else int(mission.heard.sum() - mission.heard.trace(0, 2, 3).sum())
    )
    seconds = trials * float(mission.time_s[-1])
    return _tracks(mission, answer, PacketCount(sent, received, BYTES * sent, FLOATS * sent, BYTES, seconds))


def run_centrally(mission: TrackingMission, progress: Progress) -> Tracks:
    """The central filter over a block of trials."""
    answer = simulate.estimate_centrally(mission.model, mission.draws)
    progress(1.0, _first_trial(mission, answer))
    return _tracks(mission, answer, PacketCount())


def by(rule: Rule | None) -> Callable[[TrackingMission, Progress], Tracks]:
    """An algorithm's run function for a fusion rule; None: nobody cooperates."""
    return lambda mission, progress: run(mission, progress, rule)


def _first_trial(mission: TrackingMission, answer: Estimates) -> dict[str, Any]:
    """The first trial's estimates for whoever watches."""
    cov = answer.believed[0]
    return {
        "time_s": mission.time_s.tolist(),
        "mean": {s: answer.mean[0, :, i].tolist() for i, s in enumerate(mission.subjects)},
        "cov": {
            s: np.stack([cov[:, i, 0, 0], cov[:, i, 0, 1], cov[:, i, 1, 1]], -1).tolist()
            for i, s in enumerate(mission.subjects)
        },
    }


def _tracks(mission: TrackingMission, answer: Estimates, packets: PacketCount) -> Tracks:
    trials, T = mission.draws.target.shape[:2]
    return Tracks(
        beliefs={
            subject: Belief(answer.mean[:, :, i], np.broadcast_to(answer.believed[:, :, i], (trials, T, 2, 2)).copy())
            for i, subject in enumerate(mission.subjects)
        },
        packets=packets,
    )
