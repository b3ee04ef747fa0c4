import numpy as np

from engine.acoustics.cautions import aperture_m, cautions, far_field_m, largest_speed_mps
from tests.engine.acoustics.waters import SONAR, line


def test_the_aperture_is_the_longest_distance():
    assert aperture_m(np.array([[0.0, 0.0], [3.0, 4.0], [1.0, 1.0]])) == 5.0


def test_half_a_wavelength_a_second():
    """7.4 m / 2 at a record every second (C19 eq. 4.58)."""
    assert abs(largest_speed_mps(SONAR, 1.0) - 7.4 / 2) < 0.01


def test_a_good_array_passes_and_each_fault_is_named():
    assert list(cautions(line(8), 200.0, 1.0, SONAR)) == []
    near, short, fast = (
        list(cautions(line(8), 20.0, 1.0, SONAR)),
        list(cautions(line(8, 0.1), 200.0, 1.0, SONAR)),
        list(cautions(line(3, 5.0), 500.0, 1.0, SONAR)),
    )
    assert len(near) == len(short) == len(fast) == 1
    assert "far field" in near[0] and "wavelength" in short[0] and "5.0 m/s" in fast[0]
    assert far_field_m(7.0, SONAR) > 20.0
