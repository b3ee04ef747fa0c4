"""A third party's algorithm, installed from its own package, appears and runs without a change to our tree."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def example_from_the_guide() -> str:
    """The algorithm CONTRIBUTING.md prints, so that the guide cannot rot."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    return re.search(r"```python\n(.*?)```", text, re.S).group(1)


def test_the_guides_example_is_found_by_its_entry_point_and_runs(tmp_path):
    """Laid out as an installer lays it out: a module, and metadata with the entry point."""
    site = tmp_path / "site"
    (site / "my_package").mkdir(parents=True)
    (site / "my_package" / "__init__.py").write_text("")
    (site / "my_package" / "half_trust.py").write_text(example_from_the_guide())
    info = site / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[coopnav.algorithms]\nhalf_trust = my_package.half_trust:HALF_TRUST\n")
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])}

    def coopnav(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, "-m", "server", *words], env=env, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    listed = {a["name"]: a for a in json.loads(coopnav("list", "algorithms", "--json"))}
    assert listed["half_trust"]["family"] == "navigation"
    coopnav("run", "first-look", "--algorithms", "half_trust,nekf", "--trials", "2", "--out", "answer")
    result = json.loads((tmp_path / "answer" / "result.json").read_text())
    ours, naive = (result["algorithms"][name] for name in ("half_trust", "nekf"))
    assert ours["packets"]["sent"] == naive["packets"]["sent"] > 0
    assert all(s["rmse_m"] > 0 for s in ours["subjects"].values())
