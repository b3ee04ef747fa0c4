"""Factor graphs over REST: told by the smoothers, refused for those who keep none."""

from __future__ import annotations

from tests.server.living import Live

SMALL = {
    "scenario": "walls2015-trial-2",
    "algorithms": ["k_best", "cekf"],
    "trials": 1,
    "set": {"duration_s": 900},
}


def test_a_view_says_who_has_a_graph_and_the_graph_is_served(live: Live):
    job = live.done(SMALL)["id"]
    view = live.http.get(f"/api/jobs/{job}/view").json()
    assert {name: told["graph"] for name, told in view["algorithms"].items()} == {"k_best": True, "cekf": False}
    graph = live.http.get(f"/api/jobs/{job}/graphs/k_best")
    assert graph.status_code == 200
    told = graph.json()
    assert set(told["graphs"]) == {"auv-a", "auv-b"}
    result = live.http.get(f"/api/jobs/{job}/result").json()
    assert len(told["broadcasts"]) == result["algorithms"]["k_best"]["packets"]["sent"]
    for name in ("cekf", "nobody", "..%2Fresult"):
        answer = live.http.get(f"/api/jobs/{job}/graphs/{name}")
        assert answer.status_code == 404 and answer.headers["content-type"] == "application/problem+json"
