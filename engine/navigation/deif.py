"""Decentralized extended information filter (W11 section II-D, W12 section 3; Webster et al. 2010).

A server sends, at each launch, the delta information its own sensors gathered since the launch before; a client
adds the packets up to the server's pose graph and so keeps the correlation that ranges build. With the full state
as delayed state a client of one server equals the centralized EKF at each packet, to numerical precision.

Every vehicle here is a server of its own sensors alone and a client of whom it hears. In the topologies the method
was made for (one server, its clients silent) that is the method; elsewhere it stays consistent but does not pass on
what a server learnt from ranges.

The sum does not survive a lost packet: sequence numbers reveal the gap, and unless the packet repeats the last k
deltas (W11 section IV-D) that server's ranges are not used any more.

The delta over (x_new, x_last), blocks C^-1, -C^-1 A, J + A' C^-1 A, is sent as its link (A, b, C, eta, J): the
same number of floats, but rounding one float does not mix certain and uncertain directions.
"""

from __future__ import annotations

from functools import reduce
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from engine.gaussian.forms import Moments, apply, augment, drop, keep, symmetric, transpose
from engine.gaussian.links import Link, advance, compose
from engine.navigation import packets
from engine.navigation.chains import XY, Step
from engine.navigation.mission import Arrival, Launch, NavigationMission
from engine.navigation.network import Member, Packet, run_nodes, slant_to_horizontal
from engine.navigation.ranging import Innovation
from engine.navigation.served import ServedFilter, only_in
from engine.notes import Least, Note
from engine.registry import Algorithm, Progress
from engine.tracks import Tracks

#: A larger number in a packet (or none at all) is no figure of a link.
LARGEST = 1e30


class Options(BaseModel):
    """What a scenario may choose for the DEIF, under [options.deif]."""

    model_config = ConfigDict(extra="forbid")

    delayed_state: Literal["full", "xy"] = Field("full", description="state kept of a launch; xy is W11's 14 floats")
    redundancy: int = Field(1, ge=1, le=8, description="how many of the last deltas each packet carries")
    quantization: Literal["float32", "float64"] = Field("float32", description="how a float is sent")


def link_layout(n: int, floats: str) -> np.dtype:
    """A link between n-dimensional states: symmetric parts by their upper triangle."""
    half = n * (n + 1) // 2
    kind = {"float32": "<f4", "float64": "<f8"}[floats]
    return np.dtype([("A", kind, (n, n)), ("b", kind, n), ("C", kind, half), ("eta", kind, n), ("J", kind, half)])


def floats_of(n: int) -> int:
    """Floats of one delta: 2n of the vector and n (2n + 1) of the symmetric matrix; 14 for n = 2."""
    return 2 * n + n * (2 * n + 1)


def pack_link(link: Link, trials: int, layout: np.dtype) -> np.ndarray:
    """A link as records (trials,)."""
    n = link.A.shape[-1]
    upper = np.triu_indices(n)
    record = np.zeros(trials, layout)
    record["A"], record["b"], record["eta"] = link.A, link.b, link.eta
    record["C"], record["J"] = link.C[..., upper[0], upper[1]], link.J[..., upper[0], upper[1]]
    return record


def unpack_link(record: np.ndarray) -> tuple[Link, np.ndarray]:
    """Records (trials,) back to a link, and which of them are a proper one: of some size, C and J not negative."""
    n = record["b"].shape[-1]
    upper = np.triu_indices(n)
    full = {}
    for name in ("C", "J"):
        matrix = np.zeros((len(record), n, n))
        matrix[:, upper[0], upper[1]] = matrix[:, upper[1], upper[0]] = as_float(record[name])
        full[name] = matrix
    A, b, eta = (as_float(record[name]) for name in ("A", "b", "eta"))
    flat = [A.reshape(len(record), -1), b, eta, *(m.reshape(len(record), -1) for m in full.values())]
    proper = np.logical_and.reduce(np.abs(np.concatenate(flat, axis=-1)) < LARGEST, axis=-1)
    for name in ("C", "J"):
        matrix = np.where(proper[:, None, None], full[name], 0.0)
        values, vectors = np.linalg.eigh(matrix)
        proper = proper & (values[:, 0] >= -1e-3 * np.maximum(np.abs(values[:, -1]), 1e-9))
        clipped = (vectors * np.maximum(values, 0.0)[:, None, :]) @ transpose(vectors)
        full[name] = np.where((values[:, 0] < 0)[:, None, None], clipped, matrix)
    return only_in(proper, Link(A, b, full["C"], eta, full["J"])), proper


def as_float(sent: np.ndarray) -> np.ndarray:
    """What was sent as doubles, also where it is no number."""
    with np.errstate(invalid="ignore"):
        return sent.astype(float)


class FullServer:
    """Deltas between full launch states: the links of the own sensors, composed."""

    def __init__(self, initial: Moments) -> None:
        self.state = initial
        self.since: list[Link] = []
        self.size = initial.mean.shape[-1]
        self.started = False

    def advance(self, step: Step) -> None:
        link = step.at(self.state.mean)
        self.state = advance(self.state, slice(None), link)
        self.since.append(link)

    def delta(self) -> Link:
        """The link from the last launch to this one; before the first, the belief itself."""
        link = reduce(compose, self.since) if self.started and self.since else _standing_still(self.state)
        if not self.started:
            link = from_nothing(self.state)
            self.started = True
        self.since = []
        return link


class PositionServer:
    """Deltas between launch positions only: exact where the motion is Markov in x and y, smaller always."""

    size = 2

    def __init__(self, initial: Moments) -> None:
        self.joint = initial
        self.current = slice(0, initial.mean.shape[-1])
        self.last = slice(self.current.stop, self.current.stop + 2)
        self.known: Moments | None = None

    @property
    def state(self) -> Moments:
        return keep(self.joint, self.current)

    def advance(self, step: Step) -> None:
        self.joint = advance(self.joint, self.current, step.at(self.joint.mean[..., self.current]))

    def delta(self) -> Link:
        here = keep(self.joint, XY)
        link = from_nothing(here) if self.known is None else self._link(self.known)
        if self.known is not None:
            self.joint = drop(self.joint, self.last)
        self.joint = augment(self.joint, XY)
        self.known = here
        return link

    def _link(self, known: Moments) -> Link:
        """p(x_new | x_last), and the information about x_last gained since its launch."""
        P = self.joint.cov
        Pll, Pnl = P[..., self.last, self.last], P[..., XY, self.last]
        mean_new, mean_last = self.joint.mean[..., XY], self.joint.mean[..., self.last]
        A = transpose(np.linalg.solve(Pll, transpose(Pnl)))
        after, before = np.linalg.inv(Pll), np.linalg.inv(known.cov)
        return Link(
            A=A,
            b=mean_new - apply(A, mean_last),
            C=symmetric(P[..., XY, XY] - A @ transpose(Pnl)),
            eta=apply(after, mean_last) - apply(before, known.mean),
            J=symmetric(after - before),
        )


def make_server(initial: Moments, delayed_state: str) -> FullServer | PositionServer:
    """The server that keeps "full" or "xy" launch states."""
    return FullServer(initial) if delayed_state == "full" else PositionServer(initial)


def from_nothing(state: Moments) -> Link:
    """A link that forgets its start and ends in the given belief: the first delta of all."""
    zero = np.zeros_like(state.cov)
    return Link(zero, state.mean, state.cov, np.zeros_like(state.mean), zero)


def _standing_still(state: Moments) -> Link:
    zero = np.zeros_like(state.cov)
    eye = np.broadcast_to(np.eye(state.mean.shape[-1]), state.cov.shape)
    return Link(eye, np.zeros_like(state.mean), zero, np.zeros_like(state.mean), zero)


class DeifNode:
    """A server of the own sensors and a client of everyone heard."""

    def __init__(self, member: Member, options: Options) -> None:
        self.member, self.options = member, options
        self.server = make_server(member.initial, options.delayed_state)
        self.client = ServedFilter(member)
        self.sequence = 0
        self.recent: list[np.ndarray] = []
        #: Per server: the last sequence integrated (-1: none yet), and the trials in which its sum is broken.
        self.integrated: dict[int, np.ndarray] = {}
        self.broken: dict[int, np.ndarray] = {}
        self.first_break: dict[int, float] = {}

    def _layout(self, size: int) -> np.dtype:
        delta = link_layout(size, self.options.quantization)
        return packets.layout(("deltas", delta, (self.options.redundancy,)), *packets.DEPTH)

    def advance(self, step: Step) -> None:
        self.server.advance(step)
        self.client.advance(step)

    def transmit(self, launch: Launch) -> Packet:
        layout = self._layout(self.server.size)
        delta = layout["deltas"].base
        self.recent = [pack_link(self.server.delta(), self.member.trials, delta), *self.recent]
        self.recent = self.recent[: self.options.redundancy]
        deltas = np.zeros((self.member.trials, self.options.redundancy), delta)
        for age, record in enumerate(self.recent):
            deltas[:, age] = record
        data = packets.encode(
            layout,
            self.member.trials,
            sender=self.member.index,
            sequence=self.sequence,
            deltas=deltas,
            depth=packets.to_steps(launch.depth_m, packets.DEPTH_STEP_M, "<i2"),
        )
        self.sequence = (self.sequence + 1) % 2**16
        return Packet(data, 1 + floats_of(self.server.size) * self.options.redundancy)

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation:
        """Add the deltas that are new, oldest first, then update with the range (W12 section 3.1)."""
        sender, trials = arrival.sender, self.member.trials
        size = 2 if self.options.delayed_state == "xy" else self.member.sizes[sender]
        packet = packets.decode(self._layout(size), data)
        self.client.server(sender, size)
        last = self.integrated.setdefault(sender, np.full(trials, -1))
        broken = self.broken.setdefault(sender, np.zeros(trials, bool))
        sequence = packet.record["sequence"].astype(int)
        gap = sequence - last
        usable = packet.valid & ~broken & (gap > 0)
        lost = usable & (gap > self.options.redundancy)
        broken |= lost
        usable &= ~lost
        for age in reversed(range(self.options.redundancy)):
            link, proper = unpack_link(packet.record["deltas"][:, age])
            now = usable & (gap > age)
            added = self.client.integrate(sender, link, now & proper)
            broken |= now & ~added
            usable &= added | ~now
        if broken.any():
            self.first_break.setdefault(sender, arrival.time_s)
        last[usable] = sequence[usable]
        range_m = slant_to_horizontal(arrival, packet.record["depth"] * packets.DEPTH_STEP_M)
        return self.client.update(sender, np.where(usable, range_m, np.nan))

    def belief(self) -> Moments:
        return self.client.belief()

    def notes(self) -> list[Note]:
        return [
            Note(
                "lost a packet of {} in {} trials, first after {:.0f} s; its ranges were not used from then on",
                *(self.member.names[sender], int(broken.sum()), Least(self.first_break[sender])),
            )
            for sender, broken in self.broken.items()
            if broken.any()
        ]


def run(mission: NavigationMission, progress: Progress) -> Tracks:
    """Run the DEIF on a mission with the scenario's options."""
    options = Options(**mission.options.get("deif", {}))
    return run_nodes(mission, progress, lambda member: DeifNode(member, options))


DEIF = Algorithm(
    name="deif",
    title="Decentralized EIF",
    family="navigation",
    summary="Servers send delta information, clients rebuild the server's graph: exact, until a packet is lost.",
    source="Walls and Eustice 2011, section II-D; Webster et al. 2010",
    run=run,
    options=Options,
    assumes=("one server, its clients silent (topologies B and D)", "no lost packets"),
)
