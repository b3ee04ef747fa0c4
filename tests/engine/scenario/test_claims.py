"""What the shipped scenarios' sources assert holds when the estimators run."""

from __future__ import annotations

import pytest

from engine import runner
from engine.scenario import library

W11 = ["first-look", *(f"walls2011-topology-{letter}" for letter in "abcde")]
RECORDED = ["plaza1-four-beacons", "plaza1-two-beacons", "marine-diver", "goats-auv", "mrclam6-five-robots"]


def assert_claims_hold(name: str, algorithms: list[str]) -> None:
    scenario = library.find(name)
    result = runner.run(scenario, algorithms, workers=1)
    assert result.claims
    failed = [f"{c['text']}: {c['value']} {c['operator']} {c['bound']}" for c in result.claims if not c["holds"]]
    assert not failed


@pytest.mark.parametrize("name", W11)
def test_the_claims_of_a_simulated_mission_hold(name):
    assert_claims_hold(name, ["dead_reckoning", "cekf", "nekf"])


@pytest.mark.recorded
@pytest.mark.parametrize("name", RECORDED)
def test_the_claims_of_a_recorded_mission_hold(name, recorded_data):
    recorded_data(library.find(name).mission.log)  # type: ignore[attr-defined]
    assert_claims_hold(name, ["dead_reckoning", "cekf"])
