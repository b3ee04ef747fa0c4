"""What an estimator says: beliefs over time, what its packets cost, and what it noticed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from engine.notes import Note, join


@dataclass(frozen=True)
class Belief:
    """Position belief of one subject at the report times: mean (trials, T, 2) m, cov (trials, T, 2, 2) m^2."""

    mean: np.ndarray
    cov: np.ndarray


@dataclass(frozen=True)
class Samples:
    """A non-Gaussian belief: points (trials, K, N, 2) m at time_s (K,)."""

    time_s: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Innovations:
    """Range innovations of one subject's estimator, in order of arrival.

    time_s (M,); value (trials, M) m and variance (trials, M) m^2, NaN where nothing was heard;
    accepted (trials, M) is False where the gate refused the range.
    """

    time_s: np.ndarray
    value: np.ndarray
    variance: np.ndarray
    accepted: np.ndarray


@dataclass(frozen=True)
class PacketCount:
    """Packets over all trials: broadcasts sent, receptions, encoded bytes and the floats the paper would count.

    sent, received, bytes_sent, floats_sent and mission_s (the time they took) are totals over trials; largest_bytes
    is the longest packet.
    """

    sent: int = 0
    received: int = 0
    bytes_sent: int = 0
    floats_sent: int = 0
    largest_bytes: int = 0
    mission_s: float = 0.0

    def __add__(self, other: PacketCount) -> PacketCount:
        return PacketCount(
            self.sent + other.sent,
            self.received + other.received,
            self.bytes_sent + other.bytes_sent,
            self.floats_sent + other.floats_sent,
            max(self.largest_bytes, other.largest_bytes),
            self.mission_s + other.mission_s,
        )


@dataclass(frozen=True)
class Series:
    """A named curve over the report times, value (trials, T); `subjects` it concerns, `unit` for the axis."""

    title: str
    unit: str
    value: np.ndarray
    subjects: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tracks:
    """One algorithm's answer for a block of trials at the mission's report times.

    graph is what an estimator that keeps a factor graph has to tell of its first trial, in JSON's own types.
    """

    beliefs: dict[str, Belief]
    packets: PacketCount = field(default_factory=PacketCount)
    samples: dict[str, Samples] = field(default_factory=dict)
    innovations: dict[str, Innovations] = field(default_factory=dict)
    series: dict[str, Series] = field(default_factory=dict)
    notes: tuple[Note | str, ...] = ()
    cpu_s: float = 0.0
    graph: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Reference:
    """The report times of a mission, time_s (T,), and its truth {subject: (trials or 1, T, 2)} to score against."""

    time_s: np.ndarray
    truth: dict[str, np.ndarray]


def stack_references(blocks: list[tuple[Reference, int]]) -> Reference:
    """Join the references of consecutive blocks, each with its number of trials; truth shared by all stays single."""
    first = blocks[0][0]
    truth = {}
    for subject, position in first.truth.items():
        if all(r.truth[subject].shape[0] == 1 for r, _ in blocks):
            truth[subject] = position
        else:
            parts = [np.broadcast_to(r.truth[subject], (n, *position.shape[1:])) for r, n in blocks]
            truth[subject] = np.concatenate(parts, axis=0)
    return Reference(first.time_s, truth)


def stack(blocks: list[Tracks]) -> Tracks:
    """Join the answers of consecutive blocks of trials along the trial axis; what was noted is told once."""
    first = blocks[0]
    if len(blocks) == 1:
        return first

    def stacked(arrays: list[np.ndarray]) -> np.ndarray:
        return np.concatenate(arrays, axis=0)

    return Tracks(
        beliefs={
            s: Belief(stacked([b.beliefs[s].mean for b in blocks]), stacked([b.beliefs[s].cov for b in blocks]))
            for s in first.beliefs
        },
        packets=sum((b.packets for b in blocks), PacketCount()),
        samples={
            s: Samples(first.samples[s].time_s, stacked([b.samples[s].points for b in blocks])) for s in first.samples
        },
        innovations={
            s: Innovations(
                i.time_s,
                stacked([b.innovations[s].value for b in blocks]),
                stacked([b.innovations[s].variance for b in blocks]),
                stacked([b.innovations[s].accepted for b in blocks]),
            )
            for s, i in first.innovations.items()
        },
        series={
            k: Series(s.title, s.unit, stacked([b.series[k].value for b in blocks]), s.subjects)
            for k, s in first.series.items()
        },
        notes=join(n for b in blocks for n in b.notes),
        cpu_s=sum(b.cpu_s for b in blocks),
        graph=first.graph,
    )
