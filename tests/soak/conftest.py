"""Figures measured by the soak: printed at its end, and written to test-artifacts/soak.json."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
import pytest

FIGURES = pytest.StashKey[dict[str, Any]]()


def pytest_configure(config: pytest.Config) -> None:
    config.stash[FIGURES] = {}


@pytest.fixture
def told(request: pytest.FixtureRequest) -> Callable[..., None]:
    """A function that keeps figures of the running proof."""
    figures = request.config.stash[FIGURES].setdefault(request.node.name, {})
    return lambda **measured: figures.update(measured)


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    figures = config.stash[FIGURES]
    if not figures:
        return
    machine = {"cores": psutil.cpu_count(), "python": platform.python_version(), "load": psutil.getloadavg()}
    path = Path(config.rootpath) / "test-artifacts" / "soak.json"
    path.parent.mkdir(exist_ok=True)
    known = json.loads(path.read_text()) if path.is_file() else {}
    path.write_text(json.dumps(known | {"machine": machine} | figures, indent=1))
    terminalreporter.section("figures")
    for proof, measured in figures.items():
        terminalreporter.line(f"{proof}: " + ", ".join(f"{name} {value}" for name, value in measured.items()))
