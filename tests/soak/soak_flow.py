"""Ending jobs, limits, and more jobs than the queue takes."""

from __future__ import annotations

import multiprocessing
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
from distributed.diagnostics.plugin import WorkerPlugin

from server.settings import Settings
from tests.server.living import LONG, SHORT, Live, start, until
from tests.soak.rig import quantile, rig
from tests.soak.sizes import promise, size

MEMORY = 1_000_000_000


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    yield from start(Settings(data=tmp_path_factory.mktemp("flow"), port=0, workers=2, worker_memory=MEMORY))


class Hoarding(WorkerPlugin):
    """Makes a worker, and its successors, eat memory in jobs of seed 13."""

    name = "hoarding"

    def setup(self, worker: Any) -> None:
        from engine import runner

        self.whole = whole = runner.run_shard

        def instead(scenario, shard, *others):
            hoard = []
            while scenario.seed == 13:
                hoard.append(b"x" * 20_000_000)
                time.sleep(0.02)
            return whole(scenario, shard, *others)

        runner.run_shard = instead

    def teardown(self, worker: Any) -> None:
        from engine import runner

        runner.run_shard = self.whole


def test_a_worker_over_its_memory_ends_soon(live: Live, told: Callable[..., None]):
    cluster = live.app.state.site.cluster
    cluster.client.register_plugin(Hoarding())
    over: dict[psutil.Process, float] = {}
    late: list[float] = []
    try:
        id = live.submit(SHORT | {"seed": 13, "trials": 2, "algorithms": ["cekf"]})["id"]
        while live.job(id)["state"] in ("queued", "running"):
            for nanny in list(cluster._own.workers.values()):
                if nanny.pid is not None and psutil.pid_exists(nanny.pid):
                    worker = psutil.Process(nanny.pid)
                    if worker not in over and worker.memory_info().rss > 0.95 * MEMORY:
                        over[worker] = time.monotonic()
            for worker in [worker for worker in over if not worker.is_running()]:
                late.append(time.monotonic() - over.pop(worker))
            time.sleep(0.01)
    finally:
        cluster.client.unregister_worker_plugin("hoarding")
    assert live.job(id)["state"] == "failed" and not over
    told(ended=len(late), latest_s=round(max(late, default=0.0), 3))
    promise(max(late, default=0.0), 2.0)


def test_workers_are_free_soon_after_a_job_is_cancelled(live: Live, told: Callable[..., None]):
    flow = live.app.state.site.jobs._flow
    seconds = []
    for n in range(size("cancels")):
        id = live.submit(LONG | {"seed": n})["id"]
        until(lambda: len(flow._busy) == 2, "two busy workers")
        time.sleep(0.05 * (n % 10))
        begin = time.monotonic()
        assert live.http.post(f"/api/jobs/{id}/cancel").json()["state"] == "cancelled"
        until(lambda: not flow._busy, "free workers")
        seconds.append(time.monotonic() - begin)
    told(
        cancels=len(seconds),
        median_s=round(quantile(seconds, 0.5), 3),
        p99_s=round(quantile(seconds, 0.99), 3),
        max_s=round(max(seconds), 3),
    )
    promise(quantile(seconds, 0.99), 2.0)


def test_a_job_ends_soon_after_its_time_is_up(live: Live, told: Callable[..., None]):
    late = []
    for n in range(10):
        job = live.finished(live.submit(LONG | {"seed": n, "limit_s": 1.0})["id"])
        assert job["state"] == "failed" and job["error"]["title"] == "Its time is up"
        began, ended = (datetime.fromisoformat(job[key]) for key in ("started_at", "finished_at"))
        late.append((ended - began).total_seconds() - 1.0)
    told(jobs=len(late), latest_s=round(max(late), 3))
    promise(max(late), 2.0)


def watch(url: str, over: Any, measured: Any) -> None:
    """Ask for the server's health until it is over, in a process of its own, and tell how long the answers took."""
    seconds = []
    with httpx.Client(base_url=url, timeout=60) as http:
        http.get("/api/health")
        measured.put("ready")
        while not over.is_set():
            begin = time.monotonic()
            assert http.get("/api/health").json()["live"]
            seconds.append(time.monotonic() - begin)
            time.sleep(0.02)
    measured.put(seconds)


def test_ten_times_the_queue_is_refused_in_words_while_the_server_answers(tmp_path: Path, told: Callable[..., None]):
    """Twenty clients at once; jobs that do not end meanwhile."""
    most = Settings(data=tmp_path).most_jobs_waiting
    answers: Counter[int] = Counter()
    spawn = multiprocessing.get_context("spawn")
    over, measured = spawn.Event(), spawn.SimpleQueue()
    with rig(tmp_path / "data") as it:
        watching = spawn.Process(target=watch, args=(it.url, over, measured), daemon=True)
        watching.start()
        assert measured.get() == "ready"

        def ask(client: int) -> None:
            with httpx.Client(base_url=it.url, timeout=60, headers={"coopnav-client": str(client)}) as http:
                for n in range(size("overflow") * most // 20):
                    answer = http.post("/api/jobs", json=LONG | {"seed": n})
                    answers[answer.status_code] += 1
                    assert answer.status_code == 202 or "retry-after" in answer.headers

        with ThreadPoolExecutor(20) as clients:
            list(clients.map(ask, range(20)))
        over.set()
        seconds = measured.get()
    assert set(answers) == {202, 429} and answers[202] == most
    told(
        asked=answers.total(),
        accepted=answers[202],
        refused=answers[429],
        health_p99_ms=round(1e3 * quantile(seconds, 0.99)),
        health_max_ms=round(1e3 * max(seconds)),
    )
    promise(quantile(seconds, 0.99), 0.250)
