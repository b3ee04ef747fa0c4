"""Scenarios that come as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from engine.scenario import toml
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.models import ScenarioBase


def from_json(value: Any) -> ScenarioBase:
    """The scenario of a JSON object with a scenario file's keys; null means left out. Raises ScenarioError."""
    return toml.validate(_sound("scenario", value))


def with_values(scenario: ScenarioBase, values: Mapping[str, Any]) -> ScenarioBase:
    """The scenario with some keys changed, given as JSON values by key path. Raises ScenarioError."""
    changes = {key: _sound(key, value) for key, value in values.items()}
    return toml.override(scenario, changes) if changes else scenario


def _sound(key: str, value: Any) -> Any:
    try:
        json.dumps([key, value], ensure_ascii=False).encode()
        return _without_null(value)
    except UnicodeEncodeError:
        raise ScenarioError([Problem("", "the text is not Unicode", "send UTF-8 without lone surrogates")]) from None
    except RecursionError:
        raise ScenarioError([Problem("", "tables are nested too deeply", "send a scenario file's keys")]) from None


def _without_null(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _without_null(v) for k, v in value.items() if v is not None}
    if isinstance(value, list):
        return [_without_null(v) for v in value]
    return value
