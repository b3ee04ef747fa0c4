"""What runs on a Dask worker: one shard, telling how far it is and stopping when told to."""

from __future__ import annotations

import ctypes
import os
import signal
import threading
import time
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from distributed import get_worker
from distributed.diagnostics.plugin import WorkerPlugin

from engine import registry, runner, statistics
from engine.runner import Shard
from engine.scenario import toml
from engine.scenario.models import ScenarioBase
from engine.statistics import Batch, Totals
from engine.tracks import Reference, Tracks

#: What a shard's run answers, or a batch's.
Answer = tuple[Reference, Tracks] | Totals

#: A run tells at most this often how far it is: every word goes through the server.
TELL_S = 0.25

_lock = threading.Lock()
_at_work: dict[str, int] = {}
#: The keys last stopped, in order: one that comes to its worker after that does not begin.
_stopped: dict[str, None] = {}
STOPPED_KEPT = 1000


@dataclass(frozen=True)
class Piece:
    """Shard or batch `number` of a job whose scenario is a TOML text, to be read with its origin."""

    job: str
    number: int
    text: str
    origin: str
    shard: Shard | Batch


class Stopped(Exception):
    """The job of the shard that is running has ended."""


#: Workers on the server's own machine leave the processor to the server when it wants it.
NICENESS = 10


class Prepared(WorkerPlugin):
    """Makes a worker ready before its first shard: the engine imported, Ctrl-C left to the server.

    One that shares the server's machine steps back behind it.
    """

    name = "coopnav"
    idempotent = True

    def __init__(self, shares_machine: bool) -> None:
        self.shares_machine = shares_machine

    def setup(self, worker: Any) -> None:
        if self.shares_machine and hasattr(os, "nice"):
            os.nice(NICENESS - os.nice(0))
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        registry.families()
        registry.algorithms()
        import_module("engine.mission")


def stop(key: str) -> bool:
    """Stop the run of that key in this process; whether it is still at work.

    It ends at its next sign of life, or between two steps of Python: a mission being flown gives no signs. One that has
    not come yet does not begin.
    """
    with _lock:
        thread = _at_work.get(key)
        if thread is not None and key not in _stopped:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(Stopped))
        _stopped[key] = None
        if len(_stopped) > STOPPED_KEPT:
            del _stopped[next(iter(_stopped))]
        return thread is not None


def end(dask_worker: Any) -> None:
    """End the worker process of the nanny that this runs in."""
    os.kill(dask_worker.pid, signal.SIGKILL)


def run(topic: str, key: str, piece: Piece) -> Answer | None:
    """Run a piece under a key and tell of it on a topic; None where it was stopped.

    Told are {"job", "number", "algorithm", "fraction", "partial", "outline"}: estimates and the outline of the
    mission come from the shards of trial 0 alone, and how far the others are is told every TELL_S.
    """
    worker = get_worker()
    shard = piece.shard
    watched = shard.trials[0] == 0
    next_s = 0.0

    def tell(fraction: float, partial: Any = None, *, outline: Any = None) -> None:
        nonlocal next_s
        moment = time.monotonic()
        if not watched and moment < next_s:
            if key in _stopped:
                raise Stopped
            return
        next_s = moment + TELL_S
        message = {
            "job": piece.job,
            "number": piece.number,
            "algorithm": shard.algorithm,
            "fraction": fraction,
            "partial": partial if watched else None,
            "outline": outline,
        }
        with _lock:  # so that it is not stopped halfway through
            if key in _stopped:
                raise Stopped
            worker.log_event(topic, message)

    try:
        with _lock:
            if key in _stopped:
                return None
            _at_work[key] = threading.get_ident()
        scenario = toml.loads(piece.text, origin=piece.origin)
        tell(0.0)
        if isinstance(shard, Batch):
            return statistics.run_batch(scenario, shard, tell)
        mission = runner.prepare(scenario, shard.trials)
        if watched:
            tell(0.0, outline=outlined(scenario.family, mission))
        return runner.run_shard(scenario, shard, tell)
    except Stopped:
        return None
    finally:
        with _lock:
            _at_work.pop(key, None)


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
