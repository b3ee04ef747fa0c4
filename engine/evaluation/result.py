"""A finished run: metrics, claims and tracks, and the two files of the result directory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from engine import registry
from engine.evaluation.claims import check
from engine.evaluation.metrics import SubjectMetrics, evaluate
from engine.tracks import PacketCount, Reference, Tracks

SCHEMA = 1


@dataclass(frozen=True)
class Result:
    """All algorithms' answers to one scenario, scored.

    metrics {algorithm: {subject: metrics}}; claims as `engine.evaluation.claims.check` gives them;
    truth {subject: (trials or 1, T, 2)} m at time_s (T,). lost: blocks of trials that are missing, and why.
    """

    scenario: dict[str, Any]
    seed: int
    trials: int
    metrics: dict[str, dict[str, SubjectMetrics]]
    claims: list[dict[str, Any]]
    tracks: dict[str, Tracks]
    truth: dict[str, np.ndarray]
    time_s: np.ndarray
    capacity_bps: float | None = None
    lost: list[dict[str, Any]] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """The contents of result.json: plain types, no NaN, no infinity."""
        told = {
            "schema": SCHEMA,
            "scenario": self.scenario,
            "seed": self.seed,
            "trials": self.trials,
            "algorithms": _algorithms(self.tracks, self.metrics, self.capacity_bps),
            "claims": self.claims,
        }
        return told | {"lost": self.lost} if self.lost else told

    def arrays(self) -> dict[str, np.ndarray]:
        """The contents of arrays.npz: float64, truth repeated for every trial."""
        named = {"time_s": self.time_s}
        for subject, position in self.truth.items():
            named[f"truth/{subject}"] = np.broadcast_to(position, (self.trials, *position.shape[1:]))
        for name, tracks in self.tracks.items():
            for subject, belief in tracks.beliefs.items():
                named[f"{name}/{subject}/mean"] = belief.mean
                named[f"{name}/{subject}/cov"] = belief.cov
            for subject, samples in tracks.samples.items():
                named[f"{name}/{subject}/samples"] = samples.points
                named[f"{name}/{subject}/samples_time_s"] = samples.time_s
        return {key: np.ascontiguousarray(value, dtype=np.float64) for key, value in named.items()}


def assemble(scenario: Any, reference: Reference, tracks: Mapping[str, Tracks]) -> Result:
    """Score the tracks of a scenario's algorithms against the reference and check the scenario's claims.

    The benchmark of max_deviation_m is the first algorithm run that is registered as centralized.
    """
    known = registry.algorithms()
    centralized = next((name for name in tracks if name in known and known[name].centralized), None)
    metrics = evaluate(reference, tracks, centralized)
    claims = check(scenario.claims, {"algorithms": _algorithms(tracks, metrics, capacity(scenario))})
    return Result(
        scenario=scenario.model_dump(mode="json", by_alias=True, exclude_none=True),
        seed=scenario.seed,
        trials=scenario.trials,
        metrics=metrics,
        claims=claims,
        tracks=dict(tracks),
        truth=reference.truth,
        time_s=reference.time_s,
        capacity_bps=capacity(scenario),
    )


def capacity(scenario: Any) -> float | None:
    """What the scenario says its channel carries, bit/s; families without a network have none."""
    return getattr(getattr(scenario, "network", None), "capacity_bps", None)


def _algorithms(
    tracks: Mapping[str, Tracks], metrics: Mapping[str, dict[str, SubjectMetrics]], capacity_bps: float | None
) -> dict[str, dict[str, Any]]:
    return {
        name: {
            "subjects": metrics[name],
            "packets": packet_figures(answer.packets, capacity_bps),
            "cpu_s": answer.cpu_s,
            "notes": [str(note) for note in answer.notes],
        }
        for name, answer in tracks.items()
    }


def packet_figures(packets: PacketCount, capacity_bps: float | None = None) -> dict[str, Any]:
    """Packets sent and received over all trials; mean bytes and floats of one, 0 where none was sent.

    bits_per_second is the mean load on the shared channel; exceeds_capacity compares it with the channel's, where
    the scenario states one.
    """
    sent = max(packets.sent, 1)
    load = 8 * packets.bytes_sent / packets.mission_s if packets.mission_s else 0.0
    return {
        "sent": packets.sent,
        "received": packets.received,
        "bytes_per_packet": packets.bytes_sent / sent,
        "floats_per_packet": packets.floats_sent / sent,
        "largest_bytes": packets.largest_bytes,
        "bits_per_second": load,
        "exceeds_capacity": None if capacity_bps is None else load > capacity_bps,
    }
