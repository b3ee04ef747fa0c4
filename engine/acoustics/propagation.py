"""What hydrophones record when a beacon sounds: true geometry, spreading, echoes and noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engine.acoustics.noise import Noise, gain_for, record_noise
from engine.acoustics.sonar import Sonar


@dataclass(frozen=True)
class Wall:
    """A straight vertical wall through `point` (x, y) along `direction` (x, y); reflects this part of the amplitude."""

    point: tuple[float, float]
    direction: tuple[float, float]
    reflection: float = 0.6


@dataclass(frozen=True)
class Water:
    """How sound travels, and what else is wrong with what the receiver believes.

    sound_speed_mps is the true one. Amplitude falls with range to the power -spreading. The surface reflects
    surface_reflection of it (negative: upside down). clock_offset_s: arrivals seem later by it. An outlier echo has
    travelled outlier_m farther than the direct path at outlier_gain times its amplitude; 0: there is none.
    """

    sound_speed_mps: float = 1481.0
    spreading: float = 1.0
    surface_reflection: float = -0.5
    walls: tuple[Wall, ...] = field(default=())
    clock_offset_s: float = 0.0
    outlier_m: float = 0.0
    outlier_gain: float = 0.0


def paths(beacon: np.ndarray, receiver: np.ndarray, water: Water) -> tuple[np.ndarray, np.ndarray]:
    """Delay, s, and amplitude (..., P) of every path between positions (..., 3), m, z up from the surface.

    The direct path is first and has unit amplitude at 1 m; then the surface's echo, each wall's, and the outlier.
    """
    images = [beacon, beacon * np.array([1.0, 1.0, -1.0])]
    strength = [1.0, water.surface_reflection]
    for wall in water.walls:
        images.append(mirrored(beacon, wall))
        strength.append(wall.reflection)
    length = np.stack([np.sqrt(((receiver - image) ** 2).sum(-1)) for image in images], axis=-1)
    amplitude = np.array(strength) * np.maximum(length, 0.1) ** -water.spreading
    if water.outlier_gain:
        length = np.concatenate([length, length[..., :1] + water.outlier_m], axis=-1)
        amplitude = np.concatenate([amplitude, water.outlier_gain * amplitude[..., :1]], axis=-1)
    return length / water.sound_speed_mps + water.clock_offset_s, amplitude


def mirrored(position: np.ndarray, wall: Wall) -> np.ndarray:
    """Positions (..., 3) mirrored at a wall."""
    along = np.array(wall.direction) / np.linalg.norm(wall.direction)
    normal = np.array([-along[1], along[0], 0.0])
    off = (position - np.array([*wall.point, 0.0])) @ normal
    return position - 2 * off[..., None] * normal


def arrivals(delay_s: np.ndarray, amplitude: np.ndarray, sonar: Sonar) -> np.ndarray:
    """Records (..., record_samples), float32, of the waveform arriving at delays (..., P) with amplitudes (..., P).

    Delays are not rounded to samples. What arrives after the end of the record is cut off.
    """
    N = sonar.fft_samples
    S = np.fft.rfft(sonar.waveform, N).astype(np.complex64)
    delay = np.asarray(delay_s)
    heard = (delay >= 0) & (delay * sonar.sampling_hz < sonar.record_samples)
    amplitude = np.where(heard, amplitude, 0.0).astype(np.float32)
    turn = -2j * np.pi * sonar.sampling_hz / N * np.where(heard, delay, 0.0)
    bins = np.arange(S.size)
    response = np.zeros((*delay.shape[:-1], S.size), dtype=np.complex64)
    for p in range(delay.shape[-1]):
        response += amplitude[..., p, None] * _powers(np.exp(turn[..., p]), bins.size)
    response *= S
    return np.fft.irfft(response, N, axis=-1)[..., : sonar.record_samples]


def _powers(base: np.ndarray, count: int) -> np.ndarray:
    """base (...,) to the powers 0..count-1 as an outer product of coarse and fine steps: (..., count), complex64."""
    fine = 64
    coarse = -(-count // fine)
    small = base[..., None] ** np.arange(fine)
    large = (base[..., None] ** fine) ** np.arange(coarse)
    outer = large.astype(np.complex64)[..., :, None] * small.astype(np.complex64)[..., None, :]
    return outer.reshape(*base.shape, coarse * fine)[..., :count]


def record(
    beacon: np.ndarray,
    receiver: np.ndarray,
    sonar: Sonar,
    water: Water,
    noise: Noise,
    *,
    snr_db: np.ndarray | float,
    reference_m: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """Records (..., record_samples), float32, of receivers (..., 3) hearing a beacon (..., 3), metres, z up.

    The noise is such that from reference_m the direct path, with the surface's echo on its heels, has the ratio
    snr_db (...,) after the plain matched filter; nearer it is louder, farther fainter.
    """
    delay, amplitude = paths(beacon, receiver, water)
    heard = arrivals(delay, amplitude * reference_m**water.spreading, sonar)
    deep = float(np.ravel(beacon)[2]), float(np.ravel(receiver)[2])
    farther = np.hypot(reference_m, deep[0] + deep[1]) - np.hypot(reference_m, deep[0] - deep[1])
    after = float(farther / water.sound_speed_mps)
    gain = np.asarray(gain_for(snr_db, sonar, noise, after, water.surface_reflection), dtype=np.float32)
    sounds = record_noise(heard.shape[:-1], sonar, noise, rng)
    sounds *= gain[..., None]
    sounds += heard
    return sounds
