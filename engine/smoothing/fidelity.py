"""How close reconstructed chains come to what they stand for (W15 section V-B, Fig. 5).

The target is the Gaussian that the sender's own sensors leave over the launches whose packets arrived; the
reconstruction is what a receiver makes of those packets.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from engine.gaussian.forms import Information, Moments
from engine.gaussian.links import advance
from engine.navigation.chains import Step
from engine.navigation.mission import Arrival, Launch, NavigationMission
from engine.navigation.network import Member, Packet, members, run_nodes
from engine.registry import Progress
from engine.smoothing.diary import told_by
from engine.smoothing.fleet import launches_of
from engine.smoothing.local_chain import LocalChain, local_chain
from engine.smoothing.node import SmootherNode
from engine.smoothing.reconstruction import ReceivedChain, target
from engine.smoothing.refactor import divergence
from engine.smoothing.story import heard_story
from engine.tracks import Series, Tracks


def closeness(chain: LocalChain, launches: list[int], rebuilt: Information, trial: int) -> tuple[float, float]:
    """Kullback-Leibler divergence of a reconstruction over some launches from its target, and the mean distance (m)
    between their positions."""
    wanted = target(chain.start, chain.windows, launches, trial)
    difference = np.linalg.solve(rebuilt.matrix, rebuilt.vector) - np.linalg.solve(wanted.matrix, wanted.vector)
    apart = np.linalg.norm(difference.reshape(-1, 2), axis=-1).mean()
    return float(divergence(wanted.matrix, rebuilt.matrix, difference)), float(apart)


class Listener:
    """A vehicle that sends as its smoother would and keeps what it hears, but only dead-reckons."""

    def __init__(self, node: SmootherNode) -> None:
        self.node = node
        self.chains: list[dict[int, ReceivedChain]] = [{} for _ in range(node.member.trials)]
        self.launches: list[dict[int, list[tuple[int, int]]]] = [{} for _ in range(node.member.trials)]

    def advance(self, step: Step) -> None:
        self.node.now = advance(self.node.now, slice(None), step.at(self.node.now.mean))

    def transmit(self, launch: Launch) -> Packet:
        return Packet(self.node.say(launch), self.node.floats)

    def receive(self, arrival: Arrival, data: np.ndarray) -> None:
        opened = self.node.open(arrival.sender, data)
        for trial in np.flatnonzero(np.isfinite(arrival.slant_m) & opened.valid):
            chain = self.chains[trial].setdefault(arrival.sender, ReceivedChain())
            told = told_by(chain) if trial == 0 else {}
            for number, link in opened.links(int(trial)):
                chain.add(number, link)
            heard = self.launches[trial].setdefault(arrival.sender, [])
            heard.append((arrival.index, int(opened.sequence[trial])))
            if trial == 0:
                self.node.diary.note(arrival, int(opened.sequence[0]), told, chain)

    def belief(self) -> Moments:
        return self.node.belief()

    def notes(self) -> list[str]:
        return []


def reconstruct(mission: NavigationMission, progress: Progress, make: Callable[[Member], SmootherNode]) -> Tracks:
    """Let everyone listen only, and compare at the end what they put together with what it stands for.

    The series `kld/NAME` and `mean_difference/NAME` (m) hold the figures of a sender's chain, averaged over those who
    heard it, at the last report time.
    """
    listeners: list[Listener] = []

    def listen(member: Member) -> Listener:
        listeners.append(Listener(make(member)))
        return listeners[-1]

    tracks = run_nodes(mission, progress, listen)
    T, series = len(mission.time_s), {}
    for member in members(mission):
        v, name = member.index, member.log.name
        if member.sizes[v] != 4:
            continue
        own = [e for e in mission.events if isinstance(e, Launch) and e.vehicle == v]
        number = {e.index: n for n, e in enumerate(own)}
        chain = local_chain(member.log, mission.chains[v], launches_of(mission, v), mission.trials)
        values = np.full((mission.trials, 2), np.nan)
        for trial in range(mission.trials):
            found = [
                closeness(
                    chain,
                    [number[index] for index, _ in listener.launches[trial][v]],
                    listener.chains[trial][v].chain([pose for _, pose in listener.launches[trial][v]]),
                    trial,
                )
                for listener in listeners
                if v in listener.chains[trial]
            ]
            if found:
                values[trial] = np.mean(found, axis=0)
        for column, (what, title, unit) in enumerate(
            (
                ("kld", "Divergence of the reconstructed chain of", "nat"),
                ("mean_difference", "Mean difference of the reconstructed chain of", "m"),
            )
        ):
            curve = np.full((mission.trials, T), np.nan)
            curve[:, -1] = values[:, column]
            series[f"{what}/{name}"] = Series(f"{title} {name}", unit, curve, (name,))
    heard = [{v: [pose for _, pose in found] for v, found in who.launches[0].items()} for who in listeners]
    graph = heard_story(mission, [who.node for who in listeners], tracks, [who.chains[0] for who in listeners], heard)
    return replace(tracks, series=tracks.series | series, graph=graph)


def curves(
    mission: NavigationMission,
    makers: Mapping[str, Callable[[Member], SmootherNode]],
    rates: Sequence[float],
    draws: int,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Fig. 5 in JSON's types: for each algorithm and sending vehicle, against reception rate, the mean over draws of
    `kld` and `mean_difference_m` with 95 % intervals of the mean.

    makers {algorithm: function from a member to its node} say who is compared. What is received is drawn from what is
    sent in the mission's first trial, and the same for every algorithm. Vehicles in the plane take part.
    """
    found: dict[str, Any] = {name: {} for name in makers}
    for member in members(mission):
        times = launches_of(mission, member.index)
        if member.sizes[member.index] != 4 or len(times) < 2:
            continue
        chain = local_chain(member.log, mission.chains[member.index], times, mission.trials)
        heard = [[np.flatnonzero(rng.random(len(times)) < rate) for _ in range(draws)] for rate in rates]
        for name, make in makers.items():
            node = make(member)
            own = [e for e in mission.events if isinstance(e, Launch) and e.vehicle == member.index]
            sent = [node.open(member.index, node.broadcast(e)) for e in own]
            links = [(int(opened.sequence[0]), opened.links(0)) for opened in sent]
            values = np.full((len(rates), draws, 2), np.nan)
            for r, at_rate in enumerate(heard):
                for d, launches in enumerate(at_rate):
                    if launches.size:
                        values[r, d] = _rebuild(chain, links, [int(n) for n in launches])
            found[name][member.log.name] = {
                "kld": _interval(values[..., 0]),
                "mean_difference_m": _interval(values[..., 1]),
            }
    return {"rates": list(rates), "draws": draws, "algorithms": found}


def _rebuild(chain: LocalChain, sent: list, launches: list[int]) -> tuple[float, float]:
    received = ReceivedChain()
    for n in launches:
        for number, link in sent[n][1]:
            received.add(number, link)
    return closeness(chain, launches, received.chain([sent[n][0] for n in launches]), 0)


def _interval(values: np.ndarray) -> dict[str, list[float]]:
    """Mean over draws (axis 1) with its 95 % interval, for every rate."""
    count = np.isfinite(values).sum(axis=1)
    mean = np.nanmean(values, axis=1)
    half = 1.96 * np.nanstd(values, axis=1) / np.sqrt(count)
    return {"mean": mean.tolist(), "low": (mean - half).tolist(), "high": (mean + half).tolist()}
