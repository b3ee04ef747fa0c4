"""The one real record of the thesis at hand, through the first half of the chain."""

from __future__ import annotations

import numpy as np
import pytest

from engine.acoustics.density import draw
from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.range_density import amplitude_density
from engine.acoustics.recorded import read_records
from engine.acoustics.sonar import Sonar

pytestmark = pytest.mark.recorded


@pytest.fixture
def river(recorded_data):
    folder = recorded_data("charles-river")
    chirp = np.loadtxt(folder / "chirp_template.txt", delimiter=",")
    sonar = Sonar(chirp, low_hz=250.0, high_hz=2050.0)
    return sonar, read_records(folder / "waveform.txt", sonar, np.zeros(1), "mission.records")[0]


def test_its_template_is_a_chirp_from_250_to_2002_hz(river):
    sonar, _ = river
    spectrum = np.abs(np.fft.rfft(sonar.waveform, 1 << 16)) ** 2
    frequency = np.fft.rfftfreq(1 << 16, 1 / sonar.sampling_hz)
    inside = (frequency > 250) & (frequency < 2002)
    assert len(sonar.waveform) == 751
    assert spectrum[inside].sum() > 0.95 * spectrum.sum()


def test_direct_path_and_echo_compete(river):
    """The strongest output is at sample 743 without whitening and at 833 with it, the other not far below."""
    sonar, record = river
    plain = np.abs(matched_filter(record, sonar, phat=False).real)
    whitened = np.abs(matched_filter(record, sonar).real)
    assert plain.argmax() == 743 and whitened.argmax() == 833
    assert plain[833] > 0.5 * plain.max() and whitened[743] > 0.5 * whitened.max()


def test_the_range_density_keeps_both_peaks(river):
    sonar, record = river
    for phat, first in ((False, 743), (True, 833)):
        density = amplitude_density(matched_filter(record, sonar, phat=phat))
        assert density.argmax() == first
        for peak in (743, 833):
            assert abs(density[peak - 10 : peak + 11].argmax() - 10) <= 1
        drawn = draw(np.tile(density, (20_000, 1)), np.random.default_rng(1).random(20_000))
        for peak in (743, 833):
            near = np.mean(np.abs(drawn - peak) < 5)
            assert near == pytest.approx(density[peak - 4 : peak + 5].sum(), abs=0.01)
