"""Scenarios over REST: read the shipped ones, keep one's own."""

from __future__ import annotations

from engine.scenario import library
from tests.server.living import Live


def test_shipped_scenarios_are_listed_in_brief(live: Live):
    entries = {e["name"]: e for e in live.http.get("/api/scenarios").json()}
    assert set(library.names()) <= set(entries)
    first = entries["first-look"]
    assert first["shipped"] and first["available"] and first["missing"] is None
    assert first["vehicles"] == ["scout", "ship"]
    assert first["algorithms"] == ["dead_reckoning", "cekf", "nekf"]


def test_a_saved_scenario_comes_back_runs_and_goes(live: Live):
    shipped = live.http.get("/api/scenarios/first-look").json()
    mine = shipped["scenario"] | {"title": "Mine", "duration_s": 60}
    assert live.http.put("/api/scenarios/mine", json=mine).status_code == 201
    back = live.http.get("/api/scenarios/mine").json()
    assert back["scenario"] == mine and not back["shipped"]
    as_toml = live.http.put("/api/scenarios/mine", content=back["toml"], headers={"content-type": "application/toml"})
    assert as_toml.status_code == 200 and as_toml.json()["scenario"] == mine
    assert live.done({"scenario": "mine", "trials": 1})["title"] == "Mine"
    assert live.http.delete("/api/scenarios/mine").status_code == 204
    assert live.http.get("/api/scenarios/mine").status_code == 404
    assert live.http.delete("/api/scenarios/mine").status_code == 404


def test_shipped_scenarios_stay(live: Live):
    assert live.http.delete("/api/scenarios/first-look").status_code == 403
    assert live.http.get("/api/scenarios/first-look").status_code == 200


def test_algorithms_say_what_they_are(live: Live):
    entries = {e["name"]: e for e in live.http.get("/api/algorithms").json()}
    assert entries["cekf"]["centralized"] and not entries["nekf"]["centralized"]
    assert entries["nekf"]["accepts_families"] == ["navigation"]


def test_the_documentation_names_every_path_and_fetches_nothing(live: Live):
    page = live.http.get("/api/docs").text
    spec = live.http.get("/api/openapi.json").json()
    assert "/api/jobs/{id}/events" in spec["paths"]
    for path in spec["paths"]:
        assert path in page
    assert "http://" not in page and "https://" not in page and "<script" not in page
