"""Arrays in simulated water, for the tests of this folder."""

from __future__ import annotations

import numpy as np

from engine.acoustics.noise import Noise
from engine.acoustics.propagation import Water, record
from engine.acoustics.sonar import charles_river_sonar

SONAR = charles_river_sonar()
CLEAR = Water(surface_reflection=0.0)
QUIET = Noise()


def line(elements: int = 8, spacing_m: float = 1.0, turn_rad: float = 0.0) -> np.ndarray:
    """A straight array (elements, 2) around the origin."""
    along = spacing_m * (np.arange(elements) - (elements - 1) / 2)
    return along[:, None] * np.array([np.cos(turn_rad), np.sin(turn_rad)])


def at(range_m: float, azimuth_rad: float) -> np.ndarray:
    """A beacon (2,)."""
    return range_m * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])


def submerged(position: np.ndarray, depth_m: float = 1.5) -> np.ndarray:
    """Positions (..., 2) as (..., 3) at a depth."""
    return np.concatenate([position, np.full((*position.shape[:-1], 1), -depth_m)], axis=-1)


def heard(positions, beacon, rng, *, snr_db=10.0, water=CLEAR, noise=QUIET, sonar=SONAR) -> np.ndarray:
    """Records (..., n) at positions (..., 2) with the ratio snr_db at the beacon's distance from the origin."""
    reference = float(np.linalg.norm(beacon))
    return record(
        submerged(beacon), submerged(positions), sonar, water, noise, snr_db=snr_db, reference_m=reference, rng=rng
    )
