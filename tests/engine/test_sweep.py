"""Sweeps over one key of a scenario."""

from __future__ import annotations

import pytest

from engine import sweep
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError


def test_both_ends_of_a_range_are_included():
    assert sweep.parse("network.loss=0:0.9:0.3") == sweep.Sweep("network.loss", (0.0, 0.3, 0.6, 0.9))
    assert sweep.parse("duration_s=60,120").values == (60.0, 120.0)


@pytest.mark.parametrize("text", ["network.loss", "=1:2:1", "a=1:2", "a=2:1:1", "a=0:1:0", "a=x", "a=0:1e9:1", "a=nan"])
def test_what_is_no_range_is_refused_with_an_example(text):
    with pytest.raises(ScenarioError, match=r"network\.loss=0:0\.9:0\.1"):
        sweep.parse(text)


def test_a_value_the_scenario_does_not_allow_stops_the_sweep_before_it_starts():
    with pytest.raises(ScenarioError, match=r"network\.loss"):
        sweep.points(library.find("first-look"), sweep.parse("network.loss=0:2:1"))


def test_uncertainty_grows_with_loss_and_dead_reckoning_does_not_care():
    scenario = toml.override(library.find("first-look"), {"duration_s": 600, "trials": 4})
    results = [(v, r.to_json()) for v, r in sweep.run(scenario, sweep.parse("network.loss=0,0.5,1"), workers=1)]
    curves = sweep.summary("network.loss", results)
    told = curves["algorithms"]["cekf"]["subjects"]["scout"]["sigma_m"]
    alone = curves["algorithms"]["dead_reckoning"]["subjects"]["scout"]["sigma_m"]
    assert told[0] < told[1] < told[2]
    assert alone[0] == alone[1] == alone[2] == pytest.approx(told[2], rel=1e-9)
