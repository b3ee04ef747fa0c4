"""How far a running job is, as its shards tell it."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from pathlib import Path
from typing import Any

from server import artifacts
from server.journal import Journal
from server.store import Job, Store
from server.wire import dumps

#: Progress of a job is told at most this often, and less often the longer it runs: all in all some thousand times.
PROGRESS_S, PROGRESS_SHARE = 0.1, 1 / 300


class Watch:
    """One job's progress, estimates and outline on their way from the workers to the journal."""

    def __init__(self, job: Job, shards: int, finished: set[int], journal: Journal, outline: Path) -> None:
        self._job, self._journal, self._outline = job, journal, outline
        self._told = dict.fromkeys(finished, 1.0)
        self._shards, self._done = shards, set(finished)
        self._last: dict[str, float] = {}
        self._said, self._begun = -math.inf, asyncio.get_running_loop().time()

    @property
    def fraction(self) -> float:
        """The share of the work done."""
        return sum(self._told.values()) / self._shards

    def resume(self, store: Store) -> None:
        """Learn which estimates were told before a restart."""
        after = 0
        while events := store.events(self._job.id, after):
            after = events[-1].id
            for event in events:
                if event.kind == "estimates":
                    data = json.loads(event.data)
                    self._last[data["algorithm"]] = data["time_s"][-1]

    def hear(self, message: dict[str, Any]) -> None:
        number = message["number"]
        if message["outline"] is not None and not self._outline.exists():
            with contextlib.suppress(OSError):  # the disk is full: what is computed is kept by others
                artifacts.write_text(self._outline, dumps(message["outline"]))
            self._journal.wake()
        if message["partial"]:
            self._estimates(message["algorithm"], message["partial"])
        self._told[number] = max(self._told.get(number, 0.0), min(message["fraction"], 1.0))
        self._progress()

    def finish(self, number: int) -> None:
        self._told[number] = 1.0
        self._done.add(number)
        self._progress(always=len(self._done) == self._shards)

    def _estimates(self, algorithm: str, partial: dict[str, Any]) -> None:
        """Pass on points later than those passed on before: a shard that runs again tells them again."""
        last = self._last.get(algorithm, -math.inf)
        times = partial["time_s"]
        start = next((i for i, t in enumerate(times) if t > last), len(times))
        if start == len(times):
            return
        self._last[algorithm] = times[-1]
        new = {"algorithm": algorithm, "time_s": times[start:]}
        for what, digits in (("mean", 3), ("cov", 6)):
            new[what] = {
                subject: [[x if x is None else round(x, digits) for x in row] for row in rows[start:]]
                for subject, rows in partial[what].items()
            }
        self._journal.say(self._job.id, "estimates", new)

    def _progress(self, always: bool = False) -> None:
        moment = asyncio.get_running_loop().time()
        if always or moment - self._said >= max(PROGRESS_S, PROGRESS_SHARE * (moment - self._begun)):
            self._said = moment
            done = {"fraction": self.fraction, "shards_done": len(self._done), "shards": self._shards}
            self._journal.say(self._job.id, "progress", done)
