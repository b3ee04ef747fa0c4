from __future__ import annotations

import numpy as np
import pytest

from engine.acoustics.beamformer import azimuths, correlate, direct_power, look_delays
from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.zoom import BINS, band_frequencies, zoom_transform
from tests.engine.acoustics.waters import SONAR, at, heard, line


def spectra_of(positions, beacon, rng, **more):
    return zoom_transform(matched_filter(heard(positions, beacon, rng, **more), SONAR).real, SONAR)


def test_the_zoom_transform_is_the_fourier_sum_over_the_band():
    signal = np.random.default_rng(0).normal(size=SONAR.record_samples)
    f = band_frequencies(SONAR)
    assert len(f) == BINS and f[0] == 200.0 and f[-1] < 2050.0
    some = [0, 1, 500, BINS - 1]
    time = np.arange(SONAR.record_samples) / SONAR.sampling_hz
    expected = [np.sum(signal * np.exp(-2j * np.pi * f[k] * time)) for k in some]
    np.testing.assert_allclose(zoom_transform(signal, SONAR)[some], expected, rtol=1e-8)


@pytest.mark.parametrize("elements", [2, 6, 10])
def test_tabulated_correlations_give_the_power_of_the_direct_sum(elements):
    """To 1e-6 of the strongest beam, for arrays bent at random, plane and round waves."""
    rng = np.random.default_rng(1)
    spectra = spectra_of(line(elements), at(50.0, 1.0), rng)
    table = correlate(spectra, SONAR, 40.0 / SONAR.sound_speed_mps)
    positions = line(elements) + rng.normal(size=(3, elements, 2))
    for range_m in (np.inf, 30.0):
        delays = look_delays(positions, azimuths(60), SONAR.sound_speed_mps, range_m)
        expected = direct_power(spectra, delays, band_frequencies(SONAR))
        np.testing.assert_allclose(table.power(delays), expected, atol=1e-6 * expected.max())


def test_beyond_their_reach_records_do_not_correlate():
    spectra = spectra_of(line(2), at(50.0, 1.0), np.random.default_rng(2))
    table = correlate(spectra, SONAR, 0.01)
    assert table.at(0, 1, np.array([0.02, -0.02])).tolist() == [0.0, 0.0]
    np.testing.assert_allclose(table.at(0, 1, np.array([0.003])), table.at(1, 0, np.array([-0.003])))


def test_round_waves_become_plane_ones_far_away():
    offsets = np.random.default_rng(3).normal(size=(8, 2))
    plane = look_delays(offsets, azimuths(), 1481.0)
    np.testing.assert_allclose(look_delays(offsets, azimuths(), 1481.0, 1e6), plane, atol=1e-8)
    near = look_delays(offsets, np.array([0.7]), 1481.0, 12.0)[:, 0]
    truth = np.linalg.norm(at(12.0, 0.7) - offsets, axis=1) - 12.0
    np.testing.assert_allclose(near, truth / 1481.0, atol=1e-12)


def test_a_longer_array_has_a_narrower_beam():
    """Half-power width is the wavelength over the aperture (C19 eq. 4.55): about inverse to the length."""
    widths = []
    for elements in (6, 12):
        positions = line(elements)
        spectra = spectra_of(positions, at(250.0, np.pi / 2), np.random.default_rng(4), snr_db=40.0)
        table = correlate(spectra, SONAR, 40.0 / SONAR.sound_speed_mps)
        look = np.radians(np.arange(0, 180, 0.1))
        power = table.power(look_delays(positions, look, SONAR.sound_speed_mps))
        widths.append(np.count_nonzero(power - power.min() > 0.5 * np.ptp(power)) / 10)
    assert widths[0] / widths[1] == pytest.approx(11 / 5, rel=0.25)
