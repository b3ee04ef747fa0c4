"""Tables 5.1 to 5.4 of Cheung's thesis, row group by row group: the thesis' errors and ours over ten seeds.

Run `python -m tests.benchmarks.cheung2019_tables` for all of them (an hour and a half on one core), or name tables:
`... 5.1 5.3`. A row group is what the thesis' rows share: experiment, fixes, measurements, array length and drift.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engine import runner
from engine.scenario import library, toml


@dataclass(frozen=True)
class Group:
    """One row group: how it is flown, and what the thesis printed, m: errors of mean and mode, and of the poses."""

    table: str
    experiment: str
    algorithm: str
    count: int
    fixes: int = 2
    elements: int = 8
    drift_mps: float = 0.2
    mean_m: tuple[float, ...] = ()
    mode_m: tuple[float, ...] = ()
    poses_m: tuple[float, ...] = ()

    def changes(self, trials: int) -> dict[str, object]:
        """The scenario's keys for it."""
        key = "ranging.count" if self.algorithm == "range_only" else "arrays.count"
        other = {"ranging.count": "arrays.count", "arrays.count": "ranging.count"}[key]
        counts: dict[str, object] = {key: self.count, other: 2}
        return counts | {
            "trials": trials,
            "fixes.count": self.fixes,
            "arrays.elements": self.elements,
            "odometry.drift_mps": self.drift_mps,
            "options": {},
        }


STATIONARY, DRIFTING = "stationary", "drifting"
GROUPS = (
    Group("5.1", STATIONARY, "range_only", 12, mean_m=(39.27, 38.99, 33.42), mode_m=(28.13, 28.43, 64.08)),
    Group("5.1", STATIONARY, "range_only", 20, mean_m=(40.40, 42.34, 51.84), mode_m=(21.87, 46.18, 50.16)),
    Group("5.1", STATIONARY, "range_only", 58, mean_m=(8.49, 8.45, 7.07), mode_m=(9.56, 7.41, 7.42)),
    Group("5.1", DRIFTING, "range_only", 16, mean_m=(24.02, 21.52, 21.70), mode_m=(28.45, 17.89, 29.36)),
    Group("5.1", DRIFTING, "range_only", 25, mean_m=(12.52, 12.62, 14.16), mode_m=(11.13, 10.07, 16.54)),
    Group("5.1", DRIFTING, "range_only", 65, mean_m=(2.67, 7.92, 2.75), mode_m=(4.77, 9.46, 1.63)),
    Group("5.2", STATIONARY, "sas_all_priors", 3, mean_m=(5.50,), mode_m=(6.22,)),
    Group("5.2", STATIONARY, "sas_all_priors", 7, mean_m=(3.12,), mode_m=(4.52,)),
    Group("5.2", STATIONARY, "sas_all_priors", 16, mean_m=(7.42,), mode_m=(7.05,)),
    Group("5.2", DRIFTING, "sas_all_priors", 3, mean_m=(5.51,), mode_m=(8.05,)),
    Group("5.2", DRIFTING, "sas_all_priors", 8, mean_m=(4.10,), mode_m=(6.70,)),
    Group("5.2", DRIFTING, "sas_all_priors", 14, mean_m=(4.53,), mode_m=(4.40,)),
    Group("5.3", STATIONARY, "sas_static", 5, 3, mean_m=(15.3,), mode_m=(26.3,), poses_m=(2.6,)),
    Group("5.3", STATIONARY, "sas_static", 11, 3, mean_m=(4.48,), mode_m=(5.16,), poses_m=(4.8,)),
    Group("5.3", STATIONARY, "sas_static", 16, 3, mean_m=(2.92,), mode_m=(3.12,), poses_m=(2.6,)),
    Group("5.3", STATIONARY, "sas_static", 10, 13, mean_m=(2.28,), mode_m=(4.65,), poses_m=(4.4,)),
    Group("5.3", STATIONARY, "sas_static", 10, 13, 8, 0.4, (3.38,), (4.30,), (6.4,)),
    Group("5.3", STATIONARY, "sas_static", 10, 13, 8, 0.6, (6.66,), (14.5,), (5.87,)),
    Group("5.3", DRIFTING, "sas_static", 5, 2, mean_m=(35.5,), mode_m=(36.5,), poses_m=(8.01,)),
    Group("5.3", DRIFTING, "sas_static", 12, 2, mean_m=(6.77,), mode_m=(11.0,), poses_m=(5.7,)),
    Group("5.3", DRIFTING, "sas_static", 21, 2, mean_m=(22.2,), mode_m=(21.2,), poses_m=(3.5,)),
    Group("5.3", DRIFTING, "sas_static", 5, 5, mean_m=(6.07,), mode_m=(8.24,), poses_m=(3.81,)),
    Group("5.3", DRIFTING, "sas_static", 5, 18, mean_m=(6.27,), mode_m=(5.56,), poses_m=(2.29,)),
    Group("5.3", DRIFTING, "sas_static", 5, 35, mean_m=(2.33,), mode_m=(3.67,), poses_m=(1.91,)),
    Group("5.4", STATIONARY, "sas_dynamic", 10, 2, 6, 0.2, (12.0,), (7.98,), (1.28,)),
    Group("5.4", STATIONARY, "sas_dynamic", 15, 2, 6, 0.2, (2.14,), (2.91,), (2.62,)),
    Group("5.4", STATIONARY, "sas_dynamic", 10, 3, 6, 0.2, (3.87,), (4.69,), (2.45,)),
    Group("5.4", DRIFTING, "sas_dynamic", 15, 3, 6, 0.2, (3.57, 5.89, 6.65), (4.46, 6.01, 6.14), (3.04, 2.35, 2.68)),
    Group("5.4", DRIFTING, "sas_dynamic", 14, 6, 6, 0.2, (1.20,), (2.12,), (3.07,)),
    Group("5.4", STATIONARY, "sas_dynamic", 10, 2, 8, 0.2, (13.52, 12.38), (5.52, 3.39), (1.28, 1.97)),
    Group("5.4", STATIONARY, "sas_dynamic", 12, 2, 8, 0.2, (6.61,), (5.95,), (2.21,)),
    Group("5.4", DRIFTING, "sas_dynamic", 10, 2, 8, 0.2, (7.94,), (9.43,), (2.68,)),
    Group("5.4", DRIFTING, "sas_dynamic", 9, 3, 8, 0.2, (7.55, 4.81), (7.78, 5.22), (2.79, 3.84)),
    Group("5.4", DRIFTING, "sas_dynamic", 13, 3, 8, 0.2, (4.01,), (1.68,), (1.74,)),
    Group("5.4", DRIFTING, "sas_dynamic", 19, 3, 8, 0.2, (4.25,), (8.58,), (2.27,)),
    Group("5.4", STATIONARY, "sas_dynamic", 22, 3, 8, 0.2, (3.41,), (5.31,), (2.59,)),
    Group("5.4", STATIONARY, "sas_dynamic", 10, 4, 8, 0.2, (5.52,), (4.65,), (1.26,)),
    Group("5.4", DRIFTING, "sas_dynamic", 13, 6, 8, 0.2, (1.82, 7.80), (3.22, 7.93), (2.18, 3.36)),
    Group("5.4", DRIFTING, "sas_dynamic", 22, 6, 8, 0.2, (1.96, 1.91), (1.84, 2.16), (1.88, 2.08)),
    Group("5.4", STATIONARY, "sas_dynamic", 9, 2, 10, 0.2, (2.64, 10.25, 2.89), (1.64, 9.09, 1.19), (1.78, 3.23, 2.76)),
    Group("5.4", STATIONARY, "sas_dynamic", 11, 2, 10, 0.2, (11.4,), (6.12,), (1.52,)),
    Group("5.4", DRIFTING, "sas_dynamic", 12, 2, 10, 0.2, (2.79,), (3.81,), (2.39,)),
    Group("5.4", DRIFTING, "sas_dynamic", 12, 3, 10, 0.2, (1.44,), (3.60,), (1.65,)),
    Group("5.4", DRIFTING, "sas_dynamic", 19, 4, 10, 0.2, (1.01,), (0.15,), (2.93,)),
)


def errors(group: Group, trials: int) -> dict[str, np.ndarray]:
    """Each trial's errors (trials,), m: of the beacon's mean and mode at the end, and of the poses.

    That of the poses is the largest in Table 5.3 (C19 section 5.2.3), their average elsewhere.
    """
    scenario = toml.override(library.find(f"cheung2019-{group.experiment}"), group.changes(trials))
    result = runner.run(scenario, [group.algorithm], workers=1)
    tracks, truth = result.tracks[group.algorithm], result.truth
    vehicle, beacon = scenario.vehicle.name, scenario.beacon.name  # type: ignore[attr-defined]
    off = {s: np.linalg.norm(tracks.beliefs[s].mean - truth[s], axis=-1) for s in (vehicle, beacon)}
    mode = tracks.series[f"mode_error_m/{beacon}"].value[:, -1]
    poses = off[vehicle].max(axis=1) if group.table == "5.3" else off[vehicle].mean(axis=1)
    return {"mean": off[beacon][:, -1], "mode": mode, "poses": poses}


def quartiles(value: np.ndarray) -> str:
    low, middle, high = np.percentile(value, [25, 50, 75])
    return f"{middle:.2f} ({low:.2f}-{high:.2f})"


def rows(groups: tuple[Group, ...], trials: int = 10) -> Iterator[str]:
    """A table in Markdown, line by line: medians and quartiles beside the thesis' figures."""
    heads = ("Table", "Experiment", "Fixes", "Factors", "Elements", "Drift")
    yield "| " + " | ".join([*heads, *(what for e in ("e_b mean", "e_b max", "e_p") for what in (e, "thesis"))]) + " |"
    yield "|---" * 12 + "|"
    for g in groups:
        found = errors(g, trials)
        pairs = ((found["mean"], g.mean_m), (found["mode"], g.mode_m), (found["poses"], g.poses_m))
        cells = [f"{quartiles(ours)} | {', '.join(map(str, theirs)) or '-'}" for ours, theirs in pairs]
        fixes = "all" if g.algorithm == "sas_all_priors" else g.fixes
        elements = "-" if g.algorithm == "range_only" else g.elements
        head = f"| {g.table} | {g.experiment} | {fixes} | {g.count} | {elements} | {g.drift_mps}"
        yield " | ".join([head, *cells]) + " |"


if __name__ == "__main__":
    wanted = sys.argv[1:]
    for line in rows(tuple(g for g in GROUPS if not wanted or g.table in wanted)):
        print(line, flush=True)
