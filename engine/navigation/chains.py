"""A vehicle's local log compressed once to a chain of links between the instants that matter.

Between two breakpoints (launches, arrivals, reports) a vehicle only predicts and reads its own sensors; a chain
holds that as one link per interval (the field also calls it delta information, W12 section 3). All the
estimators then run over links and acoustic events, never over samples.

Three local models: a vehicle with velocity readings or fixes alone is x, y, vx, vy under a constant-velocity
plant (W11 eq. 2); one that integrates odometry is a pose x, y, heading; a fixed node is x, y.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from engine.gaussian.forms import Moments
from engine.gaussian.links import Link, compose, measurement
from engine.mission.log import Fixes, Odometry, VehicleLog

XY = slice(0, 2)


class Step(Protocol):
    """What happened to a vehicle between two breakpoints, as a link once its start is known."""

    def at(self, mean: np.ndarray) -> Link:
        """The link linearized at the start state's mean (..., n)."""
        ...


@dataclass(frozen=True)
class Chain:
    """A vehicle's steps between consecutive times_s (K+1,), and what it believes at the first of them."""

    times_s: np.ndarray
    initial: Moments
    steps: list[Step]


def chain(log: VehicleLog, breakpoints_s: np.ndarray, trials: int) -> Chain:
    """Compress one vehicle's local log between ascending breakpoints (K+1,), the first being the start."""
    if log.odometry is not None:
        return _odometry_chain(log, log.odometry, breakpoints_s, trials)
    if log.kind == "fixed" and log.velocity is None:
        return _fixed_chain(log, breakpoints_s, trials)
    return _velocity_chain(log, breakpoints_s, trials)


def latest_before(samples_s: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Index of the last sample at or before each time; the first sample where there is none before."""
    return np.maximum(np.searchsorted(samples_s, times_s, side="right") - 1, 0)


def depth_at(log: VehicleLog, times_s: np.ndarray) -> np.ndarray:
    """Measured depth (trials or 1, M) m at the given times: the latest reading, or the vehicle's stated depth."""
    if log.depth is None or log.depth.time_s.size == 0:
        return np.full((1, len(times_s)), log.depth_m)
    return log.depth.value[:, latest_before(log.depth.time_s, times_s)]


def world_velocity(log: VehicleLog) -> tuple[np.ndarray, np.ndarray]:
    """DVL velocities turned to the world frame by the measured heading: (trials, N, 2) m/s and (trials, N, 2, 2).

    The DVL's covariance turns with it, and heading noise adds a part across the velocity. A noisy heading
    shortens the mean of a turned vector by exp(-sigma^2/2), which is undone (Lerro and Bar-Shalom 1993).
    """
    velocity, heading = log.velocity, log.heading
    if velocity is None or heading is None:
        raise ValueError(f"vehicle {log.name!r}: body velocities need a heading to be turned to the world frame")
    psi = heading.value[:, latest_before(heading.time_s, velocity.time_s)]
    c, s = np.cos(psi), np.sin(psi)
    forward, left = velocity.value[..., 0], velocity.value[..., 1]
    unshrink = np.exp(0.5 * heading.sigma_rad**2)
    z = np.stack([c * forward - s * left, s * forward + c * left], axis=-1) * unshrink
    along, cross = velocity.along_sigma_mps**2, velocity.cross_sigma_mps**2
    turned = heading.sigma_rad**2
    R = np.empty((*z.shape, 2))
    R[..., 0, 0] = along * c**2 + cross * s**2 + turned * z[..., 1] ** 2
    R[..., 1, 1] = along * s**2 + cross * c**2 + turned * z[..., 0] ** 2
    R[..., 0, 1] = R[..., 1, 0] = (along - cross) * s * c - turned * z[..., 0] * z[..., 1]
    return z, R


# --- constant velocity -------------------------------------------------------------------------------------


def _velocity_chain(log: VehicleLog, breakpoints_s: np.ndarray, trials: int) -> Chain:
    """x, y, vx, vy: W11 eq. (2)-(5) with DVL velocities and position fixes."""
    start = log.initial
    readings: list[Readings] = []
    if log.velocity is not None and log.velocity.time_s.size:
        z, R = world_velocity(log)
        readings.append(Readings(log.velocity.time_s, z, R, slice(2, 4)))
    if log.fixes is not None and log.fixes.time_s.size:
        readings.append(Readings(log.fixes.time_s, log.fixes.value, log.fixes.cov[None], XY))
    link = compress(readings, breakpoints_s, log.acceleration_psd, trials)
    mean = np.concatenate([np.broadcast_to(v, (trials, 2)) for v in (start.position_m, start.velocity_mps)], axis=-1)
    cov = np.zeros((trials, 4, 4))
    cov[:, :2, :2] = start.position_cov
    cov[:, 2:, 2:] = np.eye(2) * start.velocity_sigma_mps**2
    steps: list[Step] = [
        Link(link.A[k], link.b[k], link.C[k], link.eta[k], link.J[k]) for k in range(len(breakpoints_s) - 1)
    ]
    return Chain(breakpoints_s, Moments(mean, cov), steps)


@dataclass(frozen=True)
class Readings:
    """Linear readings z (trials or 1, N, 2) with covariance R (trials or 1, N, 2, 2) of one half of the state."""

    time_s: np.ndarray
    z: np.ndarray
    R: np.ndarray
    block: slice


#: Segments x trials worked on at once: large enough to hide call overhead, small enough to stay in cache.
_CHUNK = 12000


def compress(readings: list[Readings], breakpoints_s: np.ndarray, psd: float, trials: int) -> Link:
    """Links of a constant-velocity vehicle between breakpoints (K+1,), all fields with leading axes (K, trials or 1).

    psd is the spectral density of the white acceleration, m^2/s^3. Samples are taken in step across all segments
    and trials, so the loop is as long as the fullest segment, not as the log. A reading at a breakpoint belongs
    to the segment that ends there.
    """
    K = len(breakpoints_s) - 1
    time = np.concatenate([r.time_s for r in readings]) if readings else np.empty(0)
    kind = np.concatenate([np.full(r.time_s.size, i) for i, r in enumerate(readings)]) if readings else time
    row = np.concatenate([np.arange(r.time_s.size) for r in readings]) if readings else time
    order = np.argsort(time, kind="stable")
    order = order[(time[order] >= breakpoints_s[0]) & (time[order] <= breakpoints_s[-1]) & (K > 0)]
    time, kind, row = time[order], kind[order], row[order]
    segment = np.clip(np.searchsorted(breakpoints_s, time, side="left") - 1, 0, K - 1)
    count = np.bincount(segment, minlength=K)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])

    shared = all(r.R.shape[0] == 1 for r in readings)
    width = 1 if shared else trials
    out = Link(
        A=np.empty((K, width, 4, 4)),
        b=np.empty((K, trials, 4)),
        C=np.empty((K, width, 4, 4)),
        eta=np.empty((K, trials, 4)),
        J=np.empty((K, width, 4, 4)),
    )
    # Velocities say nothing of where the link started, so without fixes those columns stay as they are.
    columns = slice(2, 4) if all(r.block.start == 2 for r in readings) else slice(0, 4)
    inner = [(_innermost(r.z[..., :, None])[:, 0], _innermost(r.R)) for r in readings]
    fullest_first = np.argsort(-count, kind="stable")
    size = max(1, _CHUNK // trials)
    for chunk in (fullest_first[i : i + size] for i in range(0, K, size)):
        grow = _Growing(len(chunk), width, trials, columns)
        now = breakpoints_s[chunk].astype(float)
        for i in range(int(count[chunk[0]])):
            active = int((count[chunk] > i).sum())
            at = first[chunk[:active]] + i
            grow.predict(active, time[at] - now[:active], psd)
            now[:active] = time[at]
            for k, r in enumerate(readings):
                mine = kind[at] == k
                if mine.any():
                    rows = np.where(mine, row[at], 0)
                    z, R = inner[k][0][:, rows], inner[k][1][:, :, rows]
                    grow.measure(active, r.block, z, R, None if mine.all() else mine)
        grow.predict(len(chunk), breakpoints_s[chunk + 1] - now, psd)
        grown = grow.links()
        for name in ("A", "b", "C", "eta", "J"):
            getattr(out, name)[chunk] = getattr(grown, name)
    return out


def _innermost(stack: np.ndarray) -> np.ndarray:
    """(trials, N, i, j) laid out as (i, j, N, trials), the order _Growing works in."""
    return np.ascontiguousarray(stack.transpose(2, 3, 1, 0))


class _Growing:
    """Links being grown by one sample after another, over (segments, trials).

    The arrays look like (segments, trials, 4, 4) but are kept as (4, 4, segments, trials): arithmetic on whole
    planes is several times faster than a stack of small matrix products. `columns` are those of the start state
    that the readings can say anything about.
    """

    def __init__(self, segments: int, width: int, trials: int, columns: slice) -> None:
        self._A, self._C, self._J = (np.zeros((4, 4, segments, width)) for _ in range(3))
        self._b, self._eta = (np.zeros((4, segments, trials)) for _ in range(2))
        self._columns = columns
        for i in range(4):
            self._A[i, i] = 1.0

    def links(self) -> Link:
        """The links so far, with axes (segments, trials, ...)."""
        A, C, J = (m.transpose(2, 3, 0, 1) for m in (self._A, self._C, self._J))
        b, eta = (v.transpose(1, 2, 0) for v in (self._b, self._eta))
        return Link(A, b, C, eta, J)

    def predict(self, active: int, dt: np.ndarray, psd: float) -> None:
        """x += dt v, with the covariance of white acceleration over dt (segments,) seconds."""
        A, b, C = self._A[:, :, :active], self._b[:, :active], self._C[:, :, :active]
        t = dt[:, None]
        A[:2] += t * A[2:]
        b[:2] += t * b[2:]
        C[:2] += t * C[2:]
        C[:, :2] += t * C[:, 2:]
        for i in range(2):
            C[i, i] += psd * t**3 / 3
            C[i, i + 2] += psd * t**2 / 2
            C[i + 2, i] += psd * t**2 / 2
            C[i + 2, i + 2] += psd * t

    def measure(self, active: int, block: slice, z: np.ndarray, R: np.ndarray, only: np.ndarray | None) -> None:
        """Append readings z (2, segments, trials) of a block: compose with a measurement, in Kalman form.

        R (2, 2, segments, trials); `only` (segments,) masks the segments whose next sample is of this kind.
        """
        A, b, C = self._A[:, self._columns, :active], self._b[:, :active], self._C[:, :, :active]
        eta, J = self._eta[self._columns, :active], self._J[self._columns, self._columns, :active]
        Cb, Ab = C[:, block].copy(), A[block].copy()
        S = Cb[block] + R
        scale = 1.0 / (S[0, 0] * S[1, 1] - S[0, 1] * S[0, 1])
        if only is not None:
            scale *= only[:, None]
        V = np.array([[S[1, 1], -S[0, 1]], [-S[0, 1], S[0, 0]]]) * scale
        e = z - b[block]
        K = Cb[:, 0, None] * V[0] + Cb[:, 1, None] * V[1]
        G = V[:, 0, None] * Ab[0] + V[:, 1, None] * Ab[1]
        b += K[:, 0] * e[0] + K[:, 1] * e[1]
        eta += G[0] * e[0] + G[1] * e[1]
        A -= K[:, 0, None] * Ab[0] + K[:, 1, None] * Ab[1]
        J += G[0][:, None] * Ab[0] + G[1][:, None] * Ab[1]
        for i in range(4):
            C[i, i:] -= K[i, 0] * Cb[i:, 0] + K[i, 1] * Cb[i:, 1]
            C[i + 1 :, i] = C[i, i + 1 :]


# --- odometry ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class OdometryStep:
    """A pose increment (forward m, left m, turn rad) in the frame of its start, and a fix at its end, if any.

    increment (trials or 1, 3), cov (trials or 1, 3, 3); fix (trials or 1, 2) m with fix_cov (2, 2).
    """

    increment: np.ndarray
    cov: np.ndarray
    fix: np.ndarray | None = None
    fix_cov: np.ndarray | None = None

    def at(self, mean: np.ndarray) -> Link:
        """x_e = x_s (+) increment, linearized at a start pose (..., 3) (Smith, Self and Cheeseman 1990)."""
        c, s = np.cos(mean[..., 2]), np.sin(mean[..., 2])
        d = self.increment
        moved = np.stack([c * d[..., 0] - s * d[..., 1], s * d[..., 0] + c * d[..., 1]], axis=-1)
        lead = moved.shape[:-1]
        A = np.broadcast_to(np.eye(3), (*lead, 3, 3)).copy()
        A[..., 0, 2] = -moved[..., 1]
        A[..., 1, 2] = moved[..., 0]
        b = np.empty((*lead, 3))
        b[..., :2] = moved - A[..., :2, 2] * mean[..., 2:]
        b[..., 2] = d[..., 2]
        turn = np.broadcast_to(np.eye(3), (*lead, 3, 3)).copy()
        turn[..., 0, 0] = turn[..., 1, 1] = c
        turn[..., 0, 1], turn[..., 1, 0] = -s, s
        C = turn @ self.cov @ np.swapaxes(turn, -1, -2)
        link = Link(A, b, C, np.zeros((*lead, 3)), np.zeros((*lead, 3, 3)))
        if self.fix is None or self.fix_cov is None:
            return link
        return compose(link, measurement(np.eye(3)[:2], self.fix_cov, self.fix))


def _odometry_chain(log: VehicleLog, odometry: Odometry, breakpoints_s: np.ndarray, trials: int) -> Chain:
    """x, y, heading: increments composed between breakpoints; intervals with a fix inside are split there."""
    start = log.initial
    fixes = log.fixes
    inner = fixes.time_s if fixes is not None else np.empty(0)
    inner = inner[(inner >= breakpoints_s[0]) & (inner <= breakpoints_s[-1])]
    times = np.union1d(breakpoints_s, inner)
    poses, covs = integrate(odometry, times)
    pieces = [
        OdometryStep(poses[k], covs[k], *_fix_at(fixes, times[k + 1], first=k == 0, start_s=times[0]))
        for k in range(len(times) - 1)
    ]
    ends = np.searchsorted(times, breakpoints_s)
    steps: list[Step] = [
        pieces[a] if b - a == 1 else OdometrySteps(tuple(pieces[a:b])) for a, b in itertools.pairwise(ends)
    ]
    mean = np.concatenate(
        [
            np.broadcast_to(start.position_m, (trials, 2)),
            np.broadcast_to(start.heading_rad, (trials,))[:, None],
        ],
        -1,
    )
    cov = np.zeros((trials, 3, 3))
    cov[:, :2, :2] = start.position_cov
    cov[:, 2, 2] = start.heading_sigma_rad**2
    return Chain(breakpoints_s, Moments(mean, cov), steps)


@dataclass(frozen=True)
class OdometrySteps:
    """Consecutive odometry steps, relinearized one after the other."""

    steps: tuple[OdometryStep, ...]

    def at(self, mean: np.ndarray) -> Link:
        link = self.steps[0].at(mean)
        for step in self.steps[1:]:
            mean = (link.A @ mean[..., None])[..., 0] + link.b
            link = compose(link, step.at(mean))
        return link


def _fix_at(fixes: Fixes | None, time_s: float, *, first: bool, start_s: float) -> tuple:
    """The fix that ends a step (value, cov), or nothing; a fix at the very start counts to the first step."""
    if fixes is None:
        return ()
    at = np.flatnonzero(fixes.time_s == time_s)
    if first and not at.size:
        at = np.flatnonzero(fixes.time_s == start_s)
    return (fixes.value[:, at[0]], fixes.cov[at[0]]) if at.size else ()


def integrate(odometry: Odometry, times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compose increments between consecutive times (K+1,): (K, trials or 1, 3) and (K, trials or 1, 3, 3).

    An increment that straddles a time is divided in proportion, its covariance too. Before the first and after
    the last reading the vehicle is taken to stand still.
    """
    readings = odometry.time_s
    begins = np.concatenate([[min(times_s[0], readings[0])], readings[:-1]]) if readings.size else readings
    grid = np.union1d(times_s, readings)
    grid = grid[(grid >= times_s[0]) & (grid <= times_s[-1])]
    K, width = len(times_s) - 1, odometry.value.shape[0]
    pose, cov = np.zeros((K, width, 3)), np.zeros((K, width, 3, 3))
    for a, b in itertools.pairwise(grid):
        n = int(np.searchsorted(readings, b, side="left"))
        if n == readings.size or b <= begins[n]:
            continue
        share = (b - a) / (readings[n] - begins[n])
        k = int(np.searchsorted(times_s, b, side="left")) - 1
        d, D = share * odometry.value[:, n], share * odometry.cov[n]
        c, s = np.cos(pose[k, :, 2]), np.sin(pose[k, :, 2])
        moved = np.stack([c * d[:, 0] - s * d[:, 1], s * d[:, 0] + c * d[:, 1]], axis=-1)
        J1 = np.broadcast_to(np.eye(3), (width, 3, 3)).copy()
        J1[:, 0, 2], J1[:, 1, 2] = -moved[:, 1], moved[:, 0]
        J2 = np.broadcast_to(np.eye(3), (width, 3, 3)).copy()
        J2[:, 0, 0] = J2[:, 1, 1] = c
        J2[:, 0, 1], J2[:, 1, 0] = -s, s
        cov[k] = J1 @ cov[k] @ np.swapaxes(J1, -1, -2) + J2 @ D @ np.swapaxes(J2, -1, -2)
        pose[k, :, :2] += moved
        pose[k, :, 2] += d[:, 2]
    return pose, cov


# --- fixed nodes -------------------------------------------------------------------------------------------


def _fixed_chain(log: VehicleLog, breakpoints_s: np.ndarray, trials: int) -> Chain:
    """x, y that stay where they are; fixes sharpen them."""
    rest = Link(np.eye(2)[None], np.zeros((1, 2)), np.zeros((1, 2, 2)), np.zeros((1, 2)), np.zeros((1, 2, 2)))
    steps: list[Step] = [rest] * (len(breakpoints_s) - 1)
    if log.fixes is not None:
        for n, time in enumerate(log.fixes.time_s):
            if breakpoints_s[0] <= time <= breakpoints_s[-1]:
                k = max(int(np.searchsorted(breakpoints_s, time, side="left")) - 1, 0)
                steps[k] = compose(
                    steps[k].at(np.zeros(2)), measurement(np.eye(2), log.fixes.cov[n], log.fixes.value[:, n])
                )
    mean = np.broadcast_to(log.initial.position_m, (trials, 2)).copy()
    cov = np.broadcast_to(log.initial.position_cov, (trials, 2, 2)).copy()
    return Chain(breakpoints_s, Moments(mean, cov), steps)
