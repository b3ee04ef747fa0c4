"""When everyone reports where it is."""

from __future__ import annotations

import numpy as np

from engine.scenario.navigation import DEFAULT_REPORTS


def report_times(duration_s: float, interval_s: float | None) -> np.ndarray:
    """Report times (T,) from the start to the end of a mission, s; about 720 of them where no interval is asked for."""
    if interval_s is None:
        return np.linspace(0.0, duration_s, DEFAULT_REPORTS + 1)
    return np.arange(int(np.floor(duration_s / interval_s * (1 + 1e-12))) + 1) * interval_s
