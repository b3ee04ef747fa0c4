"""What a person notes on jobs, and what a job was made of."""

from __future__ import annotations

from engine.scenario import library, toml
from tests.server.living import SHORT, Live


def test_tags_and_pin_outlast_the_end_of_a_job(live: Live):
    id = live.done(SHORT)["id"]
    tagged = live.http.patch(f"/api/jobs/{id}", json={"tags": [" sea trial ", "loss", "loss"]}).json()
    assert tagged["tags"] == ["sea trial", "loss"] and tagged["pinned"] is False
    live.http.patch(f"/api/jobs/{id}", json={"pinned": True})
    listed = next(j for j in live.http.get("/api/jobs").json() if j["id"] == id)
    assert listed["tags"] == ["sea trial", "loss"] and listed["pinned"] is True
    assert listed["state"] == "done"


def test_marks_that_make_no_sense_are_refused(live: Live):
    id = live.done(SHORT)["id"]
    for body in ({"tags": [""]}, {"tags": ["x" * 41]}, {"tags": "loss"}, {"state": "done"}):
        assert live.http.patch(f"/api/jobs/{id}", json=body).status_code == 422
    assert live.job(id)["tags"] == []
    assert live.http.patch("/api/jobs/nosuchjob", json={"pinned": True}).status_code == 404


def test_the_scenario_of_a_job_runs_the_same_again(live: Live):
    job = live.done(SHORT | {"seed": 5})
    ran = live.http.get(f"/api/jobs/{job['id']}/scenario").json()
    assert ran["name"] == "first-look" and ran["changes"] == job["changes"] == SHORT["set"]
    changes = SHORT["set"] | {"trials": 1, "seed": 5}
    assert toml.loads(ran["toml"]) == toml.override(library.shipped("first-look"), changes)
    again = live.done({"scenario": ran["scenario"], "algorithms": job["algorithms"]})
    one, other = (live.http.get(f"/api/jobs/{id}/result").json()["algorithms"] for id in (job["id"], again["id"]))
    assert {n: a["subjects"] for n, a in one.items()} == {n: a["subjects"] for n, a in other.items()}
