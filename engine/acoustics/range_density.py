"""What one record says of the range to the beacon (C19 section 4.2.2, Figs. 4-4 to 4-7)."""

from __future__ import annotations

import numpy as np

from engine.acoustics.density import floored, likely, noise_power

#: The most a record may say for one range against another, as a log likelihood ratio: echoes grow with loudness.
MOST_NATS = 15.0
#: Quantile below which the output is taken for noise (C19: 0.6 to 0.8).
FLOOR = 0.8


def range_density(filtered: np.ndarray, floor: float = FLOOR) -> np.ndarray:
    """Density (..., n) over the delays of filtered records (..., n), complex, above its quantile floor.

    The weights of Algorithm 2 are the likelihood of a known signal in noise, its amplitude and phase estimated
    (C19 eq. 4.26), whose logarithm is the output's power over the noise's.
    """
    power = np.abs(filtered) ** 2 / noise_power(filtered)[..., None]
    temper = np.minimum(1.0, MOST_NATS / power.max(-1, keepdims=True))
    return floored(likely(temper * power), floor)


def amplitude_density(filtered: np.ndarray, floor: float = FLOOR) -> np.ndarray:
    """Density (..., n) as the thesis makes it: the output's magnitude above its quantile floor (C19 Algorithm 2)."""
    return floored(np.abs(np.real(filtered)), floor)
