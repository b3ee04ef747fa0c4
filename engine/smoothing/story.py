"""What a run of the smoothers did in its first trial, in JSON's own types: broadcasts and what became of them, and the
factor graph that every vehicle had in the end.

{"broadcasts": [...], "graphs": {subject: graph}}, under ANYONE a graph of all. A broadcast has its sender, time, bytes
and links (each composed to an origin, some with a prior), and for every vehicle in reach whether it arrived and what
was rebuilt from it. A graph has poses in order of time as columns: owner, number (of the launch, null for own poses),
time_s, xy (m), cov (xx xy yy, m^2, null where not computed), prior (whether one is known of it) and kind: "own",
"heard" (a launch received), "told" (lost, but its prior was repeated later) or "missing"; odometry [from, to, launches
left out in between] and ranges [receiver, sender, used], by place among the poses. Positions are smoothed: they know
what came later.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from engine.navigation.mission import Arrival, NavigationMission
from engine.navigation.network import Member, run_nodes
from engine.registry import Progress
from engine.smoothing.band import NotPositiveDefinite
from engine.smoothing.composition import Relation
from engine.smoothing.growing import Growing
from engine.smoothing.node import SmootherNode
from engine.smoothing.reconstruction import Received, ReceivedChain
from engine.tracks import Tracks

#: Under this name stands a graph that is not one vehicle's own.
ANYONE = ""
#: No more broadcasts are told (spread evenly), no more poses of a graph (the latest), no more marginals computed.
MOST_BROADCASTS, MOST_POSES, MOST_MARGINALS = 600, 1500, 60
#: Times (T,) and positions (T, 2) where a vehicle believed to be as it went.
Track = tuple[np.ndarray, np.ndarray]
Believed = Mapping[str, Track]


def smooth(mission: NavigationMission, progress: Progress, make: Callable[[Member], SmootherNode]) -> Tracks:
    """Run one node per vehicle, and tell the story of the first trial."""
    nodes: list[SmootherNode] = []

    def keep(member: Member) -> SmootherNode:
        nodes.append(make(member))
        return nodes[-1]

    tracks = run_nodes(mission, progress, keep)
    return replace(tracks, graph=story(mission, nodes, tracks))


def story(mission: NavigationMission, nodes: Sequence[SmootherNode], tracks: Tracks) -> dict[str, Any]:
    """Broadcasts and graphs of nodes that have run; tracks say where senders believed to be."""
    names, believed = _known(mission, tracks)
    graphs = {}
    for node in nodes:
        found = graph(node, nodes, names, believed)
        if found is not None:
            graphs[node.member.log.name] = found
    return {"broadcasts": broadcasts(mission, nodes, names), "graphs": graphs}


def heard_story(
    mission: NavigationMission,
    nodes: Sequence[SmootherNode],
    tracks: Tracks,
    chains: Sequence[Mapping[int, ReceivedChain]],
    launches: Sequence[Mapping[int, Sequence[int]]],
) -> dict[str, Any]:
    """The story of nodes that only listened: for each the chains it has and the launches it heard, by sender."""
    names, believed = _known(mission, tracks)
    graphs = {}
    for v, name in enumerate(names):
        found = rebuilt_graph(chains[v], launches[v], nodes, names, believed)
        if found is not None:
            graphs[name] = found
    return {"broadcasts": broadcasts(mission, nodes, names), "graphs": graphs}


def _known(mission: NavigationMission, tracks: Tracks) -> tuple[list[str], Believed]:
    names = [v.name for v in mission.log.vehicles]
    return names, {name: (mission.time_s, tracks.beliefs[name].mean[0]) for name in names}


def broadcasts(mission: NavigationMission, nodes: Sequence[SmootherNode], names: list[str]) -> list[dict[str, Any]]:
    """Every broadcast in order of time, at most MOST_BROADCASTS of them."""
    reached: dict[int, list[Arrival]] = {}
    for event in mission.events:
        if isinstance(event, Arrival):
            reached.setdefault(event.index, []).append(event)
    heard = {(h.index, node.member.index): h for node in nodes for h in node.diary.heard}
    sent = sorted(((s, node) for node in nodes for s in node.diary.sent), key=lambda pair: pair[0].time_s)
    found = []
    for broadcast, node in (sent[k] for k in spread(len(sent), MOST_BROADCASTS)):
        v = node.member.index
        reader = nodes[(v + 1) % len(nodes)]
        opened = reader.open(v, broadcast.data[None])
        times = node.spoken_s()
        receivers = []
        for arrival in reached.get(broadcast.index, []):
            told: dict[str, Any] = {"name": names[arrival.vehicle], "toa_s": _r(arrival.time_s)}
            reception = heard.get((broadcast.index, arrival.vehicle))
            told["heard"] = reception is not None
            if reception is not None:
                told |= {
                    "new": list(reception.new),
                    "after": reception.after,
                    "odometry": _odometry(reception.odometry),
                    "links": reception.links,
                    "residual_m": _r(reception.residual_m),
                    "sigma_m": _r(reception.sigma_m),
                    "used": bool(reception.used),
                }
            receivers.append(told)
        found.append(
            {
                "index": broadcast.index,
                "sender": names[v],
                "tol_s": _r(broadcast.time_s),
                "bytes": len(broadcast.data),
                "number": int(opened.sequence[0]),
                "links": [_link(n, link, times) for n, link in opened.links(0)],
                "receivers": receivers,
            }
        )
    return found


def _link(n: int, link: Received, times: np.ndarray) -> dict[str, Any]:
    """A link as sent: composed position and its sigma (m) from the origin of its stretch, and its prior."""
    told: dict[str, Any] = {
        "number": n,
        "time_s": _r(times[n]) if n < len(times) else None,
        "origin": link.stretch,
        "xy": [_r(link.z[0]), _r(link.z[1])],
        "sigma_m": _r(_spread(link.R)),
        "prior": None,
    }
    if link.prior is not None:
        mean, cov = link.prior
        told["prior"] = {"xy": [_r(mean[0]), _r(mean[1])], "sigma_m": _r(_spread(cov))}
    return told


@dataclass
class Sketch:
    """A graph as it is gathered: rows of poses, which of them stand still, where unknowns are among them, and what ties
    them together."""

    rows: list[tuple[float, str, int | None, np.ndarray, np.ndarray | None, bool, str]] = field(default_factory=list)
    place: dict[int, int] = field(default_factory=dict)
    odometry: list[tuple[int, int, int]] = field(default_factory=list)
    ranges: list[tuple[int, int, bool]] = field(default_factory=list)
    still: set[int] = field(default_factory=set)

    def pose(
        self,
        time_s: float,
        owner: str,
        number: int | None,
        xy: np.ndarray,
        *,
        idx: np.ndarray | None = None,
        prior: bool = False,
        kind: str,
    ) -> int:
        """Add a pose; its place."""
        if idx is not None:
            self.place[int(idx[0])] = len(self.rows)
        self.rows.append((float(time_s), owner, number, np.array(xy[:2], float), idx, prior, kind))
        return len(self.rows) - 1

    def sample(self) -> tuple[list[int], np.ndarray]:
        """Places of at most MOST_MARGINALS poses that are unknowns, spread evenly, and these unknowns (F, 2)."""
        unknown = [(k, row[4]) for k, row in enumerate(self.rows) if row[4] is not None]
        chosen = [unknown[k] for k in spread(len(unknown), MOST_MARGINALS)]
        return [k for k, _ in chosen], np.array([idx for _, idx in chosen], int).reshape(-1, 2)

    def told(self, cov: Mapping[int, np.ndarray]) -> dict[str, Any]:
        """In JSON's types: what stands still, and in order of time the latest MOST_POSES; cov by place (2, 2)."""
        moving = sorted(set(range(len(self.rows))) - self.still, key=lambda k: (self.rows[k][0], k))
        order = [*sorted(self.still), *moving[-MOST_POSES:]]
        at = {k: n for n, k in enumerate(order)}
        rows = [self.rows[k] for k in order]
        blocks = [cov.get(k) for k in order]
        return {
            "poses": {
                "time_s": [_r(row[0]) for row in rows],
                "owner": [row[1] for row in rows],
                "number": [row[2] for row in rows],
                "xy": [[_r(row[3][0]), _r(row[3][1])] for row in rows],
                "cov": [None if c is None else [_r(c[0, 0]), _r(c[0, 1]), _r(c[1, 1])] for c in blocks],
                "prior": [row[5] for row in rows],
                "kind": [row[6] for row in rows],
            },
            "odometry": [[at[a], at[b], left_out] for a, b, left_out in self.odometry if a in at and b in at],
            "ranges": [[at[a], at[b], used] for a, b, used in self.ranges if a in at and b in at],
        }


def graph(
    node: SmootherNode, nodes: Sequence[SmootherNode], names: list[str], believed: Believed
) -> dict[str, Any] | None:
    """The factor graph that one vehicle had in the end, smoothed; None where it has none."""
    growing, mine, sketch = node.graphs[0], node.member.log.name, Sketch()
    if not node.diary.own:
        return None
    try:
        growing.settle()
    except NotPositiveDefinite:
        return None
    for k, own in enumerate(node.diary.own[:1] if node.size == 2 else node.diary.own):
        idx = own.idx[:2]
        sketch.pose(own.time_s, mine, None, growing.values(idx), idx=idx, prior=own.fixed, kind="own")
        if k:
            sketch.odometry.append((k - 1, k, 0))
    for sender, heard in node.heard[0].items():
        spots = {n: Spot(growing.values(idx[:2]), idx[:2]) for n, idx in heard.unknowns.items()}
        _chain(sketch, heard.chain, spots, nodes[sender], names[sender], believed[names[sender]])
    for sender in node.fixed:
        numbers = [h for h in node.diary.heard if h.sender == sender]
        if numbers:
            idx, first = node.border_of(sender), numbers[0]
            at = growing.values(idx)
            place = sketch.pose(first.time_s, names[sender], first.number, at, idx=idx, prior=True, kind="heard")
            sketch.still.add(place)
    place = sketch.place
    for row in growing.range_idx.all:
        a, b = place.get(int(row[0])), place.get(int(row[2]))
        if a is not None and b is not None:
            sketch.ranges.append((a, b, True))
    sketch.ranges += _refused(node, place)
    return sketch.told(_marginals(growing, sketch))


@dataclass(frozen=True)
class Spot:
    """Where a launch heard lies, xy (2,) m, and its unknowns where it has any."""

    xy: np.ndarray
    idx: np.ndarray | None = None


def _chain(
    sketch: Sketch, chain: ReceivedChain, heard: Mapping[int, Spot], sender: SmootherNode, name: str, believed: Track
) -> dict[int, int]:
    """Another vehicle's chain: its launches heard, those whose prior was told later, and those that are missing; the
    places of the launches heard.

    What is missing is drawn where the sender believed to be.
    """
    times, links = sender.spoken_s(), chain.links
    launched = {float(sent.time_s) for sent in sender.diary.sent}
    where: dict[int, int] = {}
    numbers = {*links, *np.flatnonzero(np.isin(times, list(launched))).tolist()}
    for n in sorted(n for n in numbers if n < len(times)):
        link = links.get(n)
        prior = None if link is None else link.prior
        if n in heard:
            spot = heard[n]
            known = prior is not None
            where[n] = sketch.pose(times[n], name, n, spot.xy, idx=spot.idx, prior=known, kind="heard")
        elif prior is not None:
            sketch.pose(times[n], name, n, prior[0], prior=True, kind="told")
        else:
            clock, track = believed
            at = np.array([np.interp(times[n], clock, track[:, axis]) for axis in range(2)])
            sketch.pose(times[n], name, n, at, kind="missing")
    for a, b in pairwise(sorted(where)):
        if chain.tied(a, b):
            lost = sum(1 for time_s in times[a + 1 : b] if float(time_s) in launched)
            sketch.odometry.append((where[a], where[b], lost))
    return where


def rebuilt_graph(
    chains: Mapping[int, ReceivedChain],
    launches: Mapping[int, Sequence[int]],
    nodes: Sequence[SmootherNode],
    names: list[str],
    believed: Believed,
) -> dict[str, Any] | None:
    """The chains {sender: chain} that somebody who only listens put together, over the launches heard."""
    sketch, cov = Sketch(), {}
    for sender, chain in chains.items():
        kept = sorted(set(launches[sender]))
        known = chain.chain(kept)
        joint = np.linalg.inv(known.matrix)
        mean = (joint @ known.vector).reshape(-1, 2)
        spots = {n: Spot(xy) for n, xy in zip(kept, mean)}
        where = _chain(sketch, chain, spots, nodes[sender], names[sender], believed[names[sender]])
        for k in spread(len(kept), MOST_MARGINALS):
            cov[where[kept[k]]] = joint[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
    return sketch.told(cov) if sketch.rows else None


def _refused(node: SmootherNode, place: Mapping[int, int]) -> list[tuple[int, int, bool]]:
    """Ranges that the gate refused, between their poses."""
    own = {pose.time_s: int(pose.idx[0]) for pose in node.diary.own}
    found = []
    for h in node.diary.heard:
        known = node.heard[0].get(h.sender)
        there = node.border_of(h.sender) if h.sender in node.fixed else known and known.unknowns.get(h.number)
        if np.isfinite(h.residual_m) and not h.used and there is not None and h.time_s in own:
            ends = place.get(own[h.time_s]), place.get(int(there[0]))
            if None not in ends:
                found.append((*ends, False))
    return found


def _marginals(growing: Growing, sketch: Sketch) -> dict[int, np.ndarray]:
    """Covariances (2, 2) of some of the poses that are unknowns, spread evenly."""
    chosen, idx = sketch.sample()
    joint = growing.covariance(idx.ravel())
    return {k: joint[2 * n : 2 * n + 2, 2 * n : 2 * n + 2] for n, k in enumerate(chosen)}


def spread(count: int, most: int) -> list[int]:
    """At most so many of the indices 0..count-1, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist() if count else []


def _odometry(relation: Relation | None) -> dict[str, Any] | None:
    if relation is None:
        return None
    return {"xy": [_r(relation.z[0]), _r(relation.z[1])], "sigma_m": _r(_spread(relation.R))}


def _spread(cov: np.ndarray) -> float:
    """The fourth root of the determinant of a position covariance, m."""
    return float(max(np.linalg.det(cov[:2, :2]), 0.0) ** 0.25)


def _r(value: float) -> float | None:
    """Millimetres and milliseconds are enough; None for what is not a number."""
    return round(float(value), 3) if np.isfinite(value) else None
