"""A long day: jobs, streams, scenes, reports, and old jobs that make room; the server's memory stays what it was."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import psutil

from tests.server.living import SHORT
from tests.soak.rig import descriptors, rig
from tests.soak.sizes import size
from tests.soak.soak_leaks import cycle

KEEP_GB = 0.01


def test_memory_does_not_grow(tmp_path: Path, told: Callable[..., None]):
    """Growth is the median of the last fifth of the time over that of the second fifth: the first is for warming up."""
    soak_s = size("soak_s")
    memory: list[tuple[float, int]] = []
    jobs = 0
    with rig(tmp_path / "data", "--keep-gb", str(KEEP_GB)) as it:
        live, server = it.live, psutil.Process(it.server.process.pid)
        start = time.monotonic()
        before = descriptors(server)
        while (now := time.monotonic() - start) < soak_s:
            id = live.submit(SHORT | {"seed": jobs, "trials": 60})["id"]
            assert live.events(id)[-1][2]["state"] == "done"
            for what in ("result", "arrays", "report", "view"):
                assert live.http.get(f"/api/jobs/{id}/{what}").status_code in (200, 404)
            assert live.http.post("/api/jobs", json=SHORT | {"trials": 0}).status_code == 422
            assert live.http.get("/metrics").status_code == 200
            if jobs % 10 == 0:
                pinned = live.submit(SHORT | {"seed": jobs})["id"]
                live.http.patch(f"/api/jobs/{pinned}", json={"pinned": True})
                live.finished(pinned)
                cycle(live, pinned, pinned)
                live.http.delete(f"/api/jobs/{pinned}")
            jobs += 1
            memory.append((now, server.memory_info().rss))
        kept = len(live.http.get("/api/jobs").json())
        after = descriptors(server)

    def level(first: float, last: float) -> float:
        return statistics.median(rss for at, rss in memory if first * soak_s <= at < last * soak_s)

    growth = level(0.8, 1.0) / level(0.2, 0.4) - 1
    told(
        seconds=soak_s,
        jobs=jobs,
        jobs_kept=kept,
        memory_mb=[round(level(k / 5, (k + 1) / 5) / 1e6, 1) for k in range(5)],
        growth_percent=round(100 * growth, 2),
        files_and_threads=[before, after],
    )
    assert growth < 0.05
