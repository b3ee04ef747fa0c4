"""Who is next: every free worker gets one shard at a time, fairly between clients."""

from __future__ import annotations

import asyncio
import math
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from server.cluster import Cluster, ClusterLost, WorkerDied
from server.work import Answer, Piece

#: Of so many turns while urgent lines wait, one goes to the others.
URGENT_RUN = 5
#: Jobs that have had less than this much of a client's share go before those that had twice as much, and so on.
SHORT_S = 5.0


class Line(Protocol):
    """A job's shards that stand in line; the queue calls these on its event loop."""

    client: str
    urgent: bool

    def waiting(self) -> bool:
        """Whether it could use a worker now."""
        ...

    def alone(self) -> bool:
        """Whether its next piece wants a worker to itself."""
        ...

    def take(self, worker: str) -> Piece:
        """The piece to run next, on that worker."""
        ...

    async def finish(self, piece: Piece, answer: Answer, seconds: float) -> None:
        """Take in the answer."""
        ...

    def put_back(self, piece: Piece) -> None:
        """The piece has to run again, for no fault of its own."""
        ...

    async def died(self, piece: Piece, alone: bool) -> None:
        """Its worker died, on which it ran alone or with others."""
        ...

    def fail(self, error: Exception) -> None:
        """Give the job up."""
        ...


class _Share:
    """What a line has had of the workers, and what a piece of it usually takes, in seconds."""

    def __init__(self) -> None:
        self.used, self.usual = 0.0, 1.0


@dataclass
class _Turn:
    """A piece on a worker, of which it holds some threads, or all: then it is alone."""

    line: Line
    piece: Piece
    key: str
    worker: str
    threads: int
    alone: bool
    held: bool = True
    start: float = 0.0
    charged: float = 0.0


class Flow:
    """Hands out the workers of a cluster to lines.

    Urgent lines go first, though not always; then the client that has had least of the workers; then its jobs that
    have had little, in the order they came. One that comes late starts level with those there: idling earns nothing.
    """

    def __init__(self, cluster: Cluster, clock: Callable[[], float] = time.monotonic) -> None:
        self._cluster, self._clock = cluster, clock
        self._lines: dict[Line, _Share] = {}
        self._clients: dict[str, float] = {}
        self._busy: dict[str, int] = {}
        self._turns: dict[asyncio.Task[None], _Turn] = {}
        self._freeing: set[asyncio.Task[None]] = set()
        self._urgent_run = 0
        cluster.changed = self.dispatch

    def join(self, line: Line) -> None:
        """Let a line's pieces run from now on."""
        self._clients.setdefault(line.client, min(self._clients.values(), default=0.0))
        self._lines[line] = _Share()
        self.dispatch()

    def leave(self, line: Line) -> None:
        """Stop a line's pieces; the workers they run on are free a moment later. Answers there are kept."""
        if self._lines.pop(line, None) is None:
            return
        for task, turn in list(self._turns.items()):
            if turn.line is line and turn.held:
                task.cancel()
        if all(other.client != line.client for other in self._lines):
            self._clients.pop(line.client, None)

    async def close(self) -> None:
        """Stop all pieces."""
        self._lines.clear()
        tasks = [*self._turns, *self._freeing]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def dispatch(self) -> None:
        """Give every free worker to the line whose turn it is."""
        while True:
            threads = self._cluster.threads
            free = {w: n - self._busy.get(w, 0) for w, n in threads.items() if n > self._busy.get(w, 0)}
            line = self._next() if free else None
            if line is None:
                return
            worker = max(free, key=lambda w: free[w] / threads[w])
            alone = line.alone()
            if alone and free[worker] < threads[worker]:
                return  # nobody starts before a worker is empty
            self._begin(line, worker, threads[worker] if alone else 1)

    def _next(self) -> Line | None:
        waiting = [line for line in self._lines if line.waiting()]
        urgent = [line for line in waiting if line.urgent]
        others = [line for line in waiting if not line.urgent]
        if urgent and others:
            self._urgent_run += 1
            waiting = others if self._urgent_run % URGENT_RUN == 0 else urgent
        return min(waiting, key=self._rank, default=None)

    def _rank(self, line: Line) -> tuple[float, int]:
        level = math.floor(math.log2(max(self._lines[line].used / SHORT_S, 1.0)))
        return self._clients[line.client], level

    def _begin(self, line: Line, worker: str, threads: int) -> None:
        piece = line.take(worker)
        key = f"coopnav-{piece.job}-{piece.number}-{secrets.token_hex(4)}"
        turn = _Turn(line, piece, key, worker, threads, threads == self._cluster.threads[worker])
        turn.charged = self._lines[line].usual
        self._charge(line, turn.charged)
        self._busy[worker] = self._busy.get(worker, 0) + threads
        task = asyncio.create_task(self._serve(turn), name=key)
        self._turns[task] = turn
        task.add_done_callback(self._ended)

    def _ended(self, task: asyncio.Task[None]) -> None:
        """A turn that was cancelled leaves its worker at work on it: stop that first."""
        turn = self._turns.pop(task)
        if turn.held:
            freeing = asyncio.create_task(self._free(turn))
            self._freeing.add(freeing)
            freeing.add_done_callback(self._freeing.discard)

    async def _free(self, turn: _Turn) -> None:
        try:
            await self._cluster.free(turn.key, turn.worker)
        finally:
            self._give_back(turn)

    def _charge(self, line: Line, seconds: float) -> None:
        if line in self._lines:
            self._lines[line].used += seconds
            self._clients[line.client] += seconds

    def _give_back(self, turn: _Turn) -> None:
        """The turn's worker is free for others."""
        turn.held = False
        left = self._busy[turn.worker] - turn.threads
        if left > 0:
            self._busy[turn.worker] = left
        else:
            del self._busy[turn.worker]
        self.dispatch()

    def _over(self, turn: _Turn) -> float:
        """The turn has ended by itself; the seconds it took."""
        seconds = self._clock() - turn.start
        share = self._lines.get(turn.line)
        if share is not None:
            self._charge(turn.line, seconds - turn.charged)
            share.usual = 0.5 * (share.usual + seconds)
        self._give_back(turn)
        return seconds

    async def _serve(self, turn: _Turn) -> None:
        line, piece = turn.line, turn.piece
        turn.start = self._clock()
        try:
            try:
                answer = await self._cluster.run(piece, turn.key, turn.worker)
            except ClusterLost:
                line.put_back(piece)
                self._over(turn)
            except WorkerDied:
                await line.died(piece, turn.alone)
                self._over(turn)
            else:
                await line.finish(piece, answer, self._over(turn))
        except Exception as error:
            if turn.held:
                self._over(turn)
            line.fail(error)
        self.dispatch()
