from __future__ import annotations

import numpy as np
import pytest

from engine.slam.log import evenly
from engine.slam.mission import fly, outline
from engine.slam.simulate import listen, records
from tests.engine.slam.missions import scenario


@pytest.fixture(scope="module")
def mission():
    return fly(scenario(), [0, 1])


def test_odometry_drifts_as_a_random_walk_of_the_velocity():
    """Increments are off by 0.2 m/s each second: after 99 of them the reckoned place is by 0.2 sqrt(99) m per axis."""
    flown = fly(scenario(ranging={"count": 0}, arrays={"count": 0}, odometry={"drift_mps": 0.2}), range(200))
    moved = flown.truth["auv"][0, -1] - flown.truth["auv"][0, 0]
    off = np.array([flown.log(k).steps.sum(0) - moved for k in range(200)])
    assert off.std() == pytest.approx(0.2 * np.sqrt(99), rel=0.1)
    assert np.allclose(flown.log(0).step_cov, 0.04 * np.eye(2))


def test_fixes_are_at_both_ends_and_evenly_between(mission):
    assert mission.log(0).fixed == (0, 99)
    log = fly(scenario(fixes={"count": 4, "sigma_m": 0.5}), [0]).log(0)
    assert log.fixed == (0, 33, 66, 99) and evenly(1, 10) == [0]
    assert (log.fix_m - mission.truth["auv"][0]).std() == pytest.approx(0.5, rel=0.2)


def test_arrays_are_consecutive_poses_from_the_first_to_the_last(mission):
    arrays = mission.log(0).arrays
    assert [a.poses for a in arrays] == [tuple(range(s, s + 8)) for s in (0, 31, 61, 92)]


def test_most_pings_say_where_the_beacon_is_and_the_rest_admit_that_they_do_not_know(mission):
    """At 12 dB after the matched filter; a range density never leaves the truth without any mass near it by far."""
    auv, beacon = mission.truth["auv"][0], mission.truth["beacon"][0]
    log, right = mission.log(0), []
    assert [p.pose for p in log.pings] == evenly(20, 100)
    for ping in log.pings:
        truth = np.linalg.norm(auv[ping.pose] - beacon[ping.pose])
        near = np.abs(ping.ranges_m - truth) < 0.74
        assert ping.density.sum() == pytest.approx(1.0, abs=1e-3)
        right.append(ping.density[near].sum())
    assert np.median(right) > 0.5


def test_an_array_hears_the_beacon_where_it_is(mission):
    rng = np.random.default_rng(0)
    auv, beacon = mission.truth["auv"][0], mission.truth["beacon"][0, 0]
    near = []
    for aperture in mission.log(0).arrays:
        positions = np.tile(auv[list(aperture.poses)], (400, 1, 1))
        drawn = aperture.array.sample_beacon(positions, rng)
        centre = positions[0].mean(0)
        near.append(np.mean(np.linalg.norm(drawn - beacon, axis=1) < 3.0))
        assert abs(aperture.array.focus_m - np.linalg.norm(beacon - centre)) < 3.0
    assert np.mean(near) > 0.25


def test_every_trial_is_another_and_always_the_same(mission):
    again = fly(scenario(), [1])
    np.testing.assert_array_equal(mission.log(1).steps, again.log(0).steps)
    np.testing.assert_array_equal(mission.log(1).arrays[2].array.envelope, again.log(0).arrays[2].array.envelope)
    assert not np.allclose(mission.log(0).steps, again.log(0).steps)


def test_a_record_does_not_depend_on_which_others_are_wanted():
    few, more = scenario(ranging={"count": 0}), scenario()
    np.testing.assert_array_equal(records(few, np.array([31]), 0), records(more, np.array([5, 31]), 0)[1:])
    assert listen(few, np.array([], dtype=int), 0).shape == (0, 8000)


def test_a_transit_is_noisier():
    """Motor noise and spread: the strongest outputs vary more from record to record."""
    calm = fly(scenario(), [0]).log(0)
    towed = fly(scenario(water={"snr_db": 6.0, "snr_spread_db": 6.0, "motor_db": 10.0}), [0]).log(0)
    assert np.mean([p.snr_db for p in towed.pings]) < np.mean([p.snr_db for p in calm.pings])
    assert np.std([p.snr_db for p in towed.pings]) > np.std([p.snr_db for p in calm.pings])


def test_the_outline_shows_what_was_heard_and_fixed(mission):
    shown = outline(mission)
    assert [s["name"] for s in shown.subjects] == ["auv", "beacon"]
    assert [s["kind"] for s in shown.subjects] == ["auv", "beacon"]
    packets = [e for e in shown.events if e["kind"] == "packet"]
    assert len(packets) == len(
        {p.pose for p in mission.log(0).pings} | {k for a in mission.log(0).arrays for k in a.poses}
    )
    assert all(p["tol_s"] < p["toa_s"] for p in packets)
    assert [e["time_s"] for e in shown.events if e["kind"] == "fix"] == [0.0, 99.0]


def test_a_path_may_go_around_a_beacon_under_way():
    towed = {"kind": "waypoints", "points_m": [[0.0, 0.0], [200.0, 0.0]], "speed_mps": 1.0}
    flown = fly(scenario(vehicle={"around_beacon": True}, beacon={"path": towed}), [0])
    apart = flown.truth["auv"] - flown.truth["beacon"]
    np.testing.assert_allclose(np.linalg.norm(apart, axis=-1), 40.0)
    assert flown.truth["beacon"][0, -1, 0] == pytest.approx(99.0)
