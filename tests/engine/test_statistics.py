"""Statistics kept of a run are those of its tracks, whoever computed them and in however many pieces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine import runner, statistics
from engine.evaluation.summary import EDGES_M, QUANTILES, Spread, Summary
from engine.scenario import library, toml
from engine.tracks import Belief

NAMES = ["dead_reckoning", "cekf", "nekf"]


def mission(**changes):
    return toml.override(library.shipped("first-look"), {"duration_s": 120, "report_interval_s": 10} | changes)


@pytest.fixture(scope="module")
def both():
    """The same 130 trials, once by their tracks and once by statistics."""
    scenario = mission(trials=130)
    return runner.run(scenario, NAMES, workers=1), statistics.run(scenario, NAMES, workers=1)


def test_the_figures_are_those_of_the_tracks(both):
    tracks, kept = both[0].to_json(), both[1]
    assert kept["trials"] == tracks["trials"] and list(kept["algorithms"]) == list(tracks["algorithms"])
    for name, answer in tracks["algorithms"].items():
        assert kept["algorithms"][name]["packets"] == pytest.approx(answer["packets"])
        for subject, metrics in answer["subjects"].items():
            for metric, value in kept["algorithms"][name]["subjects"][subject].items():
                if metric in metrics:
                    expected = metrics[metric]
                    numbers = isinstance(expected, float | list)
                    assert value == (pytest.approx(expected, rel=1e-9) if numbers else expected), metric


def test_quantiles_over_trials_are_those_of_the_tracks_to_a_percent(both):
    tracks, kept = both
    for name in NAMES:
        for subject, belief in tracks.tracks[name].beliefs.items():
            error = np.hypot(*np.moveaxis(belief.mean - tracks.truth[subject], -1, 0))
            per_trial = np.sqrt((error**2).mean(axis=1))
            told = kept["algorithms"][name]["subjects"][subject]["error_over_trials"]
            assert told["trials"] == 130
            assert told["mean_m"] == pytest.approx(per_trial.mean())
            assert told["deviation_m"] == pytest.approx(per_trial.std(ddof=1))
            for q in QUANTILES:
                bounds = np.quantile(per_trial, [max(q - 0.01, 0), min(q + 0.01, 1)])
                assert 0.98 * bounds[0] <= told["quantiles_m"][f"{q:g}"] <= 1.02 * bounds[1]


def test_the_workers_do_not_change_a_bit():
    scenario = mission(trials=1200)
    one, two = (statistics.run(scenario, ["dead_reckoning"], workers=workers) for workers in (1, 2))
    for result in (one, two):
        del result["algorithms"]["dead_reckoning"]["cpu_s"]
    assert one == two


@pytest.mark.parametrize("trials", [1, 4, 5, 6, 499, 500, 501, 1_000_000])
def test_every_trial_is_in_one_batch(trials: int):
    parts = statistics.batches(mission(trials=trials), NAMES)
    ends = [statistics.SHOWN if trials > statistics.SHOWN else trials, *(batch.trials[-1] + 1 for batch in parts)]
    assert [batch.trials[0] for batch in parts] == ends[:-1] and ends[-1] == trials
    assert len(parts) <= trials / statistics.BATCH + 1


values = st.lists(st.floats(0, 1e6), min_size=0, max_size=40).map(np.array)


@given(values, values, values)
def test_spreads_add_up_as_if_all_had_been_seen_at_once(a: np.ndarray, b: np.ndarray, c: np.ndarray):
    together, apart = Spread.of(np.concatenate([a, b, c])), Spread.of(a) + Spread.of(b) + Spread.of(c)
    assert apart.count == together.count
    np.testing.assert_array_equal(apart.classes, together.classes)
    assert apart.mean == pytest.approx(together.mean, rel=1e-9, abs=1e-9)
    assert apart.squares == pytest.approx(together.squares, rel=1e-6, abs=1e-6)


def test_a_spread_knows_values_off_its_classes():
    spread = Spread.of(np.array([0.0, 1e-9, 1.0, 1e9, np.inf, np.nan]))
    assert spread.quantile(0.2) == EDGES_M[0] and spread.quantile(1.0) == np.inf
    assert spread.told()["mean_m"] is None


def test_a_trial_that_failed_leaves_no_error_figure():
    mean = np.zeros((3, 4, 2))
    mean[1, 2] = np.nan
    summary = Summary.of(np.zeros((1, 4, 2)), Belief(mean, np.broadcast_to(np.eye(2), (3, 4, 2, 2))), None)
    metrics = summary.metrics()
    assert metrics["rmse_m"] is None and metrics["anees"] is None and metrics["max_deviation_m"] is None
    assert metrics["verdict"] == "overconfident"


def test_without_a_reference_there_is_no_error():
    belief = Belief(np.zeros((3, 4, 2)), np.broadcast_to(np.eye(2), (3, 4, 2, 2)))
    metrics = (Summary.of(None, belief, None) + Summary.of(None, belief, None)).metrics()
    assert metrics["rmse_m"] is None and metrics["sigma_m"] == 1.0 and metrics["verdict"] == "no reference"
