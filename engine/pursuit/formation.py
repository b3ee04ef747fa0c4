"""Where each vehicle ought to be, relative to the target (C19 section 3.3 and Fig. 3-5)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def inner(length_m: float) -> np.ndarray:
    """An equilateral triangle about the target, corners length_m away: (3, 2) m."""
    return length_m * _towards(90.0, 210.0, 330.0)


def outer(length_m: float) -> np.ndarray:
    """An equilateral triangle beside the target, corners length_m away on average: (3, 2) m.

    C19 does not give its side; here it is that length, and the nearest side faces the target.
    """
    triangle = _towards(150.0, 30.0, 270.0) / np.sqrt(3.0)
    return _scaled(triangle + np.array([0.0, -1.0]), length_m)


def line(length_m: float) -> np.ndarray:
    """A staggered line beside the target, the middle a little farther, length_m away on average: (3, 2) m.

    C19 gives neither its length nor its stagger; here the ends are 1.33 lengths apart, the middle 0.13 behind them.
    """
    return _scaled(np.array([[-0.667, -0.8], [0.0, -0.933], [0.667, -0.8]]), length_m)


def _towards(*degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _scaled(offsets: np.ndarray, length_m: float) -> np.ndarray:
    return offsets * length_m / np.hypot(*offsets.T).mean()


FORMATIONS: dict[str, Callable[[float], np.ndarray]] = {"inner": inner, "outer": outer, "line": line}
