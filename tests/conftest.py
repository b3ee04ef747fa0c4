"""What every test may ask for."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

from engine.mission.logs import BESIDE_THE_CHECKOUT, DATA_VARIABLE

settings.register_profile("coopnav", deadline=None, print_blob=True)
settings.load_profile("coopnav")


@pytest.fixture
def recorded_data():
    """A function from the name of a recorded log to its folder: skips where it is not there, but fails in CI."""

    def folder(name: str) -> Path:
        roots = [Path(r) for r in (os.environ.get(DATA_VARIABLE), BESIDE_THE_CHECKOUT) if r]
        for root in roots:
            if (root / name).is_dir():
                return root / name
        why = f"the recorded log {name!r} is neither in {' nor in '.join(map(str, roots))}"
        if os.environ.get("CI", "").lower() in ("1", "true"):
            pytest.fail(f"{why}; in CI the tests on recorded logs must run")
        pytest.skip(f"{why}; put it there or name its parent folder in {DATA_VARIABLE}")

    return folder
