"""Arrays on dead-reckoned poses, their beacon densities multiplied: sonar without SLAM (C19 Fig. 5-17, right)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.slam.densities import Kde, fit
from engine.slam.log import SlamLog, thinned
from engine.slam.mission import SlamMission
from engine.slam.products import product
from engine.slam.reckoning import reckon
from engine.slam.run import Moment, Options, over_trials
from engine.slam.story import told_array


def solve(log: SlamLog, mission: SlamMission, trial: int) -> Iterator[Moment]:
    """The product of all arrays' forward densities so far, after each array."""
    options = Options.model_validate(dict(mission.options.get("beamform_only", {})))
    log = thinned(log, options.measurements)
    N = options.kernels
    rng = np.random.default_rng(np.random.SeedSequence([mission.scenario.seed, trial]))
    poses = reckon(log, N, rng)
    densities: dict[str, list[Kde]] = {}
    beacons: dict[str, np.ndarray] = {}
    if not log.arrays:
        yield Moment(log.poses - 1, poses[-1], poses.mean(1), {}, 1.0, poses)
    for n, a in enumerate(log.arrays, start=1):
        elements = np.swapaxes(poses[list(a.poses)], 0, 1)
        strata = rng.permutation((np.arange(N) + 0.5) / N)
        densities.setdefault(a.beacon, []).append(fit(a.array.sample_beacon(elements, rng, strata)))
        beacons[a.beacon] = product(densities[a.beacon], N, rng)
        end = n == len(log.arrays)
        last, cautions = (poses, log.cautions) if end else (None, {})
        told = {"array": told_array(a.array, elements.mean(0))} if trial == mission.trials[0] else {}
        here, track, done = poses[a.poses[-1]][:, :2], poses[: a.poses[-1] + 1].mean(1), n / len(log.arrays)
        yield Moment(a.poses[-1], here, track, dict(beacons), done, last, cautions=cautions, told=told)


run = over_trials(solve)
