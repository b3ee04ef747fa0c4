"""What a graph's variables are: points, poses and points with velocity, as plain vectors (C19 §4.4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Kind:
    """A variable's space: its dimension and which of its coordinates are angles (rad)."""

    name: str
    dim: int
    angles: tuple[int, ...] = ()

    def difference(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """a - b (..., dim) with angles wrapped to [-pi, pi)."""
        d = np.array(a - b, dtype=float)
        for i in self.angles:
            d[..., i] = wrap(d[..., i])
        return d


def wrap(angle: np.ndarray) -> np.ndarray:
    """An angle (rad) in [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


REAL = Kind("Real", 1)
POINT2 = Kind("Point2", 2)
POSE2 = Kind("Pose2", 3, angles=(2,))
DYN_POINT2 = Kind("DynPoint2", 4)
#: Which of a mixture's components a kernel takes: a whole number, drawn and never differentiated.
LABEL = Kind("Label", 1)
