"""A vehicle that smooths its own chain together with the chains it received (W15 Algorithm 2).

Its own poses at receptions and the senders' launch poses it heard are the unknowns; what lies between is composed
away. After each packet the whole problem is solved again, and what it says of the present is the vehicle's belief.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric
from engine.gaussian.links import Link, advance, compose
from engine.navigation import packets as records
from engine.navigation.chains import XY, Step
from engine.navigation.mission import Arrival, Launch
from engine.navigation.network import Member, Packet
from engine.navigation.ranging import Innovation, horizontal_range
from engine.notes import Note
from engine.smoothing.band import NotPositiveDefinite
from engine.smoothing.composition import Relation, decompose, oplus
from engine.smoothing.composition import compose as then
from engine.smoothing.diary import NOTHING, Diary, OwnPose, Sent, told_by
from engine.smoothing.growing import BORDER, Growing
from engine.smoothing.packets import NONE
from engine.smoothing.reconstruction import Received, ReceivedChain, open_packet
from engine.smoothing.sender import pose_layout
from engine.smoothing.trajectory import STEP_FLOOR, link_factors, pieces, pose_information

#: A position known worse than this (1/m^2) makes a range to it worthless.
_UNKNOWN = 1e-8


class Sender(Protocol):
    """What a vehicle broadcasts."""

    def packet(self, now: int, depth_m: np.ndarray) -> np.ndarray: ...


@dataclass
class Heard:
    """One sender's chain as one trial has it: links received, and the launches that are unknowns of the graph."""

    chain: ReceivedChain
    unknowns: dict[int, np.ndarray]


class SmootherNode:
    """One vehicle's smoother, all trials; `sender` makes its packets, of `k` slots like everyone's."""

    def __init__(self, member: Member, sender: Sender, k: int) -> None:
        self.member, self.sender, self.k = member, sender, k
        self.now = member.initial
        self.size = member.initial.mean.shape[-1]
        self.launches = 0
        self.floats = 1 + 5 * (k + 1) + 5 * k if self.size != 3 else 1 + 9 * (k + 1) + 9 * k
        self.since: Link | None = None
        self.turned: Relation | None = None
        self.fixed = [v for v, n in enumerate(member.sizes) if n == 2 and v != member.index]
        self.graphs = [self._graph(trial) for trial in range(member.trials)]
        self.heard: list[dict[int, Heard]] = [{} for _ in range(member.trials)]
        self.own: list[np.ndarray | None] = [None] * member.trials
        self.lost_ranges = 0
        self.diary, self.time_s = Diary(), 0.0

    def _graph(self, trial: int) -> Growing:
        """Border: positions of fixed nodes, one's own if one is fixed, and the sound-speed error."""
        scaled = self.member.sound_speed_sigma_mps > 0
        count = 2 * len(self.fixed) + (2 if self.size == 2 else 0) + scaled
        graph = Growing(np.zeros(count), BORDER + count - 1 if scaled else None)
        if scaled:
            sigma = self.member.sound_speed_sigma_mps / self.member.sound_speed_mps
            graph.set(("scale",), np.array([BORDER + count - 1]), np.array([[sigma**-2]]), np.zeros(1))
        for place in range(len(self.fixed)):
            idx = BORDER + 2 * place + np.arange(2)
            graph.set(("unheard", place), idx, np.eye(2) * _UNKNOWN * 1e-4, np.zeros(2))
        return graph

    def advance(self, step: Step) -> None:
        link = step.at(self.now.mean)
        self.now = advance(self.now, slice(None), link)
        trials, n = self.member.trials, self.size
        link = Link(
            *(
                np.broadcast_to(x, (trials, *shape))
                for x, shape in (
                    (link.A, (n, n)),
                    (link.b, (n,)),
                    (link.C, (n, n)),
                    (link.eta, (n,)),
                    (link.J, (n, n)),
                )
            )
        )
        self.since = link if self.since is None else compose(self.since, link)
        if n == 3:
            for piece in pieces(step):
                moved = Relation(
                    np.broadcast_to(piece.increment, (trials, 3)), np.broadcast_to(piece.cov, (trials, 3, 3))
                )
                self.turned = moved if self.turned is None else then(self.turned, moved)

    def transmit(self, launch: Launch) -> Packet:
        self.time_s = launch.time_s
        return Packet(self.say(launch), self.floats)

    def say(self, launch: Launch) -> np.ndarray:
        """Bytes (trials, n) of the next packet, noted in the diary."""
        data = self.broadcast(launch)
        self.diary.sent.append(Sent(launch.index, launch.time_s, data[0].copy()))
        return data

    def broadcast(self, launch: Launch) -> np.ndarray:
        """Bytes (trials, n) of the next packet."""
        data = self.sender.packet(self.launches, np.broadcast_to(launch.depth_m, (self.member.trials,)))
        self.launches += 1
        return data

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation:
        """Add what the packet says of its sender's chain, the own pose now, and the range; solve."""
        trials = self.member.trials
        value, variance = np.full(trials, np.nan), np.full(trials, np.nan)
        accepted = np.zeros(trials, bool)
        opened = self.open(arrival.sender, data)
        self.time_s = arrival.time_s
        for trial in np.flatnonzero(np.isfinite(arrival.slant_m) & opened.valid):
            difference = arrival.depth_m[min(trial, len(arrival.depth_m) - 1)] - opened.depth_m[trial]
            range_m = float(horizontal_range(arrival.slant_m[trial], difference))
            told = told_by(self._known(arrival.sender)) if trial == 0 else {}
            seen = self._take(int(trial), arrival.sender, opened, range_m)
            if seen is not None:
                value[trial], variance[trial], accepted[trial] = seen
            if trial == 0:
                self.diary.note(arrival, int(opened.sequence[0]), told, self._known(arrival.sender), seen)
        return Innovation(value, variance, accepted)

    def _known(self, sender: int) -> ReceivedChain | None:
        """What the first trial has of a sender's chain."""
        heard = self.heard[0].get(sender)
        return None if heard is None else heard.chain

    def spoken_s(self) -> np.ndarray:
        """Times of the own poses that packets number, so far."""
        return np.array([sent.time_s for sent in self.diary.sent])

    def open(self, sender: int, data: np.ndarray):
        """Decode a packet of that sender."""
        size = self.member.sizes[sender]
        return open_pose_packet(data, self.k) if size == 3 else open_packet(data, 0 if size == 2 else self.k)

    def _take(self, trial: int, sender: int, opened, range_m: float) -> tuple[float, float, bool] | None:
        graph = self.graphs[trial]
        there = self._sender_pose(trial, sender, opened)
        if there is None or not np.isfinite(range_m):
            return None
        here = self.own_pose(trial)
        try:
            seen = self._range(graph, here, there, range_m)
            graph.solve()
        except NotPositiveDefinite:
            self.lost_ranges += 1
            return None
        self._settle(trial, here)
        return seen

    def _settle(self, trial: int, here: np.ndarray) -> None:
        """Take the graph's belief of the present for one's own."""
        graph = self.graphs[trial]
        mean, cov = self.now.mean.copy(), self.now.cov.copy()
        mean[trial] = graph.values(here)
        cov[trial] = symmetric(graph.covariance(here))
        self.now = Moments(mean, cov)

    def _range(self, graph: Growing, here: np.ndarray, there: np.ndarray, range_m: float) -> tuple[float, float, bool]:
        """Judge a range by what is known without it, and add it unless it is refused."""
        sigma, gate = self.member.log.range_sigma_m, self.member.gate_sigma
        graph.solve(steps=1)
        d = graph.values(here[:2]) - graph.values(there)
        distance = max(float(np.linalg.norm(d)), 1e-9)
        H = np.concatenate([d, -d]) / distance
        idx = np.concatenate([here[:2], there])
        expected, scale = distance, graph.scale
        if scale is not None:
            kappa = float(graph.values(np.array([scale]))[0])
            H = np.concatenate([H * (1 + kappa), [distance]])
            idx = np.concatenate([idx, [scale]])
            expected *= 1 + kappa
        variance = float(H @ graph.covariance(idx) @ H) + sigma**2
        e = range_m - expected
        if gate is not None and e**2 > gate**2 * variance:
            return e, variance, False
        graph.add_range(here[:2], there, range_m, sigma)
        return e, variance, True

    def own_pose(self, trial: int) -> np.ndarray:
        """The unknowns of the own pose now, appended to the graph and tied to the one before."""
        graph, last = self.graphs[trial], self.own[trial]
        if self.size == 2:
            idx = BORDER + 2 * len(self.fixed) + np.arange(2)
            if last is None:
                initial = self.now
                L = np.linalg.inv(initial.cov[trial])
                graph.border_x[2 * len(self.fixed) : 2 * len(self.fixed) + 2] = initial.mean[trial]
                graph.set(("own", 0), idx, L, L @ graph.displacement(idx, initial.mean[trial]))
            elif self.since is not None and self.since.J[trial].any():
                seen = self.since.eta[trial] - self.since.J[trial] @ graph.border_reference[idx - BORDER]
                graph.set(("own", len(graph.kept)), idx, self.since.J[trial], seen)
            self._own_done(trial, idx)
            return idx
        idx = graph.append(self.now.mean[trial])
        if last is None:
            L = np.linalg.inv(self.now.cov[trial] + 1e-10 * np.eye(self.size))
            graph.set(("own", int(idx[0])), idx, symmetric(L), np.zeros(self.size))
        else:
            assert self.since is not None
            link = Link(*(getattr(self.since, f)[trial] for f in ("A", "b", "C", "eta", "J")))
            if self.turned is not None and not link.J.any():
                information = pose_information(self.turned.R[trial])
                graph.add_between(last, idx, self.turned.z[trial], information)
            else:
                lead = Link(*(getattr(link, f)[None] for f in ("A", "b", "C", "eta", "J")))
                factor = link_factors(lead, last[None], idx[None], graph.reference)
                graph.set(("own", int(idx[0])), factor.idx[0], factor.matrix[0], factor.vector[0])
        self._own_done(trial, idx)
        return idx

    def _own_done(self, trial: int, idx: np.ndarray) -> None:
        """The next own pose counts from this one."""
        self.own[trial] = idx
        if trial == 0:
            fixed = self.since is not None and bool(self.since.J[0, XY, XY].max() > NOTHING)
            self.diary.own.append(OwnPose(self.time_s, idx, fixed))
        if self.since is None:
            return
        n = self.size
        parts = {f: getattr(self.since, f).copy() for f in ("A", "b", "C", "eta", "J")}
        parts["A"][trial] = np.eye(n)
        for f in ("b", "C", "eta", "J"):
            parts[f][trial] = 0.0
        self.since = Link(**parts)
        if self.turned is not None:
            z, R = self.turned.z.copy(), self.turned.R.copy()
            z[trial], R[trial] = 0.0, 0.0
            self.turned = Relation(z, R)

    def _sender_pose(self, trial: int, sender: int, opened) -> np.ndarray | None:
        """Put the packet's links into the graph; the unknowns (2,) of the launch position, None if unknowable."""
        graph = self.graphs[trial]
        if sender in self.fixed:
            return self._fixed_pose(graph, sender, opened, trial)
        mine = self.heard[trial].setdefault(sender, Heard(ReceivedChain(), {}))
        now = int(opened.sequence[trial])
        changed = [n for n, link in opened.links(trial) if mine.chain.add(n, link)]
        if self.member.sizes[sender] == 3:
            return self._pose_launch(graph, sender, mine, now, changed)
        return self._plane_launch(graph, sender, mine, now, changed)

    def border_of(self, sender: int) -> np.ndarray:
        """The unknowns of a fixed node's position."""
        return BORDER + 2 * self.fixed.index(sender) + np.arange(2)

    def _fixed_pose(self, graph: Growing, sender: int, opened, trial: int) -> np.ndarray:
        idx = self.border_of(sender)
        mean, L = opened.values["new.z"][trial], np.linalg.inv(opened.values["new.R"][trial])
        if ("fixed", sender) not in graph.kept:
            graph.border_reference[idx - BORDER] = graph.border_x[idx - BORDER] = mean
        graph.set(("fixed", sender), idx, L, L @ graph.displacement(idx, mean))
        return idx

    def _plane_launch(
        self, graph: Growing, sender: int, mine: Heard, now: int, changed: list[int]
    ) -> np.ndarray | None:
        unknowns = mine.unknowns
        kept = sorted(unknowns)
        if now not in unknowns:
            start = self._guess(graph, mine, now, kept)
            if start is None:
                return None
            unknowns[now] = graph.append(start)
            graph.set(("weak", sender, now), unknowns[now], np.eye(2) * _UNKNOWN, np.zeros(2))
            kept = sorted(unknowns)
        touched = {min((n for n in kept if n >= c), default=now) for c in changed} | {now}
        for b in sorted(touched):
            self._refresh(graph, sender, mine, kept[kept.index(b) - 1] if b != kept[0] else None, b)
        return unknowns[now]

    def _guess(self, graph: Growing, mine: Heard, now: int, kept: list[int]) -> np.ndarray | None:
        """Where a new launch probably was: by odometry from the last one, else by what is known of it alone."""
        chain = mine.chain
        if kept and chain.tied(kept[-1], now):
            return graph.values(mine.unknowns[kept[-1]]) + chain.relation(kept[-1], now).z
        prior, known = chain.links[now].prior, chain.anchor(now)
        if prior is not None:
            return prior[0]
        if known is None or np.linalg.eigvalsh(known.matrix)[0] < _UNKNOWN:
            return None
        return np.linalg.solve(known.matrix, known.vector)

    def _refresh(self, graph: Growing, sender: int, mine: Heard, a: int | None, b: int) -> None:
        """Renew what ties launch b to the one before, or to its own past, and its prior."""
        chain, idx = mine.chain, mine.unknowns[b]
        window = chain.window(a, b) if a is not None else None
        if window is not None and a is not None:
            lead = Link(*(getattr(window, f)[None] for f in ("A", "b", "C", "eta", "J")))
            factor = link_factors(lead, mine.unknowns[a][None], idx[None], graph.reference)
            graph.set(("window", sender, b), factor.idx[0], factor.matrix[0], factor.vector[0])
        else:
            known = chain.anchor(b)
            if known is not None:
                vector = known.vector - known.matrix @ graph.reference[idx]
                graph.set(("window", sender, b), idx, known.matrix, vector)
        prior = chain.links[b].prior
        if prior is not None:
            L = symmetric(np.linalg.inv(prior[1]))
            graph.set(("prior", sender, b), idx, L, L @ graph.displacement(idx, prior[0]))

    def _pose_launch(self, graph: Growing, sender: int, mine: Heard, now: int, changed: list[int]) -> np.ndarray:
        """A launch pose in SE(2), tied to the last one heard; repeated links in between become poses too."""
        links, unknowns = mine.chain.links, mine.unknowns
        last = max(unknowns, default=-1)
        for n in sorted(n for n in links if n > last and (n == now or links[n].prior is not None)):
            link = links[n]
            before = max(unknowns, default=None)
            if before is None:
                idx = graph.append(link.z)
                L = symmetric(np.linalg.inv(link.R + STEP_FLOOR * np.eye(3)))
                graph.set(("window", sender, n), idx, L, np.zeros(3))
            else:
                step = decompose(Relation(links[before].z, links[before].R), Relation(link.z, link.R))
                start = oplus(graph.values(unknowns[before]), step.z)
                idx = graph.append(start)
                R = _positive(step.R)
                graph.add_between(unknowns[before], idx, step.z, pose_information(R))
            unknowns[n] = idx
        for n in changed:
            prior, idx = links[n].prior, unknowns.get(n)
            if prior is not None and idx is not None:
                L = symmetric(np.linalg.inv(prior[1]))
                off = graph.displacement(idx, prior[0])
                off[2] = (off[2] + np.pi) % (2 * np.pi) - np.pi
                graph.set(("prior", sender, n), idx, L, apply(L, off))
        return unknowns[now][:2]

    def belief(self) -> Moments:
        """What the vehicle knows of its position now, from everything that arrived until now."""
        return Moments(self.now.mean[..., XY], self.now.cov[..., XY, XY])

    def notes(self) -> list[Note]:
        if not self.lost_ranges:
            return []
        return [Note("left out {} ranges to launches about which too little was received", self.lost_ranges)]


@dataclass(frozen=True)
class OpenedPoses:
    """A decoded packet of a pose chain."""

    sequence: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray
    record: np.ndarray

    def links(self, trial: int) -> list[tuple[int, Received]]:
        """The links of one trial's packet by launch number."""
        now, found = int(self.sequence[trial]), []
        for link in self.record["links"][trial]:
            age = int(link["age"])
            if age == NONE or age > now:
                continue
            prior = (link["prior_mean"].copy(), _full(link["prior_cov"])) if np.isfinite(link["prior_cov"][0]) else None
            found.append((now - age, Received(link["z"].copy(), _full(link["R"]), 0, prior, now if prior else -1)))
        return sorted(found, key=lambda f: f[0])


def open_pose_packet(data: np.ndarray, k: int) -> OpenedPoses:
    """Decode packets (trials, n) of a sender in SE(2) with k slots."""
    packet = records.decode(pose_layout(k), data)
    depth = packet.record["depth"] * records.DEPTH_STEP_M
    return OpenedPoses(packet.record["sequence"], depth, packet.valid, packet.record)


def _full(upper: np.ndarray) -> np.ndarray:
    matrix = np.empty((3, 3))
    i, j = np.triu_indices(3)
    matrix[i, j] = matrix[j, i] = upper
    return matrix


def _positive(R: np.ndarray) -> np.ndarray:
    """A decomposed covariance without what rounding made negative."""
    values, vectors = np.linalg.eigh(symmetric(R))
    return (vectors * np.maximum(values, 0.0)) @ vectors.T
