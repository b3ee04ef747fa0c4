"""What a job will cost, and whether that is more than this server takes on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from distributed.system import MEMORY_LIMIT

from engine import runner, statistics
from engine.scenario.errors import Problem
from engine.scenario.models import ScenarioBase
from server.settings import Settings

#: Report times, and length (s), assumed of a recorded mission, which is not read beforehand.
USUAL_TIMES, USUAL_S = 800, 3600.0
#: Worker seconds per trial, subject and second of mission, where an algorithm has not been seen: measured on W11's
#: topologies with all six filters; a batch smoother takes ten times as much.
USUAL_RATE = 1.0e-6
#: Memory of a worker: the process with the engine in it, and per trial of a block, subject and second of mission
#: (measured on W11's, W12's and W15's simulated missions: 347 to 467 bytes).
PROCESS_BYTES, BYTES = 180e6, 400.0
#: Bytes of a result per trial, algorithm, subject and report time: mean and covariance.
RESULT_BYTES = 6 * 8


@dataclass(frozen=True)
class Cost:
    """An estimate: shards, worker seconds together, bytes of the result, bytes of memory of one worker.

    work is trials x subjects x seconds of mission x algorithms.
    """

    trials: int
    subjects: int
    duration_s: float
    shards: int
    work: float
    worker_s: float
    result_bytes: float
    worker_bytes: float


def estimate(scenario: ScenarioBase, names: Sequence[str], rates: Mapping[str, float], keep: str = "tracks") -> Cost:
    """The cost of running algorithms on a scenario; rates {algorithm: worker seconds per unit of work} seen before."""
    subjects = max(len(getattr(scenario, "vehicles", ())), 1)
    duration_s = scenario.duration_s or USUAL_S
    interval_s = getattr(scenario, "report_interval_s", None)
    times = math.floor(duration_s / interval_s) + 1 if scenario.duration_s and interval_s else USUAL_TIMES
    each = scenario.trials * subjects * duration_s
    block = min(scenario.trials, runner.BLOCK)
    whole = scenario if keep == "tracks" else statistics.shown(scenario)
    batches = [] if keep == "tracks" else statistics.batches(scenario, names)
    return Cost(
        trials=scenario.trials,
        subjects=subjects,
        duration_s=duration_s,
        shards=len(runner.blocks(whole.trials)) * len(names) + len(batches),
        work=each * len(names),
        worker_s=sum(each * rates.get(name, USUAL_RATE) for name in names),
        result_bytes=whole.trials * subjects * times * RESULT_BYTES * len(names),
        worker_bytes=PROCESS_BYTES + block * subjects * duration_s * BYTES,
    )


def problems(cost: Cost, settings: Settings, keep: str = "tracks") -> list[Problem]:
    """What is too much of a job, each with what would be accepted."""
    found = []
    most = settings.most_trials if keep == "tracks" else settings.most_trials_summed
    if cost.trials > most:
        found.append(_problem(f"{cost.trials} trials are too many for one job that keeps {keep}", most))
    if cost.work > settings.most_work:
        many = f"{cost.trials} trials of {cost.subjects} vehicles over {cost.duration_s:g} s are too much for one job"
        found.append(_problem(many, math.floor(cost.trials * settings.most_work / cost.work)))
    if cost.result_bytes > settings.largest_result:
        large = f"the result of {cost.trials} trials would take about {cost.result_bytes / 1e9:.1f} GB"
        found.append(_problem(large, math.floor(cost.trials * settings.largest_result / cost.result_bytes)))
    memory = worker_memory(settings)
    if memory is not None and cost.worker_bytes > memory:
        block = min(cost.trials, runner.BLOCK)
        fewer = max(math.floor((memory - PROCESS_BYTES) * block / (cost.worker_bytes - PROCESS_BYTES)), 0)
        many = f"{block} trials at a time of {cost.subjects} vehicles over {cost.duration_s:g} s take about "
        many += f"{cost.worker_bytes / 1e9:.1f} GB of memory, a worker has {memory / 1e9:.1f}"
        found.append(_problem(many, fewer))
    return found


def worker_memory(settings: Settings) -> float | None:
    """Bytes that a worker of our own cluster may use; None where the cluster is somebody's."""
    if settings.cluster is not None:
        return None
    return settings.worker_memory or MEMORY_LIMIT / settings.workers


def told(cost: Cost, settings: Settings, threads: int, queued: int, keep: str = "tracks") -> dict[str, Any]:
    """An estimate as REST tells it: with `threads` workers and `queued` jobs before it."""
    found = problems(cost, settings, keep)
    return {
        "trials": cost.trials,
        "subjects": cost.subjects,
        "duration_s": cost.duration_s,
        "shards": cost.shards,
        "worker_s": cost.worker_s,
        "elapsed_s": cost.worker_s / max(min(threads, cost.shards), 1),
        "result_bytes": cost.result_bytes,
        "worker_bytes": cost.worker_bytes,
        "workers": threads,
        "jobs_before": queued,
        "accepted": not found,
        "problems": [{"key": p.key, "message": p.message, "remedy": p.remedy} for p in found],
    }


def _problem(found: str, fewer: int) -> Problem:
    return Problem("trials", found, f"ask for at most {fewer}" if fewer else "shorten the mission")
