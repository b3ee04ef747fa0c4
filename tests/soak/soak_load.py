"""Fifty browsers' event streams and five hundred reads a second while a job runs: how long the answers take."""

from __future__ import annotations

import asyncio
import itertools
import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tests.server.living import LONG, SHORT
from tests.soak.rig import quantile, rig
from tests.soak.sizes import promise, size

CONNECTIONS = 25


async def ask(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, path: str) -> int:
    """A GET over a connection that stays open; the status."""
    writer.write(f"GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n".encode())
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower()
    length = next((int(line[15:]) for line in head.split("\r\n") if line.startswith("content-length:")), 0)
    await reader.readexactly(length)
    return int(head.split(maxsplit=2)[1])


async def read(port: int, paths: Sequence[str], rate: float, for_s: float) -> tuple[list[float], Counter[int]]:
    """Reads at a fixed rate, each timed from when it was due: a late one counts its waiting."""
    seconds: list[float] = []
    answers: Counter[int] = Counter()
    start = time.monotonic() + 0.5
    turns = itertools.count()

    async def connection() -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        while (turn := next(turns)) < rate * for_s:
            due = start + turn / rate
            await asyncio.sleep(due - time.monotonic())
            answers[await ask(reader, writer, paths[turn % len(paths)])] += 1
            seconds.append(time.monotonic() - due)
        writer.close()

    await asyncio.gather(*(connection() for _ in range(CONNECTIONS)))
    return seconds, answers


async def follow(port: int, paths: Sequence[str], for_s: float) -> int:
    """Event streams, one connection each; the events they brought."""
    events = 0

    async def stream(path: str) -> None:
        nonlocal events
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(f"GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n".encode())
        while line := await reader.readline():
            events += line.startswith(b"id:")
        writer.close()

    streams = [asyncio.create_task(stream(path)) for path in paths]
    await asyncio.sleep(for_s)
    for task in streams:
        assert not task.done() or task.exception() is None
        task.cancel()
    await asyncio.gather(*streams, return_exceptions=True)
    return events


async def _both(port: int, paths: Sequence[str], streams: Sequence[str], rate: float, for_s: float) -> Any:
    return await asyncio.gather(read(port, paths, rate, for_s), follow(port, streams, for_s))


def browse(port: int, paths: Sequence[str], streams: Sequence[str], rate: float, for_s: float, told: Any) -> None:
    """Load the server from a process of its own."""
    told.put(asyncio.run(_both(port, paths, streams, rate, for_s)))


def test_reads_are_answered_soon_under_load(tmp_path: Path, told: Callable[..., None]):
    rate, for_s = size("reads_per_s"), size("load_s")
    with rig(tmp_path / "data") as it:
        done = it.live.done(SHORT)["id"]
        running = it.live.submit(LONG | {"trials": 6_000})["id"]
        paths = [
            "/api/health",
            f"/api/jobs/{done}",
            f"/api/jobs/{running}",
            f"/api/jobs/{done}/result",
            "/static/main.js",
        ]
        spawn = multiprocessing.get_context("spawn")
        measured = spawn.SimpleQueue()
        streams = [f"/api/jobs/{running}/events"] * size("streams")
        spawn.Process(target=browse, args=(it.port, paths, streams, rate, for_s, measured), daemon=True).start()
        (seconds, answers), events = measured.get()
        state = it.live.job(running)["state"]
    assert set(answers) == {200} and state == "running"
    told(
        reads=len(seconds),
        reads_per_s=rate,
        streams=len(streams),
        events=events,
        median_ms=round(1e3 * quantile(seconds, 0.5), 1),
        p99_ms=round(1e3 * quantile(seconds, 0.99), 1),
        max_ms=round(1e3 * max(seconds), 1),
    )
    promise(quantile(seconds, 0.99), 0.250)
