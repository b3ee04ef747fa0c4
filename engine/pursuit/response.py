"""How an estimate follows the target's turns: the empirical transfer function and its break (C19 Fig. 3-12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Points of the moving average that smooths the gain.
SMOOTHED = 7
#: Break frequencies tried: ratios between them, and how far beyond the frequencies of the data they go.
RATIO, BEYOND = 1.02, 2.0


@dataclass(frozen=True)
class Response:
    """gain (trials, F), metres of error for a rad/s of turning, not smoothed, at frequency_rps (F,) rad/s."""

    frequency_rps: np.ndarray
    gain: np.ndarray

    @property
    def smoothed(self) -> np.ndarray:
        """The typical trial's gain (F,), by the thesis' centred moving average."""
        width = min(SMOOTHED, len(self.frequency_rps))
        return np.convolve(np.median(self.gain, axis=0), np.ones(width) / width, mode="same")


def response(turn_rps: np.ndarray, step_s: float, moments_s: np.ndarray, error_m: np.ndarray) -> Response | None:
    """FFT of an error over FFT of the target's turning, up to the highest frequency that updates can tell of.

    turn_rps (trials, N) every step_s from 0 on; error_m (trials, M) at moments_s (M,), NaN where there was no update,
    joined by straight lines. None where a trial has fewer than 16 updates.
    """
    known = np.isfinite(error_m)
    if known.sum(axis=1).min() < 16:
        return None
    time_s = step_s * np.arange(turn_rps.shape[1])
    error = np.stack([np.interp(time_s, moments_s[k], e[k]) for k, e in zip(known, error_m)])
    turning, followed = (np.abs(np.fft.rfft(x - x.mean(axis=1, keepdims=True))) for x in (turn_rps, error))
    frequency = 2 * np.pi * np.fft.rfftfreq(turn_rps.shape[1], step_s)
    nyquist = np.pi * known.sum(axis=1).mean() / time_s[-1]
    chosen = (frequency > 0) & (frequency < nyquist)
    return Response(frequency[chosen], followed[:, chosen] / np.maximum(turning[:, chosen], 1e-12))


def break_frequency(found: Response) -> np.ndarray:
    """Where the gain of a first-order lag fitted to each trial's has fallen by 3 dB, (trials,) rad/s.

    Least squares on the logarithm of the gain, whose scatter (a ratio of two random spectra) is the same everywhere;
    over the lower half of the frequencies, since straight lines between updates are smoother than what they stand for.
    """
    lower = slice(0, max(len(found.frequency_rps) // 2, 1))
    w = found.frequency_rps[lower]
    tried = np.exp(np.arange(np.log(w[0]), np.log(BEYOND * w[-1]), np.log(RATIO)))
    fall = 0.5 * np.log1p((w / tried[:, None]) ** 2)
    left = np.log(np.maximum(found.gain[:, lower], 1e-12))[:, None] + fall
    return tried[np.argmin(left.var(axis=-1), axis=1)]
