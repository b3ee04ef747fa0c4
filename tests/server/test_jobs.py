"""A job from submission to result."""

from __future__ import annotations

import io

import numpy as np

from engine import runner
from engine.scenario import library, toml
from tests.server.living import LONG, SHORT, Live


def test_a_job_gives_the_numbers_of_the_engine_itself(live: Live):
    job = live.done(SHORT | {"trials": 3, "seed": 11})
    changes = {"duration_s": 120, "report_interval_s": 4, "trials": 3, "seed": 11}
    own = runner.run(toml.override(library.shipped("first-look"), changes), workers=1)

    told = live.http.get(f"/api/jobs/{job['id']}/result").json()
    assert told["seed"] == 11 and told["trials"] == 3
    for name, answer in own.to_json()["algorithms"].items():
        assert told["algorithms"][name]["subjects"] == answer["subjects"]
        assert told["algorithms"][name]["packets"] == answer["packets"]
        errors = {subject: metrics["rmse_m"] for subject, metrics in answer["subjects"].items()}
        assert live.job(job["id"])["rmse_m"][name] == errors
    with np.load(io.BytesIO(live.http.get(f"/api/jobs/{job['id']}/arrays").content)) as arrays:
        expected = own.arrays()
        assert set(arrays.files) == set(expected)
        for key, value in expected.items():
            np.testing.assert_array_equal(arrays[key], value)


def test_a_jobs_life_is_told_in_order_with_its_estimates(live: Live):
    id = live.submit(SHORT)["id"]
    events = live.events(id)
    ids = [e[0] for e in events]
    assert ids == sorted(set(ids))
    states = [data["state"] for _, kind, data in events if kind == "state"]
    assert states == ["queued", "running", "done"]
    assert events[-1][1] == "state"
    fractions = [data["fraction"] for _, kind, data in events if kind == "progress"]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0

    told: dict[str, list[float]] = {}
    for _, kind, data in events:
        if kind == "estimates":
            told.setdefault(data["algorithm"], []).extend(data["time_s"])
            assert all(len(rows) == len(data["time_s"]) for rows in data["mean"].values())
    view = live.http.get(f"/api/jobs/{id}/view").json()
    assert set(told) == {"dead_reckoning", "cekf", "nekf"}
    for times in told.values():
        np.testing.assert_allclose(times, view["time_s"], atol=1e-3)


def test_events_go_on_after_the_last_one_seen(live: Live):
    id = live.done(SHORT)["id"]
    events = live.events(id)
    middle = len(events) // 2
    assert live.events(id, after=events[middle][0]) == events[middle + 1 :]
    assert live.events(id, after=events[-1][0]) == []


def test_the_same_idempotency_key_is_the_same_job(live: Live):
    first = live.submit(SHORT, **{"idempotency-key": "press-1"})
    again = live.submit(SHORT, **{"idempotency-key": "press-1"})
    other = live.submit(SHORT, **{"idempotency-key": "press-2"})
    assert again["id"] == first["id"] != other["id"]
    clash = live.http.post("/api/jobs", json=SHORT | {"seed": 99}, headers={"idempotency-key": "press-1"})
    assert clash.status_code == 409
    assert clash.headers["content-type"] == "application/problem+json"


def test_a_cancelled_job_ends_and_frees_the_workers(live: Live):
    id = live.submit(LONG)["id"]
    live.events(id, most=3)
    answer = live.http.post(f"/api/jobs/{id}/cancel")
    assert answer.json()["state"] == "cancelled"
    assert live.events(id)[-1][2]["state"] == "cancelled"
    live.done(SHORT)
    assert live.job(id)["state"] == "cancelled"
    assert live.http.get(f"/api/jobs/{id}/result").status_code == 409
    assert not list((live.settings.data / "jobs" / id).glob("shard-*"))
    assert live.http.get(f"/api/jobs/{id}/view").status_code == 204, "its parts are gone: nothing to see"


def test_a_finished_job_cannot_be_cancelled_but_deleted(live: Live):
    id = live.done(SHORT)["id"]
    assert live.http.post(f"/api/jobs/{id}/cancel").json()["state"] == "done"
    assert live.http.delete(f"/api/jobs/{id}").status_code == 204
    assert live.http.get(f"/api/jobs/{id}").status_code == 404
    assert not (live.settings.data / "jobs" / id).exists()


def test_an_inline_scenario_runs_as_the_named_one_does(live: Live):
    body = live.http.get("/api/scenarios/first-look").json()["scenario"]
    body |= {"duration_s": 120, "report_interval_s": 4, "trials": 1}
    inline = live.done({"scenario": body})
    named = live.done(SHORT)
    assert inline["scenario"] is None and named["scenario"] == "first-look"
    results = [live.http.get(f"/api/jobs/{j['id']}/result").json()["algorithms"] for j in (inline, named)]
    for name, answer in results[0].items():
        assert answer["subjects"] == results[1][name]["subjects"]


def test_the_view_is_thinned_and_has_what_the_page_draws(live: Live):
    job = live.done({"scenario": "first-look", "trials": 2, "set": {"duration_s": 1200, "report_interval_s": 1}})
    view = live.http.get(f"/api/jobs/{job['id']}/view").json()
    T = len(view["time_s"])
    assert T <= 800 and view["time_s"][0] == 0 and view["time_s"][-1] == 1200
    assert [s["name"] for s in view["subjects"]] == ["scout", "ship"]
    for answer in view["algorithms"].values():
        for curves in answer["subjects"].values():
            assert {len(curves[k]) for k in ("mean", "cov", "error_m", "sigma_m", "nees")} == {T}
    low, high = view["nees_interval"]
    assert low < 2 < high
    packets = [e for e in view["events"] if e["kind"] == "packet"]
    assert packets and all(e["tol_s"] < e["toa_s"] for e in packets)


def test_the_report_stands_alone(live: Live):
    job = live.done(SHORT)
    page = live.http.get(f"/api/jobs/{job['id']}/report")
    assert page.headers["content-type"].startswith("text/html")
    assert "First look" in page.text and "<svg" in page.text and "seed 7" in page.text
    assert "http://" not in page.text and "https://" not in page.text and "<script" not in page.text


def test_an_unknown_job_is_unknown_everywhere(live: Live):
    for path in ("", "/events", "/result", "/arrays", "/report", "/view"):
        answer = live.http.get(f"/api/jobs/nosuchjob{path}")
        assert answer.status_code == 404 and answer.json()["type"] == "urn:coopnav:unknown-job"
    assert live.http.post("/api/jobs/nosuchjob/cancel").status_code == 404
    assert live.http.delete("/api/jobs/nosuchjob").status_code == 404
