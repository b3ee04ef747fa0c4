"""A hundred pursuits of ninety minutes, three vehicles, both architectures, on two cores; and one update's cost."""

from __future__ import annotations

import time

import numpy as np

from engine import runner
from engine.gaussian.forms import Moments
from engine.pursuit.arrivals import update
from engine.pursuit.formation import inner
from engine.pursuit.sigma_points import gauss_hermite
from engine.scenario import library, toml

#: What a hundred trials by both architectures may take, s.
MOST_S = 10.0


def test_a_hundred_trials_of_both_architectures():
    scenario = library.find("cheung2019-pursuit-inner")
    assert (scenario.trials, scenario.duration_s) == (100, 5400)
    plain = toml.override(scenario, {"algorithms": ["decentralized_pursuit", "centralized_pursuit"]})
    runner.run(toml.override(plain, {"trials": 2}), plain.algorithms, workers=2)
    begun, cpu = time.perf_counter(), time.process_time()
    result = runner.run(plain, plain.algorithms, workers=2)
    took = time.perf_counter() - begun
    print(f"\n100 trials x 90 min x 2 architectures, 2 processes: {took:.1f} s wall", end="")
    print(f", {time.process_time() - cpu:.1f} s CPU of the parent")
    assert set(result.tracks) == set(plain.algorithms)
    assert took < MOST_S


def test_an_update_of_many_trials_costs_little_more_than_one():
    places, rng = inner(90.0), np.random.default_rng(1)
    arrivals = np.linalg.norm(places, axis=-1) + 0.2 * rng.standard_normal((1000, 3))
    prior = Moments(np.zeros((1000, 3)), np.broadcast_to(np.diag([100.0, 100.0, 1.0]), (1000, 3, 3)))

    def took(n: int) -> float:
        belief = Moments(prior.mean[:n], prior.cov[:n])
        times = []
        for _ in range(20):
            begun = time.perf_counter()
            update(belief, arrivals[:n], np.ones((n, 3), bool), places, 0.2, gauss_hermite)
            times.append(time.perf_counter() - begun)
        return float(np.median(times))

    one, many = took(1), took(1000)
    print(f"\nupdate with 27 points: {1e6 * one:.0f} us alone, {1e6 * many / 1000:.1f} us each of 1000 trials")
    assert many < 200 * one
