from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.propagation import Wall, Water, arrivals, mirrored, paths
from tests.engine.acoustics.waters import SONAR, at, heard, line, submerged


def test_an_arrival_is_the_waveform_later():
    """Whole delays to single precision; half a sample as a cubic spline of the waveform has it."""
    n = len(SONAR.waveform)
    sound = arrivals(np.array([[500 / SONAR.sampling_hz]]), np.array([[2.0]]), SONAR)[0]
    np.testing.assert_allclose(sound[500 : 500 + n], 2 * SONAR.waveform, atol=1e-4)
    np.testing.assert_allclose(sound[:490], 0.0, atol=1e-4)
    sound = arrivals(np.array([[500.5 / SONAR.sampling_hz]]), np.array([[1.0]]), SONAR)[0]
    spline = CubicSpline(np.arange(n), SONAR.waveform)
    inner = np.arange(50, n - 50)
    np.testing.assert_allclose(sound[500 + inner], spline(inner - 0.5), atol=0.02)


def test_what_comes_after_the_records_end_is_not_heard():
    late = (SONAR.record_samples + 1) / SONAR.sampling_hz
    assert np.abs(arrivals(np.array([[late]]), np.array([[1.0]]), SONAR)).max() == 0.0


def test_echoes_come_by_their_images():
    """Surface and wall by Pythagoras, and the outlier as told."""
    wall = Wall((0.0, -5.0), (1.0, 0.0), 0.6)
    water = Water(walls=(wall,), outlier_m=30.0, outlier_gain=2.0, clock_offset_s=0.001)
    beacon, receiver = np.array([0.0, 0.0, -2.0]), np.array([40.0, 0.0, -1.0])
    delay, amplitude = paths(beacon, receiver, water)
    length = [np.hypot(40, 1), np.hypot(40, 3), np.sqrt(40**2 + 10**2 + 1), np.hypot(40, 1) + 30]
    np.testing.assert_allclose((delay - 0.001) * water.sound_speed_mps, length)
    np.testing.assert_allclose(amplitude, [1 / length[0], -0.5 / length[1], 0.6 / length[2], 2 / length[0]], rtol=1e-12)


def test_a_wall_mirrors_across_itself():
    wall = Wall((1.0, 2.0), (3.0, 1.0))
    position = np.random.default_rng(0).normal(size=(5, 3))
    image = mirrored(position, wall)
    np.testing.assert_allclose(mirrored(image, wall), position, atol=1e-12)
    np.testing.assert_allclose((image - position)[:, :2] @ [3.0, 1.0], 0.0, atol=1e-12)
    middle = (image + position)[:, :2] / 2 - [1.0, 2.0]
    np.testing.assert_allclose(middle @ [-1.0, 3.0], 0.0, atol=1e-12)


def test_several_hydrophones_and_several_pings_at_once():
    """Leading axes broadcast: three pings of a moving beacon at five hydrophones are fifteen records."""
    beacons = np.stack([at(60.0 + k, 0.3) for k in range(3)])
    pyramid = line(5, 0.05)
    rng = np.random.default_rng(5)
    records = heard(pyramid[None], beacons[:, None], rng, snr_db=60.0)
    assert records.shape == (3, 5, SONAR.record_samples) and records.dtype == np.float32
    ranges = np.abs(matched_filter(records, SONAR).real).argmax(-1) * SONAR.metres_per_sample
    truth = np.linalg.norm(submerged(beacons)[:, None] - submerged(pyramid), axis=-1)
    np.testing.assert_allclose(ranges, truth, atol=0.05)


@pytest.mark.parametrize(
    ("water", "error_m"),
    [
        (Water(surface_reflection=0.0, clock_offset_s=0.002), 0.002 * 1481),
        (Water(surface_reflection=0.0, sound_speed_mps=1500.0), 80.0 * (1481 / 1500 - 1)),
        (Water(surface_reflection=0.0, outlier_m=25.0, outlier_gain=1.5), 25.0),
    ],
    ids=["clock offset", "sound speed", "outlier echo"],
)
def test_a_wrong_model_shows_as_a_wrong_range(water, error_m):
    record = heard(line(1), at(80.0, 0.0), np.random.default_rng(6), snr_db=30.0, water=water)
    measured = np.abs(matched_filter(record, SONAR)[0]).argmax() * SONAR.metres_per_sample
    assert measured - 80.0 == pytest.approx(error_m, abs=0.1)
