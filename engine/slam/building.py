"""From a log to the factor graph, in the order a vehicle would add to it (C19 Figs. 5-6, 5-15)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from engine.slam.factors.dynamic_odometry import dynamic_odometry
from engine.slam.factors.factor import Factor
from engine.slam.factors.heard import heard, reading
from engine.slam.factors.odometry import displacement, pose_odometry
from engine.slam.factors.prior import prior
from engine.slam.factors.synthetic_aperture import synthetic_aperture
from engine.slam.log import SlamLog
from engine.slam.variables import DYN_POINT2, POINT2, POSE2, Kind

#: Chance that a record's range is of nothing that was sent, and the range error that its density does not know of, m.
DOUBT, BENT_M = 0.05, 0.3
#: How far the distance of a pose that heard the beacon may still be off, m.
RANGED_M = 1.0
#: Prior of a velocity, and how far it may change within a second, m/s.
VELOCITY_SIGMA_MPS, CHANGE_MPS = 2.0, 0.5
#: Ranges added at a time at first, and what share of those there are later: beliefs come early, and are not all lost.
RANGES_AT_ONCE, SHARE_AT_ONCE = 2, 0.1


@dataclass(frozen=True)
class Plan:
    """What an algorithm makes of a log: which measurements, which fixes, and what a pose is."""

    measurements: Literal["ranges", "arrays"]
    fixes: Literal["some", "all"] = "some"
    motion: Literal["static", "dynamic"] = "static"


@dataclass(frozen=True)
class Growth:
    """Variables and factors added together, the pose they reach, and the number of measurements among them."""

    kinds: dict[str, Kind]
    factors: list[Factor]
    pose: int
    measurements: int


def name(pose: int) -> str:
    """The variable of a pose."""
    return f"x{pose}"


def growths(log: SlamLog, plan: Plan, time_s: np.ndarray, outlier_share: float) -> Iterator[Growth]:
    """The graph, piece by piece: each ends with measurements of a beacon, the last at the last pose.

    Where nothing was measured it is one piece.
    """
    kind = _kind(log, plan)
    slack = _slack(log, plan)
    events = _events(log, plan, slack, outlier_share) or [(log.poses - 1, [])]
    known: set[str] = set()
    reached = -1
    for n, (pose, factors) in enumerate(events):
        last = log.poses - 1 if n == len(events) - 1 else pose
        kinds, added = _onward(log, plan, kind, time_s, reached, last)
        for factor in factors:
            beacon = factor.variables[-1]
            if beacon not in known:
                known.add(beacon)
                kinds[beacon] = POINT2
        yield Growth(kinds, added + factors, pose, len(factors))
        reached = max(reached, last)


def _kind(log: SlamLog, plan: Plan) -> Kind:
    if log.steps.shape[1] == 3:
        return POSE2
    return DYN_POINT2 if plan.motion == "dynamic" else POINT2


def _onward(
    log: SlamLog, plan: Plan, kind: Kind, time_s: np.ndarray, reached: int, last: int
) -> tuple[dict[str, Kind], list[Factor]]:
    """Poses after `reached` up to `last`, with their odometry and fixes."""
    kinds: dict[str, Kind] = {}
    factors: list[Factor] = []
    fixed = range(log.poses) if plan.fixes == "all" else log.fixed
    for k in range(reached + 1, last + 1):
        kinds[name(k)] = kind
        if k == 0 and log.start is not None:
            assert log.start_cov is not None
            factors.append(prior(name(0), POSE2, log.start, log.start_cov))
        if k in fixed:
            factors.append(_fix(log, kind, k))
        elif k == 0 and log.start is None:
            raise ValueError("the first pose needs a fix")
        if k > 0:
            dt = float(time_s[k] - time_s[k - 1])
            factors.append(_step(kind, k, log.steps[k - 1], log.step_cov[k - 1], dt))
    return kinds, factors


def _fix(log: SlamLog, kind: Kind, k: int) -> Factor:
    """A fix; where a pose has a heading or a velocity, one that says next to nothing of it."""
    mean, var = np.zeros(kind.dim), np.full(kind.dim, log.fix_sigma_m**2)
    mean[:2] = log.fix_m[k]
    if kind is DYN_POINT2:
        var[2:] = VELOCITY_SIGMA_MPS**2
    elif kind is POSE2:
        var[2:] = (100 * np.pi) ** 2
    return prior(name(k), kind, mean, np.diag(var))


def _step(kind: Kind, k: int, step: np.ndarray, cov: np.ndarray, dt_s: float) -> Factor:
    a, b = name(k - 1), name(k)
    if kind is POSE2:
        return pose_odometry(a, b, step, cov)
    if kind is POINT2:
        return displacement(a, b, POINT2, step, cov)
    change = np.diag([*np.zeros(2), *np.full(2, dt_s * CHANGE_MPS**2)])
    change[:2, :2] = cov
    noise = float(np.sqrt(np.trace(cov) / 2) / dt_s) + CHANGE_MPS
    return dynamic_odometry(a, b, np.array([*step, 0.0, 0.0]), change, dt_s, noise)


def _events(log: SlamLog, plan: Plan, slack: np.ndarray, outlier_share: float) -> list[tuple[int, list[Factor]]]:
    """Measurements in order of time: the pose at which each set is complete, and its factors."""
    found: list[tuple[int, Factor]] = []
    if plan.measurements == "arrays":
        relative = float(np.sqrt(log.step_cov[:, :2, :2].trace(axis1=1, axis2=2).mean() / 2))
        for a in log.arrays:
            poses = tuple(name(k) for k in a.poses)
            off = float(slack[list(a.poses)].max())
            found.append((a.poses[-1], synthetic_aperture(poses, a.beacon, a.array, max(off, relative), relative)))
    else:
        for before, p in zip((None, *log.pings), log.pings):
            off = slack[p.pose] if before is None else _since(log, slack, before.pose, p.pose)
            factor = heard(name(p.pose), p.beacon, p.ranges_m, p.density, off, DOUBT, BENT_M)
            found.append((p.pose, factor))
        for r in log.readings:
            factor = reading(name(r.pose), r.beacon, r.range_m, r.sigma_m, slack[r.pose], outlier_share)
            found.append((r.pose, factor))
    found.sort(key=lambda event: event[0])
    groups: list[list[tuple[int, Factor]]] = []
    done = 0
    while done < len(found):
        at_once = max(RANGES_AT_ONCE, int(SHARE_AT_ONCE * done)) if plan.measurements == "ranges" else 1
        groups.append(found[done : done + at_once])
        done += at_once
    return [(group[-1][0], [factor for _, factor in group]) for group in groups]


def _since(log: SlamLog, slack: np.ndarray, heard: int, now: int) -> float:
    """How far (m) a pose's distance may be off where an earlier ping has told that of another: what odometry added."""
    steps = float(log.step_cov[heard:now, :2, :2].trace(axis1=1, axis2=2).sum()) / 2
    return min(float(slack[now]), float(np.hypot(np.sqrt(steps), RANGED_M)))


def _slack(log: SlamLog, plan: Plan) -> np.ndarray:
    """Standard deviation per axis (P,) of dead reckoning since the last fix: how far a pose may be off when reached."""
    fixed = set(range(log.poses)) if plan.fixes == "all" else set(log.fixed)
    out, var = np.empty(log.poses), 0.0
    for k in range(log.poses):
        if k > 0:
            var += float(np.trace(log.step_cov[k - 1][:2, :2])) / 2
        if k in fixed:
            var = log.fix_sigma_m**2
        out[k] = np.sqrt(var)
    return out
