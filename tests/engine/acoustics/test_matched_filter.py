import numpy as np
import pytest

from engine.acoustics.matched_filter import matched_filter
from tests.engine.acoustics.waters import SONAR, at, heard, line


def test_plain_filter_is_the_correlation():
    record = np.random.default_rng(0).normal(size=SONAR.record_samples)
    filtered = matched_filter(record, SONAR, phat=False)
    assert filtered.dtype == np.complex128
    slid = np.correlate(np.concatenate([record, np.zeros(len(SONAR.waveform) - 1)]), SONAR.waveform, "valid")
    np.testing.assert_allclose(filtered.real, slid, atol=1e-9)


def test_the_phase_transform_does_not_care_how_loud_a_record_is():
    record = np.random.default_rng(1).normal(size=SONAR.record_samples)
    np.testing.assert_allclose(matched_filter(record, SONAR), matched_filter(1e3 * record, SONAR), rtol=1e-6, atol=1e-8)


def test_it_finds_the_range_to_the_resolution_of_the_chirp():
    """Resolution c / 2B is 0.37 m (C19 eq. 5.1); eight records at 20 dB, as all ranges, from 20 to 200 m."""
    rng = np.random.default_rng(2)
    for range_m in (20.0, 75.0, 200.0):
        positions, beacon = line(), at(range_m, 1.0)
        envelope = np.abs(matched_filter(heard(positions, beacon, rng, snr_db=20.0), SONAR))
        truth = np.linalg.norm(positions - beacon, axis=1)
        assert np.all(np.abs(envelope.argmax(-1) * SONAR.metres_per_sample - truth) < 0.37)


def test_records_of_another_length_are_refused():
    with pytest.raises(ValueError, match="8000"):
        matched_filter(np.zeros(7999), SONAR)
