"""A server on a free port of this machine, and its client, as tests use them."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import httpx
import pytest
import uvicorn

from server.app import create_app
from server.serving import configured, listen
from server.settings import Settings

PATIENCE_S = 90.0

#: A mission that takes a fraction of a second.
SHORT = {"scenario": "first-look", "trials": 1, "set": {"duration_s": 120, "report_interval_s": 4}}
#: One that takes longer than anybody waits.
LONG = {"scenario": "walls2011-topology-c", "trials": 2000}


def until(true: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """The first true answer; fails when there is none in time."""
    deadline = time.monotonic() + patience_s
    while time.monotonic() < deadline:
        found = true()
        if found:
            return found
        time.sleep(0.02)
    pytest.fail(f"waited {patience_s:.0f} s in vain for {what}")


@dataclass(frozen=True)
class Live:
    """A running server: its address, its client, its settings."""

    url: str
    http: httpx.Client
    settings: Settings
    app: Any

    @property
    def ws(self) -> str:
        return self.url.replace("http", "ws")

    def submit(self, body: dict[str, Any], **headers: str) -> dict[str, Any]:
        answer = self.http.post("/api/jobs", json=body, headers=headers)
        assert answer.status_code == 202, answer.text
        return answer.json()

    def job(self, id: str) -> dict[str, Any]:
        return self.http.get(f"/api/jobs/{id}").json()

    def finished(self, id: str) -> dict[str, Any]:
        """The job once it has ended."""
        return until(lambda: (j := self.job(id))["state"] in ("done", "failed", "cancelled") and j, f"the end of {id}")

    def done(self, body: dict[str, Any]) -> dict[str, Any]:
        """A job that has run well."""
        job = self.finished(self.submit(body)["id"])
        assert job["state"] == "done", job
        return job

    def events(self, id: str, after: int = 0, most: int = 10_000) -> list[tuple[int, str, Any]]:
        """A job's server-sent events (id, kind, data) until they end or are enough."""
        found: list[tuple[int, str, Any]] = []
        headers = {"last-event-id": str(after)} if after else {}
        with self.http.stream("GET", f"/api/jobs/{id}/events", headers=headers) as answer:
            assert answer.headers["content-type"].startswith("text/event-stream")
            fields: dict[str, str] = {}
            for line in answer.iter_lines():
                name, _, value = line.partition(": ")
                if line:
                    fields[name] = value
                elif "data" in fields:
                    found.append((int(fields["id"]), fields["event"], json.loads(fields["data"])))
                    fields = {}
                    if len(found) >= most:
                        break
        return found


def start(settings: Settings, ready: Callable[[Any], Any] = lambda health: health["ready"]) -> Iterator[Live]:
    """Serve in a thread of this process until the test is over; yields once the server's health is as wanted."""
    listener = listen(settings)
    port = listener.getsockname()[1]
    app = create_app(replace(settings, port=port))
    server = uvicorn.Server(configured(app, settings))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    url = f"http://127.0.0.1:{port}"
    with httpx.Client(base_url=url, timeout=PATIENCE_S) as http:
        until(lambda: ready(http.get("/api/health").json()), "the server")
        yield Live(url, http, settings, app)
    server.should_exit = True
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
