"""The running record of jobs: events go to the store in batches, and readers are woken after each."""

from __future__ import annotations

import asyncio
import logging
import sqlite3
from collections.abc import AsyncIterator
from typing import Any

from server.store import FINAL, Event, Store
from server.wire import dumps

#: Events that arrive within this time are committed together.
BATCH_S = 0.03
#: Pause before the next attempt where the disk is full, and how many events wait for it at most, the newest.
AGAIN_S, MOST_WAITING = 1.0, 10_000

#: Events read at a time.
MOST_EVENTS = 100

log = logging.getLogger(__name__)


class Journal:
    """Appends and follows events; belongs to one event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._waiting: list[tuple[str, str, str]] = []
        self._writing: asyncio.Task[None] | None = None
        self._news = asyncio.Event()
        self.closing = asyncio.Event()
        self._committing = asyncio.Lock()

    def say(self, job: str, kind: str, data: Any) -> None:
        """Record an event soon."""
        self._waiting.append((job, kind, dumps(data)))
        if self._writing is None or self._writing.done():
            self._writing = asyncio.create_task(self._write())

    async def _write(self) -> None:
        """Commit what there is, waiting for room on the disk if need be."""
        pause_s = BATCH_S
        while self._waiting and not self.closing.is_set():
            await asyncio.sleep(pause_s)
            try:
                await self._commit()
                pause_s = BATCH_S
            except sqlite3.OperationalError as error:
                log.error("events cannot be recorded: %s", error)
                pause_s = AGAIN_S

    async def _commit(self) -> None:
        async with self._committing:
            batch, self._waiting = self._waiting, []
            try:
                if batch:
                    await asyncio.to_thread(self._store.append, batch)
            except sqlite3.OperationalError:
                self._waiting = [*batch, *self._waiting][-MOST_WAITING:]
                raise
        self.wake()

    async def flush(self) -> None:
        """Return when everything said so far is in the store; sqlite3.OperationalError where that is not possible."""
        await self._commit()

    def wake(self) -> None:
        """Let readers look at the store again."""
        self._news.set()
        self._news = asyncio.Event()

    def close(self) -> None:
        """End all readers: the server is going down."""
        self.closing.set()
        self.wake()

    async def follow(self, job: str, after: int = 0, pause_s: float = 15.0) -> AsyncIterator[Event | None]:
        """A job's events after an event id as they come, up to its final state; None when it was quiet for long.

        Ends where the job has ended, is deleted, or the server closes.
        """
        running = False  # known to run, since its last events told of no state: it need not be asked
        while not self.closing.is_set():
            news = self._news
            found = None if running else self._store.job(job)
            ended = not running and (found is None or found.state in FINAL)
            events = self._store.events(job, after, MOST_EVENTS)
            for event in events:
                yield event
                after = event.id
            read_all = len(events) < MOST_EVENTS
            if ended and read_all:
                return
            # A job that was woken for and tells nothing may have been deleted.
            in_doubt = running if not events else any(event.kind == "state" for event in events)
            running = bool(events) and not in_doubt
            if in_doubt or not read_all:
                continue
            try:
                await asyncio.wait_for(news.wait(), pause_s)
            except TimeoutError:
                running = False
                yield None
