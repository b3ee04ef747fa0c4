from __future__ import annotations

import numpy as np
import pytest

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.propagation import Water
from engine.acoustics.synthetic_array import DOUBT_NATS, synthesize
from tests.engine.acoustics.waters import SONAR, at, heard, line


def array(positions, beacon, rng, **more):
    return synthesize(matched_filter(heard(positions, beacon, rng, **more), SONAR), positions, SONAR)


@pytest.mark.parametrize("azimuth_deg", [50.0, 75.0, 90.0, 110.0, 130.0])
def test_bearing_within_a_degree_and_range_within_037_m_at_10_db(azimuth_deg):
    """Eight elements a metre apart, 10 dB after the matched filter, root mean square over 20; and the mirror image."""
    rng = np.random.default_rng(int(azimuth_deg))
    look = np.radians(np.arange(0, 360, 0.1))
    bearing_error, range_error, mirror_share = [], [], []
    for _ in range(20):
        positions, beacon = line(), at(80.0, np.radians(azimuth_deg))
        heard_by = array(positions, beacon, rng, snr_db=10.0)
        power = heard_by.power(positions[None], look)[0]
        upper = look[:1800][power[:1800].argmax()]
        bearing_error.append(np.degrees(upper) - azimuth_deg)
        along = heard_by.power_along(positions[None], np.array([[np.cos(upper), np.sin(upper)]]))[0]
        range_error.append(heard_by.ranges_m[along.argmax()] - 80.0)
        mirror_share.append(power[1801:].max() / power[:1800].max())
    assert np.sqrt(np.mean(np.square(bearing_error))) < 1.0
    assert np.sqrt(np.mean(np.square(range_error))) < 0.37
    np.testing.assert_allclose(mirror_share, 1.0, atol=0.02)


def test_forward_a_straight_array_puts_the_beacon_on_either_side():
    rng = np.random.default_rng(1)
    positions, beacon = line(), at(60.0, 1.1)
    drawn = array(positions, beacon, rng, snr_db=20.0).sample_beacon(np.tile(positions, (2000, 1, 1)), rng)
    near = [np.mean(np.linalg.norm(drawn - place, axis=1) < 3.0) for place in (beacon, beacon * [1, -1])]
    assert sum(near) > 0.9
    assert near[0] / near[1] == pytest.approx(1.0, abs=0.2)


def test_forward_draws_at_ordered_quantiles_go_around():
    """What a caller spreads evenly over the quantiles is spread evenly over the beams."""
    rng = np.random.default_rng(7)
    positions = np.tile(line(), (500, 1, 1))
    heard_by = array(positions[0], at(60.0, 1.1), rng, snr_db=20.0)
    drawn = heard_by.sample_beacon(positions, rng, strata=(np.arange(500) + 0.5) / 500)
    bearing = np.arctan2(drawn[:, 1], drawn[:, 0]) % (2 * np.pi)
    assert np.all(np.diff(bearing) > -1e-9)


def test_forward_a_bent_array_tells_the_sides_apart():
    rng = np.random.default_rng(2)
    turn = np.linspace(0, np.pi / 2, 8)
    positions = 6.0 * np.stack([np.sin(turn), 1 - np.cos(turn)], axis=1)
    positions -= positions.mean(0)
    beacon = at(60.0, 1.1)
    look = np.radians(np.arange(0, 360, 0.5))
    power = array(positions, beacon, rng, snr_db=20.0).power(positions[None], look)[0]
    assert abs(look[power.argmax()] - 1.1) < np.radians(1.0)


def test_backward_finds_the_range_of_the_element_left_out():
    """However wrong the left-out element's own position is: it is not looked at."""
    rng = np.random.default_rng(3)
    positions, beacon = line(10), at(60.0, 1.1)
    heard_by = array(positions, beacon, rng, snr_db=15.0)
    believed = np.tile(positions, (500, 1, 1))
    believed[:, 2] += 100.0
    beacons = np.tile(beacon, (500, 1))
    truth = np.linalg.norm(beacon - positions[2])
    power = heard_by.leave_one_out(beacons, believed, 2)
    assert abs(heard_by.ranges_m[power[0].argmax()] - truth) < 0.37
    drawn = heard_by.sample_range(beacons, believed, 2, rng)
    assert abs(np.median(drawn) - truth) < 0.37
    assert np.mean(np.abs(drawn - truth) < 1.0) > 0.5


def test_backward_is_forward_seen_from_an_element():
    """The power with element i put anywhere at a range is the leave-one-out power at that range."""
    rng = np.random.default_rng(4)
    positions, beacon = line(5), at(60.0, 0.8)
    heard_by = array(positions, beacon, rng, snr_db=20.0)
    power = heard_by.leave_one_out(beacon[None], positions[None], 3)[0]
    some = np.arange(5, len(power), 50)
    moved = np.tile(positions, (len(some), 1, 1))
    turn = rng.uniform(0, 2 * np.pi, len(some))
    away = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    moved[:, 3] = beacon + heard_by.ranges_m[some, None] * away
    np.testing.assert_allclose(heard_by.focused_power(moved, beacon), power[some], rtol=1e-3)


def test_the_likelihood_is_greatest_at_the_beacon_and_bounded_elsewhere():
    rng = np.random.default_rng(5)
    positions, beacon = line(), at(60.0, 1.1)
    for snr_db in (15.0, 60.0):
        heard_by = array(positions, beacon, rng, snr_db=snr_db)
        places = beacon + rng.uniform(-15, 15, (500, 2))
        elsewhere = heard_by.log_likelihood(positions, places)
        there = heard_by.log_likelihood(positions, beacon)
        assert np.all(elsewhere[np.linalg.norm(places - beacon, axis=1) > 4.0] < there - 2.0)
        assert abs(there) < 4.0 and np.all(elsewhere >= -DOUBT_NATS - 1e-5)
        assert np.isfinite(heard_by.log_likelihood(positions, at(1e6, 0.0)))


def test_beam_and_focus_agree_on_what_an_array_says():
    """A source in the window: the beam's power there is the focused power, plus the noise that the window has."""
    rng = np.random.default_rng(8)
    positions, beacon = line(), at(60.0, 1.1)
    heard_by = array(positions, beacon, rng, snr_db=30.0)
    beam = float(heard_by.power(positions[None], np.array([1.1]))[0, 0])
    focus = float(heard_by.focused_power(positions, beacon))
    assert beam == pytest.approx(focus, rel=0.25)


def test_a_strong_echo_is_kept_beside_the_direct_path():
    rng = np.random.default_rng(6)
    water = Water(surface_reflection=0.0, outlier_m=40.0, outlier_gain=1.2)
    positions, beacon = line(), at(60.0, 1.1)
    heard_by = array(positions, beacon, rng, snr_db=20.0, water=water)
    along = heard_by.power_along(positions[None], np.array([[np.cos(1.1), np.sin(1.1)]]))[0]
    for range_m in (60.0, 100.0):
        near = np.abs(heard_by.ranges_m - range_m) < 0.5
        assert along[near].max() > 0.2 * along.max()


def test_an_array_has_at_least_two_records():
    with pytest.raises(ValueError, match="two or more"):
        synthesize(np.zeros((1, 8000), dtype=complex), np.zeros((1, 2)), SONAR)
