"""What the page draws of a run, against the tracks it was made of."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, ttest_rel

from engine import runner
from engine.evaluation.spread import errors
from engine.runner import Shard
from engine.scenario import library, toml
from server import view, work
from server.wire import dumps

NAMES = ["dead_reckoning", "cekf", "nekf"]
TRIALS = 5


@pytest.fixture(scope="module")
def parts():
    changes = {"duration_s": 300, "report_interval_s": 4, "trials": TRIALS}
    scenario = toml.override(library.shipped("first-look"), changes)
    blocks = [tuple(range(3)), tuple(range(3, TRIALS))]
    shards = [Shard(name, trials) for name in NAMES for trials in blocks]
    found = [(shard, *runner.run_shard(scenario, shard, lambda *_: None)) for shard in shards]
    return scenario, found


@pytest.fixture(scope="module")
def told(parts):
    scenario, found = parts
    return json.loads(dumps(view.build(work.outline(scenario), found, NAMES)))


def joined(parts, name: str, subject: str):
    mine = [(reference, tracks) for shard, reference, tracks in parts[1] if shard.algorithm == name]
    return np.concatenate([errors(r.truth[subject], t.beliefs[subject]) for r, t in mine])


def test_the_band_is_that_of_all_trials(parts, told):
    error = joined(parts, "nekf", "scout")
    assert len(error) == TRIALS
    band = told["algorithms"]["nekf"]["subjects"]["scout"]["band"]["error_m"]
    np.testing.assert_allclose(band, np.percentile(error, [5, 50, 95], axis=0), atol=6e-4)
    assert told["band"] == [0.05, 0.5, 0.95]


def test_the_distribution_is_that_of_all_errors(parts, told):
    error = joined(parts, "nekf", "scout")
    shares = told["algorithms"]["nekf"]["subjects"]["scout"]["distribution_m"]
    np.testing.assert_allclose(shares, np.percentile(error, np.arange(101)), atol=6e-4)


def test_errors_without_a_reference_have_no_distribution(parts):
    scenario, _ = parts
    shard = Shard("nekf", (0,))
    reference, tracks = runner.run_shard(scenario, shard, lambda *_: None)
    belief = tracks.beliefs["scout"]
    failed = replace(belief, mean=np.where(np.arange(belief.mean.shape[1])[:, None] == 7, np.nan, belief.mean))
    for truth, subject in (({}, belief), (reference.truth, failed)):
        found = replace(reference, truth=truth), replace(tracks, beliefs={"scout": subject})
        told = view.build(work.outline(scenario), [(shard, *found)], ["nekf"])
        assert told["algorithms"]["nekf"]["subjects"]["scout"]["distribution_m"] == []


def test_differences_between_estimators_are_paired_by_trial(parts, told):
    mine, theirs = (np.sqrt(np.mean(joined(parts, n, "scout") ** 2, axis=1)) for n in ("nekf", "dead_reckoning"))
    mean, half = told["differences"]["rmse_m"]["scout"]["nekf"]["dead_reckoning"]
    expected = ttest_rel(mine, theirs).confidence_interval(0.95)
    assert mean - half == pytest.approx(expected.low, abs=1e-5)
    assert mean + half == pytest.approx(expected.high, abs=1e-5)
    back, _ = told["differences"]["rmse_m"]["scout"]["dead_reckoning"]["nekf"]
    assert back == -mean


def test_innovations_are_averaged_within_bounds_of_their_number(parts, told):
    seen = told["algorithms"]["cekf"]["surprise"]["scout"]
    count = len(seen["time_s"])
    assert count and all(len(values) == count for values in seen.values())
    heard = [t.innovations["scout"] for s, _, t in parts[1] if s.algorithm == "cekf"]
    accepted = sum(int(np.sum(np.isfinite(i.value) & i.accepted)) for i in heard)
    each = [round(1 / _variance_of_mean(low, high)) for low, high in zip(seen["low"], seen["high"])]
    assert sum(each) == accepted


def _variance_of_mean(low: float, high: float) -> float:
    """1 / n of the chi-square interval of a mean of n."""
    counts = np.arange(1, 200)
    bounds = chi2.ppf([[0.025], [0.975]], counts) / counts
    return 1 / counts[np.argmin(np.abs(bounds[0] - low) + np.abs(bounds[1] - high))]


def test_bytes_broadcast_add_up_to_what_was_counted(parts, told):
    for name in ("dead_reckoning", "nekf"):
        counted = sum(t.packets.bytes_sent for s, _, t in parts[1] if s.algorithm == name)
        curve = told["algorithms"][name]["series"]["sent_bytes"]["value"]
        assert curve == sorted(curve)
        assert curve[-1] == pytest.approx(counted / TRIALS)
    assert counted > 0


def test_one_trial_has_neither_bands_nor_intervals(parts):
    scenario, _ = parts
    alone = [
        (shard, *runner.run_shard(scenario, shard, lambda *_: None))
        for shard in (Shard(name, (0,)) for name in ("dead_reckoning", "nekf"))
    ]
    told = json.loads(dumps(view.build(work.outline(scenario), alone, NAMES)))
    assert set(told["algorithms"]) == {"dead_reckoning", "nekf"}
    assert told["algorithms"]["nekf"]["subjects"]["scout"]["band"] == {"error_m": None, "sigma_m": None}
    mean, half = told["differences"]["sigma_m"]["scout"]["nekf"]["dead_reckoning"]
    assert mean < 0 and half is None


def test_fixes_that_follow_each_other_are_told_as_one(parts):
    def fix(subject: str, time_s: float) -> dict[str, object]:
        return {"kind": "fix", "subject": subject, "time_s": time_s}

    scenario, found = parts
    packet = {"kind": "packet", "from": "scout", "to": "ship", "tol_s": 5.0, "toa_s": 5.1, "heard": True}
    events = [fix("ship", 0.0), fix("scout", 0.0), packet, fix("ship", 20.0), fix("ship", 50.0), fix("ship", 81.0)]
    seen = view.build(work.outline(scenario) | {"events": events}, found, NAMES)["events"]
    assert seen == [
        fix("ship", 0.0) | {"until_s": 50.0},
        fix("scout", 0.0) | {"until_s": 0.0},
        packet,
        fix("ship", 81.0) | {"until_s": 81.0},
    ]
    assert "until_s" not in events[0], "what the mission told stays as it is"
