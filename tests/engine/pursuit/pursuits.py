"""Pursuits for the tests to fly."""

from __future__ import annotations

from typing import Any

from engine.pursuit.mission import PursuitMission, fly
from engine.scenario import toml
from engine.scenario.pursuit import PursuitScenario

NAMES = ("nostromo", "silvana", "kestrel")


def scenario(**changes: Any) -> PursuitScenario:
    """A short pursuit in C19's inner formation without loss, with tables or keys changed."""
    tables: dict[str, Any] = {
        "schema": 1,
        "title": "a pursuit",
        "family": "pursuit",
        "duration_s": 600.0,
        "seed": 7,
        "algorithms": ["decentralized_pursuit"],
        "formation": {"kind": "inner", "length_m": 90.0},
        "vehicles": [{"name": name} for name in NAMES],
        "report_interval_s": 10.0,
    }
    found = toml.validate(tables | changes)
    assert isinstance(found, PursuitScenario)
    return found


def mission(trials: int = 4, **changes: Any) -> PursuitMission:
    return fly(scenario(**changes), range(trials))
