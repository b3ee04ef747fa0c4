import numpy as np

from engine.acoustics.matched_filter import matched_filter
from engine.acoustics.range_density import amplitude_density, range_density
from tests.engine.acoustics.waters import SONAR, at, heard


def test_the_mass_is_at_the_true_range_where_the_record_is_clear():
    """At 25 dB nearly all of it within the resolution of the chirp; the thesis' amplitudes leave most on noise."""
    records = heard(np.zeros((20, 2)), at(90.0, 0.0), np.random.default_rng(0), snr_db=25.0)
    filtered = matched_filter(records, SONAR)
    near = np.abs(SONAR.ranges_m - 90.0) < 0.74
    assert np.median(range_density(filtered)[:, near].sum(-1)) > 0.9
    assert np.median(amplitude_density(filtered)[:, near].sum(-1)) < 0.5


def test_a_doubtful_record_is_honest():
    """At 5 dB the true range has the mass it should: over many records the mean log density beats a flat one."""
    records = heard(np.zeros((200, 2)), at(90.0, 0.0), np.random.default_rng(1), snr_db=5.0)
    density = range_density(matched_filter(records, SONAR), floor=0.0)
    near = np.abs(SONAR.ranges_m - 90.0) < 0.74
    mass = density[:, near].sum(-1)
    right = near[density.argmax(-1)]
    assert abs(mass.mean() - right.mean()) < 0.15
    assert np.log(mass).mean() > np.log(near.mean())
