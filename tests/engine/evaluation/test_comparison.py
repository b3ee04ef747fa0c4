"""W11's Table I decided from results made up so that each cell must come out one way."""

from __future__ import annotations

import copy

import pytest

from engine.evaluation.comparison import COLUMNS, LOSSY, TOPOLOGIES, VEHICLES, table_1


def subject(sigma: float, growth: float = 1.0, verdict: str = "consistent") -> dict:
    return {"sigma_m": sigma, "sigma_growth": growth, "verdict": verdict}


def result(**algorithms: dict) -> dict:
    packets = {"floats_per_packet": 6.0, "bytes_per_packet": 21.0}
    return {"algorithms": {n: {"subjects": s, "packets": packets} for n, s in algorithms.items()}}


@pytest.fixture
def runs():
    """An ideal estimator: half of dead reckoning's sigma, no growth, whatever is lost."""
    each = result(
        dead_reckoning={v: subject(4.0, 1.2) for v in VEHICLES},
        cekf={v: subject(1.0) for v in VEHICLES},
        ours={v: subject(2.0) for v in VEHICLES},
    )
    return {t: copy.deepcopy(each) for t in TOPOLOGIES}, copy.deepcopy(each)


def ours(runs) -> dict:
    [row] = [r for r in table_1(*runs) if r["algorithm"] == "ours"]
    return {c: row[c]["holds"] for c in COLUMNS}


def of(runs, topology: str, vehicle: str) -> dict:
    where = runs[1] if topology == "lossy" else runs[0][f"walls2011-topology-{topology}"]
    return where["algorithms"]["ours"]["subjects"][vehicle]


def test_an_ideal_estimator_has_every_tick(runs):
    assert set(ours(runs).values()) == {True}


def test_overconfidence_about_one_vehicle_in_one_topology_is_inconsistency(runs):
    of(runs, "a", "iver31")["verdict"] = "overconfident"
    assert ours(runs) == dict(zip(COLUMNS, (False, True, True, True)))


def test_growth_of_more_than_half_of_dead_reckonings_is_unbounded(runs):
    of(runs, "d", "iver28")["sigma_growth"] = 1.11
    assert ours(runs)["bounds_error"] is False
    of(runs, "d", "iver28")["sigma_growth"] = 1.09
    assert ours(runs)["bounds_error"] is True


def test_what_is_bounded_in_the_star_but_not_in_the_cascade_depends_on_the_topology(runs):
    of(runs, "e", "iver31")["sigma_growth"] = 1.19
    assert ours(runs)["arbitrary_topology"] is False


def test_hearing_without_gaining_is_not_working(runs):
    of(runs, "a", "iver28")["sigma_m"] = 3.95
    assert ours(runs)["arbitrary_topology"] is False


def test_the_vehicle_that_hears_nobody_need_not_gain(runs):
    of(runs, "b", "iver28")["sigma_m"] = 4.0
    assert ours(runs)["arbitrary_topology"] is True


def test_losing_most_of_the_gain_or_the_consistency_is_not_robust(runs):
    of(runs, "lossy", "iver28")["sigma_m"] = 3.1
    assert ours(runs)["robust_to_loss"] is False
    of(runs, "lossy", "iver28").update(sigma_m=2.1, verdict="overconfident")
    assert ours(runs)["robust_to_loss"] is False


def test_an_algorithm_missing_from_a_run_has_no_row(runs):
    del runs[0][LOSSY]["algorithms"]["ours"]
    assert [r["algorithm"] for r in table_1(*runs)] == ["dead_reckoning", "cekf"]
