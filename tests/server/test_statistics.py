"""Jobs of which only statistics are kept: planned for a million trials, the same as on the command line, resumable."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from engine import statistics
from engine.scenario import library, toml
from server import artifacts
from tests.server.living import SHORT, Live

NAMES = ["dead_reckoning", "cekf"]
BODY = SHORT | {"trials": 1100, "algorithms": NAMES, "keep": "statistics"}
SCENARIO = toml.override(library.shipped("first-look"), BODY["set"] | {"trials": 1100})


def test_a_job_gives_what_the_command_line_gives(live: Live):
    job = live.done(BODY)
    told = live.http.get(f"/api/jobs/{job['id']}/result").json()
    expected = statistics.run(SCENARIO, NAMES, workers=1)
    for answer in (*told["algorithms"].values(), *expected["algorithms"].values()):
        assert answer.pop("cpu_s") > 0
    assert told == expected and told["trials"] == 1100
    assert any("1100 trials" in note and "first 5" in note for note in job["notes"])
    assert not list((live.settings.data / "jobs" / job["id"]).glob("shard-*"))


def test_its_first_trials_can_be_looked_at(live: Live):
    id = live.done(BODY)["id"]
    whole = live.done(BODY | {"trials": 5, "keep": "tracks"})["id"]
    few, all_ = (np.load(io.BytesIO(live.http.get(f"/api/jobs/{i}/arrays").content)) for i in (id, whole))
    assert set(few.files) == set(all_.files)
    for key in few.files:
        np.testing.assert_array_equal(few[key], all_[key])
    assert live.http.get(f"/api/jobs/{id}/view").json()["algorithms"]["cekf"]["trials"] == 5
    assert "1100 trials" in live.http.get(f"/api/jobs/{id}/report").text


def test_a_million_trials_are_planned_in_few_pieces_and_as_tracks_refused(live: Live):
    million = BODY | {"trials": 1_000_000}
    told = live.http.post("/api/jobs/estimate", json=million).json()
    assert told["accepted"] and told["shards"] == 2 + 2000 and told["result_bytes"] < 1e6
    refused = live.http.post("/api/jobs", json=million | {"keep": "tracks"})
    assert refused.status_code == 422 and "keeps tracks" in refused.json()["detail"]
    id = live.submit(million)["id"]
    assert live.http.post(f"/api/jobs/{id}/cancel").json()["state"] == "cancelled"


def test_what_batches_left_is_the_same_after_reading(tmp_path: Path):
    batch = replace(statistics.batches(SCENARIO, NAMES)[0], trials=range(5, 70))
    totals = statistics.run_batch(SCENARIO, batch)
    artifacts.write_totals(tmp_path / "totals.npz", totals)
    again = artifacts.read_totals(tmp_path / "totals.npz")
    for name, total in totals.items():
        assert (again[name].packets, again[name].notes) == (total.packets, total.notes)
        for subject, summary in total.summaries.items():
            assert again[name].summaries[subject].metrics() == summary.metrics()
            assert again[name].summaries[subject].curves() == summary.curves()
