"""Runs: the same numbers whoever computes them, and the result contract."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from engine import runner
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError


def short(trials: int = 3, **changes):
    return toml.override(library.find("first-look"), {"duration_s": 120, "trials": trials, **changes})


def test_trials_are_the_same_whatever_the_number_of_workers_and_the_size_of_blocks(monkeypatch):
    """Seven trials in one process, and in blocks of three on two, bit for bit."""
    one = runner.run(short(7), workers=1).arrays()
    monkeypatch.setattr(runner, "BLOCK", 3)
    monkeypatch.setattr(runner, "blocks", lambda n: [tuple(range(i, min(i + 3, n))) for i in range(0, n, 3)])
    two = runner.run(short(7), workers=2).arrays()
    assert one.keys() == two.keys()
    for name, value in one.items():
        np.testing.assert_array_equal(value, two[name], err_msg=name)


def test_another_seed_is_another_result():
    a, b = (runner.run(short(1, seed=s), workers=1).arrays() for s in (1, 2))
    assert not np.array_equal(a["cekf/scout/mean"], b["cekf/scout/mean"])


def test_the_result_has_the_contracts_figures_and_no_nan():
    result = runner.run(short(2), workers=1)
    told = json.loads(json.dumps(result.to_json(), allow_nan=False))
    assert {"schema", "scenario", "seed", "trials", "algorithms", "claims"} <= told.keys()
    for answer in told["algorithms"].values():
        assert {"subjects", "packets", "cpu_s", "notes"} <= answer.keys()
        assert {"sent", "received", "bytes_per_packet", "floats_per_packet"} <= answer["packets"].keys()
        for figures in answer["subjects"].values():
            wanted = "rmse_m final_rmse_m sigma_m final_sigma_m anees anees_interval consistent max_deviation_m"
            assert set(wanted.split()) <= figures.keys()
    arrays = result.arrays()
    T = len(arrays["time_s"])
    assert arrays["truth/scout"].shape == (2, T, 2)
    assert arrays["nekf/scout/cov"].shape == (2, T, 2, 2)


@pytest.mark.parametrize(
    ("algorithms", "words"),
    [(["nefk"], "there is no algorithm named 'nefk'"), ([], "no algorithm to run")],
)
def test_algorithms_that_cannot_be_run_are_named_before_anything_is(algorithms, words):
    with pytest.raises(ScenarioError, match=words):
        runner.run(short(), algorithms, workers=1)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"deif": {"redundancy": 99}}, "options.deif.redundancy"),
        ({"deif": {"delayed": "xy"}}, "options.deif.delayed"),
        ({"cekf": {"x": 1}}, "options.cekf"),
        ({"nobody": {}}, "options.nobody"),
    ],
)
def test_options_an_algorithm_does_not_have_are_named_before_anything_runs(options, key):
    with pytest.raises(ScenarioError, match=key.replace(".", r"\.")):
        runner.run(short().model_copy(update={"options": options}), ["deif"], workers=1)


def test_progress_ends_at_one_and_never_goes_back():
    told: list[float] = []
    runner.run(short(1), ["dead_reckoning", "nekf"], workers=1, progress=told.append)
    assert told[-1] == 1.0
    assert all(b >= a for a, b in itertools.pairwise(told))
