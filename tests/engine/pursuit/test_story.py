"""What a watcher is told, against what happened."""

from __future__ import annotations

import json

import numpy as np

from engine.pursuit import centralized, decentralized
from engine.pursuit.options import PursuitOptions
from engine.registry import silent
from tests.engine.pursuit.pursuits import NAMES, mission

OPTIONS = PursuitOptions()


def test_the_story_of_a_cycle_without_loss_is_that_of_figure_3_3():
    told = decentralized.fly(mission(), OPTIONS, True, silent)[1].graph
    assert json.loads(json.dumps(told)) == told
    assert told["holders"] == list(NAMES) and told["cycle_s"] == 28.0
    first = [s for s in told["slots"] if s["cycle"] == 0]
    assert [s["sender"] for s in first] == ["target", *NAMES]
    assert [s["kinds"] for s in first] == [[0, 0, 0], [0, 1, 1], [1, 0, 2], [2, 2, 0]]
    assert first[0]["heard"] == list(NAMES) and first[1]["heard"] == ["silvana", "kestrel"]
    assert first[2]["known"] == [[True, True, False], [True, True, False], [True, True, True]]


def test_the_shores_story_has_one_holder_and_its_command():
    told = centralized.fly(mission(), OPTIONS, silent)[1].graph
    assert told["holders"] == ["shore"] and told["cycle_s"] == 35.0
    first = [s for s in told["slots"] if s["cycle"] == 0]
    assert [s["sender"] for s in first] == ["target", *NAMES, "shore"]
    assert first[1]["heard"] == ["silvana", "kestrel", "shore"]
    before, after = np.array(first[3]["waypoints_m"]), np.array(first[4]["waypoints_m"])
    assert (np.abs(after - before).max(axis=1) > 0).all()
    np.testing.assert_allclose(after - after.mean(axis=0), told["offsets_m"], atol=0.02)


def test_waypoints_are_the_aim_in_formation_once_a_vehicle_has_updated():
    told = decentralized.fly(mission(), OPTIONS, True, silent)[1].graph
    last = told["slots"][3]
    for h, name in ((0, "nostromo"), (1, "silvana")):
        assert last["kinds"][h] == 2, name
        np.testing.assert_allclose(np.array(last["aim_m"][h]) + told["offsets_m"][h], last["waypoints_m"][h], atol=0.02)


def test_arrivals_less_distances_are_the_same_for_all_but_noise():
    told = decentralized.fly(mission(), OPTIONS, True, silent)[1].graph
    flight = mission()
    ping = told["pings"][3]
    source = flight.target_at(ping["time_s"])[0]
    left = np.array(ping["arrivals_m"]) - np.linalg.norm(np.array(ping["places_m"]) - source, axis=1)
    assert np.ptp(left) < 2.0  # 0.2 m of noise, and the way the target makes within its clock's jitter
