"""What becomes of a job when its workers crash, hang, eat memory, or its time is up: told, and nobody else suffers."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from distributed.diagnostics.plugin import WorkerPlugin

from engine.runner import Shard
from engine.scenario.errors import ScenarioError
from server import work
from server.settings import Settings
from server.work import Piece
from tests.server.living import LONG, SHORT, Live, start, until

MANY = SHORT | {"trials": 100, "algorithms": ["dead_reckoning", "cekf", "nekf"]}


@pytest.fixture(scope="module")
def fragile(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    """A server whose two workers may use 1 GB each."""
    yield from start(Settings(data=tmp_path_factory.mktemp("fragile"), port=0, workers=2, worker_memory=1_000_000_000))


@pytest.fixture
def spoilt(fragile: Live) -> Iterator[Callable[[str, str], Live]]:
    """A function that makes every worker, and its successors, do something else in shards of seed 13.

    It takes where ("run_shard" or "prepare" of the runner) and what: "crash", "hoard", "sleep" or "spin"; only trials
    from 50 on are spoilt.
    """
    cluster = fragile.app.state.site.cluster

    def spoil(where: str, what: str) -> Live:
        class Spoilt(WorkerPlugin):
            name = "spoilt"

            def setup(self, worker: Any) -> None:
                import os
                import time

                from engine import runner

                whole = getattr(runner, where)

                def instead(scenario, chosen, *others):
                    trials = getattr(chosen, "trials", chosen)
                    if scenario.seed == 13 and trials[0] >= 50 and getattr(chosen, "algorithm", "nekf") == "nekf":
                        if what == "crash":
                            os._exit(1)
                        if what == "hoard":
                            hoard = []
                            while True:
                                hoard.append(b"x" * 50_000_000)
                                time.sleep(0.05)
                        while what == "spin":
                            pass
                        time.sleep(3600)
                    return whole(scenario, chosen, *others)

                self.undo = lambda: setattr(runner, where, whole)
                setattr(runner, where, instead)

            def teardown(self, worker: Any) -> None:
                self.undo()

        cluster.client.register_plugin(Spoilt())
        return fragile

    yield spoil
    cluster.client.unregister_worker_plugin("spoilt")
    until(lambda: fragile.http.get("/api/health").json()["workers"] == 2, "the workers' successors")


@pytest.mark.parametrize("what", ["crash", "hoard"])
def test_a_shard_that_ends_its_worker_three_times_is_given_up_and_the_rest_is_as_ever(
    spoilt: Callable[[str, str], Live], what: str
):
    live = spoilt("run_shard", what)
    job = live.done(MANY | {"seed": 13})
    assert [{k: v for k, v in entry.items() if k != "reason"} for entry in job["lost"]] == [
        {"algorithm": "nekf", "trials": [50, 99], "seed": 13, "tries": 3}
    ]
    assert any("nekf: trials 50 to 99 of seed 13 are missing" in note for note in job["notes"])
    told = live.http.get(f"/api/jobs/{job['id']}/result").json()
    assert told["trials"] == 50 and told["lost"] == job["lost"]

    whole = live.done(MANY | {"seed": 13, "trials": 50})
    first = live.http.get(f"/api/jobs/{whole['id']}/result").json()
    for name, answer in first["algorithms"].items():
        assert told["algorithms"][name]["subjects"] == answer["subjects"]
    arrays = [np.load(io.BytesIO(live.http.get(f"/api/jobs/{j['id']}/arrays").content)) for j in (job, whole)]
    for key in arrays[0].files:
        np.testing.assert_array_equal(arrays[0][key], arrays[1][key])


def test_a_job_of_which_nothing_is_left_fails_in_words(spoilt: Callable[[str, str], Live], monkeypatch):
    live = spoilt("run_shard", "crash")
    monkeypatch.setattr("engine.runner.blocks", lambda trials: [tuple(range(50, 50 + trials))])
    job = live.finished(live.submit(SHORT | {"trials": 2, "seed": 13, "algorithms": ["nekf"]})["id"])
    assert job["state"] == "failed" and job["error"]["title"] == "Its workers died"
    assert "nekf: trials 50 to 51 of seed 13" in job["error"]["detail"]


@pytest.mark.parametrize("what", ["spin", "sleep"])
def test_cancelling_frees_a_worker_that_gives_no_sign_of_life(spoilt: Callable[[str, str], Live], what: str):
    """A mission in flight is stopped between two steps of Python; in compiled code its process is started again."""
    live = spoilt("prepare", what)
    id = live.submit(MANY | {"seed": 13})["id"]
    flow = live.app.state.site.jobs._flow
    until(lambda: live.job(id)["progress"] >= 1 / 3, "the first blocks")
    assert live.http.post(f"/api/jobs/{id}/cancel").json()["state"] == "cancelled"
    until(lambda: not flow._busy, "free workers")
    live.done(SHORT)
    assert live.job(id)["state"] == "cancelled"


def test_a_run_that_is_stopped_before_it_came_to_its_worker_does_not_begin(monkeypatch):
    monkeypatch.setattr(work, "get_worker", lambda: None)
    piece = Piece("job", 0, "no scenario", "test", Shard("cekf", (0,)))
    with pytest.raises(ScenarioError):
        work.run("topic", "early", piece)
    assert not work.stop("late")
    assert work.run("topic", "late", piece) is None


def test_a_job_whose_time_is_up_is_ended_and_says_so(fragile: Live):
    id = fragile.submit(LONG | {"limit_s": 0.5})["id"]
    job = fragile.finished(id)
    assert job["state"] == "failed" and job["error"]["title"] == "Its time is up"
    assert "0.5 s" in job["error"]["detail"]
    assert not list((fragile.settings.data / "jobs" / id).glob("shard-*"))
    fragile.done(SHORT)
