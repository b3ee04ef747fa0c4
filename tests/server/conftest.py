"""A running server, shared by the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from server.settings import Settings
from tests.server.living import Live, start


@pytest.fixture(scope="session")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    yield from start(Settings(data=tmp_path_factory.mktemp("data"), port=0, workers=2))


@pytest.fixture
def data_files(live: Live) -> Callable[[], set[Path]]:
    """Scenario files and job folders the server keeps now."""

    def files() -> set[Path]:
        return {p for room in ("scenarios", "jobs") for p in (live.settings.data / room).glob("*")}

    return files
