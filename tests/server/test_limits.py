"""How much a server takes on: a bounded queue, keys that stand for one job, and what goes before other jobs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from server.settings import Settings
from tests.server.living import SHORT, Live, start
from tests.server.test_bad_input import check_problem


@pytest.fixture
def idle(tmp_path) -> Iterator[Live]:
    """A server whose cluster is away: what it accepts waits."""
    limits = {"most_jobs_waiting": 3, "most_jobs_of_client": 2}
    yield from start(
        Settings(data=tmp_path, port=0, cluster="tcp://127.0.0.1:9", **limits), ready=lambda health: health["live"]
    )


def post(live: Live, client: str, **headers: str):
    return live.http.post("/api/jobs", json=SHORT, headers={"coopnav-client": client} | headers)


def test_a_full_queue_is_told_and_takes_jobs_again_when_one_has_ended(idle: Live):
    mine = [post(idle, "ann", **{"idempotency-key": f"press-{n}"}) for n in range(2)]
    assert [answer.status_code for answer in mine] == [202, 202]
    check_problem(post(idle, "ann"), 429, "2 jobs of yours")
    assert post(idle, "bob").status_code == 202
    refused = post(idle, "eve")
    check_problem(refused, 429, "3 jobs are waiting")
    assert int(refused.headers["retry-after"]) > 0

    again = post(idle, "ann", **{"idempotency-key": "press-1"})
    assert again.status_code == 202 and again.json()["id"] == mine[1].json()["id"]
    assert idle.http.post(f"/api/jobs/{mine[0].json()['id']}/cancel").json()["state"] == "cancelled"
    assert post(idle, "eve").status_code == 202


def test_no_more_than_the_queue_holds_is_accepted_however_many_come_at_once(idle: Live):
    with ThreadPoolExecutor(8) as pool:
        answers = Counter(pool.map(lambda n: post(idle, f"client-{n}").status_code, range(16)))
    assert answers == {202: 3, 429: 13}
    assert len(idle.http.get("/api/jobs").json()) == 3
    assert len(list((idle.settings.data / "jobs").iterdir())) == 3, "nothing is left of those refused"


def test_a_key_is_of_bounded_length(idle: Live):
    check_problem(post(idle, "ann", **{"idempotency-key": "k" * 201}), 422, "idempotency-key")


def test_a_what_if_that_takes_long_stands_in_line_like_any_other(idle: Live):
    small = idle.submit(SHORT | {"purpose": "what-if"})
    day = {"duration_s": 86400, "report_interval_s": 600}
    large = idle.submit(SHORT | {"purpose": "what-if", "trials": 400, "set": day})
    assert (small["purpose"], large["purpose"]) == ("what-if", "run")
