"""Random numbers that belong to one purpose: no stream depends on which others are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from zlib import crc32

import numpy as np


def stream(seed: int, trial: int, owner: str, purpose: str) -> np.random.Generator:
    """The generator of one trial, owner (a vehicle's name) and purpose (a sensor's), always the same for the same."""
    entropy = (seed, trial, crc32(owner.encode()), crc32(purpose.encode()))
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(entropy)))


def normals(seed: int, trials: Sequence[int], owner: str, purpose: str, shape: tuple[int, ...]) -> np.ndarray:
    """Standard normals (trials, *shape), a stream for each trial."""
    out = np.empty((len(trials), *shape))
    for row, trial in zip(out, trials):
        stream(seed, trial, owner, purpose).standard_normal(out=row)
    return out


def measured(
    truth: np.ndarray, sigma: np.ndarray | float, seed: int, trials: Sequence[int], owner: str, purpose: str
) -> np.ndarray:
    """Truth (...) with Gaussian noise of the given sigma (broadcast to it) in every trial: (trials, ...).

    The noise is drawn in single precision, which is several times faster and fine enough for a sensor's.
    """
    out = np.empty((len(trials), *truth.shape))
    noise = np.empty(truth.shape, dtype=np.float32)
    for i, trial in enumerate(trials):
        stream(seed, trial, owner, purpose).standard_normal(dtype=np.float32, out=noise)
        np.multiply(noise, sigma, out=out[i, ...])
        out[i] += truth
    return out


def uniforms(seed: int, trials: Sequence[int], owner: str, purpose: str, shape: tuple[int, ...]) -> np.ndarray:
    """Uniform numbers in [0, 1), (trials, *shape), a stream for each trial."""
    out = np.empty((len(trials), *shape))
    for row, trial in zip(out, trials):
        stream(seed, trial, owner, purpose).random(out=row)
    return out
