"""The zoom transform: the spectrum of records on a fine grid over the chirp's band only (C19 section 4.2.3)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engine.acoustics.sonar import Sonar

#: Bins over the band, as the thesis'.
BINS = 1024


def band_frequencies(sonar: Sonar, bins: int = BINS) -> np.ndarray:
    """Frequencies of the zoom transform (bins,), Hz, from the band's lower end, its upper end left out."""
    return sonar.low_hz + (sonar.high_hz - sonar.low_hz) / bins * np.arange(bins)


def zoom_transform(signals: np.ndarray, sonar: Sonar, bins: int = BINS) -> np.ndarray:
    """Spectrum (..., bins) of signals (..., n) at `band_frequencies` (C19 Algorithm 3).

    Algorithm 3 prints a contour step of (f2 - f1)/(n Fs) with n the signal's length; it is one over the number of bins.
    """
    step = (sonar.high_hz - sonar.low_hz) / (bins * sonar.sampling_hz)
    start = sonar.low_hz / sonar.sampling_hz
    transform = chirp_z(signals.shape[-1], bins, w=np.exp(-2j * np.pi * step), a=np.exp(2j * np.pi * start))
    return transform(signals)


def chirp_z(n: int, bins: int, w: complex, a: complex) -> Callable[[np.ndarray], np.ndarray]:
    """The chirp z-transform of signals (..., n) to (..., bins): at a * w**-k of the z-plane, k = 0 to bins - 1."""
    from scipy.signal import CZT  # with all that it brings half a second, which missions without sound need not wait

    return CZT(n, bins, w=w, a=a)
