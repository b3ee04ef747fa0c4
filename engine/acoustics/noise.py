"""Noise in the records: the water's, the electronics' and the motors' (C19 section 4.2.1, Fig. 4-1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.acoustics.sonar import Sonar


@dataclass(frozen=True)
class Noise:
    """Relative levels of the noise's parts; the whole is scaled to the signal to noise ratio asked for.

    Ambient noise has unit density at 1 kHz and falls by `slope_db_per_decade` above `corner_hz`. Electronic bands of
    `band_width_hz` stand every `band_spacing_hz` from `band_start_hz` on, `bands_db` above the ambient level at 1 kHz.
    The motor turns at `motor_hz`: harmonics of it up to 1.5 kHz, `motor_db` above the ambient level at 1 kHz, and a
    broad rumble under them, 10 dB less; None where it stands still while recording.
    """

    slope_db_per_decade: float = 18.0
    corner_hz: float = 100.0
    bands_db: float = 6.0
    band_start_hz: float = 10_000.0
    band_spacing_hz: float = 1500.0
    band_width_hz: float = 60.0
    motor_db: float | None = None
    motor_hz: float = 47.0


def density(frequency_hz: np.ndarray, noise: Noise) -> np.ndarray:
    """Power density (...,) of the noise at frequencies (...,), Hz, relative to the ambient one at 1 kHz."""
    f = np.asarray(frequency_hz, dtype=float)
    out = (np.maximum(f, noise.corner_hz) / 1000.0) ** (-noise.slope_db_per_decade / 10.0)
    off = (f - noise.band_start_hz + noise.band_spacing_hz / 2) % noise.band_spacing_hz - noise.band_spacing_hz / 2
    in_band = f > noise.band_start_hz - noise.band_spacing_hz / 2
    out = out + in_band * 10 ** (noise.bands_db / 10) * np.exp(-0.5 * (off / noise.band_width_hz) ** 2)
    if noise.motor_db is not None:
        off = (f + noise.motor_hz / 2) % noise.motor_hz - noise.motor_hz / 2
        tones = (f > noise.motor_hz / 2) * np.exp(-0.5 * (off / 2.0) ** 2) + 0.1
        out = out + 10 ** (noise.motor_db / 10) * tones * np.exp(-((f / 1500.0) ** 4))
    return out


def record_noise(shape: tuple[int, ...], sonar: Sonar, noise: Noise, rng: np.random.Generator) -> np.ndarray:
    """Noise records (*shape, record_samples), float32: unit density at 1 kHz is unit variance per sample if white."""
    N = sonar.fft_samples
    f = np.fft.rfftfreq(N, 1 / sonar.sampling_hz)
    level = np.sqrt(density(f, noise) * N / 2).astype(np.float32)
    level[0] = 0.0
    parts = rng.standard_normal((*shape, len(f), 2), dtype=np.float32)
    parts *= level[:, None]
    return np.fft.irfft(parts.view(np.complex64)[..., 0], N, axis=-1)[..., : sonar.record_samples]


def gain_for(
    snr_db: np.ndarray | float, sonar: Sonar, noise: Noise, echo_s: float = 0.0, echo: float = 0.0
) -> np.ndarray | float:
    """Factor on `record_noise` that gives a unit chirp this ratio after the plain matched filter, dB (C19 eq. 4.14).

    The ratio is of the squared output at the arrival to the mean squared output due to noise. An echo of relative
    amplitude `echo` that follows so soon, after echo_s, that it merges with the chirp counts with it.
    """
    N = sonar.fft_samples
    f = np.fft.rfftfreq(N, 1 / sonar.sampling_hz)
    S2 = np.abs(np.fft.rfft(sonar.waveform, N)) ** 2
    S2[1:] *= 2.0
    output = S2 * (1 + echo * np.exp(-2j * np.pi * f * echo_s))
    peak = np.abs(output.sum()) / N
    mean_square = (S2 * density(f, noise)).sum() / N
    return np.sqrt(peak**2 / mean_square / 10 ** (np.asarray(snr_db) / 10))
