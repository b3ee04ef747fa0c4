"""Jobs while server, scheduler and workers are killed at random: each is done once, with the numbers of a quiet run."""

from __future__ import annotations

import contextlib
import io
import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
import pytest

from engine import runner
from engine.scenario import library, toml
from tests.server.living import until
from tests.soak.rig import Rig, rig
from tests.soak.sizes import promise, size

ALGORITHMS = ["dead_reckoning", "cekf", "nekf", "mdeif"]
CHANGES = {"duration_s": 600.0, "report_interval_s": 10.0}
TRIALS, SEEDS = 120, 8


def body(n: int) -> dict[str, Any]:
    return {"scenario": "first-look", "trials": TRIALS, "algorithms": ALGORITHMS, "seed": n % SEEDS, "set": CHANGES}


def submit(rig: Rig, n: int) -> str:
    """Ask until there is an answer, always under the same key: the answer may be lost and the job accepted."""

    def asked() -> str | None:
        with contextlib.suppress(httpx.TransportError):
            answer = rig.http.post("/api/jobs", json=body(n), headers={"idempotency-key": f"job-{n}"}, timeout=10)
            if answer.status_code == 202:
                return answer.json()["id"]
            assert answer.status_code in (429, 503), answer.text
        time.sleep(0.1)
        return None

    return until(asked, "an accepted job", 600)


def done(rig: Rig) -> int:
    """How many jobs are done; none while the server is away."""
    with contextlib.suppress(httpx.TransportError):
        return sum(job["state"] == "done" for job in rig.http.get("/api/jobs", timeout=10).json())
    return 0


@pytest.mark.parametrize("cluster", [False, True], ids=["own workers", "a cluster by address"])
def test_every_job_is_done_once_whatever_is_killed(tmp_path: Path, told: Callable[..., None], cluster: bool):
    jobs, kills = size("jobs"), size("kills")
    chance = random.Random(7)
    killed: Counter[str] = Counter()
    ready_again: list[float] = []
    start = time.monotonic()
    with rig(tmp_path / "data", cluster=cluster) as it:
        ids: dict[int, str] = {}
        submitting = threading.Thread(target=lambda: ids.update((n, submit(it, n)) for n in range(jobs)), daemon=True)
        submitting.start()
        for kill in range(kills):
            until(lambda due=jobs * kill // (kills + 1): done(it) >= due, "jobs between two kills", 900)
            time.sleep(chance.uniform(0.0, 0.5))
            what = chance.choice(["server", "worker", "worker", *(["scheduler"] if cluster else [])])
            if what == "worker":
                with contextlib.suppress(IndexError, psutil.NoSuchProcess):
                    chance.choice(it.workers()).kill()
                it.ready()
            else:
                it.services[0 if what == "server" else 1].kill()
                ready_again.append(it.ready())
            killed[what] += 1
        submitting.join(600)
        until(lambda: done(it) == jobs, "the last job", 900)
        elapsed_s = time.monotonic() - start

        assert len(set(ids.values())) == jobs
        listed = {job["id"]: job for job in it.http.get("/api/jobs").json()}
        assert set(listed) == set(ids.values())
        assert all(job["state"] == "done" and not job["lost"] for job in listed.values())
        quiet = [runner.run(scenario(seed), ALGORITHMS, workers=1) for seed in range(SEEDS)]
        for n, id in ids.items():
            assert submit(it, n) == id
            states = [data["state"] for _, kind, data in it.live.events(id) if kind == "state"]
            assert states[-1] == "done" and states.count("done") == 1
            compare(it, id, quiet[n % SEEDS])
        other = it.http.post("/api/jobs", json=body(1) | {"trials": 1}, headers={"idempotency-key": "job-1"})
        assert other.status_code == 409
    told(
        jobs=jobs,
        killed=dict(killed),
        identical=jobs,
        ready_again_max_s=round(max(ready_again, default=0.0), 2),
        elapsed_s=round(elapsed_s),
    )
    promise(max(ready_again, default=0.0), 5.0)


def scenario(seed: int) -> Any:
    return toml.override(library.shipped("first-look"), CHANGES | {"trials": TRIALS, "seed": seed})


def compare(it: Rig, id: str, quiet: Any) -> None:
    """A job's files hold the numbers of a run that nobody disturbed, to the last bit."""
    with np.load(io.BytesIO(it.http.get(f"/api/jobs/{id}/arrays").content)) as arrays:
        expected = quiet.arrays()
        assert set(arrays.files) == set(expected)
        for key in arrays.files:
            assert arrays[key].tobytes() == expected[key].tobytes(), key
    found, wanted = it.http.get(f"/api/jobs/{id}/result").json()["algorithms"], quiet.to_json()["algorithms"]
    for name in ALGORITHMS:
        assert (found[name]["subjects"], found[name]["packets"]) == (wanted[name]["subjects"], wanted[name]["packets"])
