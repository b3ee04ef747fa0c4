"""DEIF with origin states (W12 section 4): packets that survive the loss of their predecessors.

Instead of the step from the last launch, a server sends the joint marginal of the new launch state and an origin
state that both sides know. The client recovers the step from the last launch it has by how the information about
the origin changed (W12 eq. 6, whose print is damaged; the form here is verified), and hands it to the same client
filter as the DEIF. A lost packet leaves the graph as if that launch had been marginalized out.

The correlation with an old origin dies, and with it the precision of that recovery. So every packet also
acknowledges, per vehicle, the last launch integrated from it, and a server moves its origin to the oldest of what
its clients acknowledged. A packet whose step cannot be recovered is skipped: once the last integrated launch has
become the origin the next packet connects to it directly, without any difference of informations. A server that
nobody ever acknowledges resets its origin when the correlation is gone; its clients then begin again from their
own sensors alone, since what they know can no longer be related to it.

A velocity is forgotten within seconds of Doppler readings, so nothing of it survives in the correlation with an
origin several launches back, and the recovery would be of rank two: launch states are positions by default, as in
W11's packet of 14 floats. Full states can be had; then only the launch acknowledged last can be stepped from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from engine.gaussian.forms import Information, Moments, apply, augment, drop, keep, symmetric, transpose
from engine.gaussian.links import Link, from_delta, move, update
from engine.navigation import packets
from engine.navigation.chains import XY, Step
from engine.navigation.deif import floats_of, from_nothing, make_server
from engine.navigation.mission import Arrival, Launch, NavigationMission
from engine.navigation.network import Member, Packet, correlation_of, run_nodes, slant_to_horizontal
from engine.navigation.ranging import Innovation
from engine.navigation.served import ServedFilter, only_in
from engine.notes import Note
from engine.registry import Algorithm, Progress
from engine.tracks import Tracks

#: A server nobody acknowledges resets its origin below this correlation.
DEAD_CORRELATION = 1e-4
#: The recovered step is refused where round-off may exceed this part of the information it rests on.
WORST_ROUND_OFF = 1e-4
#: No honest sender is so far away or so uncertain, m, and no term of an honest step is so large (NaN is not smaller).
FARTHEST_M, LARGEST_TERM = 1e8, 1e16
#: Launch states a server keeps for its clients to choose an origin from, and a client keeps to recognize it.
SERVER_KEEPS, CLIENT_KEEPS = 24, 8


def packet_layout(n: int, vehicles: int) -> np.dtype:
    """The joint marginal over (new, origin), which launch the origin is, and acknowledgements (-1: none)."""
    half = n * (2 * n + 1)
    return packets.layout(
        ("mean", "<f8", 2 * n),
        ("cov", "<f8", half),
        ("origin", "<u2"),
        ("acks", "<i4", vehicles),
        *packets.DEPTH,
    )


def recover_step(c: Moments, s: Moments) -> tuple[Link, np.ndarray]:
    """The step t_prev -> t_new from the joint c of (t_prev, t_0) and the packet s of (t_new, t_0): W12 eq. (6).

    With 2 = prev, 3 = new, 0 = origin, in information form:
    Om^-1 = c02^-1 (c00 - s00) c20^-1, beta = -s30 (Om^-1 c20)^-1, nu = (c02 Om^-1)^-1 (eta_c0 - eta_s0),
    L33 = s33 + beta Om^-1 beta', L32 = beta, eta3 = eta_s3 + beta Om^-1 nu, L22' - L22 = Om - c22,
    eta2' - eta2 = nu - eta_c2. Returns the step as a link and, per trial, the part of the information difference
    that may be round-off (infinite where it is not a difference of informations at all).
    """
    n = c.mean.shape[-1] // 2
    last, origin = slice(0, n), slice(n, 2 * n)
    trials = c.mean.shape[:-1]
    with np.errstate(all="ignore"):
        ci, si = _safe_information(c), _safe_information(s)
        c20, c02 = ci.matrix[..., last, origin], ci.matrix[..., origin, last]
        gained = symmetric(ci.matrix[..., origin, origin] - si.matrix[..., origin, origin])
        values = np.linalg.eigvalsh(gained)
        scale = np.abs(ci.matrix[..., origin, origin]).max(axis=(-1, -2))
        round_off = np.where(values[..., 0] > 0, np.finfo(float).eps * scale / values[..., 0], np.inf)
        # A trial that cannot be recovered must not spoil the others: let it invert something harmless.
        fine = (round_off < WORST_ROUND_OFF) & (np.abs(np.linalg.det(c02)) > 0)
        eye = np.broadcast_to(np.eye(n), (*trials, n, n))
        gained = np.where(fine[..., None, None], gained, eye)
        c02 = np.where(fine[..., None, None], c02, eye)
        c20 = transpose(c02)
        Om_inv = np.linalg.solve(c02, transpose(np.linalg.solve(c02, transpose(gained))))
        Om = symmetric(np.linalg.inv(Om_inv))
        beta = -transpose(np.linalg.solve(transpose(Om_inv @ c20), transpose(si.matrix[..., last, origin])))
        nu = np.linalg.solve(c02 @ Om_inv, (ci.vector[..., origin] - si.vector[..., origin])[..., None])[..., 0]
        L33 = symmetric(si.matrix[..., last, last] + beta @ Om_inv @ transpose(beta))
        eta3 = si.vector[..., last] + apply(beta @ Om_inv, nu)
        matrix = np.concatenate(
            [
                np.concatenate([L33, beta], axis=-1),
                np.concatenate([transpose(beta), Om - ci.matrix[..., last, last]], axis=-1),
            ],
            axis=-2,
        )
        vector = np.concatenate([eta3, nu - ci.vector[..., last]], axis=-1)
        proper = fine & np.isfinite(matrix).all((-1, -2)) & (np.linalg.eigvalsh(_finite(L33))[..., 0] > 0)
        matrix = np.where(proper[..., None, None], matrix, np.eye(2 * n))
        link = from_delta(Information(np.where(proper[..., None], vector, 0.0), matrix))
    return link, np.where(proper, round_off, np.inf)


def direct_step(known: Moments, s: Moments) -> Link:
    """The step from the origin itself to t_new, where the origin is the last launch integrated.

    `known` is what the client knew of the origin; the packet s of (t_new, t_0) may know more of it by now.
    """
    n = s.mean.shape[-1] // 2
    new, origin = slice(0, n), slice(n, 2 * n)
    P00, P30 = s.cov[..., origin, origin], s.cov[..., new, origin]
    A = transpose(np.linalg.solve(P00, transpose(P30)))
    after, before = np.linalg.inv(P00), np.linalg.inv(known.cov)
    return Link(
        A=A,
        b=s.mean[..., new] - apply(A, s.mean[..., origin]),
        C=symmetric(s.cov[..., new, new] - A @ transpose(P30)),
        eta=apply(after, s.mean[..., origin]) - apply(before, known.mean),
        J=symmetric(after - before),
    )


def _finite(matrix: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(matrix), matrix, 0.0)


def _safe_information(moments: Moments) -> Information:
    """Information form; a singular trial comes out as one without information."""
    n = moments.mean.shape[-1]
    scale = np.sqrt(np.maximum(np.diagonal(moments.cov, axis1=-2, axis2=-1), 1e-30))
    unit = moments.cov / (scale[..., :, None] * scale[..., None, :])
    regular = np.linalg.eigvalsh(unit)[..., 0] > n * np.finfo(float).eps
    unit = np.where(regular[..., None, None], unit, np.eye(n))
    inverse = np.linalg.inv(unit) / (scale[..., :, None] * scale[..., None, :])
    matrix = np.where(regular[..., None, None], symmetric(inverse), 0.0)
    return Information(apply(matrix, moments.mean), matrix)


class Options(BaseModel):
    """What a scenario may choose for the MDEIF, under [options.mdeif]."""

    model_config = ConfigDict(extra="forbid")

    delayed_state: Literal["full", "xy"] = Field("xy", description="state kept of a launch; xy is W11's 14 floats")


class OriginServer:
    """The own sensors alone: launch states still of use, joined by the DEIF's deltas, and each trial's origin."""

    def __init__(self, initial: Moments, delayed_state: str) -> None:
        self.source = make_server(initial, delayed_state)
        self.n = self.source.size
        self.joint = keep(initial, slice(0, 0))
        self.launches: list[int] = []
        trials = initial.mean.shape[0]
        self.origin = np.zeros(trials, int)
        self.acknowledged: dict[int, np.ndarray] = {}
        self.correlation = np.ones(trials)
        self.resets = np.zeros(trials, int)

    def acknowledge(self, client: int, launch: np.ndarray) -> None:
        """A client says which launch it integrated last, per trial (-1: says nothing)."""
        best = self.acknowledged.setdefault(client, np.full(launch.shape, -1))
        known = np.isin(launch, self.launches)
        best[known] = np.maximum(best, launch)[known]

    def marginal(self, sequence: int) -> Moments:
        """Add the launch `sequence` to the graph and return the joint marginal of it and each trial's origin."""
        self._shift(sequence)
        link, end = self.source.delta(), self.joint.mean.shape[-1]
        if self.launches:
            last = slice(end - self.n, end)
            longer = augment(update(self.joint, last, link.eta, link.J), last)
            self.joint = move(longer, slice(end, end + self.n), link.A, link.b, link.C)
        else:
            self.joint = Moments(link.b, link.C)
        self.launches.append(sequence)
        pair = self._pair(sequence)
        self.correlation = correlation_of(pair, XY, slice(self.n, self.n + 2))
        nobody = np.ones(self.origin.shape, bool)
        for best in self.acknowledged.values():
            nobody &= best < 0
        dead = nobody & (self.correlation < DEAD_CORRELATION)
        if dead.any():
            self.resets += dead
            self.origin[dead] = sequence
            pair = self._pair(sequence)
        self._forget()
        return pair

    def _shift(self, sequence: int) -> None:
        """Move the origin to the oldest of the launches that the clients acknowledged last (W12 section 4.3)."""
        if not self.launches:
            self.origin[:] = sequence
            return
        oldest = np.full(self.origin.shape, np.iinfo(int).max)
        for best in self.acknowledged.values():
            oldest = np.where(best >= 0, np.minimum(oldest, best), oldest)
        ahead = (oldest < np.iinfo(int).max) & (oldest > self.origin) & np.isin(oldest, self.launches)
        self.origin = np.where(ahead, oldest, self.origin)

    def _pair(self, sequence: int) -> Moments:
        n, trials = self.n, np.arange(len(self.origin))[:, None]
        where = np.searchsorted(self.launches, self.origin)
        new = n * self.launches.index(sequence) + np.arange(n)
        index = np.concatenate([np.broadcast_to(new, (len(trials), n)), n * where[:, None] + np.arange(n)], axis=-1)
        mean = self.joint.mean[trials, index]
        cov = self.joint.cov[trials[..., None], index[:, :, None], index[:, None, :]]
        return Moments(mean, cov)

    def _forget(self) -> None:
        """Marginalize out launches no client can come to need: older than every origin, then the oldest unused."""
        needed = set(self.origin.tolist())
        useless = [k for k in self.launches if k < self.origin.min()]
        spare = [k for k in self.launches[:-1] if k not in needed and k not in useless]
        useless += spare[: max(0, len(self.launches) - len(useless) - SERVER_KEEPS)]
        for launch in useless:
            at = self.n * self.launches.index(launch)
            self.joint = drop(self.joint, slice(at, at + self.n))
            self.launches.remove(launch)


@dataclass
class Remembered:
    """What a client knows of one server's own graph: joint moments of its last launches, per trial.

    sequence (trials, slots), -1 where empty; state over slots x n; last (trials,) the newest integrated (-1: none).
    """

    sequence: np.ndarray
    state: Moments
    last: np.ndarray

    @classmethod
    def nothing(cls, trials: int, n: int) -> Remembered:
        size = CLIENT_KEEPS * n
        blank = Moments(np.zeros((trials, size)), np.broadcast_to(np.eye(size), (trials, size, size)).copy())
        return cls(np.full((trials, CLIENT_KEEPS), -1), blank, np.full(trials, -1))

    def slot(self, sequence: np.ndarray) -> np.ndarray:
        """Slot of a launch per trial; -1 where it is not remembered."""
        match = (self.sequence == sequence[:, None]) & (sequence >= 0)[:, None]
        return np.where(match.any(-1), match.argmax(-1), -1)

    def pick(self, *slots: np.ndarray) -> Moments:
        """Joint moments of the given slots (trials,) each, in that order."""
        return _picked(self.state, *slots)

    def begin(self, s: Moments, sequence: np.ndarray, origin: np.ndarray, where: np.ndarray) -> None:
        """Start from one packet, the joint of (new, origin), in the trials of a mask; forget all before."""
        n = s.mean.shape[-1] // 2
        self.sequence[where] = -1
        self.sequence[where, 0] = sequence[where]
        self.sequence[where, 1] = np.where(origin == sequence, -1, origin)[where]
        self.last[where] = sequence[where]
        self.state.mean[where, : 2 * n] = s.mean[where]
        self.state.cov[where] = np.eye(self.state.mean.shape[-1])
        self.state.cov[where, : 2 * n, : 2 * n] = s.cov[where]

    def forget(self, where: np.ndarray) -> None:
        """Know nothing of this server any more, in the trials of a mask."""
        self.sequence[where], self.last[where] = -1, -1

    def extend(self, link: Link, sequence: np.ndarray, origin: np.ndarray, where: np.ndarray) -> None:
        """Add the launch reached by `link` from the last one, in the trials of a mask, over the oldest slot.

        The origin now in use is kept however old it is.
        """
        n = self.state.mean.shape[-1] // CLIENT_KEEPS
        n = self.state.mean.shape[-1] // CLIENT_KEEPS
        age = np.where(self.sequence == origin[:, None], np.iinfo(np.int64).max, self.sequence)
        age = np.where(self.sequence == self.last[:, None], np.iinfo(np.int64).max, age)
        target, source = age.argmin(-1), np.maximum(self.slot(self.last), 0)
        # Sort the slots per trial: the last launch first, the one to be overwritten at the end.
        rank = np.broadcast_to(np.arange(CLIENT_KEEPS), self.sequence.shape).copy()
        np.put_along_axis(rank, source[:, None], -1, -1)
        np.put_along_axis(rank, target[:, None], CLIENT_KEEPS, -1)
        order = np.argsort(rank, axis=-1)
        sorted_state = self.pick(*order.T)
        kept, newest = slice(0, (CLIENT_KEEPS - 1) * n), slice(0, n)
        longer = augment(update(keep(sorted_state, kept), newest, link.eta, link.J), newest)
        longer = move(longer, slice(kept.stop, kept.stop + n), link.A, link.b, link.C)
        back = _picked(longer, *np.argsort(order, axis=-1).T)
        self.state = Moments(
            np.where(where[:, None], back.mean, self.state.mean),
            np.where(where[:, None, None], back.cov, self.state.cov),
        )
        self.sequence[where, target[where]] = sequence[where]
        self.last[where] = sequence[where]


def _picked(state: Moments, *slots: np.ndarray) -> Moments:
    """Joint moments of the given slots (trials,) each, in that order."""
    n = state.mean.shape[-1] // CLIENT_KEEPS
    trials = np.arange(state.mean.shape[0])[:, None]
    index = np.concatenate([np.maximum(s, 0)[:, None] * n + np.arange(n) for s in slots], axis=-1)
    return Moments(state.mean[trials, index], state.cov[trials[..., None], index[:, :, None], index[:, None, :]])


class MdeifNode:
    """A server of origin state packets and a client of everyone heard."""

    def __init__(self, member: Member, options: Options) -> None:
        self.member, self.options = member, options
        self.server = OriginServer(member.initial, options.delayed_state)
        self.client = ServedFilter(member)
        self.sequence = 0
        self.graphs: dict[int, Remembered] = {}
        self.skipped: dict[int, np.ndarray] = {}
        self.restarted: dict[int, np.ndarray] = {}

    def advance(self, step: Step) -> None:
        self.server.source.advance(step)
        self.client.advance(step)

    def transmit(self, launch: Launch) -> Packet:
        n, vehicles, trials = self.server.n, len(self.member.names), self.member.trials
        pair = self.server.marginal(self.sequence)
        upper = np.triu_indices(2 * n)
        acks = np.full((trials, vehicles), -1)
        for sender, graph in self.graphs.items():
            acks[:, sender] = graph.last
        data = packets.encode(
            packet_layout(n, vehicles),
            trials,
            sender=self.member.index,
            sequence=self.sequence,
            mean=pair.mean,
            cov=pair.cov[:, upper[0], upper[1]],
            origin=self.server.origin,
            acks=acks,
            depth=packets.to_steps(launch.depth_m, packets.DEPTH_STEP_M, "<i2"),
        )
        self.sequence += 1
        return Packet(data, 1 + floats_of(n))

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation:
        """Recover the step from the last launch had, add it, update with the range (W12 section 4.4)."""
        sender, trials = arrival.sender, self.member.trials
        n = 2 if self.options.delayed_state == "xy" else self.member.sizes[sender]
        packet = packets.decode(packet_layout(n, len(self.member.names)), data)
        record = packet.record
        graph = self.graphs.setdefault(sender, Remembered.nothing(trials, n))
        self.client.server(sender, n)
        s, proper = _pair_of(record, n)
        valid = packet.valid & proper
        self.server.acknowledge(sender, np.where(valid, record["acks"][:, self.member.index], -1))

        sequence, origin = record["sequence"].astype(int), record["origin"].astype(int)
        valid &= sequence > graph.last
        again = valid & (origin == sequence) & (graph.last >= 0)
        if again.any():
            self.client.start_again(again, self.server.source.state)
            for other in self.graphs.values():
                other.forget(again)
            self.restarted[sender] = self.restarted.get(sender, np.zeros(trials, int)) + again
        begun = valid & (graph.last < 0)
        fixed = self.member.sizes[sender] == 2
        link, stepped = _proper(*self._step(graph, s, origin, valid & ~begun, fixed))
        start = from_nothing(keep(s, slice(0, n)))
        added = self.client.integrate(sender, _where(begun, start, link), begun | stepped)
        begun, stepped = begun & added, stepped & added
        self.skipped[sender] = self.skipped.get(sender, np.zeros(trials, int)) + (valid & ~begun & ~stepped)
        graph.extend(link, sequence, origin, stepped)
        graph.begin(s, sequence, origin, begun)
        usable = begun | stepped
        range_m = slant_to_horizontal(arrival, record["depth"] * packets.DEPTH_STEP_M)
        return self.client.update(sender, np.where(usable, range_m, np.nan))

    def _step(
        self, graph: Remembered, s: Moments, origin: np.ndarray, valid: np.ndarray, fixed: bool
    ) -> tuple[Link, np.ndarray]:
        """The link from the last launch integrated to the packet's, and in which of the valid trials it is known."""
        n = s.mean.shape[-1] // 2
        newest = graph.slot(graph.last)
        if fixed:
            # A node that does not move has one state, whatever the origin.
            same = Moments(np.tile(s.mean[:, :n], 2), np.tile(s.cov[:, :n, :n], (1, 2, 2)))
            return direct_step(_harmless(graph.pick(newest), valid), _harmless(same, valid)), valid
        at_origin = graph.slot(origin)
        known = valid & (at_origin >= 0)
        direct, indirect = known & (graph.last == origin), known & (graph.last != origin)
        link = direct_step(_harmless(graph.pick(at_origin), direct), _harmless(s, direct))
        if indirect.any():
            c = _harmless(graph.pick(newest, at_origin), indirect)
            recovered, round_off = recover_step(c, _harmless(s, indirect))
            link = _where(indirect, recovered, link)
            indirect &= round_off < WORST_ROUND_OFF
        return link, direct | indirect

    def belief(self) -> Moments:
        return self.client.belief()

    def monitor(self) -> dict[str, np.ndarray]:
        """Correlation of the last launch with its origin (W12 Fig. 5)."""
        return {f"origin_correlation/{self.member.log.name}": self.server.correlation}

    def notes(self) -> list[Note]:
        notes = []
        for sender, count in self.skipped.items():
            if count.any():
                notes.append(
                    Note(
                        "skipped {} packets of {} in {} trials: too old or too damaged to recover the step from",
                        *(int(count.sum()), self.member.names[sender], int((count > 0).sum())),
                    )
                )
        for sender, count in self.restarted.items():
            notes.append(
                Note(
                    "began again {} times with {}, which hears no acknowledgement and had to reset its origin",
                    *(int(count.sum()), self.member.names[sender]),
                )
            )
        if self.server.resets.any():
            resets = int(self.server.resets.sum())
            notes.append(Note("reset its origin {} times: nobody acknowledges its packets", resets))
        return notes


def _pair_of(record: np.ndarray, n: int) -> tuple[Moments, np.ndarray]:
    """The joint marginal in a packet and in which trials it is a proper Gaussian."""
    upper = np.triu_indices(2 * n)
    cov = np.zeros((len(record), 2 * n, 2 * n))
    cov[:, upper[0], upper[1]] = cov[:, upper[1], upper[0]] = record["cov"]
    flat = np.concatenate([cov.reshape(len(record), -1), record["mean"]], axis=-1)
    finite = np.logical_and.reduce(np.isfinite(flat), axis=-1)
    cov = np.where(finite[:, None, None], cov, np.eye(2 * n))
    values = np.linalg.eigvalsh(cov)
    proper = finite & (values[:, 0] >= -1e-9 * values[:, -1]) & (values[:, -1] > 0) & (values[:, -1] < FARTHEST_M**2)
    proper &= (np.abs(np.where(finite[:, None], record["mean"], 0.0)) < FARTHEST_M).all(axis=-1)
    origin = np.linalg.eigvalsh(cov[:, n:, n:])
    proper &= origin[:, 0] > 1e-14 * origin[:, -1]
    return Moments(
        np.where(proper[:, None], record["mean"], 0.0), np.where(proper[:, None, None], cov, np.eye(2 * n))
    ), proper


def _proper(link: Link, where: np.ndarray) -> tuple[Link, np.ndarray]:
    """The link, and in which trials of a mask it is a step: of a credible size, C and J without negative parts."""
    parts = [link.A, link.b[..., None], link.C, link.eta[..., None], link.J]
    largest = np.max([np.abs(part).max(axis=(-2, -1), initial=0.0) for part in parts], axis=0)
    where = where & (largest < LARGEST_TERM)
    link = only_in(where, link)
    for part in (link.C, link.J):
        values = np.linalg.eigvalsh(part)
        where = where & (values[..., 0] >= -WORST_ROUND_OFF * np.abs(values).max(-1))
    return only_in(where, link), where


def _harmless(moments: Moments, where: np.ndarray) -> Moments:
    """The moments in the trials of a mask, standard ones elsewhere, so that all can be inverted."""
    n = moments.mean.shape[-1]
    return Moments(np.where(where[:, None], moments.mean, 0.0), np.where(where[:, None, None], moments.cov, np.eye(n)))


def _where(mask: np.ndarray, one: Link, other: Link) -> Link:
    two = mask[:, None, None]
    return Link(
        np.where(two, one.A, other.A),
        np.where(mask[:, None], one.b, other.b),
        np.where(two, one.C, other.C),
        np.where(mask[:, None], one.eta, other.eta),
        np.where(two, one.J, other.J),
    )


def run(mission: NavigationMission, progress: Progress) -> Tracks:
    """Run the MDEIF on a mission with the scenario's options."""
    options = Options(**mission.options.get("mdeif", {}))
    return run_nodes(mission, progress, lambda member: MdeifNode(member, options), MdeifNode.monitor)


MDEIF = Algorithm(
    name="mdeif",
    title="Origin state method (MDEIF)",
    family="navigation",
    summary="DEIF whose packets refer to an acknowledged origin state: a lost packet costs only its own range.",
    source="Walls and Eustice 2012",
    run=run,
    options=Options,
    assumes=("clients answer now and then, to move the origin",),
)
