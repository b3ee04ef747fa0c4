"""What a pane draws of a pursuit, against the geometry it stands for."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.pursuit import centralized, decentralized
from engine.pursuit.options import PursuitOptions
from engine.registry import silent
from server.scenes import palette, pursuit
from server.scenes.geometry import chart
from tests.engine.pursuit.pursuits import NAMES, mission

SUBJECTS = [*NAMES, *(f"target-{name}" for name in NAMES)]
CHART = chart(np.array([[-500.0, -500.0], [500.0, 500.0]]), 0.0)


@given(
    st.floats(-0.98, 0.98),
    st.floats(0, 2 * np.pi),
    st.floats(1.0, 400.0),
    st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
)
def test_every_point_of_a_hyperbola_has_the_difference_of_distances(share, angle, length, start):
    near = np.array(start)
    far = near + length * np.array([np.cos(angle), np.sin(angle)])
    line = pursuit.hyperbola(near, far, share * length, 3 * length)
    difference = np.linalg.norm(line - far, axis=1) - np.linalg.norm(line - near, axis=1)
    np.testing.assert_allclose(difference, share * length, atol=1e-6 * length)
    assert np.linalg.norm(line - 0.5 * (near + far), axis=1).max() == pytest.approx(3 * length, rel=1e-6)


@pytest.mark.parametrize("farther", [100.0, -100.0, 250.0])
def test_a_difference_that_no_place_has_draws_nothing(farther):
    assert pursuit.hyperbola(np.zeros(2), np.array([100.0, 0.0]), farther, 300.0).shape == (0, 2)


@pytest.fixture(scope="module")
def told():
    """A decentralized pursuit's story, as it is after a file, with the truth it is about."""
    flight = mission()
    _, tracks = decentralized.fly(flight, PursuitOptions(), True, silent)
    found = pursuit.read(json.loads(json.dumps(tracks.graph)), SUBJECTS)
    assert found is not None
    return flight, tracks, found


def drawn(told, moment_s: float, whose: str | None) -> pursuit.Drawing:
    flight, tracks, found = told
    n = int(np.searchsorted(flight.time_s, moment_s))
    now = {s: b.mean[0, n] for s, b in tracks.beliefs.items()}
    return pursuit.drawing(found, moment_s, CHART, palette.LIGHT, whose, now, flight.target_at(moment_s)[0])


def test_the_hyperbolas_of_full_information_meet_where_the_target_was_at_the_ping(told):
    flight, _, _ = told
    with_them, without = drawn(told, 250.0, "target-kestrel"), drawn(told, 250.0, None)
    extra = [
        line for line in with_them.lines if not any(line.shape == o.shape and (line == o).all() for o in without.lines)
    ]
    assert len(extra) == 2
    ping = CHART.place(flight.target_at(224.0)[0])
    for line in extra:
        assert np.linalg.norm(line[:, 0, :2] - ping[:2], axis=1).min() < 0.06
    assert len(with_them.thin) == len(without.thin) + 4


def test_before_anybody_has_spoken_nobody_has_a_hyperbola(told):
    early = drawn(told, 3.0, "nostromo")
    assert len(early.lines) == len(drawn(told, 3.0, None).lines)


def test_messages_go_from_the_sender_to_everybody_while_they_are_under_way(told):
    """At 8 s nostromo speaks: two lines from its place. At 6 s the ping is over and nobody speaks."""
    speaking, silence = drawn(told, 8.0, None), drawn(told, 6.99, None)
    rays = [line for line in speaking.lines if line.shape == (1, 2, 3)]
    assert len(rays) == 2
    starts = np.array([line[0, 0] for line in rays])
    np.testing.assert_allclose(starts[0], starts[1])
    assert not [line for line in silence.lines if line.shape == (1, 2, 3) and (line == rays[0]).all()]


def test_the_shores_knowledge_is_drawn_for_any_vehicle():
    flight = mission()
    _, tracks = centralized.fly(flight, PursuitOptions(), silent)
    found = pursuit.read(tracks.graph, SUBJECTS)
    assert found is not None
    now = {s: b.mean[0, 30] for s, b in tracks.beliefs.items()}
    lines = [
        len(pursuit.drawing(found, 309.0, CHART, palette.LIGHT, whose, now, None).lines) for whose in ("nostromo", None)
    ]
    assert lines[0] == lines[1] + 2


def test_what_tells_of_no_schedule_has_no_layer():
    assert pursuit.read({"graphs": {}}, SUBJECTS) is None
    assert pursuit.read({}, SUBJECTS) is None
