"""Whose turn it is: clients share the workers evenly, short jobs do not wait for long ones, what-ifs go first."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from engine.runner import Shard
from server.cluster import ClusterLost, WorkerDied
from server.flow import Flow
from server.work import Piece


class Workers:
    """A cluster of worker threads in which every piece takes one turn of a clock, and dies where told to."""

    def __init__(self, **threads: int) -> None:
        self.threads = threads
        self.changed: Callable[[], None] = lambda: None
        self.log: list[tuple[str, str, int]] = []
        self.breaks: dict[tuple[str, int], list[Exception]] = {}
        self.freed: list[str] = []
        self.now = 0
        self._tick = asyncio.Event()

    async def run(self, piece: Piece, key: str, worker: str) -> Any:
        self.log.append((worker, piece.job, piece.number))
        await self._tick.wait()
        faults = self.breaks.get((piece.job, piece.number))
        if faults:
            raise faults.pop(0)
        return piece.number

    async def free(self, key: str, worker: str) -> None:
        self.freed.append(worker)

    async def tick(self, times: int = 1) -> None:
        """Let everything that runs end and what follows begin."""
        await self._settle()
        for _ in range(times):
            self.now += 1
            tick, self._tick = self._tick, asyncio.Event()
            tick.set()
            await self._settle()

    async def _settle(self) -> None:
        for _ in range(20):
            await asyncio.sleep(0)


class Line:
    """A job of so many pieces."""

    def __init__(self, job: str, client: str, pieces: int, urgent: bool = False) -> None:
        self.job, self.client, self.urgent = job, client, urgent
        self.pending, self.finished, self.deaths = list(range(pieces)), [], []
        self.failure: Exception | None = None

    def waiting(self) -> bool:
        return bool(self.pending)

    def alone(self) -> bool:
        return self.pending[0] in self.deaths

    def take(self, worker: str) -> Piece:
        number = self.pending.pop(0)
        return Piece(self.job, number, "", "", Shard("a", (number,)))

    async def finish(self, piece: Piece, answer: Any, seconds: float) -> None:
        self.finished.append(answer)

    def put_back(self, piece: Piece) -> None:
        self.pending.insert(0, piece.number)

    async def died(self, piece: Piece, alone: bool) -> None:
        self.deaths.append(piece.number)
        self.pending.insert(0, piece.number)

    def fail(self, error: Exception) -> None:
        self.failure = error


@pytest.fixture
def play() -> Callable[[Callable[[], Coroutine[Any, Any, None]]], None]:
    """Runs a story on an event loop whose clock moves only by the turns of the workers."""

    def run(story: Callable[[], Coroutine[Any, Any, None]]) -> None:
        asyncio.run(asyncio.wait_for(story(), 30))

    return run


def test_two_clients_share_the_workers_evenly_however_many_jobs_one_has(play, monkeypatch):
    async def story():
        workers = Workers(w=1)
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        for n in range(9):
            flow.join(Line(f"many{n}", "ann", 5))
        flow.join(Line("few", "bob", 5))
        await workers.tick(11)
        assert Counter(job[:3] for _, job, _ in workers.log)["few"] == 5
        await flow.close()

    play(story)


def test_a_client_who_comes_late_is_not_served_for_the_time_away(play):
    async def story():
        workers = Workers(w=1)
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        flow.join(Line("early", "ann", 100))
        await workers.tick(20)
        flow.join(Line("late", "bob", 100))
        before = len(workers.log)
        await workers.tick(20)
        since = Counter(job for _, job, _ in workers.log[before:])
        assert abs(since["early"] - since["late"]) <= 1
        await flow.close()

    play(story)


def test_a_what_if_goes_before_the_rest_which_still_gets_every_fifth_turn(play):
    async def story():
        workers = Workers(w=1)
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        flow.join(Line("long", "ann", 100))
        flow.join(Line("what-if", "ann", 100, urgent=True))
        await workers.tick(20)
        assert [job for _, job, _ in workers.log][1:6] == ["what-if"] * 4 + ["long"]
        assert Counter(job for _, job, _ in workers.log[1:])["long"] == 4
        await flow.close()

    play(story)


def test_jobs_of_one_client_run_in_the_order_they_came(play):
    async def story():
        workers = Workers(w=1)
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        lines = [Line(f"job{n}", "ann", 2) for n in range(3)]
        for line in lines:
            flow.join(line)
        await workers.tick(6)
        assert [job for _, job, _ in workers.log] == ["job0", "job0", "job1", "job1", "job2", "job2"]
        assert [line.finished for line in lines] == [[0, 1]] * 3
        await flow.close()

    play(story)


def test_a_piece_whose_worker_died_gets_a_worker_to_itself(play):
    async def story():
        workers = Workers(w=3)
        workers.breaks[("a", 0)] = [WorkerDied("gone")]
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        line = Line("a", "ann", 7)
        flow.join(line)
        await workers.tick()
        assert line.deaths == [0] and len(workers.log) == 4 and workers.log[3] == ("w", "a", 0)
        await workers.tick(3)
        assert sorted(line.finished) == list(range(7))
        await flow.close()

    play(story)


def test_a_lost_cluster_costs_nothing_but_time(play):
    async def story():
        workers = Workers(w=1)
        workers.breaks[("a", 1)] = [ClusterLost("gone"), ClusterLost("gone")]
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        line = Line("a", "ann", 3)
        flow.join(line)
        await workers.tick(2)
        workers.threads = {}
        await workers.tick(2)
        assert line.finished == [0] and line.waiting()
        workers.threads = {"another": 2}
        workers.changed()
        await workers.tick(3)
        assert sorted(line.finished) == [0, 1, 2] and line.deaths == []
        await flow.close()

    play(story)


def test_a_line_that_leaves_frees_its_workers_for_the_next(play):
    async def story():
        workers = Workers(w=1, v=1)
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        ended, next_one = Line("ended", "ann", 9), Line("next", "ann", 2)
        flow.join(ended)
        flow.join(next_one)
        flow.leave(ended)
        await workers.tick(2)
        assert sorted(workers.freed) == ["v", "w"]
        assert sorted(next_one.finished) == [0, 1] and ended.finished == []
        await flow.close()

    play(story)


def test_an_estimators_error_ends_its_line(play):
    async def story():
        workers = Workers(w=1)
        workers.breaks[("a", 0)] = [ZeroDivisionError("no vehicle")]
        flow = Flow(workers, lambda: workers.now)  # pyright: ignore[reportArgumentType]
        line = Line("a", "ann", 1)
        flow.join(line)
        await workers.tick()
        assert isinstance(line.failure, ZeroDivisionError)
        await flow.close()

    play(story)
