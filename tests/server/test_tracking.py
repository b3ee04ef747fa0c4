"""The tracking family's own questions over REST."""

from __future__ import annotations

import pytest

from tests.server.living import Live


def test_an_operating_point_is_answered_with_a_verdict(live: Live):
    body = {"process": 1, "sensors": [10, 20], "prior": 10, "steps": 20, "trials": 500}
    told = live.http.post("/api/tracking/analysis", json=body).json()
    assert "worse than one sensor alone here, after 3 steps" in told["verdict"]
    assert told["steady"]["naive_fusion"]["actual"] == pytest.approx(3.9123, rel=1e-6)
    assert len(told["histories"]["naive_fusion"]["actual"]) == 21


@pytest.mark.parametrize("kind", ["one_step", "asymptotic"])
def test_a_map_has_the_asked_size_and_its_boundary(live: Live, kind: str):
    told = live.http.post("/api/tracking/regions", json={"kind": kind, "size": 40}).json()
    assert len(told["dangerous"]) == len(told["dangerous"][0]) == len(told["boundary"]) == 40
    assert {0, 1} == {cell for row in told["dangerous"] for cell in row}


def test_a_map_of_turned_ellipses_shrinks_the_dangerous_region(live: Live):
    body = {"size": 16, "elongation": 3}
    along, across = (
        live.http.post("/api/tracking/regions", json=body | {"angle_deg": angle}).json() for angle in (0, 90)
    )
    assert sum(map(sum, across["dangerous"])) < sum(map(sum, along["dangerous"]))
    assert min(map(min, across["ratios"]["intersection_to_single"])) < 0.95


def test_a_slow_target_is_answered_as_fast_as_any(live: Live):
    told = live.http.post("/api/tracking/analysis", json={"process": 1e-9, "sensors": [10, 20], "prior": 10}).json()
    assert told["steady"]["naive_fusion"]["actual"] > 1e3 * told["steady"]["single_sensor"]["actual"]


@pytest.mark.parametrize(
    ("path", "body", "key"),
    [
        ("analysis", {"process": 1, "sensors": [1, -2], "prior": 1}, "sensors"),
        ("analysis", {"process": 1, "sensors": [1], "prior": 1}, "sensors"),
        ("analysis", {"process": 1, "sensors": [1, 2], "prior": 1, "trials": 10**9}, "trials"),
        ("analysis", {"process": 1, "sensors": [1] * 8, "prior": 1, "trials": 20_000, "steps": 100}, "trials"),
        ("analysis", {"process": 1, "sensors": [1] * 8, "prior": 1, "trials": 10, "steps": 400}, "steps"),
        ("regions", {"size": 100_000}, "size"),
        ("regions", {"kind": "sideways"}, "kind"),
        ("regions", {"size": 400, "elongation": 3}, "size"),
    ],
)
def test_questions_out_of_bounds_are_problems_that_name_the_key(live: Live, path: str, body: dict, key: str):
    answer = live.http.post(f"/api/tracking/{path}", json=body)
    assert answer.status_code == 422
    assert key in answer.text


def test_a_tracking_scenario_runs_as_a_job(live: Live):
    job = live.done({"scenario": "rui-chitre-one-step", "trials": 50})
    result = live.http.get(f"/api/jobs/{job['id']}/result").json()
    assert set(result["algorithms"]["naive_fusion"]["subjects"]) == {"target-first", "target-second"}
    assert live.http.get(f"/api/jobs/{job['id']}/view").status_code == 200
