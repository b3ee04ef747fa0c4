"""A server that is killed finishes what it accepted, once, and leaves no process behind."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import httpx
import psutil
import pytest

from server import artifacts
from server.settings import Settings
from server.store import Store
from tests.server.living import PATIENCE_S, start, until

BODY = {
    "scenario": "first-look",
    "trials": 200,
    "algorithms": ["dead_reckoning", "cekf"],
    "set": {"duration_s": 300, "report_interval_s": 10},
}


def serve(data: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(data)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def address(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().split()[-1].rstrip("/")


@pytest.fixture
def killed(tmp_path: Path) -> Iterator[tuple[Path, str, list[int]]]:
    """The data of a server killed in the middle of a job, the job's id, and the shards finished by then."""
    process = serve(tmp_path)
    try:
        with httpx.Client(base_url=address(process), timeout=PATIENCE_S) as http:
            id = http.post("/api/jobs", json=BODY).json()["id"]
            watcher = Store(tmp_path / "coopnav.sqlite")
            until(lambda: watcher.shards(id), "a finished shard")
            workers = psutil.Process(process.pid).children(recursive=True)
            process.kill()
            process.wait()
            finished, job = list(watcher.shards(id)), watcher.job(id)
            watcher.close()
        assert job is not None and job.state == "running" and len(finished) < 10
        _, alive = psutil.wait_procs(workers, timeout=PATIENCE_S)
        assert not alive, "worker processes outlived the server"
        yield tmp_path, id, finished
    finally:
        process.kill()
        process.wait()


def test_an_accepted_job_is_finished_and_no_finished_shard_runs_again(killed: tuple[Path, str, list[int]]):
    data, id, finished = killed
    store = Store(data / "coopnav.sqlite")
    for number in finished:
        path = data / "jobs" / id / f"shard-{number}.npz"
        shard, reference, tracks = artifacts.read_shard(path)
        digest = artifacts.write_shard(path, shard, reference, replace(tracks, notes=(f"shard {number} kept",)))
        store.finish_shard(id, number, digest, 0.0)
    store.close()

    server = start(Settings(data=data, port=0, workers=2))
    live = next(server)
    job = live.finished(id)
    assert job["state"] == "done"
    assert {n.partition(": ")[2] for n in job["notes"]} >= {f"shard {n} kept" for n in finished}
    told = live.http.get(f"/api/jobs/{id}/result").json()
    states = [d["state"] for _, kind, d in live.events(id) if kind == "state"]
    assert states == ["queued", "running", "done"]

    undisturbed = live.http.get(f"/api/jobs/{live.done(BODY)['id']}/result").json()
    for name, answer in undisturbed["algorithms"].items():
        assert told["algorithms"][name]["subjects"] == answer["subjects"]
    assert next(server, None) is None


def test_ctrl_c_ends_the_server_and_its_workers(tmp_path: Path):
    """A terminal sends the interrupt to every process of the group."""
    process = serve(tmp_path)
    try:
        url = address(process)
        until(lambda: httpx.get(f"{url}/api/health", timeout=PATIENCE_S).json()["ready"], "the workers")
        family = psutil.Process(process.pid).children(recursive=True)
        assert family
        for each in [psutil.Process(process.pid), *family]:
            each.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0
        _, alive = psutil.wait_procs(family, timeout=PATIENCE_S)
        assert not alive
    finally:
        process.kill()
