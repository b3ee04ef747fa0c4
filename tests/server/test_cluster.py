"""Jobs on somebody's Dask cluster, and what becomes of them when an estimator or a worker breaks."""

from __future__ import annotations

import gc
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster
from distributed.scheduler import TaskGroup
from distributed.security import Security

from engine import runner
from server.cluster import PROCESSES
from server.settings import Settings
from tests.server.living import SHORT, Live, start, until


@pytest.fixture(scope="module")
def theirs() -> Iterator[LocalCluster]:
    """A cluster whose one worker is a thread of this process, so that tests can break it."""
    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def remote(theirs: LocalCluster, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    data = tmp_path_factory.mktemp("remote")
    yield from start(Settings(data=data, port=0, cluster=theirs.scheduler_address))


def test_a_cluster_by_address_gives_the_same_numbers(live: Live, remote: Live):
    results = [s.http.get(f"/api/jobs/{s.done(SHORT)['id']}/result").json()["algorithms"] for s in (live, remote)]
    for name, answer in results[0].items():
        assert answer["subjects"] == results[1][name]["subjects"]


def test_a_failing_estimator_fails_its_job_in_words(remote: Live, monkeypatch: pytest.MonkeyPatch):
    whole = runner.run_shard

    def breaks(scenario, shard, progress=lambda *_: None):
        if shard.algorithm == "nekf":
            raise ZeroDivisionError("no vehicle to divide by")
        return whole(scenario, shard, progress)

    with monkeypatch.context() as patched:
        patched.setattr(runner, "run_shard", breaks)
        job = remote.finished(remote.submit(SHORT)["id"])
    assert job["state"] == "failed"
    assert "no vehicle to divide by" in job["error"]["detail"] and "Traceback" not in job["error"]["detail"]
    assert remote.events(job["id"])[-1][2]["state"] == "failed"
    assert remote.http.get(f"/api/jobs/{job['id']}/result").status_code == 409
    remote.done(SHORT)


def test_a_killed_worker_costs_a_shard_and_not_the_job(live: Live):
    id = live.submit({"scenario": "first-look", "trials": 150, "set": {"duration_s": 600}})["id"]
    live.events(id, most=4)
    site = live.app.state.site
    worker = next(iter(site.cluster._own.workers.values()))
    os.kill(worker.pid, 9)
    assert live.finished(id)["state"] == "done"
    until(lambda: live.http.get("/api/health").json()["workers"] == 2, "the worker's successor")


def test_the_scheduler_keeps_nothing_of_jobs_that_are_done(live: Live):
    def kept() -> int:
        gc.collect()
        return sum(type(thing) is TaskGroup for thing in gc.get_objects())

    remembered = PROCESSES["distributed.diagnostics.computations.max-history"]
    before = kept()  # other clusters of this process have theirs
    for seed in range(3 * remembered):
        live.done(SHORT | {"seed": seed})
    until(lambda: kept() <= before + remembered + 1, f"no more than {remembered} groups of tasks in memory", 20)


def test_a_cluster_that_does_not_answer_is_told_and_jobs_wait(tmp_path: Path):
    settings = Settings(data=tmp_path, port=0, cluster="tcp://127.0.0.1:9")
    server = start(settings, ready=lambda health: health["problem"])
    waiting = next(server)
    health = waiting.http.get("/api/health").json()
    assert health["live"] and not health["ready"] and "127.0.0.1:9" in health["problem"]
    id = waiting.submit(SHORT)["id"]
    assert waiting.job(id)["state"] == "queued"
    assert waiting.http.post(f"/api/jobs/{id}/cancel").json()["state"] == "cancelled"
    assert next(server, None) is None


def test_a_scheduler_and_workers_started_by_hand_with_certificates(live: Live, tmp_path: Path):
    """As on a cluster whose nodes are shared: nobody without the certificates gets a word in."""
    made = Security.temporary()
    pem = {name: tmp_path / f"{name}.pem" for name in ("ca", "cert", "key")}
    for file, text in zip(pem.values(), (made.tls_ca_file, made.tls_client_cert, made.tls_client_key)):
        assert isinstance(text, str)
        file.write_text(text)
    keys = ["--tls-ca-file", str(pem["ca"]), "--tls-cert", str(pem["cert"]), "--tls-key", str(pem["key"])]
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tls://127.0.0.1:{probe.getsockname()[1]}"
    at = ["--host", "tls://127.0.0.1", "--no-dashboard", *keys]
    commands = [["scheduler", "--port", address.rpartition(":")[2]], ["worker", address, "--nthreads", "1"]]
    running = [
        subprocess.Popen([sys.executable, "-m", "dask", *command, *at], stderr=subprocess.DEVNULL)
        for command in commands
    ]
    try:
        settings = Settings(
            data=tmp_path / "data",
            port=0,
            cluster=address,
            cluster_ca=pem["ca"],
            cluster_cert=pem["cert"],
            cluster_key=pem["key"],
        )
        server = start(settings)
        theirs = next(server)
        results = [s.http.get(f"/api/jobs/{s.done(SHORT)['id']}/result").json()["algorithms"] for s in (live, theirs)]
        for name, answer in results[0].items():
            assert answer["subjects"] == results[1][name]["subjects"]
        assert next(server, None) is None
    finally:
        for process in reversed(running):
            process.terminate()
            process.wait()
