from __future__ import annotations

import numpy as np
import pytest

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.propagation import Water
from engine.acoustics.synthetic_array import synthesize
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
    near = [np.mean(np.linalg.norm(drawn - place, axis=1) < 12.0) for place in (beacon, beacon * [1, -1])]
    assert min(near) > 0.25
    assert near[0] / near[1] == pytest.approx(1.0, abs=0.2)


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
    ranges, correlation = heard_by.leave_one_out(beacons, believed, 2)
    truth = np.linalg.norm(beacon - positions[2])
    assert abs(ranges[correlation[0].argmax()] - truth) < 0.37
    drawn = heard_by.sample_range(beacons, believed, 2, rng)
    assert abs(np.median(drawn) - truth) < 0.37
    assert np.mean(np.abs(drawn - truth) < 1.0) > 0.5


def test_backward_is_what_changes_in_the_beams_power():
    """Moving one element along the line of sight changes the array's power by twice the leave-one-out correlation."""
    rng = np.random.default_rng(4)
    positions, beacon = line(5), at(60.0, 0.8)
    heard_by = array(positions, beacon, rng, snr_db=20.0)
    table = heard_by.correlations
    delays = np.linalg.norm(beacon - positions, axis=1) / SONAR.sound_speed_mps
    lag = delays[3] + np.linspace(-1e-3, 1e-3, 21)
    moved = np.tile(delays[:, None], (1, 21))
    moved[3] = lag
    others = table.energy.sum() + 2 * sum(
        float(table.at(i, j, delays[i] - delays[j])) for i, j in table.pairs if 3 not in (i, j)
    )
    np.testing.assert_allclose(table.power(moved), others + 2 * table.leave_one_out(3, lag, delays), rtol=1e-9)


def test_evidence_is_greatest_at_the_beacon():
    rng = np.random.default_rng(5)
    positions, beacon = line(), at(60.0, 1.1)
    heard_by = array(positions, beacon, rng, snr_db=15.0)
    places = beacon + rng.uniform(-15, 15, (500, 2))
    elsewhere = heard_by.evidence(positions, places)
    there = heard_by.evidence(positions, beacon)
    assert np.all(elsewhere[np.linalg.norm(places - beacon, axis=1) > 3.0] < there)
    assert 0.5 < there <= 1.0 and np.all(elsewhere >= 0)


def test_a_strong_echo_is_kept_beside_the_direct_path():
    rng = np.random.default_rng(6)
    water = Water(surface_reflection=0.0, outlier_m=40.0, outlier_gain=1.2)
    positions, beacon = line(), at(60.0, 1.1)
    heard_by = array(positions, beacon, rng, snr_db=20.0, water=water)
    along = heard_by.power_along(positions[None], np.array([[np.cos(1.1), np.sin(1.1)]]))[0]
    for range_m in (60.0, 100.0):
        near = np.abs(heard_by.ranges_m - range_m) < 0.5
        assert along[near].max() > 0.2


def test_an_array_has_at_least_two_records():
    with pytest.raises(ValueError, match="two or more"):
        synthesize(np.zeros((1, 8000), dtype=complex), np.zeros((1, 2)), SONAR)
