"""Small missions for the tests of this folder."""

from __future__ import annotations

from engine.scenario.slam import SlamScenario


def scenario(**changes) -> SlamScenario:
    """A vehicle that circles a drifting beacon for a hundred seconds; tables in `changes` are merged key by key."""
    tables = {
        "schema": 1,
        "title": "Once round",
        "family": "slam",
        "duration_s": 99.0,
        "seed": 4,
        "vehicle": {
            "name": "auv",
            "path": {"kind": "loiter", "center_m": [0.0, 0.0], "radius_m": 40.0, "speed_mps": 1.5},
        },
        "beacon": {"name": "beacon", "path": {"kind": "station", "position_m": [3.0, -2.0]}},
        "water": {"snr_db": 12.0, "reference_m": 40.0},
        "ranging": {"count": 20},
        "arrays": {"count": 4, "elements": 8},
    }
    for key, value in changes.items():
        merged = isinstance(value, dict) and isinstance(tables.get(key), dict)
        tables[key] = tables[key] | value if merged else value
    return SlamScenario.model_validate(tables)
