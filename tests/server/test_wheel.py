"""A built wheel carries the page and the scenarios and runs outside the checkout."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import httpx
import pytest

from tests.server.living import PATIENCE_S, until

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel unpacked as an installer would, without its dependencies."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = folder.glob("coopnav-*.whl")
    target = folder / "site"
    install = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--quiet", "--target", str(target)]
    subprocess.run([*install, str(wheel)], check=True, capture_output=True)
    return target


def environment(installed: Path) -> dict[str, str]:
    """The wheel before everything else, and nothing of the checkout."""
    return os.environ | {"PYTHONPATH": str(installed), "PYTHONSAFEPATH": "1"}


def test_the_wheel_holds_what_it_needs(installed: Path):
    assert (installed / "server" / "static" / "index.html").is_file()
    assert {p.name for p in (installed / "engine" / "scenarios").glob("*.toml")} == {
        p.name for p in (ROOT / "scenarios").glob("*.toml")
    }
    (wheel,) = installed.parent.glob("coopnav-*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert not [n for n in names if n.startswith(("tests/", ".")) or "__pycache__" in n]


def test_the_installed_server_starts_and_serves_the_page_and_runs_a_job(installed: Path, tmp_path: Path):
    where = "import server, engine; print(server.__file__, engine.__file__)"
    run = {"cwd": tmp_path, "env": environment(installed), "text": True}
    found = subprocess.run([sys.executable, "-c", where], capture_output=True, check=True, **run).stdout.split()
    assert all(Path(path).is_relative_to(installed) for path in found)

    command = [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(tmp_path / "data")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, **run)
    try:
        assert process.stdout is not None
        url = process.stdout.readline().split()[-1].rstrip("/")
        with httpx.Client(base_url=url, timeout=PATIENCE_S) as http:
            assert "<html" in http.get("/").text
            assert "first-look" in {e["name"] for e in http.get("/api/scenarios").json()}
            body = {"scenario": "first-look", "trials": 1, "set": {"duration_s": 60}}
            id = http.post("/api/jobs", json=body).json()["id"]
            until(lambda: http.get(f"/api/jobs/{id}").json()["state"] == "done", "the job")
    finally:
        process.terminate()
        process.wait(PATIENCE_S)
