"""What runs on a Dask worker: one shard, telling how far it is and stopping when told to."""

from __future__ import annotations

import signal
import threading
from importlib import import_module
from typing import Any

from distributed import get_worker
from distributed.diagnostics.plugin import WorkerPlugin

from engine import registry, runner
from engine.runner import Shard
from engine.scenario import toml
from engine.scenario.models import ScenarioBase
from engine.tracks import Reference, Tracks

_cancelled: set[str] = set()


class Cancelled(Exception):
    """The job of the shard that is running was cancelled."""


class Prepared(WorkerPlugin):
    """Makes a worker ready before its first shard: the engine imported, Ctrl-C left to the server."""

    name = "coopnav"
    idempotent = True

    def setup(self, worker: Any) -> None:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        registry.families()
        registry.algorithms()
        import_module("engine.mission")


def cancel(job: str) -> None:
    """Stop the shards of a job that are running in this process at their next sign of life."""
    _cancelled.add(job)


def run(topic: str, job: str, number: int, text: str, origin: str, shard: Shard) -> tuple[Reference, Tracks] | None:
    """Run shard `number` of a job and tell of it on a topic; None where the job was cancelled meanwhile.

    Told are {"job", "number", "algorithm", "fraction", "partial", "outline"}: estimates and the outline of the
    mission come from the shards of trial 0 alone.
    """
    worker = get_worker()
    watched = shard.trials[0] == 0

    def tell(fraction: float, partial: Any = None, *, outline: Any = None) -> None:
        if job in _cancelled:
            raise Cancelled
        message = {
            "job": job,
            "number": number,
            "algorithm": shard.algorithm,
            "fraction": fraction,
            "partial": partial if watched else None,
            "outline": outline,
        }
        worker.log_event(topic, message)

    try:
        scenario = toml.loads(text, origin=origin)
        tell(0.0)
        mission = runner.prepare(scenario, shard.trials)
        if watched:
            tell(0.0, outline=outlined(scenario.family, mission))
        return runner.run_shard(scenario, shard, tell)
    except Cancelled:
        return None


def outline(scenario: ScenarioBase) -> dict[str, Any]:
    """A mission's outline, flown here for it."""
    return outlined(scenario.family, runner.prepare(scenario, (0,)))


def outlined(family: str, mission: Any) -> dict[str, Any]:
    """The first trial as a watcher sees it: times, truth, subjects, events."""
    outline = registry.families()[family].outline(mission)
    return {
        "time_s": mission.time_s.tolist(),
        "truth": {subject: position[0].tolist() for subject, position in mission.truth.items()},
        "subjects": outline.subjects,
        "events": outline.events,
    }
