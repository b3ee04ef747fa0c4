"""What the receiver knows: the transmitted waveform, its band, how it samples, and the sound speed it assumes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.fft import next_fast_len


def linear_chirp(low_hz: float, high_hz: float, samples: int, sampling_hz: float) -> np.ndarray:
    """A cosine whose frequency rises linearly from low to high over its (samples,), amplitude 1 (C19 section 4.2.1)."""
    time = np.arange(samples) / sampling_hz
    rate = (high_hz - low_hz) * sampling_hz / samples
    return np.cos(2 * np.pi * (low_hz * time + rate * time**2 / 2))


@dataclass(frozen=True, eq=False)
class Sonar:
    """One-way ranging: a record starts when the beacon transmits `waveform` (n,) and has `record_samples` samples."""

    waveform: np.ndarray
    low_hz: float = 200.0
    high_hz: float = 2050.0
    sampling_hz: float = 37_500.0
    record_samples: int = 8000
    sound_speed_mps: float = 1481.0

    @property
    def metres_per_sample(self) -> float:
        """Range that sound covers in one sample (C19 eq. 4.23)."""
        return self.sound_speed_mps / self.sampling_hz

    @property
    def ranges_m(self) -> np.ndarray:
        """Range of every sample of a record (record_samples,), m (C19 eq. 4.23)."""
        return np.arange(self.record_samples) * self.metres_per_sample

    @property
    def centre_wavelength_m(self) -> float:
        """Wavelength in the middle of the band, m."""
        return 2 * self.sound_speed_mps / (self.low_hz + self.high_hz)

    @property
    def longest_wavelength_m(self) -> float:
        """Wavelength at the lower end of the band, m."""
        return self.sound_speed_mps / self.low_hz

    @property
    def fft_samples(self) -> int:
        """Length at which correlation with the waveform does not wrap around."""
        return cast(int, next_fast_len(self.record_samples + len(self.waveform) - 1, real=True))


def charles_river_sonar(**changes) -> Sonar:
    """The sonar of the thesis: 200 to 2050 Hz in 1024 samples at 37.5 kHz (C19 section 4.2.1)."""
    settings = {"low_hz": 200.0, "high_hz": 2050.0, "sampling_hz": 37_500.0, "samples": 1024} | changes
    samples = settings.pop("samples")
    waveform = linear_chirp(settings["low_hz"], settings["high_hz"], samples, settings["sampling_hz"])
    return Sonar(waveform, **settings)
