import numpy as np
import pytest
from scipy.signal import welch

from engine.acoustics.matched_filter import correlator_power_ratio_db, matched_filter
from engine.acoustics.noise import Noise, density, record_noise
from engine.acoustics.propagation import Water
from tests.engine.acoustics.waters import SONAR, at, heard, line


def spectrum(noise: Noise, records: int = 60):
    sound = record_noise((records,), SONAR, noise, np.random.default_rng(2))
    frequency, power = welch(sound, SONAR.sampling_hz, nperseg=4000)
    return frequency, power.mean(0) * SONAR.sampling_hz / 2


def test_ambient_noise_falls_by_18_db_a_decade():
    frequency, power = spectrum(Noise(bands_db=-100.0))
    band = (frequency >= 200) & (frequency <= 15_000)
    slope, level = np.polyfit(np.log10(frequency[band] / 1000), 10 * np.log10(power[band]), 1)
    assert slope == pytest.approx(-18, abs=0.3)
    assert level == pytest.approx(0, abs=0.3)


def test_electronic_bands_stand_above_10_khz_and_the_motor_in_the_chirps_band():
    frequency, quiet = spectrum(Noise())
    _, running = spectrum(Noise(motor_db=10.0))
    band = np.abs(frequency - 11_500) < 30
    beside = np.abs(frequency - 12_250) < 200
    assert 10 * np.log10(quiet[band].mean() / quiet[beside].mean()) > 10
    chirp = (frequency > SONAR.low_hz) & (frequency < SONAR.high_hz)
    assert running[chirp].mean() > 1.5 * quiet[chirp].mean()
    np.testing.assert_allclose(running[frequency > 5000], quiet[frequency > 5000], rtol=0.5)


def test_the_noise_has_the_density_it_says():
    noise = Noise(motor_db=3.0)
    frequency, power = spectrum(noise)
    wide = density(np.arange(0, 18_750, 1.0), noise)
    assert power.sum() / len(frequency) == pytest.approx(wide.mean(), rel=0.05)


@pytest.mark.parametrize("noise", [Noise(), Noise(motor_db=8.0), Noise(slope_db_per_decade=0.0)])
@pytest.mark.parametrize("snr_db", [10.0, 25.0])
def test_the_ratio_after_the_plain_matched_filter_is_the_one_asked_for(noise, snr_db):
    """Mean peak power is the signal's plus the noise's own, and the measure takes the highest of a few samples."""
    beacon, positions = at(120.0, 1.0), np.zeros((300, 2))
    records = heard(positions, beacon, np.random.default_rng(3), snr_db=snr_db, noise=noise)
    delay = np.full(300, 120.0 / SONAR.sound_speed_mps)
    measured = correlator_power_ratio_db(matched_filter(records, SONAR, phat=False), delay, SONAR)
    expected = 10 * np.log10(10 ** (snr_db / 10) + 1)
    assert 10 * np.log10(np.mean(10 ** (measured / 10))) == pytest.approx(expected, abs=0.7)


def test_nearer_is_louder():
    beacon = at(100.0, 0.0)
    near = heard(line(1) + [50.0, 0.0], beacon, np.random.default_rng(4), snr_db=60.0)
    far = heard(line(1), beacon, np.random.default_rng(4), snr_db=60.0)
    assert np.abs(near).max() / np.abs(far).max() == pytest.approx(2.0, rel=0.05)


def test_the_ratio_counts_the_surfaces_echo_with_the_direct_path():
    """At 1.5 m down it comes 6 cm later, upside down, and takes half of the low notes away."""
    beacon, positions = at(75.0, 1.0), np.zeros((300, 2))
    water = Water(surface_reflection=-0.5)
    records = heard(positions, beacon, np.random.default_rng(5), snr_db=20.0, water=water)
    delay = np.full(300, 75.0 / SONAR.sound_speed_mps)
    measured = correlator_power_ratio_db(matched_filter(records, SONAR, phat=False), delay, SONAR)
    assert np.median(measured) == pytest.approx(20.0, abs=1.0)
