"""The channel between estimators: events in order, packets as bytes, losses, counts.

A distributed estimator is one node per vehicle. A node learns its own vehicle's links and the packets that
arrived, nothing else; packets of trials in which nothing was heard are blanked before it sees them. A
centralized benchmark is one object that is told of every vehicle's links and every range.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from engine.gaussian.forms import Moments
from engine.mission.log import VehicleLog
from engine.navigation.chains import Step
from engine.navigation.mission import Arrival, Launch, NavigationMission, Report
from engine.navigation.ranging import Innovation, horizontal_range
from engine.notes import Note, join
from engine.registry import Progress
from engine.tracks import Belief, Innovations, PacketCount, Series, Tracks

#: The curve of what all vehicles together have broadcast so far.
SENT = "sent_bytes"


@dataclass(frozen=True)
class Member:
    """What a node knows of its own vehicle and of the network before the mission.

    names and sizes are every vehicle's name and number of states (2: a fixed node, 3: a pose, 4: x, y, vx, vy).
    """

    index: int
    log: VehicleLog
    initial: Moments
    names: tuple[str, ...]
    sizes: tuple[int, ...]
    trials: int
    sound_speed_mps: float
    sound_speed_sigma_mps: float
    gate_sigma: float | None


@dataclass(frozen=True)
class Packet:
    """A packet to send: bytes (trials, n), and how many floats its paper would count."""

    data: np.ndarray
    floats: int


class Node(Protocol):
    """One vehicle's estimator."""

    def advance(self, step: Step) -> None:
        """Move on by a step of the own local log."""
        ...

    def transmit(self, launch: Launch) -> Packet | None:
        """The packet broadcast now, if the algorithm sends any."""
        ...

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation | None:
        """Take in a packet (trials, n) and its range; what the range update saw, if it made one."""
        ...

    def belief(self) -> Moments:
        """Own position belief, (trials, 2) and (trials, 2, 2)."""
        ...

    def notes(self) -> Sequence[Note | str]:
        """What the person running this should know."""
        ...


class Fleet(Protocol):
    """A centralized estimator of all vehicles at once."""

    def advance(self, vehicle: int, step: Step) -> None: ...

    def launch(self, launch: Launch) -> None: ...

    def receive(self, arrival: Arrival) -> Innovation | None: ...

    def belief(self, vehicle: int) -> Moments: ...

    def correlation(self, first: int, second: int) -> np.ndarray: ...

    def notes(self) -> Sequence[Note | str]: ...


def members(mission: NavigationMission) -> list[Member]:
    """Every vehicle's own knowledge at the start."""
    log = mission.log
    names = tuple(v.name for v in log.vehicles)
    sizes = tuple(chain.initial.mean.shape[-1] for chain in mission.chains)
    return [
        Member(
            i,
            v,
            mission.chains[i].initial,
            names,
            sizes,
            log.trials,
            log.sound_speed_mps,
            log.sound_speed_sigma_mps,
            log.gate_sigma,
        )
        for i, v in enumerate(log.vehicles)
    ]


def run_nodes(
    mission: NavigationMission,
    progress: Progress,
    make: Callable[[Member], Any],
    monitor: Callable[[Any], dict[str, np.ndarray]] | None = None,
) -> Tracks:
    """Run one node per vehicle over the mission's events.

    `monitor` names further curves of a node to keep, (trials,) each, by "what/vehicle".
    """
    nodes: list[Node] = [make(member) for member in members(mission)]
    counts: list[PacketCount] = []
    said = np.zeros(mission.trials)
    in_flight: dict[int, np.ndarray] = {}

    def launch(event: Launch) -> None:
        packet = nodes[event.vehicle].transmit(event)
        if packet is not None:
            sent, size = packet.data.shape
            counts.append(PacketCount(sent, 0, sent * size, sent * packet.floats, size))
            said[:] += size
            in_flight[event.index] = packet.data

    def receive(event: Arrival) -> Innovation | None:
        data = in_flight.get(event.index)
        if event.last:
            in_flight.pop(event.index, None)
        if data is None:
            return None
        heard = np.isfinite(event.slant_m)
        counts.append(PacketCount(received=int(heard.sum())))
        return nodes[event.vehicle].receive(event, np.where(heard[:, None], data, 0).astype(np.uint8))

    def curves() -> dict[str, np.ndarray]:
        own = {k: v for node in nodes for k, v in monitor(node).items()} if monitor else {}
        return own | {SENT: said}

    recorder = _Recorder(mission, progress)
    recorder.drive(
        advance=lambda v, step: nodes[v].advance(step),
        launch=launch,
        receive=receive,
        belief=lambda v: nodes[v].belief(),
        curves=curves,
    )
    notes = [n.about(m.log.name) for m, node in zip(members(mission), nodes) for n in join(node.notes())]
    time = PacketCount(mission_s=mission.trials * mission.log.duration_s)
    return recorder.tracks(sum(counts, time), notes)


def run_fleet(mission: NavigationMission, progress: Progress, make: Callable[[list[Member]], Fleet]) -> Tracks:
    """Run a centralized estimator over the mission's events; it needs no packets, so none are counted."""
    everyone = members(mission)
    fleet = make(everyone)
    moving = [m.index for m in everyone if m.log.kind != "fixed"]

    names = everyone[0].names

    def curves() -> dict[str, np.ndarray]:
        pairs = [(i, j) for n, i in enumerate(moving) for j in moving[n + 1 :]]
        return {f"correlation/{names[i]}~{names[j]}": fleet.correlation(i, j) for i, j in pairs}

    recorder = _Recorder(mission, progress)
    recorder.drive(fleet.advance, fleet.launch, fleet.receive, fleet.belief, curves)
    return recorder.tracks(PacketCount(), fleet.notes())


class _Recorder:
    """Drives an estimator through the events and keeps what it says at the report times."""

    def __init__(self, mission: NavigationMission, progress: Progress) -> None:
        self.mission, self.progress = mission, progress
        log = mission.log
        V, T = len(log.vehicles), len(log.time_s)
        self.mean = np.empty((V, log.trials, T, 2))
        self.cov = np.empty((V, log.trials, T, 2, 2))
        self.curves: dict[str, np.ndarray] = {}
        self.innovations: list[list[tuple[float, Innovation]]] = [[] for _ in range(V)]
        self.started = time.process_time()

    def drive(
        self,
        advance: Callable[[int, Step], None],
        launch: Callable[[Launch], None],
        receive: Callable[[Arrival], Innovation | None],
        belief: Callable[[int], Moments],
        curves: Callable[[], dict[str, np.ndarray]],
    ) -> None:
        mission = self.mission
        at = [0] * len(mission.chains)

        def catch_up(vehicle: int, time_s: float) -> None:
            times = mission.chains[vehicle].times_s
            while at[vehicle] + 1 < len(times) and times[at[vehicle] + 1] <= time_s:
                advance(vehicle, mission.chains[vehicle].steps[at[vehicle]])
                at[vehicle] += 1

        T = len(mission.time_s)
        stream = _Stream(self, self.progress)
        for event in mission.events:
            if isinstance(event, Report):
                for v in range(len(at)):
                    catch_up(v, event.time_s)
                    now = belief(v)
                    self.mean[v, :, event.index], self.cov[v, :, event.index] = now.mean, now.cov
                for name, value in curves().items():
                    self.curves.setdefault(name, np.zeros((mission.trials, T)))[:, event.index] = value
                stream.tick(event.index + 1, T)
                continue
            catch_up(event.vehicle, event.time_s)
            if isinstance(event, Launch):
                launch(event)
            else:
                seen = receive(event)
                if seen is not None:
                    self.innovations[event.vehicle].append((event.time_s, seen))

    def tracks(self, packets: PacketCount, notes: Sequence[Note | str]) -> Tracks:
        names = [v.name for v in self.mission.log.vehicles]
        innovations = {
            names[v]: Innovations(
                np.array([t for t, _ in seen]),
                np.stack([i.value for _, i in seen], axis=-1),
                np.stack([i.variance for _, i in seen], axis=-1),
                np.stack([i.accepted for _, i in seen], axis=-1),
            )
            for v, seen in enumerate(self.innovations)
            if seen
        }
        series = {name: _series(name, value) for name, value in self.curves.items()}
        return Tracks(
            beliefs={name: Belief(self.mean[v], self.cov[v]) for v, name in enumerate(names)},
            packets=packets,
            innovations=innovations,
            series=series,
            notes=(*self.mission.log.notes, *notes),
            cpu_s=time.process_time() - self.started,
        )


def _series(name: str, value: np.ndarray) -> Series:
    """A curve by its name: SENT, or a coefficient, "what/subject" or "what/subject~subject"."""
    if name == SENT:
        return Series("Bytes broadcast by all so far", "B", value)
    what, _, whom = name.partition("/")
    subjects = tuple(whom.split("~"))
    title = f"{what.replace('_', ' ').capitalize()} of {' and '.join(subjects)}"
    return Series(title, "1", value, subjects)


class _Stream:
    """Tells the watcher how far the run is, with the first trial's new estimates, a few times a second."""

    EVERY_S = 0.15

    def __init__(self, recorder: _Recorder, progress: Progress) -> None:
        self.recorder, self.progress = recorder, progress
        self.sent, self.told = 0, time.monotonic()

    def tick(self, done: int, total: int) -> None:
        now = time.monotonic()
        if done < total and now - self.told < self.EVERY_S:
            return
        self.told = now
        recorder, new = self.recorder, slice(self.sent, done)
        cov = recorder.cov[:, 0, new]
        partial: dict[str, Any] = {
            "time_s": recorder.mission.time_s[new].tolist(),
            "mean": {},
            "cov": {},
        }
        for v, vehicle in enumerate(recorder.mission.log.vehicles):
            partial["mean"][vehicle.name] = recorder.mean[v, 0, new].tolist()
            partial["cov"][vehicle.name] = np.stack([cov[v, :, 0, 0], cov[v, :, 0, 1], cov[v, :, 1, 1]], -1).tolist()
        self.sent = done
        self.progress(done / total, partial)


def correlation_of(joint: Moments, first: slice, second: slice) -> np.ndarray:
    """Correlation of two position blocks (trials,): tr P_ij / sqrt(tr P_ii tr P_jj), the coefficient of W11's
    appendix where both axes behave alike; zero where a block is known exactly."""
    P = joint.cov

    def trace(a: slice, b: slice) -> np.ndarray:
        return np.trace(P[..., a, b], axis1=-2, axis2=-1)

    scale = np.sqrt(trace(first, first) * trace(second, second))
    return np.divide(trace(first, second), scale, out=np.zeros_like(scale), where=scale > 0)


def slant_to_horizontal(arrival: Arrival, sender_depth_m: np.ndarray) -> np.ndarray:
    """The horizontal range (trials,) of a reception, given the depth in the packet."""
    return horizontal_range(arrival.slant_m, arrival.depth_m - sender_depth_m)
