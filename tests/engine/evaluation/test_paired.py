"""Differences between estimators, paired by trial, against SciPy's paired t test."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ttest_rel

from engine.evaluation.metrics import evaluate
from engine.evaluation.paired import difference, differences, figures
from engine.tracks import Belief, Reference, Tracks


def test_the_interval_is_that_of_scipys_paired_t_test():
    rng = np.random.default_rng(3)
    luck = rng.normal(10.0, 3.0, size=12)
    mine, theirs = luck + rng.normal(0.4, 0.5, 12), luck + rng.normal(0.0, 0.5, 12)
    found = difference(mine, theirs)
    expected = ttest_rel(mine, theirs).confidence_interval(0.95)
    assert found.mean - found.half == pytest.approx(expected.low)
    assert found.mean + found.half == pytest.approx(expected.high)


def test_the_interval_holds_the_true_difference_as_often_as_it_says():
    rng = np.random.default_rng(4)
    holds = 0
    for _ in range(2000):
        luck = rng.normal(0.0, 5.0, size=6)
        found = difference(luck + rng.normal(1.0, 1.0, 6), luck)
        holds += abs(found.mean - 1.0) <= found.half
    assert holds / 2000 == pytest.approx(0.95, abs=0.02), "four standard errors"


def test_a_trial_alone_has_no_interval_and_failed_trials_do_not_count():
    alone = difference(np.array([3.0]), np.array([1.0]))
    assert alone.mean == 2.0 and np.isnan(alone.half)
    assert np.isnan(difference(np.array([np.nan]), np.array([1.0])).mean)
    whole = difference(np.array([3.0, 5.0]), np.array([1.0, 2.0]))
    assert difference(np.array([3.0, np.nan, 5.0]), np.array([1.0, 1.0, 2.0])) == whole


def test_figures_of_the_trials_make_up_those_of_the_result():
    rng = np.random.default_rng(5)
    truth = {"iver": rng.normal(size=(4, 9, 2))}
    truth["iver"][:, -2:] = np.nan
    shape = rng.normal(size=(4, 9, 2, 2))
    belief = Belief(rng.normal(size=(4, 9, 2)), shape @ shape.swapaxes(-1, -2))
    told = evaluate(Reference(np.arange(9.0), truth), {"cekf": Tracks({"iver": belief})})["cekf"]["iver"]
    own = figures(truth["iver"], belief)
    assert np.sqrt(np.mean(own["rmse_m"] ** 2)) == pytest.approx(told["rmse_m"])
    assert np.sqrt(np.mean(own["final_rmse_m"] ** 2)) == pytest.approx(told["final_rmse_m"])
    assert own["sigma_m"].mean() == pytest.approx(told["sigma_m"])
    assert own["final_sigma_m"].mean() == pytest.approx(told["final_sigma_m"])
    assert np.isnan(figures(None, belief)["rmse_m"]).all()


def test_trials_are_matched_by_their_numbers():
    one = {"iver": {"rmse_m": np.array([1.0, 2.0, 3.0])}}
    other = {"iver": {"rmse_m": np.array([30.0, 10.0])}}
    told = differences({"a": one, "b": other}, {"a": [0, 1, 2], "b": [2, 0]})["rmse_m"]["iver"]
    assert told["a"]["b"].mean == pytest.approx((3 - 30 + 1 - 10) / 2)
    assert told["b"]["a"].mean == -told["a"]["b"].mean
    assert set(told) == {"a", "b"} and set(told["a"]) == {"b"}
