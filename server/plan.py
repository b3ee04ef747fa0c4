"""A job's shards: which wait, which run, which are finished, and which were given up."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from engine.runner import Shard
from engine.statistics import Batch
from engine.tracks import Reference, Tracks
from server import artifacts
from server.store import Job, Store
from server.watch import Watch
from server.work import Answer, Piece

log = logging.getLogger(__name__)

#: A shard whose worker dies so often is given up.
TRIES = 3
#: Answers on their way to the disk; a job with more waits for the disk, not the disk for memory.
MOST_UNWRITTEN = 8
#: So many of the next shards are searched for one whose mission a worker has flown already.
AHEAD = 64


class Plan:
    """The line in which one job's shards wait for workers.

    `started` is set when the first one runs, `settled` while no answer is being written; `ended` is done when no shard
    is left, or raises what ended the job.
    cost {algorithm: (trials x subjects x mission seconds, worker seconds)} is what was computed here.
    """

    def __init__(
        self, job: Job, shards: list[Shard | Batch], store: Store, watch: Watch, file: Callable[[int], Path]
    ) -> None:
        self.client, self.urgent = job.client, job.purpose == "what-if"
        self._job, self._shards, self._store, self._watch, self._file = job, shards, store, watch, file
        over = {*store.shards(job.id), *store.lost(job.id)}
        self._pending = deque(n for n in range(len(shards)) if n not in over)
        self._left = len(self._pending)
        self._tries: dict[int, int] = {}
        self._flown: dict[Sequence[int], str] = {}
        self._unwritten = 0
        self.cost: dict[str, tuple[float, float]] = {}
        self.started, self.settled = asyncio.Event(), asyncio.Event()
        self.settled.set()
        self.ended: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        if not self._left:
            self.started.set()
            self.ended.set_result(None)

    def waiting(self) -> bool:
        return bool(self._pending) and self._unwritten < MOST_UNWRITTEN and not self.ended.done()

    def alone(self) -> bool:
        return self._pending[0] in self._tries

    def take(self, worker: str) -> Piece:
        """The next shard, if possible one whose mission was flown on that worker, or on none yet."""
        number = self._pending[0] if self.alone() else self._fitting(worker)
        self._pending.remove(number)
        shard = self._shards[number]
        self._flown.setdefault(shard.trials, worker)
        self.started.set()
        return Piece(self._job.id, number, self._job.toml, self._job.origin, shard)

    def _fitting(self, worker: str) -> int:
        fresh = None
        for place, number in enumerate(self._pending):
            home = self._flown.get(self._shards[number].trials)
            if home == worker:
                return number
            if home is None and fresh is None:
                fresh = number
            if place == AHEAD:
                break
        return self._pending[0] if fresh is None else fresh

    async def finish(self, piece: Piece, answer: Answer, seconds: float) -> None:
        """Keep an answer: its file whole, then that it is there."""
        self._unwritten += 1
        self.settled.clear()
        try:
            digest = await asyncio.to_thread(_write, self._file(piece.number), piece, answer)
            self._watch.finish(piece.number)
            await asyncio.to_thread(self._store.finish_shard, self._job.id, piece.number, digest, self._watch.fraction)
        finally:
            self._unwritten -= 1
            if not self._unwritten:
                self.settled.set()
        if isinstance(answer, tuple):
            self._count(piece, *answer, seconds)
        self._one_less()

    def _count(self, piece: Piece, reference: Reference, tracks: Tracks, seconds: float) -> None:
        length_s = float(np.ptp(reference.time_s)) if reference.time_s.size else 0.0
        work, spent = self.cost.get(piece.shard.algorithm, (0.0, 0.0))
        work += len(piece.shard.trials) * max(len(tracks.beliefs), 1) * length_s
        self.cost[piece.shard.algorithm] = work, spent + seconds

    def put_back(self, piece: Piece) -> None:
        self._pending.appendleft(piece.number)

    async def died(self, piece: Piece, alone: bool) -> None:
        """Try again, by itself; after so many tries give the shard up."""
        tries = self._tries[piece.number] = self._tries.get(piece.number, 0) + 1
        if tries < TRIES or not alone:
            self.put_back(piece)
            return
        lost = {
            "algorithm": piece.shard.algorithm,
            "trials": [piece.shard.trials[0], piece.shard.trials[-1]],
            "seed": self._job.seed,
            "tries": tries,
            "reason": "its worker process ended every time, as when memory runs out or compiled code crashes",
        }
        log.error("job %s: shard %d given up: %s", self._job.id, piece.number, lost)
        self._watch.finish(piece.number)
        await asyncio.to_thread(self._store.lose_shard, self._job.id, piece.number, lost, self._watch.fraction)
        self._one_less()

    def fail(self, error: Exception) -> None:
        if not self.ended.done():
            self.ended.set_exception(error)

    def _one_less(self) -> None:
        self._left -= 1
        if self._left == 0 and not self.ended.done():
            self.ended.set_result(None)


def _write(path: Path, piece: Piece, answer: Answer) -> str:
    if isinstance(answer, tuple):
        assert isinstance(piece.shard, Shard), "a batch leaves totals"
        return artifacts.write_shard(path, piece.shard, *answer)
    return artifacts.write_totals(path, answer)
