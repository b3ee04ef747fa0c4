"""When a synthetic array is not what the beamformer takes it for, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.acoustics.sonar import Sonar


def aperture_m(positions: np.ndarray) -> np.ndarray:
    """Largest distance between two of the elements (..., m, 2): (...,), m (C19 eq. 4.43)."""
    apart = positions[..., :, None, :] - positions[..., None, :, :]
    return np.sqrt((apart**2).sum(-1)).max((-2, -1))


def far_field_m(aperture: float, sonar: Sonar) -> float:
    """Range from which a plane wave is a fair model, m, at the band's middle (C19 section 4.2.4)."""
    return 2 * aperture**2 / sonar.centre_wavelength_m


def largest_speed_mps(sonar: Sonar, interval_s: float) -> float:
    """Speed at which elements are half the longest wavelength apart (C19 eq. 4.58)."""
    return sonar.longest_wavelength_m / (2 * interval_s)


def cautions(positions: np.ndarray, range_m: float, interval_s: float, sonar: Sonar) -> Iterator[str]:
    """What speaks against an array with elements (m, 2) visited every interval_s, and a source at range_m."""
    length = float(aperture_m(positions))
    if length < sonar.centre_wavelength_m:
        yield (
            f"an aperture of {length:.1f} m is shorter than a wavelength of {sonar.centre_wavelength_m:.1f} m: "
            "the beam says little about the bearing"
        )
    far = far_field_m(length, sonar)
    if range_m < far:
        yield f"the source at {range_m:.0f} m is not in the far field of an aperture of {length:.1f} m ({far:.0f} m)"
    speed = float(np.linalg.norm(np.diff(positions, axis=0), axis=-1).max(initial=0.0)) / interval_s
    fastest = largest_speed_mps(sonar, interval_s)
    if speed > fastest:
        yield (
            f"at {speed:.1f} m/s elements are farther apart than half a wavelength: at most {fastest:.1f} m/s for a "
            f"record every {interval_s:g} s"
        )
