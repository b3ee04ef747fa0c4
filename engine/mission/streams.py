"""Random numbers that belong to one purpose: no stream depends on which others are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from zlib import crc32

import numpy as np


def stream(seed: int, trial: int, owner: str, purpose: str) -> np.random.Generator:
    """The generator of one trial, owner (a vehicle's name) and purpose (a sensor's); the same whenever it is asked for."""
    entropy = (seed, trial, crc32(owner.encode()), crc32(purpose.encode()))
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(entropy)))


def normals(seed: int, trials: Sequence[int], owner: str, purpose: str, shape: tuple[int, ...]) -> np.ndarray:
    """Standard normals (trials, *shape), a stream for each trial; single precision, which is faster and enough for noise."""
    out = np.empty((len(trials), *shape), dtype=np.float32)
    for row, trial in zip(out, trials):
        stream(seed, trial, owner, purpose).standard_normal(dtype=np.float32, out=row)
    return out


def uniforms(seed: int, trials: Sequence[int], owner: str, purpose: str, shape: tuple[int, ...]) -> np.ndarray:
    """Uniform numbers in [0, 1), (trials, *shape), a stream for each trial."""
    out = np.empty((len(trials), *shape))
    for row, trial in zip(out, trials):
        stream(seed, trial, owner, purpose).random(out=row)
    return out
