"""The real server in a process of its own, as a person would start it."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, Route

PATIENCE_S = 180.0


def until(true: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """The first true answer; fails when there is none in time."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        found = true()
        if found:
            return found
        time.sleep(0.05)
    pytest.fail(f"waited {patience_s:.0f} s in vain for {what}")


def held(page: Page, url: str) -> Callable[[], None]:
    """Requests for a URL wait from now on, until the function that is returned is called."""
    waiting: list[Route] = []
    holding = True

    def hold(route: Route) -> None:
        if holding:
            waiting.append(route)
        else:
            route.continue_()

    def release() -> None:
        nonlocal holding
        until(lambda: page.evaluate("1") and waiting, f"a request for {url}")
        holding = False
        for route in waiting:
            route.continue_()

    page.route(url, hold)
    return release


@dataclass
class Server:
    """`coopnav serve` on a port of this machine (0: a free one, the same again after a restart)."""

    data: Path
    port: int = 0
    process: subprocess.Popen[str] = field(init=False)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        command = [sys.executable, "-m", "server", "serve", "--port", str(self.port), "--data", str(self.data)]
        root = Path(__file__).resolve().parents[2]
        self.process = subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        assert "is open at" in said, f"the server said: {said!r}"
        self.port = int(said.strip().rstrip("/").rsplit(":", 1)[1])
        until(lambda: self.get("/api/health").get("ready"), "the server's workers")

    def stop(self) -> None:
        """End the server; its port is free afterwards."""
        self.process.terminate()
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait(timeout=20)

    def get(self, path: str) -> Any:
        try:
            return httpx.get(self.url + path, timeout=60).json()
        except httpx.TransportError:
            return {}

    def finished(self, body: dict[str, Any]) -> str:
        """Id of a job that was submitted and is done."""
        answer = httpx.post(f"{self.url}/api/jobs", json=body, timeout=60)
        assert answer.status_code == 202, answer.text
        id = answer.json()["id"]
        until(lambda: self.get(f"/api/jobs/{id}").get("state") == "done", "a job to finish")
        return id
