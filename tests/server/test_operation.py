"""What the person who runs the server has: a doctor, a token of his own, logs a machine reads, and probes."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest
from uvicorn.protocols.utils import ClientDisconnected

from server import logs, serving
from server.app import MOST_THREADS
from server.cli import main
from server.doctor import findings
from server.results import Results
from server.settings import Settings
from tests.server.living import PATIENCE_S, SHORT, Live, start, until

TOKEN = "a-token-that-lasts-longer"


def test_the_doctor_finds_a_sound_machine_well(tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr("server.doctor.BROWSERS", ())
    assert main(["doctor", "--port", "0", "--data", str(tmp_path / "new"), "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    for what in ("software", "page", "algorithms", "scenarios", "port", "data", "disk", "memory", "workers", "panes"):
        assert re.search(rf"^(ok|note) .*{what}", printed, re.MULTILINE), printed
    assert "FAIL" not in printed and not (tmp_path / "new").exists()


def test_the_doctor_names_what_keeps_the_server_from_working(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("server.doctor.BROWSERS", ())
    monkeypatch.setattr("server.doctor.PATIENCE_S", 0.5)
    (tmp_path / "file").touch()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        sick = Settings(data=tmp_path / "file" / "data", port=port, cluster="tcp://127.0.0.1:9")
        found = {finding.what: finding for finding in findings(sick)}
    assert {what for what, finding in found.items() if finding.mark == "FAIL"} >= {"port", "workers"}
    assert str(port) in found["port"].found and "127.0.0.1:9" in found["workers"].found


def test_the_doctor_reads_the_jobs_of_a_server_that_is_running(live: Live, monkeypatch):
    monkeypatch.setattr("server.doctor.BROWSERS", ())
    live.done(SHORT)
    settings = Settings(data=live.settings.data, port=0, workers=1)
    found = next(finding for finding in findings(settings) if finding.what == "data")
    assert found.mark == "ok" and "'done'" in found.found


def test_a_token_from_the_environment_is_used_and_not_printed(monkeypatch):
    monkeypatch.setenv(serving.TOKEN_VARIABLE, TOKEN)
    assert serving.given_token() == TOKEN
    assert TOKEN not in serving.address(Settings(data=Path(), token=TOKEN), shown=False)
    for token in ("short", "ü" * 20, "a token of\nmany words"):
        monkeypatch.setenv(serving.TOKEN_VARIABLE, token)
        with pytest.raises(serving.CannotServe, match="at least"):
            serving.given_token()


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--cluster-ca", "ca.pem"], "go together"),
        (["--cluster-ca", "a", "--cluster-cert", "b", "--cluster-key", "c"], "--cluster"),
        (["--cluster", "tls://x:1", "--cluster-ca", "a", "--cluster-cert", "b", "--cluster-key", "c"], "not there"),
    ],
)
def test_half_of_what_a_secured_cluster_takes_is_refused(arguments: list[str], word: str, capsys):
    assert main(["serve", *arguments]) == 2
    assert word in capsys.readouterr().err


class Kept(logging.Handler):
    """Keeps formatted lines."""

    def __init__(self, formatter: logging.Formatter) -> None:
        super().__init__()
        self.setFormatter(formatter)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(self.format(record))


@pytest.fixture
def told() -> Iterator[list[str]]:
    """The server's log lines as JSON text, from the level info on."""
    log, kept = logging.getLogger("server"), Kept(logs.Lines())
    level = log.level
    log.addHandler(kept)
    log.setLevel(logging.INFO)
    yield kept.lines
    log.removeHandler(kept)
    log.setLevel(level)


def test_log_lines_are_json_and_carry_the_job_and_the_request(live: Live, told: list[str]):
    answer = live.http.get("/api/jobs/nosuchjob%0aforged")
    id = live.submit(SHORT)["id"]
    live.finished(id)
    lines: list[dict[str, Any]] = [json.loads(line) for line in told]
    requests = [line for line in lines if line["logger"] == "server.requests"]
    assert {"time", "level", "message", "method", "route", "status", "seconds", "request"} <= set(requests[0])
    assert requests[0]["request"] == answer.headers["x-request-id"] and requests[0]["status"] == 404
    assert any(line.get("job") == id and line["route"] == "/api/jobs/{id}" for line in requests)
    states = [line["message"] for line in lines if line["logger"] == "server.jobs" and line.get("job") == id]
    assert [message.rpartition(" ")[2] for message in states] == ["accepted", "running", "done"]


def test_a_browser_that_goes_away_before_its_websocket_opens_is_no_error(live: Live, told: list[str]):
    told.clear()
    scope = {
        "type": "websocket",
        "path": "/api/scenes/session",
        "headers": [(b"host", b"localhost")],
        "query_string": b"",
        "subprotocols": [],
    }

    async def receive() -> dict[str, Any]:
        return {"type": "websocket.connect"}

    async def send(message: Any) -> None:
        raise ClientDisconnected

    asyncio.run(live.app(scope, receive, send))
    lines = [json.loads(line) for line in told]
    assert "websocket /api/scenes/session: the client went away" in [line["message"] for line in lines]
    assert not [line for line in lines if line["level"] in ("error", "critical")]


def test_text_lines_are_one_line_whatever_is_asked(live: Live):
    log, kept = logging.getLogger("server.requests"), Kept(logs.Text())
    level = log.level
    log.addHandler(kept)
    log.setLevel(logging.INFO)
    try:
        live.http.get("/api/scenarios/x%0aERROR%20forged%1b[31m")
        until(lambda: kept.lines, "a log line")
    finally:
        log.removeHandler(kept)
        log.setLevel(level)
    assert not [line for line in kept.lines if "\n" in line or "\x1b" in line]


def test_a_server_without_workers_lives_and_is_not_ready(tmp_path: Path):
    server = start(Settings(data=tmp_path, port=0, cluster="tcp://127.0.0.1:9"), ready=lambda health: health["live"])
    alone = next(server)
    assert alone.http.get("/api/health/live").status_code == 200
    refused = alone.http.get("/api/health/ready")
    assert refused.status_code == 503 and "retry-after" in refused.headers
    assert "coopnav_ready 0\n" in alone.http.get("/metrics").text
    assert next(server, None) is None


def test_the_figures_are_prometheus_text(live: Live):
    live.done(SHORT)
    lines = live.http.get("/metrics").text.splitlines()
    sample = re.compile(r'[a-z_]+(\{[a-z_]+="[^"]*"(,[a-z_]+="[^"]*")*\})? [0-9.e+-]+')
    assert all(line.startswith("# ") or sample.fullmatch(line) for line in lines)
    assert any(line.startswith('coopnav_jobs{state="done"}') for line in lines)


def test_told_to_end_the_server_lets_go_of_streams_and_workers_and_keeps_what_it_accepted(tmp_path: Path):
    """SIGTERM, as service managers and container runtimes send it; then the next server finishes the job."""
    command = [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(tmp_path), "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ)
    try:
        assert process.stdout is not None and process.stderr is not None
        url = process.stdout.readline().split()[-1]
        many = SHORT | {"trials": 2000, "algorithms": ["dead_reckoning"]}
        with httpx.Client(base_url=url, timeout=PATIENCE_S) as http:
            until(lambda: http.get("/api/health").json()["ready"], "the workers")
            id = http.post("/api/jobs", json=many).json()["id"]
            with http.stream("GET", f"/api/jobs/{id}/events") as stream:
                lines = stream.iter_lines()
                next(line for line in lines if line == "event: progress")
                process.send_signal(signal.SIGTERM)
                assert "event: failed" not in list(lines)
        assert process.wait(PATIENCE_S) in (0, -signal.SIGTERM)
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        process.wait()
    server = start(Settings(data=tmp_path, port=0, workers=2))
    assert next(server).finished(id)["state"] == "done"
    assert next(server, None) is None


def test_a_body_does_not_wait_until_its_head_is_acknowledged(tmp_path: Path):
    """Nagle's rule holds the second of two small writes back for up to 40 ms: of every answer on a kept connection."""

    async def delayed() -> bool:
        found: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        def accepted(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            sock = writer.get_extra_info("socket")
            found.set_result(sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        server = await asyncio.start_server(accepted, sock=serving.listen(Settings(data=tmp_path, port=0)))
        async with server:
            _, writer = await asyncio.open_connection(*server.sockets[0].getsockname())
            at_once = await found
            writer.close()
        return not at_once

    assert not asyncio.run(delayed())


@pytest.mark.parametrize(
    "path", ["/", "/api/health", "/api/jobs/{id}/result", "/static/main.js", "/api/jobs/nosuchjob"]
)
def test_head_tells_what_get_would_bring(live: Live, path: str):
    path = path.format(id=live.done(SHORT)["id"])
    head, get = live.http.head(path), live.http.get(path)
    assert (head.status_code, head.content) == (get.status_code, b"")
    assert head.headers["content-type"] == get.headers["content-type"]
    assert live.http.head(path).status_code == get.status_code, "the connection goes on"


def test_health_answers_while_every_thread_is_at_work(live: Live, monkeypatch: pytest.MonkeyPatch):
    gate, at_work = threading.Event(), threading.Semaphore(0)

    def slow(self: Results, id: str) -> None:
        at_work.release()
        gate.wait(PATIENCE_S)

    monkeypatch.setattr(Results, "view", slow)
    with ThreadPoolExecutor(MOST_THREADS) as readers:
        reading = [readers.submit(httpx.get, f"{live.url}/api/jobs/any/view") for _ in range(MOST_THREADS)]
        try:
            assert all(at_work.acquire(timeout=PATIENCE_S) for _ in reading)
            assert httpx.get(f"{live.url}/api/health", timeout=PATIENCE_S / 4).json()["ready"]
            assert httpx.get(f"{live.url}/static/main.js", timeout=PATIENCE_S / 4).status_code == 200
        finally:
            gate.set()
        assert {answer.result().status_code for answer in reading} == {204}
