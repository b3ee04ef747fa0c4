"""The scenarios that ship with coopnav, by name."""

from __future__ import annotations

import difflib
import re
from functools import cache
from pathlib import Path

from engine import registry
from engine.scenario import toml
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.models import ScenarioBase

NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")
_ENGINE = Path(__file__).resolve().parents[1]


@cache
def folder() -> Path:
    """Where the shipped scenarios are: inside an installed wheel, or at the top of the checkout."""
    installed = _ENGINE / "scenarios"
    return installed if installed.is_dir() else _ENGINE.parent / "scenarios"


def names() -> list[str]:
    """The shipped scenarios' names, the one to open first in front, the others in order."""
    found = sorted(p.stem for p in folder().glob("*.toml") if NAME.fullmatch(p.stem))
    return sorted(found, key=lambda name: name != "first-look")


def shipped(name: str) -> ScenarioBase:
    """The shipped scenario of that name; ScenarioError where there is none."""
    if not NAME.fullmatch(name) or name not in names():
        near = difflib.get_close_matches(name, names(), n=1)
        remedy = f"did you mean {near[0]!r}?" if near else f"there are: {', '.join(names())}"
        raise ScenarioError([Problem("scenario", f"there is no scenario named {name[:80]!r}", remedy)])
    scenario = toml.load(folder() / f"{name}.toml")
    return scenario.model_copy(update={"origin": ""})


def find(name_or_path: str) -> ScenarioBase:
    """A shipped scenario by name, or the one in a file or in a folder's scenario.toml. Raises ScenarioError.

    A word without a slash or suffix is a name; to read a folder of that name, write ./folder.
    """
    if NAME.fullmatch(name_or_path) and (name_or_path in names() or not Path(name_or_path).is_dir()):
        return shipped(name_or_path)
    return toml.load(name_or_path)


def missing(scenario: ScenarioBase, *roots: Path | str) -> str | None:
    """Why a scenario's recording is not to be found on this machine; None where it is, or the mission is simulated.

    The recording is not read. roots are folders to look in besides those always searched.
    """
    mission = getattr(scenario, "mission", None)
    if getattr(mission, "kind", None) != "recorded":
        return None
    from engine.mission.logs import log_folder

    try:
        log_folder(scenario, roots)
    except ScenarioError as error:
        return str(error)
    return None


def check_algorithms(scenario: ScenarioBase) -> None:
    """Raise ScenarioError where the scenario or its claims name an algorithm that is not installed."""
    known = registry.algorithms()
    places = [(f"algorithms[{n}]", name) for n, name in enumerate(scenario.algorithms)]
    for n, claim in enumerate(scenario.claims):
        places.append((f"claims[{n}].algorithm", claim.algorithm))
        if claim.than is not None:
            places.append((f"claims[{n}].than.algorithm", claim.than.algorithm))
    problems = [
        Problem(key, f"there is no algorithm named {name!r}", f"choose from: {', '.join(sorted(known))}")
        for key, name in places
        if name not in known
    ]
    if problems:
        raise ScenarioError(problems)
