"""Which model reads which family's scenarios; a new family adds its file and its line."""

from __future__ import annotations

from engine.scenario.models import ScenarioBase
from engine.scenario.navigation import NavigationScenario
from engine.scenario.pursuit import PursuitScenario
from engine.scenario.slam import SlamScenario
from engine.scenario.tracking import TrackingScenario

MODELS: dict[str, type[ScenarioBase]] = {
    "navigation": NavigationScenario,
    "pursuit": PursuitScenario,
    "slam": SlamScenario,
    "tracking": TrackingScenario,
}
