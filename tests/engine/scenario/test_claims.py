"""What the shipped scenarios' sources assert holds when the estimators run."""

from __future__ import annotations

import pytest

from engine import runner
from engine.scenario import library

SIMULATED = [
    "first-look",
    *(f"walls2011-topology-{letter}" for letter in "abcde"),
    *(f"walls2012-{what}" for what in ("two-node", "two-node-lossy", "lost-communication")),
    *(f"rui-chitre-{what}" for what in ("one-step", "gap", "regions", "steady-safe", "steady-dangerous")),
]
RECORDED = [
    "plaza1-four-beacons",
    "plaza1-two-beacons",
    "marine-diver",
    "goats-auv",
    "mrclam6-five-robots",
    "yaps-hydrophones",
]


def assert_claims_hold(name: str) -> None:
    scenario = library.find(name)
    result = runner.run(scenario, runner.claimed(scenario), workers=1)
    assert result.claims
    failed = [f"{c['text']}: {c['value']} {c['operator']} {c['bound']}" for c in result.claims if not c["holds"]]
    assert not failed


@pytest.mark.parametrize("name", SIMULATED)
def test_the_claims_of_a_simulated_mission_hold(name):
    assert_claims_hold(name)


@pytest.mark.recorded
@pytest.mark.parametrize("name", RECORDED)
def test_the_claims_of_a_recorded_mission_hold(name, recorded_data):
    recorded_data(library.find(name).mission.log)  # type: ignore[attr-defined]
    assert_claims_hold(name)
