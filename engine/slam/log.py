"""What one trial's vehicle knows: odometry, fixes, records of single pings and synthetic arrays, or recorded ranges."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from engine.acoustics.synthetic_array import SyntheticArray

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Ping:
    """The beacon as heard at one pose: density (W,) over ranges_m (W,), evenly spaced, zero beyond them.

    strongest_m is the range of the filter's strongest output, snr_db its power over the noise's.
    """

    pose: int
    beacon: str
    ranges_m: np.ndarray
    density: np.ndarray
    strongest_m: float
    snr_db: float


@dataclass(frozen=True)
class Reading:
    """A recorded range to a beacon at one pose, with its stated standard deviation."""

    pose: int
    beacon: str
    range_m: float
    sigma_m: float


@dataclass(frozen=True, eq=False)
class Aperture:
    """A synthetic array: the poses (m) that are its elements, what it heard, and what speaks against it."""

    poses: tuple[int, ...]
    beacon: str
    array: SyntheticArray
    cautions: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class SlamLog:
    """One trial. P poses; steps (P-1, 2) m in world axes, or (P-1, 3) forward, left, turn in the vehicle's.

    step_cov (P-1, d, d). fix_m (P, 2) is what a fix at each pose reads, with fix_sigma_m; the vehicle has those at the
    poses numbered in `fixed`. start (3,) is the first pose (x, y, heading) with start_cov where steps are in the
    vehicle's axes, else None.
    """

    steps: np.ndarray
    step_cov: np.ndarray
    fix_m: np.ndarray
    fix_sigma_m: float
    fixed: tuple[int, ...]
    pings: tuple[Ping, ...] = ()
    arrays: tuple[Aperture, ...] = ()
    readings: tuple[Reading, ...] = ()
    start: np.ndarray | None = None
    start_cov: np.ndarray | None = None

    @property
    def poses(self) -> int:
        """Number of poses P."""
        return len(self.steps) + 1

    @property
    def cautions(self) -> dict[int, tuple[str, ...]]:
        """What speaks against each array, by its first pose."""
        return {a.poses[0]: a.cautions for a in self.arrays}


def evenly(count: int, total: int) -> list[int]:
    """`count` numbers of `total`, from the first to the last, evenly spread."""
    if count <= 1:
        return [0][:count]
    return [round(k * (total - 1) / (count - 1)) for k in range(count)]


def thinned(log: SlamLog, count: int | None) -> SlamLog:
    """A log with at most `count` of the pings, arrays and readings each, evenly spread; without a count, all."""

    def some(items: tuple[T, ...]) -> tuple[T, ...]:
        return items if count is None or count >= len(items) else tuple(items[k] for k in evenly(count, len(items)))

    return replace(log, pings=some(log.pings), arrays=some(log.arrays), readings=some(log.readings))
