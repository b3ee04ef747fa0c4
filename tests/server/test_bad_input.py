"""Input that cannot be used gets a clear problem, leaves nothing behind, and harms nobody."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.server.living import SHORT, Live

NAMED = {"scenario": "first-look"}
JSON, TOML = {"content-type": "application/json"}, {"content-type": "application/toml"}


def check_problem(answer, status: int, *words: str) -> None:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    body = answer.json()
    assert body["status"] == status and body["type"] and body["title"] and body["detail"]
    for word in words:
        assert word in answer.text
    assert "Traceback" not in answer.text


@pytest.mark.parametrize(
    ("body", "status", "word"),
    [
        ({"scenario": "no-such-mission"}, 404, "no-such-mission"),
        ({"scenario": "../../etc/passwd"}, 404, "no scenario"),
        ({"scenario": "/etc/passwd"}, 404, "no scenario"),
        ({}, 422, "scenario"),
        (NAMED | {"algorithms": ["teleportation"]}, 422, "teleportation"),
        (NAMED | {"algorithms": []}, 422, "algorithm"),
        (NAMED | {"trials": 0}, 422, "trials"),
        (NAMED | {"trials": 1_000_000}, 422, "trials"),
        (NAMED | {"trials": 100_000}, 422, "GB"),
        (NAMED | {"trials": 1.5}, 422, "trials"),
        (NAMED | {"seed": -1}, 422, "seed"),
        (NAMED | {"seed": 2**70}, 422, "seed"),
        (NAMED | {"unknown": 1}, 422, "unknown"),
        (NAMED | {"set": {"network.lss": 0.4}}, 422, "network.lss"),
        (NAMED | {"set": {"network.loss": 2}}, 422, "network.loss"),
        (NAMED | {"set": {"": 1}}, 422, "key"),
        (NAMED | {"set": {"network": None}}, 422, ""),
        (NAMED | {"set": {"vehicles.scout.sensors.modem.range_sigma_m": -1}}, 422, "range_sigma_m"),
        ({"scenario": {}}, 422, "schema"),
        ({"scenario": {"schema": 1, "title": "x", "family": "alchemy"}}, 422, "family"),
        ({"scenario": ["list"]}, 422, "scenario"),
    ],
)
def test_a_bad_submission_is_a_problem(
    live: Live, data_files: Callable[[], set[Path]], body: dict, status: int, word: str
):
    before, jobs = data_files(), live.http.get("/api/jobs").json()
    check_problem(live.http.post("/api/jobs", json=body), status, word)
    assert data_files() == before
    assert [j["id"] for j in live.http.get("/api/jobs").json()] == [j["id"] for j in jobs]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "",
        "null",
        "[]",
        '{"scenario": "first-look", "trials": NaN}',
        '{"scenario": "first-look", "set": {"network.loss": NaN}}',
        '{"scenario": "first-look", "set": {"duration_s": Infinity}}',
        '{"scenario": {"schema": 1, "title": "\\ud800", "family": "navigation"}}',
        '{"scenario": "\\ud800"}',
        '{"scenario": "first-look", "algorithms": ["\\ud800"]}',
        '{"scenario": "first-look", "set": {"\\ud800": 1}}',
        '{"scenario": ' + "[" * 5000 + "]" * 5000 + "}",
        '{"scenario": {"a": ' + '{"a":' * 900 + "1" + "}" * 900 + "}}",
    ],
)
def test_text_that_is_hardly_json_is_a_problem(live: Live, text: str):
    answer = live.http.post("/api/jobs", content=text, headers=JSON)
    assert answer.status_code in (400, 404, 422)
    check_problem(answer, answer.status_code)


@pytest.mark.parametrize(
    ("name", "headers", "text", "status"),
    [
        ("mine", TOML, "title = = 1", 422),
        ("mine", TOML, b"title = '\xff'", 422),
        ("mine", TOML, "schema = 1", 422),
        ("mine", TOML, "schema = 2\ntitle = 'x'\nfamily = 'navigation'", 422),
        ("mine", JSON, "{", 422),
        ("mine", JSON, "3", 422),
        ("mine", {"content-type": "text/plain"}, "x", 415),
        ("Mine", TOML, None, 422),
        ("a" * 65, TOML, None, 422),
        ("..%2Fmine", TOML, None, 404),
        ("%2e%2e", TOML, None, 422),
        ("first-look", TOML, None, 403),
    ],
)
def test_a_bad_scenario_is_not_saved(
    live: Live, data_files: Callable[[], set[Path]], name: str, headers: dict, text, status: int
):
    before = data_files()
    content = live.http.get("/api/scenarios/first-look").json()["toml"] if text is None else text
    check_problem(live.http.put(f"/api/scenarios/{name}", content=content, headers=headers), status)
    assert data_files() == before


def test_a_body_too_large_is_refused_before_it_is_read(live: Live):
    huge = b'{"scenario": "' + b"x" * live.settings.largest_body + b'"}'
    check_problem(live.http.post("/api/jobs", content=huge, headers=JSON), 413)

    def in_parts():
        for _ in range(live.settings.largest_body // 65536 + 2):
            yield b"x" * 65536

    check_problem(live.http.post("/api/jobs", content=in_parts(), headers=JSON), 413)


@pytest.mark.parametrize("after", ["", "-1", "x", "9" * 40, "１"])
def test_a_strange_last_event_id_does_no_harm(live: Live, after: str):
    id = live.done(SHORT)["id"]
    answer = live.http.get(f"/api/jobs/{id}/events", headers={"last-event-id": after.encode()})
    assert answer.status_code == 200


def test_the_server_still_works_after_all_that(live: Live):
    assert live.done(SHORT)["state"] == "done"
