"""The scenarios one can run: shipped ones, and those a person saved."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError
from engine.scenario.models import ScenarioBase
from server.artifacts import write_text
from server.problems import Refusal

NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")
#: Saved scenarios: every one of them is read for the list.
MOST = 500


@dataclass(frozen=True)
class Shelf:
    """Scenario files by name; saved ones are TOML files in a folder, never links out of it."""

    folder: Path

    def names(self) -> list[tuple[str, bool]]:
        """All names, with whether shipped; a shipped name hides a saved one."""
        shipped = list(library.names())
        saved = sorted(p.stem for p in self.folder.glob("*.toml") if NAME.fullmatch(p.stem) and not p.is_symlink())
        return [(n, True) for n in shipped] + [(n, False) for n in saved if n not in shipped]

    def find(self, name: str) -> ScenarioBase:
        """The scenario of a name; Refusal 404 where there is none."""
        if name in library.names():
            return library.shipped(name)
        path = self._path(name)
        if path is None or path.is_symlink() or not path.is_file():
            raise Refusal(404, "unknown-scenario", f"there is no scenario named {name[:80]!r}")
        return toml.load(path)

    def is_shipped(self, name: str) -> bool:
        return name in library.names()

    def save(self, name: str, scenario: ScenarioBase) -> bool:
        """Keep a scenario under a name; whether it is a new one."""
        path = self._writable(name)
        new = not path.exists()
        if new and sum(1 for _ in self.folder.glob("*.toml")) >= MOST:
            raise Refusal(422, "scenarios", f"{MOST} scenarios are kept already; delete some")
        self.folder.mkdir(parents=True, exist_ok=True)
        write_text(path, toml.dumps(scenario))
        return new

    def delete(self, name: str) -> None:
        path = self._writable(name)
        if not path.is_file():
            raise Refusal(404, "unknown-scenario", f"there is no scenario named {name!r}")
        path.unlink()

    def entries(self) -> list[dict[str, Any]]:
        """Every scenario in brief, with what keeps it from running here."""
        return [self._entry(name, shipped) for name, shipped in self.names()]

    def _entry(self, name: str, shipped: bool) -> dict[str, Any]:
        try:
            scenario = self.find(name)
        except ScenarioError as error:
            return _brief(name, shipped, None) | {"missing": str(error)}
        except Refusal as error:
            return _brief(name, shipped, None) | {"missing": error.detail}
        return _brief(name, shipped, scenario)

    def _path(self, name: str) -> Path | None:
        return self.folder / f"{name}.toml" if NAME.fullmatch(name) else None

    def _writable(self, name: str) -> Path:
        path = self._path(name)
        if path is None:
            problem = {
                "key": "name",
                "message": "this is no name for a scenario",
                "remedy": "use up to 64 lower-case letters, digits and hyphens, a letter or digit first",
            }
            raise Refusal(422, "name", f"name: {problem['message']}; {problem['remedy']}", [problem])
        if self.is_shipped(name):
            raise Refusal(
                403, "read-only", f"{name} is shipped with coopnav and stays as it is; save it under another name"
            )
        return path


def _brief(name: str, shipped: bool, scenario: ScenarioBase | None) -> dict[str, Any]:
    missing = None if scenario is None else unavailable(scenario)
    return {
        "name": name,
        "title": scenario.title if scenario else name,
        "summary": scenario.summary if scenario else "",
        "source": scenario.source if scenario else "",
        "family": scenario.family if scenario else "",
        "algorithms": list(scenario.algorithms) if scenario else [],
        "vehicles": [v.name for v in getattr(scenario, "vehicles", ())],
        "duration_s": scenario.duration_s if scenario else None,
        "trials": scenario.trials if scenario else 0,
        "shipped": shipped,
        "available": scenario is not None and missing is None,
        "missing": missing,
    }


def unavailable(scenario: ScenarioBase) -> str | None:
    """Why a scenario cannot run on this machine: its recorded data is not there."""
    return library.missing(scenario)
