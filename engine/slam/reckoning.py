"""Dead reckoning between fixes, for estimators without a graph."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.slam.log import SlamLog


def reckon(log: SlamLog, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Positions (P, draws, 2): odometry from fix to fix, each draw with its own errors of both."""
    fixed = set(log.fixed)
    out = np.empty((log.poses, draws, 2))
    heading = np.zeros(draws)
    if log.start is not None:
        assert log.start_cov is not None
        start = rng.multivariate_normal(log.start, log.start_cov, size=draws)
        out[0], heading = start[:, :2], start[:, 2]
    for k in range(log.poses):
        if k > 0:
            step = rng.multivariate_normal(log.steps[k - 1], log.step_cov[k - 1], size=draws)
            if step.shape[1] == 3:
                c, s = np.cos(heading), np.sin(heading)
                moved = np.stack([c * step[:, 0] - s * step[:, 1], s * step[:, 0] + c * step[:, 1]], axis=-1)
                heading = heading + step[:, 2]
            else:
                moved = step
            out[k] = out[k - 1] + moved
        if k in fixed:
            out[k] = log.fix_m[k] + log.fix_sigma_m * rng.standard_normal((draws, 2))
    return out


def drifted(log: SlamLog) -> np.ndarray:
    """The track (P, 2) that odometry tells of from fix to fix, taken at its word."""
    start_cov = None if log.start_cov is None else np.zeros_like(log.start_cov)
    word = replace(log, step_cov=np.zeros_like(log.step_cov), fix_sigma_m=0.0, start_cov=start_cov)
    return reckon(word, 1, np.random.default_rng(0))[:, 0]
