"""The matched filter, plain or after the phase transform (C19 Algorithm 1)."""

from __future__ import annotations

import numpy as np

from engine.acoustics.sonar import Sonar

#: Keeps bins without any energy from being divided by zero (Algorithm 1 adds it to the magnitude).
TINY = 1e-9


def matched_filter(records: np.ndarray, sonar: Sonar, *, phat: bool = True) -> np.ndarray:
    """Correlation of records (..., n) with the waveform at every delay, complex (..., n).

    The real part is the filter's output and the magnitude its envelope. `phat` discards the magnitude of the
    records' spectra first, which whitens noise of unknown colour (C19 eq. 4.22, Algorithm 1).
    """
    n, N = records.shape[-1], sonar.fft_samples
    if n != sonar.record_samples:
        raise ValueError(f"records of {n} samples, the sonar's have {sonar.record_samples}")
    single = np.result_type(records, np.float32) == np.float32
    H = np.conj(np.fft.rfft(sonar.waveform.astype(np.float32 if single else np.float64), N))
    Y = np.fft.rfft(records, N, axis=-1)
    if phat:
        Y /= np.abs(Y) + TINY
    one_sided = np.zeros((*Y.shape[:-1], N), dtype=Y.dtype)
    one_sided[..., : Y.shape[-1]] = Y * H
    one_sided[..., 1 : (N + 1) // 2] *= 2.0
    return np.fft.ifft(one_sided, axis=-1)[..., :n]


def correlator_power_ratio_db(filtered: np.ndarray, delay_s: np.ndarray, sonar: Sonar) -> np.ndarray:
    """Measured signal to noise ratio (...,), dB, of filtered records (..., n) with arrivals at delay_s (...).

    The squared output at the arrival, over the mean squared output before it, where there is noise alone
    (C19 eq. 4.14); NaN where the arrival comes too early to tell.
    """
    output = np.abs(np.real(filtered))
    width = int(np.ceil(2 * sonar.sampling_hz / (sonar.high_hz - sonar.low_hz)))
    sample = np.arange(output.shape[-1])
    at = np.asarray(delay_s)[..., None] * sonar.sampling_hz
    near = np.abs(sample - at) <= width / 4
    before = sample < at - 4 * width
    count = before.sum(-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        noise = np.where(before, output, 0.0) ** 2
        noise = noise.sum(-1) / np.where(count >= 20 * width, count, np.nan)
        return 10 * np.log10(np.where(near, output, 0.0).max(-1) ** 2 / noise)
