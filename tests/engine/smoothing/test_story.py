"""What a run tells of its broadcasts and factor graphs, against what happened."""

from __future__ import annotations

import json
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from engine.navigation.mission import Arrival, Launch
from engine.registry import algorithms, silent
from engine.smoothing.story import ANYONE

sys.path.insert(0, str(Path(__file__).parent))
from chainlab import surfacing_mission
from loglab import make_mission

OURS = ["k_last", "k_best", "paull"]


def told(mission, name: str):
    tracks = algorithms()[name].run(mission, silent)
    assert json.loads(json.dumps(tracks.graph, allow_nan=False)) == tracks.graph
    return tracks, tracks.graph


@pytest.mark.parametrize("name", OURS)
def test_every_broadcast_is_told_with_its_bytes_and_who_received_it(name):
    mission = surfacing_mission(trials=1, loss=0.5, seed=4)
    tracks, graph = told(mission, name)
    launches = [e for e in mission.events if isinstance(e, Launch)]
    arrivals = [e for e in mission.events if isinstance(e, Arrival)]
    assert [b["tol_s"] for b in graph["broadcasts"]] == [round(e.time_s, 3) for e in launches]
    assert sum(b["bytes"] for b in graph["broadcasts"]) == tracks.packets.bytes_sent
    heard = [r["heard"] for b in graph["broadcasts"] for r in b["receivers"]]
    assert sorted(heard) == sorted(bool(np.isfinite(e.slant_m[0])) for e in arrivals)
    assert sum(heard) == tracks.packets.received
    for broadcast in graph["broadcasts"]:
        assert broadcast["links"][-1]["number"] == broadcast["number"]
        assert broadcast["links"][-1]["time_s"] == broadcast["tol_s"]
        for receiver in broadcast["receivers"]:
            if receiver["heard"]:
                assert set(receiver["new"]) <= {link["number"] for link in broadcast["links"]}


def test_a_packet_of_k_best_tells_its_own_link_and_two_with_priors():
    _, graph = told(surfacing_mission(trials=1, loss=0.5, seed=4), "k_best")
    with_priors = [sum(link["prior"] is not None for link in b["links"]) for b in graph["broadcasts"]]
    assert max(with_priors) == 2 and max(len(b["links"]) for b in graph["broadcasts"]) == 3
    assert {b["bytes"] for b in graph["broadcasts"]} == {64}


def test_launches_are_heard_told_later_or_missing_and_odometry_spans_what_is_left_out():
    mission = surfacing_mission(trials=1, loss=0.5, seed=4)
    _, graph = told(mission, "k_last")
    sent = sum(isinstance(e, Launch) and e.vehicle == 0 for e in mission.events)
    poses = graph["graphs"]["v1"]["poses"]
    of_sender = [n for n, owner in enumerate(poses["owner"]) if owner == "v0"]
    assert sorted(poses["number"][n] for n in of_sender) == list(range(sent))
    assert {poses["kind"][n] for n in of_sender} == {"heard", "told", "missing"}
    heard = sorted(poses["number"][n] for n in of_sender if poses["kind"][n] == "heard")
    spans = {
        (poses["number"][a], poses["number"][b]): left_out
        for a, b, left_out in graph["graphs"]["v1"]["odometry"]
        if poses["owner"][a] == "v0"
    }
    assert spans == {(a, b): b - a - 1 for a, b in pairwise(heard)}
    assert poses["time_s"] == sorted(poses["time_s"])
    for receiver, sender, used in graph["graphs"]["v1"]["ranges"]:
        assert used and poses["owner"][receiver] == "v1" and poses["kind"][sender] == "heard"


def test_the_smoothed_graph_is_the_centralized_smoothers_where_the_chain_is_exact():
    """Without fixes and losses, and one silent client: the same poses to 5 cm, the same marginals to 3 %."""
    mission = make_mission([(0, 1)], trials=1, seed=3, fixed_by_gps=())
    ours = told(mission, "k_best")[1]["graphs"]["v1"]["poses"]
    theirs = told(mission, "centralized_smoother")[1]["graphs"][ANYONE]["poses"]
    known = {(o, t): (xy, cov) for o, t, xy, cov in zip(*(theirs[k] for k in ("owner", "time_s", "xy", "cov")))}
    compared = 0
    for owner, time_s, xy, cov in zip(*(ours[k] for k in ("owner", "time_s", "xy", "cov"))):
        there, wanted = known[owner, time_s]
        np.testing.assert_allclose(xy, there, atol=0.05)
        if cov is not None and wanted is not None:
            np.testing.assert_allclose(cov, wanted, rtol=0.03, atol=0.02)
            compared += 1
    assert compared > 10


def test_who_only_listens_tells_the_chains_it_put_together():
    mission = surfacing_mission(options={"k_best": {"reconstruct_only": True}}, trials=1, loss=0.5, seed=4)
    _, graph = told(mission, "k_best")
    poses = graph["graphs"]["v1"]["poses"]
    assert set(poses["owner"]) == {"v0"} and "heard" in poses["kind"] and graph["graphs"]["v1"]["ranges"] == []
    received = [r for b in graph["broadcasts"] if b["sender"] == "v0" for r in b["receivers"] if r["heard"]]
    assert poses["kind"].count("heard") == len(received)


def test_fixes_are_priors_of_the_pose_after_them():
    """The vehicle that surfaces has priors, the other has none."""
    mission = surfacing_mission(trials=1, loss=0.2, seed=4)
    for name, whose in (("k_last", None), ("centralized_smoother", ANYONE)):
        _, graph = told(mission, name)
        for vehicle, expected in (("v0", True), ("v1", False)):
            poses = graph["graphs"][vehicle if whose is None else whose]["poses"]
            own = [p for p, o, k in zip(poses["prior"], poses["owner"], poses["kind"]) if o == vehicle and k == "own"]
            assert any(own) == expected
