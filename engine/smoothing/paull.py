"""Paull, Seto and Leonard (2014), as W15 section V-A compares with it: factors sent as they are, ranges included.

A packet holds the launch's composed link; for every other vehicle the latest range measured to it with the own pose at
that arrival; and the latest single fix with its pose. Ranges so work in both directions and between third parties,
where both poses were received; but of many fixes few are sent, and packets grow with the network.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from engine.mission.log import Fixes, VehicleLog
from engine.navigation.chains import chain as compress_log
from engine.navigation.mission import Arrival, Launch, NavigationMission
from engine.navigation.network import Member, Packet
from engine.navigation.ranging import Innovation, horizontal_range
from engine.registry import Algorithm, Progress
from engine.smoothing import packets
from engine.smoothing.fidelity import reconstruct
from engine.smoothing.fleet import launches_of, make_sender
from engine.smoothing.local_chain import local_chain
from engine.smoothing.node import Heard, Sender, SmootherNode
from engine.smoothing.packets import NONE, OLDEST
from engine.smoothing.reconstruction import Received, ReceivedChain
from engine.smoothing.sender import PlaneSender, choose_last
from engine.smoothing.story import smooth
from engine.tracks import Tracks

#: A fix nearer (s) to another pose than this is not made a pose of its own: too little happens in between.
NEAREST_S = 1.0
RANGE_STEP_M = 0.01


class Options(BaseModel):
    """What a scenario may choose for Paull et al., under [options.paull]."""

    model_config = ConfigDict(extra="forbid")

    priors: int = Field(1, ge=0, le=4, description="single fixes that each packet carries, with their poses")
    reconstruct_only: bool = Field(
        False, description="only put the chains together and compare them with their targets, do not navigate"
    )


def frame_fields(vehicles: int, priors: int) -> list[tuple[str, int]]:
    """Names and widths in bits of a packet in a network of so many vehicles."""
    link = [("pose", 16), ("x", -20), ("y", -20), ("exponent", 4), ("xx", 19), ("yy", 19), ("xy", -20)]
    prior = [("dx", -17), ("dy", -17), ("sx", 9), ("sy", 9), ("rho", -8)]
    fields = [("sender", 8), ("sequence", 16), ("depth", 16), ("stretch", 8)]
    fields += [(f"new.{name}", bits) for name, bits in link]
    for other in range(vehicles - 1):
        fields += [(f"r{other}.there", 1), *((f"r{other}.{name}", bits) for name, bits in link)]
        fields += [(f"r{other}.target", 16), (f"r{other}.range", 20)]
    for n in range(priors):
        fields += [(f"p{n}.there", 1), *((f"p{n}.{name}", bits) for name, bits in (*link, *prior))]
    return fields


def packet_size(vehicles: int, priors: int = 1) -> dict[str, int]:
    """Composed links and bytes of a packet in a network of so many vehicles, for the bandwidth comparison."""
    bits = sum(abs(width) for _, width in frame_fields(vehicles, priors))
    return {"links": 1 + (vehicles - 1) + priors, "ranges": vehicles - 1, "priors": priors, "bytes": -(-bits // 8) + 2}


@dataclass
class Poses:
    """The poses a vehicle may speak of, in order of time: its odometry alone composed to each, and single fixes.

    times_s (N,) are theirs; of_launch (K,) and of_arrival {time: pose} number them; fixes[k] are (pose, fix number) of
    the window before launch k, the latest first.
    """

    sender: PlaneSender
    times_s: np.ndarray
    of_launch: np.ndarray
    of_arrival: dict[float, int]
    fixes: list[list[tuple[int, int]]]


def poses_of(mission: NavigationMission, vehicle: int, log: VehicleLog, priors: int) -> Poses:
    """Lay out a vehicle's poses from its own log."""
    launches = launches_of(mission, vehicle)
    arrivals = np.array([e.time_s for e in mission.events if isinstance(e, Arrival) and e.vehicle == vehicle])
    spoken = np.union1d(launches, arrivals)
    measures = log.velocity is not None
    chosen = _single_fixes(log.fixes, launches, spoken, priors) if measures else [[] for _ in launches]
    fix_times = np.array([log.fixes.time_s[n] for window in chosen for n in window]) if log.fixes is not None else []
    times = np.union1d(spoken, fix_times) if measures else launches
    alone = replace(log, fixes=None) if measures else log
    breakpoints = np.union1d([0.0], times)
    chain = local_chain(alone, compress_log(alone, breakpoints, mission.trials), times, mission.trials)
    place = {float(t): n for n, t in enumerate(times)}
    return Poses(
        PlaneSender(vehicle, chain, mission.trials, 0, choose_last),
        times,
        np.array([place[float(t)] for t in launches], int),
        {float(t): place[float(t)] for t in arrivals if float(t) in place},
        [
            [(place[float(log.fixes.time_s[n])], n) for n in window] if log.fixes is not None else []
            for window in chosen
        ],
    )


def _single_fixes(fixes: Fixes | None, launches: np.ndarray, spoken: np.ndarray, priors: int) -> list[list[int]]:
    """Numbers of the latest fixes before each launch and after the one before it."""
    if fixes is None:
        return [[] for _ in launches]
    gap = np.abs(fixes.time_s[:, None] - spoken).min(axis=1, initial=np.inf)
    usable = np.flatnonzero(gap >= NEAREST_S)
    since = np.concatenate([[0.0], launches[:-1]])
    return [[int(n) for n in usable if a < fixes.time_s[n] < b][::-1][:priors] for a, b in zip(since, launches)]


@dataclass
class Measured:
    """The latest range to another vehicle in every trial: own pose, the other's pose, metres; pose -1 for none new."""

    pose: np.ndarray
    target: np.ndarray
    range_m: np.ndarray


@dataclass(frozen=True)
class Opened:
    """A decoded packet of all trials; `sequence` numbers the sender's pose at the launch."""

    sequence: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray
    values: dict[str, np.ndarray]
    links_of: Callable[[int], list[tuple[int, Received]]] = field(repr=False)

    def links(self, trial: int) -> list[tuple[int, Received]]:
        """The links of one trial's packet by pose number."""
        return self.links_of(trial)


class PaullNode(SmootherNode):
    """The smoother of W15 fed with Paull's packets: ranges that others measured are factors too."""

    def __init__(self, member: Member, sender: Sender, poses: Poses | None, options: Options) -> None:
        super().__init__(member, sender, 0)
        self.poses, self.options = poses, options
        self.fields = frame_fields(len(member.sizes), options.priors)
        self.measured: dict[int, Measured] = {}
        self.own_launches: list[dict[int, np.ndarray]] = [{} for _ in range(member.trials)]
        self.used: list[set[tuple[int, int]]] = [set() for _ in range(member.trials)]
        size = packet_size(len(member.sizes), options.priors)
        self.floats = 1 + 5 * size["links"] + size["ranges"] + 5 * size["priors"]

    def _speaks(self, vehicle: int) -> bool:
        """Whether a vehicle's chain is in the plane, as this method needs it."""
        return self.member.sizes[vehicle] == 4

    def others(self, vehicle: int) -> list[int]:
        """The other vehicles, in the order of the slots of that vehicle's packets."""
        return [v for v in range(len(self.member.sizes)) if v != vehicle]

    def spoken_s(self) -> np.ndarray:
        return super().spoken_s() if self.poses is None else self.poses.times_s

    def transmit(self, launch: Launch) -> Packet:
        self.time_s = launch.time_s
        if self.poses is not None:
            pose = int(self.poses.of_launch[self.launches])
            for trial in range(self.member.trials):
                self.own_launches[trial][pose] = self.own_pose(trial)
        return super().transmit(launch)

    def broadcast(self, launch: Launch) -> np.ndarray:
        """The launch's link, ranges since the last launch with their poses, single fixes with theirs."""
        if self.poses is None:
            return super().broadcast(launch)
        poses, n, trials = self.poses, self.launches, self.member.trials
        pose = int(poses.of_launch[n])
        sender = poses.sender
        stretch = sender.stretch[pose]
        begun = pose - stretch
        values: dict[str, np.ndarray | int] = {
            "sender": self.member.index,
            "sequence": n % 2**16,
            "depth": np.rint(np.broadcast_to(launch.depth_m, (trials,)) / packets.DEPTH_STEP_M).astype(np.int64),
            "stretch": NONE if stretch == 0 else min(begun, OLDEST),
            "new.pose": pose,
        }
        values |= packets.odometry_values("new", sender.lattice[pose])
        for slot, other in enumerate(self.others(self.member.index)):
            latest = self.measured.pop(other, None)
            if latest is not None:
                values |= self._range_slot(f"r{slot}", latest, stretch)
        own = sender.chain.links[pose]
        fixes = self.member.log.fixes
        if own.prior_information is not None and own.prior_mean is not None and self.options.priors:
            values |= {"p0.there": 1, "p0.pose": pose}
            cov = np.linalg.inv(own.prior_information)
            values |= packets.prior_values("p0", own.prior_mean, cov, sender.lattice[pose])
            values |= packets.odometry_values("p0", sender.lattice[pose])
        for slot, (at, fix) in enumerate(poses.fixes[n]):
            if sender.stretch[at] != stretch or fixes is None:
                continue
            near = sender.lattice[at]
            mean = np.broadcast_to(fixes.value[:, fix], (trials, 2))
            cov = np.broadcast_to(fixes.cov[fix], (trials, 2, 2))
            values |= {f"p{slot}.there": 1, f"p{slot}.pose": at}
            values |= packets.odometry_values(f"p{slot}", near) | packets.prior_values(f"p{slot}", mean, cov, near)
        self.launches += 1
        return packets.write_bits(self.fields, trials, values)

    def _range_slot(self, prefix: str, latest: Measured, stretch: int) -> dict[str, np.ndarray]:
        assert self.poses is not None
        sender, values = self.poses.sender, {}
        for pose in np.unique(latest.pose[latest.pose >= 0]):
            if sender.stretch[pose] != stretch:
                continue
            mine = latest.pose == pose
            link = packets.odometry_values(prefix, sender.lattice[pose])
            link |= {
                f"{prefix}.there": np.ones(len(mine), int),
                f"{prefix}.pose": np.full(len(mine), pose),
                f"{prefix}.target": latest.target,
                f"{prefix}.range": np.rint(latest.range_m / RANGE_STEP_M).astype(np.int64),
            }
            for name, value in link.items():
                values[name] = np.where(mine, value, values.get(name, 0))
        return values

    def open(self, sender: int, data: np.ndarray):
        if not self._speaks(sender):
            return super().open(sender, data)
        values, valid = packets.read_bits(self.fields, data)
        return Opened(
            values["new.pose"],
            values["depth"] * packets.DEPTH_STEP_M,
            valid,
            values,
            lambda trial: self._read_links(values, trial),
        )

    def _read_links(self, values: dict[str, np.ndarray], trial: int) -> list[tuple[int, Received]]:
        one = {name: value[trial : trial + 1] for name, value in values.items()}
        now = int(one["new.pose"][0])
        age = int(one["stretch"][0])
        stretch = 0 if age == NONE else now - age
        found: dict[int, Received] = {}

        def note(prefix: str, prior: bool) -> None:
            near = packets.read_odometry(prefix, one)
            mean, cov = packets.read_prior(prefix, one, near) if prior else (None, None)
            told = (mean[0], cov[0]) if mean is not None and cov is not None else None
            pose = int(one[f"{prefix}.pose"][0])
            found[pose] = Received(near.z()[0], near.R()[0], stretch, told, now if told else -1)

        note("new", False)
        for slot in range(len(self.member.sizes) - 1):
            if one[f"r{slot}.there"][0]:
                note(f"r{slot}", False)
        for slot in range(self.options.priors):
            if one[f"p{slot}.there"][0]:
                note(f"p{slot}", True)
        return sorted(found.items(), key=lambda item: item[0])

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation:
        seen = super().receive(arrival, data)
        if self.poses is None or not self._speaks(arrival.sender):
            return seen
        pose = self.poses.of_arrival.get(float(arrival.time_s))
        if pose is not None:
            opened = self.open(arrival.sender, data)
            range_m = horizontal_range(arrival.slant_m, arrival.depth_m - opened.depth_m)
            heard = opened.valid & seen.accepted & np.isfinite(range_m)
            old = self.measured.get(arrival.sender)
            none = np.full(self.member.trials, -1)
            was = old or Measured(none, none, np.zeros(self.member.trials))
            self.measured[arrival.sender] = Measured(
                np.where(heard, pose, was.pose),
                np.where(heard, opened.sequence, was.target),
                np.where(heard, np.nan_to_num(range_m), was.range_m),
            )
        return seen

    def _sender_pose(self, trial: int, sender: int, opened) -> np.ndarray | None:
        """As in W15's smoother; before that, the poses and ranges the sender reports of its own receptions."""
        if not self._speaks(sender):
            return super()._sender_pose(trial, sender, opened)
        graph = self.graphs[trial]
        mine = self.heard[trial].setdefault(sender, Heard(ReceivedChain(), {}))
        changed = [n for n, link in opened.links(trial) if mine.chain.add(n, link)]
        now = int(opened.sequence[trial])
        others = self.others(sender)
        for slot, other in enumerate(others):
            if not opened.values[f"r{slot}.there"][trial]:
                continue
            pose, target = (int(opened.values[f"r{slot}.{name}"][trial]) for name in ("pose", "target"))
            there = self._target(trial, other, target)
            if there is None or (sender, pose) in self.used[trial]:
                continue
            here = self._plane_launch(graph, sender, mine, pose, changed)
            if here is not None:
                self.used[trial].add((sender, pose))
                range_m = float(opened.values[f"r{slot}.range"][trial]) * RANGE_STEP_M
                graph.add_range(here, there, range_m, self.member.log.range_sigma_m)
        return self._plane_launch(graph, sender, mine, now, changed)

    def _target(self, trial: int, vehicle: int, pose: int) -> np.ndarray | None:
        """The launch pose that a reported range was measured to, where it is known here."""
        if vehicle == self.member.index:
            own = self.own_launches[trial].get(pose)
            return None if own is None else own[:2]
        heard = self.heard[trial].get(vehicle)
        return None if heard is None else heard.unknowns.get(pose)


def make_nodes(mission: NavigationMission, options: Options) -> Callable[[Member], PaullNode]:
    """A function from a vehicle's own knowledge to its node."""

    def make(member: Member) -> PaullNode:
        v = member.index
        if member.sizes[v] == 4:
            poses = poses_of(mission, v, member.log, options.priors)
            return PaullNode(member, poses.sender, poses, options)
        return PaullNode(member, make_sender(mission, member, 0, choose_last, False), None, options)

    return make


def run(mission: NavigationMission, progress: Progress) -> Tracks:
    """Run Paull's method on a mission with the scenario's options."""
    options = Options(**mission.options.get("paull", {}))
    make = make_nodes(mission, options)
    return (reconstruct if options.reconstruct_only else smooth)(mission, progress, make)


PAULL = Algorithm(
    name="paull",
    title="Paull et al.",
    family="smoothing",
    summary="Shares single fixes, and the ranges it measured, as they are: ranges work both ways, packets grow with "
    "the network. Shown is what a vehicle knew at the time.",
    source="Paull, Seto and Leonard 2014, as in Walls, Cunningham and Eustice 2015, section V",
    run=run,
    assumes=("positions in the plane: vehicles that integrate odometry share their launches only",),
    options=Options,
)
