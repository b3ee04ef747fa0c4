"""Scenarios over REST: read the shipped ones, keep one's own."""

from __future__ import annotations

from engine.scenario import library
from server import shelf
from tests.server.living import Live

TOML = {"content-type": "application/toml"}


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


def test_saved_scenarios_are_limited_in_number(live: Live, monkeypatch):
    text = live.http.get("/api/scenarios/first-look").json()["toml"]
    kept = sum(1 for _ in (live.settings.data / "scenarios").glob("*.toml"))
    monkeypatch.setattr(shelf, "MOST", kept + 1)
    answers = [live.http.put(f"/api/scenarios/limit-{n}", content=text, headers=TOML) for n in (0, 1, 0)]
    assert [a.status_code for a in answers] == [201, 422, 200]
    assert "delete some" in answers[1].json()["detail"]
    assert live.http.delete("/api/scenarios/limit-0").status_code == 204


def test_an_edited_scenario_comes_as_json_and_toml_and_is_not_kept(live: Live):
    edits = {"set": {"network.loss": 0.5, "vehicles.scout.sensors.modem.range_sigma_m": 2.0}}
    edited = live.http.post("/api/scenarios/first-look/edited", json=edits).json()
    assert edited["scenario"]["network"]["loss"] == 0.5 and "loss = 0.5" in edited["toml"]
    assert edited["scenario"]["vehicles"][0]["sensors"]["modem"]["range_sigma_m"] == 2.0
    assert live.http.get("/api/scenarios/first-look").json()["scenario"]["network"]["loss"] == 0.2
    wrong = live.http.post("/api/scenarios/first-look/edited", json={"set": {"network.loss": 7}})
    assert wrong.status_code == 422 and wrong.json()["errors"][0]["key"] == "network.loss"


def test_every_family_tells_its_schema(live: Live):
    for family in {e["family"] for e in live.http.get("/api/scenarios").json()}:
        schema = live.http.get(f"/api/schemas/{family}").json()
        assert {"title", "seed", "trials", "duration_s"} <= set(schema["properties"])
    assert live.http.get("/api/schemas/nosuch").status_code == 404


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
