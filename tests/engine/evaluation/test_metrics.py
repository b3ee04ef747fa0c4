"""Metrics of small cases worked out by hand."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import chi2

from engine.evaluation.metrics import correlations, curves, evaluate, gate
from engine.tracks import Belief, Innovations, Reference, Series, Tracks

#: Two trials, three times: errors of 5, 0 and 1 m in the first, 0, 10 and 3 m in the second.
TRUTH = np.array([[[0.0, 0.0], [10.0, 0.0], [20.0, 0.0]]])
ERROR = np.array([[[3.0, 4.0], [0.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [6.0, 8.0], [0.0, 3.0]]])
COV = np.array([1.0, 4.0, 9.0])[:, None, None] * np.eye(2)
BELIEF = Belief(TRUTH + ERROR, np.broadcast_to(COV, (2, 3, 2, 2)))


def scores(truth: np.ndarray | None, tracks: Tracks) -> dict:
    reference = Reference(np.arange(3.0), {} if truth is None else {"iver": truth})
    return evaluate(reference, {"x": tracks})["x"]["iver"]


def test_metrics_of_two_trials_by_hand():
    found = scores(TRUTH, Tracks({"iver": BELIEF}))
    assert found["rmse_m"] == pytest.approx(np.sqrt((25 + 0 + 1 + 0 + 100 + 9) / 6))
    assert found["final_rmse_m"] == pytest.approx(np.sqrt((1 + 9) / 2))
    assert found["sigma_m"] == pytest.approx((1 + 2 + 3) / 3)
    assert found["final_sigma_m"] == pytest.approx(3)
    assert found["anees"] == pytest.approx((25 / 2 + 100 / 4 / 2 + 10 / 9 / 2) / 3)
    assert found["anees_interval"] == pytest.approx(list(chi2.ppf([0.025, 0.975], 4) / 2))
    assert (found["consistent"], found["verdict"]) == (False, "overconfident")
    assert found["max_deviation_m"] is None


def test_curves_of_two_trials_by_hand():
    found = curves(TRUTH, BELIEF)
    np.testing.assert_allclose(found.error_m, np.sqrt([12.5, 50, 5]))
    np.testing.assert_allclose(found.sigma_m, [1, 2, 3])
    np.testing.assert_allclose(found.nees, [12.5, 12.5, 5 / 9])


def test_a_truth_of_each_trial_scores_as_the_shared_one():
    each = np.broadcast_to(TRUTH, (2, 3, 2))
    assert scores(each, Tracks({"iver": BELIEF})) == scores(TRUTH, Tracks({"iver": BELIEF}))


def test_every_error_with_a_reference_weighs_the_same():
    truth = np.broadcast_to(TRUTH, (2, 3, 2)).copy()
    truth[1, 1:] = np.nan
    found = scores(truth, Tracks({"iver": BELIEF}))
    assert found["rmse_m"] == pytest.approx(np.sqrt((25 + 0 + 1 + 0) / 4))


def test_the_final_error_is_taken_where_the_reference_ends():
    truth = TRUTH.copy()
    truth[:, 2] = np.nan
    found = scores(truth, Tracks({"iver": BELIEF}))
    assert found["final_rmse_m"] == pytest.approx(np.sqrt(50))
    assert found["rmse_m"] == pytest.approx(np.sqrt(125 / 4))
    assert found["final_sigma_m"] == pytest.approx(3)


def test_medians_are_over_trials_of_what_each_is_off_on_average_and_in_the_end():
    away = np.array([[0.0, 1.0, 2.0], [3.0, 3.0, 6.0], [10.0, 100.0, 40.0]])
    mean = TRUTH + np.stack([away, 0 * away], axis=-1)
    series = Series("", "m", np.where(away > 1.5, away, np.nan), ("iver",))
    tracks = Tracks({"iver": Belief(mean, np.tile(np.eye(2), (3, 3, 1, 1)))}, series={"lag_m/iver": series})
    found = scores(TRUTH, tracks)
    assert found["error_median_m"] == pytest.approx(4.0)
    assert found["final_error_median_m"] == pytest.approx(6.0)
    assert found["lag_m_median"] == pytest.approx(4.0)
    assert (found["lag_m_first"], found["lag_m_final"]) == (3.0, 6.0)


@pytest.mark.parametrize("truth", [None, np.full((1, 3, 2), np.nan)])
def test_without_a_reference_only_what_needs_none_is_reported(truth):
    found = scores(truth, Tracks({"iver": BELIEF}))
    assert [found[k] for k in ("rmse_m", "final_rmse_m", "anees", "consistent")] == [None] * 4
    assert found["verdict"] == "no reference"
    assert found["sigma_m"] == pytest.approx(2)


def test_a_beacon_known_exactly_is_consistent():
    beacon = Belief(TRUTH, np.zeros((1, 3, 2, 2)))
    found = scores(TRUTH, Tracks({"iver": beacon}))
    assert (found["rmse_m"], found["anees"], found["consistent"]) == (0.0, None, True)


def test_a_failed_estimate_has_no_error_figure_and_json_no_nan():
    mean = BELIEF.mean.copy()
    mean[0, 1] = np.nan
    found = scores(TRUTH, Tracks({"iver": Belief(mean, BELIEF.cov)}))
    assert (found["rmse_m"], found["anees"], found["verdict"]) == (None, None, "overconfident")
    json.dumps(found, allow_nan=False)


def test_deviation_is_the_largest_distance_to_the_centralized_mean():
    shifted = BELIEF.mean.copy()
    shifted[1, 2] += [3.0, -4.0]
    shifted[0, 0] += [1.0, 0.0]
    results = {"cekf": Tracks({"iver": BELIEF}), "nekf": Tracks({"iver": Belief(shifted, BELIEF.cov)})}
    found = evaluate(Reference(np.arange(3.0), {"iver": TRUTH}), results, "cekf")
    assert found["nekf"]["iver"]["max_deviation_m"] == pytest.approx(5.0)
    assert found["cekf"]["iver"]["max_deviation_m"] == 0.0


def test_correlation_is_reported_to_both_and_its_drop_is_from_the_peak_before():
    value = np.array([[0.0, 0.4, 0.9, 0.2, 0.3], [0.0, 0.6, 0.7, 0.2, 0.5]])
    series = {
        "correlation/a~b": Series("", "1", value, ("a", "b")),
        "speed": Series("", "m/s", value, ("a",)),
    }
    expected = {"mean": 0.38, "min": 0.0, "max": 0.8, "final": 0.4, "drop": 0.6}
    assert correlations("a", series) == {"b": pytest.approx(expected)}
    assert correlations("b", series) == {"a": pytest.approx(expected)}
    assert correlations("c", series) == {}


def test_the_gate_counts_what_was_heard_and_averages_what_was_accepted():
    found = gate(
        Innovations(
            np.array([1.0, 2.0, 3.0]),
            value=np.array([[1.0, np.nan, 30.0], [2.0, 3.0, -1.0]]),
            variance=np.array([[1.0, np.nan, 1.0], [4.0, 3.0, 2.0]]),
            accepted=np.array([[True, False, False], [True, True, True]]),
        )
    )
    assert (found["offered"], found["accepted"]) == (5, 4)
    assert found["mean_nis"] == pytest.approx((1 + 1 + 3 + 0.5) / 4)
    assert found["nis_interval"] == pytest.approx(list(chi2.ppf([0.025, 0.975], 4) / 4))


def test_a_vehicle_that_heard_nothing_has_no_mean_nis():
    nothing = Innovations(np.array([1.0]), np.full((1, 1), np.nan), np.full((1, 1), np.nan), np.zeros((1, 1), bool))
    assert gate(nothing) == {"offered": 0, "accepted": 0, "mean_nis": None, "nis_interval": None}


def test_without_a_reference_the_ranges_speak():
    """White innovations of the predicted variance: their mean NIS lies in its interval."""
    value = np.random.default_rng(7).normal(size=(1, 500))
    seen = Innovations(np.arange(500.0), value, np.ones((1, 500)), np.ones((1, 500), bool))
    found = scores(None, Tracks({"iver": BELIEF}, innovations={"iver": seen}))
    low, high = found["ranges"]["nis_interval"]
    assert low < found["ranges"]["mean_nis"] < high
    assert "Of 500 ranges 500 passed the gate" in found["explanation"]


def test_a_series_of_one_subject_is_a_metric_with_the_interval_of_its_mean():
    """Means 1, 2 and 3 of three trials; a fourth has none."""
    value = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [np.nan, 3.0, np.nan], [np.nan, np.nan, np.nan]])
    found = scores(None, Tracks({"iver": BELIEF}, series={"delay/iver": Series("", "s", value, ("iver",))}))
    half = 1.96 / np.sqrt(3)
    assert found["delay"] == pytest.approx((3 + 6 + 3) / 7)
    assert found["delay_interval"] == pytest.approx([2 - half, 2 + half])
    alone = scores(None, Tracks({"iver": BELIEF}, series={"delay/iver": Series("", "s", value[:1], ("iver",))}))
    assert alone["delay_interval"] is None
