"""Centralized smoother (W15 eq. 2-3): every vehicle's sensors and every range in one batch least-squares problem.

The benchmark of the family. Unlike every filter it knows what came later, so its track is the smoothed one.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine.navigation.cekf import CekfFleet
from engine.navigation.mission import Arrival, Launch, NavigationMission, Report
from engine.navigation.network import members
from engine.navigation.ranging import horizontal_range
from engine.notes import Most, Note
from engine.registry import Algorithm, Progress
from engine.smoothing.ambiguity import WIDE_M, Judged, likeliest, starts
from engine.smoothing.band import BandInverse
from engine.smoothing.composition import oplus
from engine.smoothing.diary import NOTHING
from engine.smoothing.graph import Gaussians, Graph, Ranges, priors
from engine.smoothing.smoother import Solution
from engine.smoothing.story import ANYONE, Sketch
from engine.smoothing.trajectory import (
    Links,
    PoseChain,
    link_factors,
    pieces,
    pose_chain,
    pose_factors,
    row,
    stacked,
)
from engine.tracks import Belief, Innovations, Series, Tracks

#: A belief of a start this sure (m^2, m^2/s^2, rad^2) is taken for one a little less sure.
PRIOR_FLOOR = 1e-10
#: Least squares has settled where a step moves nothing by more than this (m).
SETTLED_M = 1e-4


@dataclass(frozen=True)
class Reception:
    """A possible range of the mission: its event, the launch it belongs to, breakpoints of receiver and sender."""

    arrival: Arrival
    launch: Launch
    heard_at: int
    sent_at: int


@dataclass(frozen=True)
class Numbering:
    """Which unknowns belong to what: per vehicle idx (breakpoints, n), a fixed node's the same at every one."""

    idx: list[np.ndarray]
    poses: list[np.ndarray]
    scale: int | None
    banded: int
    total: int


def receptions(mission: NavigationMission) -> list[Reception]:
    """Every reception there could have been, in order of arrival."""
    launches = {e.index: e for e in mission.events if isinstance(e, Launch)}
    found = []
    for e in mission.events:
        if isinstance(e, Arrival):
            launch = launches[e.index]
            times = mission.chains[e.vehicle].times_s, mission.chains[e.sender].times_s
            heard_at, sent_at = np.searchsorted(times[0], e.time_s), np.searchsorted(times[1], launch.time_s)
            found.append(Reception(e, launch, int(heard_at), int(sent_at)))
    return found


def number(mission: NavigationMission, chains: list[PoseChain | Links | None]) -> Numbering:
    """Number all unknowns: poses of all vehicles in order of time, then fixed nodes, then the sound-speed error."""
    keys, sizes = [], []
    for v, (chain, own) in enumerate(zip(mission.chains, chains)):
        if own is None:
            continue
        if isinstance(own, PoseChain):
            pose_time = np.interp(np.arange(len(own.poses)), own.at, chain.times_s)
        else:
            pose_time = chain.times_s
        keys.append(np.stack([pose_time, np.full(len(pose_time), v), np.arange(len(pose_time))]))
        sizes.append(np.full(len(pose_time), chain.initial.mean.shape[-1]))
    poses: list[np.ndarray] = [np.zeros((1, 2), int)] * len(chains)
    banded = 0
    if keys:
        key, size = np.concatenate(keys, axis=1), np.concatenate(sizes)
        order = np.lexsort((key[2], key[1], key[0]))
        first = np.empty(len(order), int)
        first[order] = np.concatenate([[0], np.cumsum(size[order])[:-1]])
        banded = int(size.sum())
        for v in {int(v) for v in key[1]}:
            mine = key[1] == v
            poses[v] = first[mine][:, None] + np.arange(int(size[mine][0]))
    total = banded
    idx = []
    for v, own in enumerate(chains):
        if own is None:
            poses[v] = np.array([[total, total + 1]])
            total += 2
            idx.append(np.repeat(poses[v], len(mission.chains[v].times_s), axis=0))
        else:
            idx.append(poses[v][own.at] if isinstance(own, PoseChain) else poses[v])
    scale = total if mission.log.sound_speed_sigma_mps > 0 else None
    return Numbering(idx, poses, scale, banded, total + (scale is not None))


@dataclass(frozen=True)
class Filtered:
    """What the centralized EKF thought as it went: where least squares starts, in all trials at once.

    states: per vehicle (breakpoints, trials, n); accepted {(broadcast, receiver): (trials,)} by its gate.
    """

    states: list[np.ndarray]
    accepted: dict[tuple[int, int], np.ndarray]


def filtered(mission: NavigationMission) -> Filtered:
    """Run the centralized EKF over the mission's events, keeping every vehicle's state at its breakpoints."""
    fleet = CekfFleet(members(mission))
    states = [np.empty((len(c.times_s), *c.initial.mean.shape)) for c in mission.chains]
    for v, chain in enumerate(mission.chains):
        states[v][0] = chain.initial.mean
    at = [0] * len(mission.chains)
    accepted = {}
    for event in mission.events:
        for v in range(len(at)) if isinstance(event, Report) else (event.vehicle,):
            times = mission.chains[v].times_s
            while at[v] + 1 < len(times) and times[at[v] + 1] <= event.time_s:
                fleet.advance(v, mission.chains[v].steps[at[v]])
                at[v] += 1
                states[v][at[v]] = fleet.joint.mean[..., fleet.vehicles[v]]
        if isinstance(event, Launch):
            fleet.launch(event)
        elif isinstance(event, Arrival):
            accepted[event.index, event.vehicle] = fleet.receive(event).accepted
            states[event.vehicle][at[event.vehicle]] = fleet.joint.mean[..., fleet.vehicles[event.vehicle]]
    return Filtered(states, accepted)


class Centralized:
    """The mission's graph, numbered once and filled in for one trial after the other."""

    def __init__(self, mission: NavigationMission) -> None:
        self.mission = mission
        self.filtered = filtered(mission)
        self.receptions = receptions(mission)
        self.linear = [
            stacked(c.steps, mission.trials) if c.initial.mean.shape[-1] != 3 else None for c in mission.chains
        ]

    def solve(self, trial: int) -> tuple[Numbering, Graph, Judged]:
        """One trial's graph and its solution, starting from what the filter thought."""
        mission, log = self.mission, self.mission.log
        chains: list[PoseChain | Links | None] = []
        for chain, links in zip(mission.chains, self.linear):
            size = chain.initial.mean.shape[-1]
            chains.append(pose_chain(chain, trial) if links is None else None if size == 2 else links)
        numbering = number(mission, chains)
        reference = self._start(trial, numbering, chains)
        gaussians, betweens = [], []
        for chain, links, own, idx in zip(mission.chains, self.linear, chains, numbering.poses):
            start = row(chain.initial.mean, trial)
            cov = row(chain.initial.cov, trial) + PRIOR_FLOOR * np.eye(len(start))
            gaussians.append(priors(idx[:1], start[None], cov[None], reference))
            if isinstance(own, PoseChain):
                more, between = pose_factors(own, idx, reference)
                gaussians += more
                betweens += between
            elif own is not None:
                gaussians.append(link_factors(own.of(trial), idx[:-1], idx[1:], reference))
            elif links is not None:
                fixes = links.of(trial)
                seen = (fixes.eta - fixes.J @ reference[idx[0]]).sum(axis=0)
                gaussians.append(Gaussians(idx[:1], fixes.J.sum(axis=0)[None], seen[None]))
        if numbering.scale is not None:
            sigma = log.sound_speed_sigma_mps / log.sound_speed_mps
            at = np.array([[numbering.scale]])
            gaussians.append(priors(at, np.zeros((1, 1)), np.full((1, 1, 1), sigma**2), reference))
        ranges = self._ranges(trial, numbering)
        graph = Graph(reference, numbering.banded, tuple(gaussians), tuple(betweens), ranges)
        accepted = self.filtered.accepted
        used = [accepted[r.arrival.index, r.arrival.vehicle][trial] for r, _ in self.heard(trial)]
        weights = [np.array(used, float)] if ranges else []
        wide = [
            numbering.poses[v][0]
            for v, (chain, own) in enumerate(zip(mission.chains, chains))
            if own is None and np.linalg.eigvalsh(row(chain.initial.cov, trial))[-1] > WIDE_M**2
        ]
        tried = starts(graph, wide, reference)
        judged = likeliest(
            graph,
            tried,
            weights=weights if len(tried) == 1 else None,
            gate_sigma=log.gate_sigma,
            settled=SETTLED_M,
        )
        return numbering, graph, judged

    def _start(self, trial: int, numbering: Numbering, chains: list[PoseChain | Links | None]) -> np.ndarray:
        """The filter's states; poses that a fix puts between breakpoints follow from the one before by odometry."""
        x = np.zeros(numbering.total)
        for own, poses, idx, states in zip(chains, numbering.poses, numbering.idx, self.filtered.states):
            if own is None:
                x[idx[-1]] = states[-1, trial]
                continue
            x[idx] = states[:, trial]
            if isinstance(own, PoseChain):
                for k in np.setdiff1d(np.arange(len(poses)), own.at):
                    x[poses[k]] = oplus(x[poses[k - 1]], own.z[k - 1])
        return x

    def heard(self, trial: int) -> list[tuple[Reception, float]]:
        """The receptions of a trial with their horizontal ranges, m."""
        found = []
        for r in self.receptions:
            if np.isfinite(r.arrival.slant_m[trial]):
                depth = row(r.arrival.depth_m, trial) - row(r.launch.depth_m, trial)
                value = float(horizontal_range(r.arrival.slant_m[trial], depth))
                if np.isfinite(value):
                    found.append((r, value))
        return found

    def told(self, numbering: Numbering, solution: Solution, inverse: BandInverse) -> dict[str, Any]:
        """The first trial's graph, as `story` tells it: the poses that ranges touch, and what ties them."""
        sketch, heard = Sketch(), self.heard(0)
        names = [v.name for v in self.mission.log.vehicles]
        touched: list[set[int]] = [set() for _ in names]
        for r, _ in heard:
            touched[r.arrival.vehicle].add(r.heard_at)
            touched[r.arrival.sender].add(r.sent_at)
        place: dict[tuple[int, int], int] = {}
        for v, chain in enumerate(self.mission.chains):
            still, before = chain.initial.mean.shape[-1] == 2, None
            for n in sorted(touched[v])[: 1 if still else None]:
                idx = numbering.idx[v][n, :2]
                at = solution.x[idx]
                prior = still or self._fixed(v, before or 0, n)
                here = sketch.pose(chain.times_s[n], names[v], None, at, idx=idx, prior=prior, kind="own")
                place |= {(v, k): here for k in touched[v]} if still else {(v, n): here}
                if still:
                    sketch.still.add(here)
                elif before is not None:
                    sketch.odometry.append((here - 1, here, 0))
                before = n
        used = solution.weights[0] > 0 if heard else []
        for (r, _), mine in zip(heard, used):
            ends = place[r.arrival.vehicle, r.heard_at], place[r.arrival.sender, r.sent_at]
            sketch.ranges.append((*ends, bool(mine)))
        chosen, idx = sketch.sample()
        blocks = inverse.blocks(idx) if chosen else []
        return {"broadcasts": [], "graphs": {ANYONE: sketch.told(dict(zip(chosen, blocks)))}}

    def _fixed(self, vehicle: int, first: int, last: int) -> bool:
        """Whether a vehicle had a fix between two of its breakpoints, in the first trial."""
        links = self.linear[vehicle]
        if links is None:
            steps = self.mission.chains[vehicle].steps[first:last]
            return any(piece.fix is not None for step in steps for piece in pieces(step))
        return bool(np.abs(links.of(0).J[first:last, :2, :2]).max(initial=0.0) > NOTHING)

    def _ranges(self, trial: int, numbering: Numbering) -> tuple[Ranges, ...]:
        heard = self.heard(trial)
        if not heard:
            return ()
        vehicles = self.mission.log.vehicles
        return (
            Ranges(
                np.array([numbering.idx[r.arrival.vehicle][r.heard_at, :2] for r, _ in heard]),
                np.array([numbering.idx[r.arrival.sender][r.sent_at, :2] for r, _ in heard]),
                np.array([value for _, value in heard]),
                np.array([vehicles[r.arrival.vehicle].range_sigma_m for r, _ in heard]),
                numbering.scale,
            ),
        )


def run(mission: NavigationMission, progress: Progress) -> Tracks:
    """Smooth every trial; the belief at a report time is the smoothed one."""
    started = time.process_time()
    log = mission.log
    names = [v.name for v in log.vehicles]
    T, trials = len(mission.time_s), mission.trials
    mean, cov = np.empty((len(names), trials, T, 2)), np.empty((len(names), trials, T, 2, 2))
    centralized = Centralized(mission)
    at = [np.searchsorted(c.times_s, mission.time_s) for c in mission.chains]
    moving = [v for v, vehicle in enumerate(log.vehicles) if mission.chains[v].initial.mean.shape[-1] > 2]
    pairs = [(i, j) for n, i in enumerate(moving) for j in moving[n + 1 :]]
    correlation = {pair: np.zeros((trials, T)) for pair in pairs}
    ranges = _RangeRecord(centralized.receptions, trials)
    unsettled, ambiguous, refused, graph_told = [], [], 0, {}
    for trial in range(trials):
        numbering, graph, judged = centralized.solve(trial)
        solution = judged.solution
        if judged.rival_m is not None:
            ambiguous.append(judged.rival_m)
        inverse = solution.inverse()
        for v in range(len(names)):
            idx = numbering.idx[v][at[v], :2]
            mean[v, trial], cov[v, trial] = solution.x[idx], inverse.blocks(idx)
        for i, j in pairs:
            both = np.concatenate([numbering.idx[i][at[i], :2], numbering.idx[j][at[j], :2]], axis=1)
            correlation[i, j][trial] = _correlation(inverse.blocks(both))
        ranges.note(trial, centralized, graph, solution, inverse)
        if trial == 0:
            graph_told = centralized.told(numbering, solution, inverse)
        if solution.status != "converged":
            unsettled.append(trial)
        refused += sum(int((w == 0).sum()) for w in solution.weights)
        progress((trial + 1) / trials, _partial(mission, names, mean, cov) if trial == 0 else None)
    notes = []
    if unsettled:
        notes.append(Note("least squares did not settle in {} trials", len(unsettled)))
    if ambiguous:
        notes.append(
            Note(
                "ambiguous in {} trials: another solution, up to {:.0f} m away, fits the ranges nearly as well",
                *(len(ambiguous), Most(max(ambiguous))),
            )
        )
    if refused:
        notes.append(Note("refused {} ranges as gross errors", refused))
    return Tracks(
        beliefs={name: Belief(mean[v], cov[v]) for v, name in enumerate(names)},
        innovations=ranges.innovations(names),
        series={
            f"correlation/{names[i]}~{names[j]}": Series(
                f"Correlation of {names[i]} and {names[j]}", "1", value, (names[i], names[j])
            )
            for (i, j), value in correlation.items()
        },
        notes=tuple(notes),
        cpu_s=time.process_time() - started,
        graph=graph_told,
    )


class _RangeRecord:
    """What is left of the ranges after smoothing: residuals, with the variance that they should have."""

    def __init__(self, found: list[Reception], trials: int) -> None:
        self.found = found
        self.row = {id(r): k for k, r in enumerate(found)}
        self.value, self.variance = (np.full((trials, len(found)), np.nan) for _ in range(2))
        self.accepted = np.zeros((trials, len(found)), bool)

    def note(self, trial: int, centralized: Centralized, graph: Graph, solution: Solution, inverse) -> None:
        for group, weight in zip(graph.ranges, solution.weights):
            H = group.jacobian(solution.x)
            spread = np.einsum("fi,fij,fj->f", H, inverse.blocks(group.idx), H)
            used = weight > 0
            at = [self.row[id(r)] for r, _ in centralized.heard(trial)]
            self.value[trial, at] = group.value - group.expected(solution.x)
            # A range that was used has pulled the estimate its way: its residual is smaller than its noise.
            left = np.maximum(group.sigma**2 - spread, 1e-3 * group.sigma**2)
            self.variance[trial, at] = np.where(used, left, group.sigma**2 + spread)
            self.accepted[trial, at] = used

    def innovations(self, names: list[str]) -> dict[str, Innovations]:
        found = {}
        for v, name in enumerate(names):
            mine = [k for k, r in enumerate(self.found) if r.arrival.vehicle == v]
            if mine:
                time_s = np.array([self.found[k].arrival.time_s for k in mine])
                found[name] = Innovations(time_s, self.value[:, mine], self.variance[:, mine], self.accepted[:, mine])
        return found


def _correlation(blocks: np.ndarray) -> np.ndarray:
    """tr P_ij / sqrt(tr P_ii tr P_jj) of joint position covariances (T, 4, 4)."""
    trace = [np.trace(blocks[:, a, b], axis1=-2, axis2=-1) for a, b in _CORNERS]
    scale = np.sqrt(trace[1] * trace[2])
    return np.divide(trace[0], scale, out=np.zeros_like(scale), where=scale > 0)


_CORNERS = ((slice(0, 2), slice(2, 4)), (slice(0, 2), slice(0, 2)), (slice(2, 4), slice(2, 4)))


def _partial(mission: NavigationMission, names: list[str], mean: np.ndarray, cov: np.ndarray) -> dict:
    """The first trial's whole track, for someone watching."""
    return {
        "time_s": mission.time_s.tolist(),
        "mean": {name: mean[v, 0].tolist() for v, name in enumerate(names)},
        "cov": {
            name: np.stack([cov[v, 0, :, 0, 0], cov[v, 0, :, 0, 1], cov[v, 0, :, 1, 1]], -1).tolist()
            for v, name in enumerate(names)
        },
    }


CENTRALIZED_SMOOTHER = Algorithm(
    name="centralized_smoother",
    title="Centralized smoother",
    family="smoothing",
    summary="All sensors and ranges of all vehicles in one least-squares problem; its track is the smoothed one, "
    "which knows what came later.",
    source="Walls, Cunningham and Eustice 2015, eq. (2)-(3)",
    run=run,
    centralized=True,
    assumes=("all sensor data of all vehicles in one place: post-processing only",),
)
