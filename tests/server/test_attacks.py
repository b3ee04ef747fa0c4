"""What an attacker tries, and what he gets: a table, then what takes more than one request.

Who he is: a page of another site open in the user's browser; another program or user of the same machine; anybody who
reaches a server bound to more than loopback. What he may not get: files, somebody's jobs changed, code run, a tunnel
out, or the server's time. The user himself, and what he installed, are trusted.
"""

from __future__ import annotations

import gzip
import io
import json
import pickle
import socket
import ssl
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from server import artifacts
from server.attempts import FREE
from server.guard import OPEN
from server.scenes import inner, relay
from server.settings import Settings
from tests.server.living import PATIENCE_S, SHORT, Live, start, until

TOKEN = "a-token-of-at-least-24-letters"
MIB = 2**20
JSON, TOML = {"content-type": "application/json"}, {"content-type": "application/toml"}
CSV = {"content-type": "text/csv"}
CHUNKED = {"transfer-encoding": "chunked"}
BINARY, ZIPPED = {"content-type": "application/octet-stream"}, JSON | {"content-encoding": "gzip"}
EVIL = {"origin": "http://evil.example"}


def deep(opening: str, closing: str, times: int = 100_000) -> str:
    return opening * times + closing * times


UNKNOWN = "".join(f"k{n} = 1\n" for n in range(100_000))


def with_set(key: str, value: str) -> str:
    return f'{{"scenario": "first-look", "set": {{"{key}": {value}}}}}'


def with_algorithm(name: str) -> str:
    return f'{{"scenario": "first-look", "algorithms": ["{name}"]}}'


def zip_bomb() -> bytes:
    """An archive a thousandth the size of what is in it."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.csv", bytes(16 * MIB))
    return packed.getvalue()


ZIP_BOMB = zip_bomb()
CLAIM = json.dumps([{"text": "x" * MIB, "metric": "rmse_m", "algorithm": "cekf", "operator": "<", "bound": 1}])
RECORDED = """{"scenario": {"schema": 1, "title": "x", "family": "navigation", "algorithms": ["cekf"],
"mission": {"kind": "recorded", "format": "csv", "log": "%s",
"odometry": [{"vehicle": "a", "file": "passwd.csv", "time": "t", "forward": "f", "turn": "w"}]},
"vehicles": [{"name": "a", "kind": "auv", "initial": {"position_sigma_m": 1}, "sensors": {}}]}}"""

ATTACKS = [
    # what is tried, method, path, headers, body, answers
    ("path traversal to a file of the page's server", "GET", "/static/../server/app.py", {}, "", {404}),
    ("the same, encoded", "GET", "/static/%2e%2e/server/app.py", {}, "", {404}),
    ("the same, encoded twice", "GET", "/static/%252e%252e/server/app.py", {}, "", {404}),
    ("the same, with its slashes encoded", "GET", "/static/..%2f..%2f..%2fetc%2fpasswd", {}, "", {404}),
    ("the same, with backslashes", "GET", "/static/..\\..\\etc\\passwd", {}, "", {400, 404}),
    ("an absolute path", "GET", "/static//etc/passwd", {}, "", {404}),
    ("a null byte in a path", "GET", "/static/index.html%00.png", {}, "", {404}),
    ("a scenario name that is a path", "GET", "/api/scenarios/..%2f..%2fetc%2fpasswd", {}, "", {404}),
    ("the same in a submission", "POST", "/api/jobs", JSON, '{"scenario": "../../../etc/passwd"}', {404}),
    ("the same to write", "PUT", "/api/scenarios/..%2fevil", TOML, "schema = 1", {404, 405}),
    ("the same to delete", "DELETE", "/api/scenarios/..%2f..%2fcoopnav.sqlite", {}, "", {404, 405, 422}),
    ("a job's id that is a path", "GET", "/api/jobs/..%2f..%2fcoopnav.sqlite/result", {}, "", {404}),
    ("a pane's id guessed", "GET", "/scenes/AAAAAAAAAAAAAAAAAAAAAAAA/", {}, "", {404}),
    ("DNS rebinding", "GET", "/api/jobs", {"host": "evil.example:8000"}, "", {403}),
    ("DNS rebinding, a name that begins like ours", "GET", "/api/jobs", {"host": "127.0.0.1.evil.example"}, "", {403}),
    ("DNS rebinding with a name that is none", "GET", "/api/jobs", {"host": "[::1"}, "", {403}),
    ("a form of another site", "POST", "/api/jobs", EVIL | {"content-type": "text/plain"}, '{"scenario":"x"}', {403}),
    ("a script of another site", "DELETE", "/api/scenarios/mine", EVIL, "", {403}),
    ("a page in a sandbox, or a file", "POST", "/api/jobs", {"origin": "null"} | JSON, "{}", {403}),
    ("a page on another port", "POST", "/api/jobs", {"origin": "http://127.0.0.1:1"} | JSON, "{}", {403}),
    ("an origin that is none", "POST", "/api/jobs", {"origin": "http://[::1"} | JSON, "{}", {403}),
    ("a preflight of another site", "OPTIONS", "/api/jobs", EVIL, "", {405}),
    ("a body too large", "POST", "/api/jobs", JSON, " " * (3 * MIB), {413}),
    ("a body too large by its own word", "POST", "/api/jobs", JSON | {"content-length": str(10**15)}, "", {413}),
    ("a compressed bomb", "POST", "/api/jobs", ZIPPED, gzip.compress(bytes(MIB)), {400, 422}),
    ("deeply nested JSON", "POST", "/api/jobs", JSON, deep("[", "]"), {400, 422}),
    ("deeply nested JSON objects", "PUT", "/api/scenarios/mine", JSON, deep('{"a":', "}"), {422}),
    ("an integer of a million digits", "POST", "/api/jobs", JSON, f'{{"trials": {"9" * MIB}}}', {400, 422}),
    ("the same to save", "PUT", "/api/scenarios/mine", JSON, f'{{"seed": {"9" * MIB}}}', {422}),
    ("an integer of 4000 digits", "PUT", "/api/scenarios/mine", JSON, f'{{"schema": {"9" * 4000}}}', {422}),
    ("the same in a key", "POST", "/api/jobs", JSON, with_set("seed", "9" * 4000), {422}),
    ("the same in a path", "POST", "/api/jobs", JSON, with_set("vehicles." + "9" * 5000, "1"), {422}),
    ("NaN where a number goes", "POST", "/api/jobs", JSON, with_set("duration_s", "NaN"), {422}),
    ("deeply nested TOML", "PUT", "/api/scenarios/mine", TOML, "a = " + deep("[", "]"), {422}),
    ("nested TOML tables", "PUT", "/api/scenarios/mine", TOML, "a = " + deep("{a = ", "}"), {422}),
    ("a TOML key of a million parts", "PUT", "/api/scenarios/mine", TOML, "a" + ".a" * (MIB // 2) + " = 1", {422}),
    ("the same, quoted", "PUT", "/api/scenarios/mine", TOML, '" . "' + '." . "' * (MIB // 8) + " = 1", {422}),
    ("a TOML integer of 5000 digits", "PUT", "/api/scenarios/mine", TOML, "schema = " + "9" * 5000, {422}),
    ("a TOML integer of 4 million bits", "PUT", "/api/scenarios/mine", TOML, "schema = 0x" + "f" * MIB, {422}),
    ("TOML strings without an end", "PUT", "/api/scenarios/mine", TOML, '\\"""\n' * (MIB // 5), {422}),
    ("the same, on one line", "PUT", "/api/scenarios/mine", TOML, 'a = "' + '\\"' * (MIB // 2), {422}),
    ("the same as a value", "POST", "/api/jobs", JSON, with_set("seed", json.dumps('\\"' * (MIB // 4))), {422}),
    ("a claim of a megabyte, told in every list of jobs", "POST", "/api/jobs", JSON, with_set("claims", CLAIM), {422}),
    ("a hundred thousand unknown keys", "PUT", "/api/scenarios/mine", TOML, UNKNOWN, {422}),
    ("a pickle as a scenario", "PUT", "/api/scenarios/mine", BINARY, pickle.dumps({}), {415, 422}),
    ("code named as an algorithm", "POST", "/api/jobs", JSON, with_algorithm("os:system"), {422}),
    ("a file named as an algorithm", "POST", "/api/jobs", JSON, with_algorithm("/tmp/x.py"), {422}),
    ("a log whose name is a path", "PUT", "/api/logs/..%2fevil/x.csv", CSV, "a,b\n1,2\n", {404, 405, 422}),
    ("a log's file whose name is a path", "PUT", "/api/logs/mine/..%2f..%2fx.csv", CSV, "a\n1\n", {404, 405, 422}),
    ("a log's file that is hidden", "PUT", "/api/logs/mine/.x.csv", CSV, "a\n1\n", {422}),
    ("a program as a log's file", "PUT", "/api/logs/mine/x.py", CSV, "import os\n", {422}),
    ("a scenario as a log's file", "PUT", "/api/logs/mine/scenario.toml", TOML, "schema = 1\n", {422}),
    ("a zip bomb as a log's file", "PUT", "/api/logs/mine/x.csv", CSV, ZIP_BOMB, {422}),
    ("a pickle as a log's file", "PUT", "/api/logs/mine/x.csv", CSV, pickle.dumps({}), {422}),
    ("a log's file too large", "PUT", "/api/logs/mine/x.csv", CSV | {"content-length": str(10**12)}, "", {413}),
    ("a log read from elsewhere", "POST", "/api/jobs", JSON, RECORDED % "../../../etc", {404, 422}),
    ("the same, from the root", "POST", "/api/jobs", JSON, RECORDED % "/etc", {404, 422}),
    ("a method that is none", "TRACE", "/", {}, "", {405}),
    ("a request hidden in another's body", "POST", "/api/jobs", JSON | CHUNKED, "0\r\n\r\nGET /api/jobs", {400}),
    ("a length that is none", "POST", "/api/jobs", JSON | {"content-length": "+5"}, "12345", {400}),
    ("a length below nothing", "POST", "/api/jobs", JSON | {"content-length": "-1"}, "1", {400}),
    ("an unknown encoding of the body", "POST", "/api/jobs", {"transfer-encoding": "xchunked"}, "0\r\n\r\n", {400}),
    ("a line end in a path", "GET", "/api/jobs/x%0d%0aset-cookie:a=b", {}, "", {404}),
    ("a null byte in a head", "GET", "/", {"x": "a\0b"}, "", {400}),
    ("a head that is none", "\0", "/", {}, "", {400}),
    ("a form instead of JSON", "POST", "/api/jobs", {"content-type": "text/plain"}, '{"scenario":"first-look"}', {415}),
    ("a link to somebody else's server", "GET", "http://evil.example/api/jobs", {}, "", {404}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "path", "headers", "body", "answers"), [row[1:] for row in ATTACKS], ids=[row[0] for row in ATTACKS]
)
def test_an_attack_is_answered_by_a_problem_and_leaves_nothing_behind(
    live: Live, data_files: Callable[[], set[Path]], method: str, path: str, headers: dict, body, answers: set[int]
):
    before = data_files()
    status, told = raw(live, method, path, headers, body)
    assert status in answers, told[:300]
    problem = json.loads(told)
    assert problem["status"] == status and problem["type"].startswith("urn:coopnav:")
    assert problem["title"] and problem["detail"]
    for leak in (b"Traceback", b"root:", b"SQLite", b"import "):
        assert leak not in told
    assert data_files() == before
    assert live.http.get("/api/health").json()["live"]


def raw(live: Live, method: str, path: str, headers: dict, body: str | bytes) -> tuple[int, bytes]:
    """Status and body of a request sent exactly as it is written, which no client would send."""
    data = body.encode() if isinstance(body, str) else body
    where = urlsplit(live.url)
    sent = {"host": where.netloc, "content-length": str(len(data)), "connection": "close"} | headers
    head = f"{method} {path} HTTP/1.1\r\n" + "".join(f"{k}: {v}\r\n" for k, v in sent.items()) + "\r\n"
    with closing(socket.create_connection((where.hostname, where.port), timeout=PATIENCE_S)) as wire:
        wire.sendall(head.encode() + data)
        return answer(wire)


def answer(wire: socket.socket) -> tuple[int, bytes]:
    """Status and body of what the server says until it hangs up; status 0 when it says nothing."""
    said = b""
    with suppress(ConnectionResetError):
        while part := wire.recv(65536):
            said += part
    head, _, body = said.partition(b"\r\n\r\n")
    return (int(head.split()[1]) if head else 0), body


# --- across sites -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/api/scenes/session", "/scenes/guess"])
@pytest.mark.parametrize("headers", [EVIL, {"origin": "null"}, {"host": "evil.example"}])
def test_a_websocket_of_another_site_is_not_opened(live: Live, path: str, headers: dict[str, str]):
    handshake = {"connection": "Upgrade", "upgrade": "websocket", "sec-websocket-version": "13"}
    status, told = raw(live, "GET", path, handshake | {"sec-websocket-key": "AAAAAAAAAAAAAAAAAAAAAA=="} | headers, "")
    assert status == 403 and json.loads(told)["type"] in ("urn:coopnav:origin", "urn:coopnav:host")


def test_no_answer_lets_another_site_read_it(live: Live):
    for path in ("/", "/api/jobs", "/api/openapi.json", "/metrics", "/static/index.html"):
        headers = live.http.get(path, headers=EVIL).headers
        assert not [name for name in headers if name.startswith("access-control-")]
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert headers["x-content-type-options"] == "nosniff"
        assert "object-src 'none'" in headers["content-security-policy"]
        assert "unsafe-inline" not in headers["content-security-policy"].split("style-src")[0]


# --- slowly, or too much ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    """A server as it is when bound elsewhere, and impatient; without waiting for its workers."""
    settings = Settings(
        data=tmp_path_factory.mktemp("walled"), port=0, workers=1, token=TOKEN, slowest_head_s=0.3, slowest_body_s=0.3
    )
    yield from start(settings, ready=lambda _: True)


@pytest.mark.parametrize("head", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nhost: localhost\r\nx-slow: "])
def test_a_client_that_never_ends_its_head_is_hung_up_on(walled: Live, head: bytes):
    where = urlsplit(walled.url)
    with closing(socket.create_connection((where.hostname, where.port), timeout=PATIENCE_S)) as wire:
        wire.sendall(head)
        assert answer(wire)[0] == 0


def test_neither_a_second_head_on_the_same_connection(walled: Live):
    where = urlsplit(walled.url)
    with closing(socket.create_connection((where.hostname, where.port), timeout=PATIENCE_S)) as wire:
        wire.sendall(b"GET /api/health/live HTTP/1.1\r\nhost: localhost\r\n\r\nGET / HT")
        assert answer(wire)[0] == 200


def test_a_client_that_never_ends_its_body_is_told_and_hung_up_on(walled: Live):
    headers = {"authorization": f"Bearer {TOKEN}", "content-length": "1000"} | JSON
    assert raw(walled, "POST", "/api/jobs", headers, '{"scenario":')[0] == 408


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    """A server for few, and for little at once."""
    settings = Settings(
        data=tmp_path_factory.mktemp("small"), port=0, workers=1, most_connections=8, largest_bodies=1000
    )
    yield from start(settings, ready=lambda _: True)


def test_connections_too_many_are_told_and_hung_up_on_and_websockets_count(small: Live):
    where = urlsplit(small.url)
    with ExitStack() as crowd:
        for _ in range(3):
            crowd.enter_context(connect(f"{small.ws}/api/scenes/session", open_timeout=PATIENCE_S))
        for _ in range(3):
            crowd.enter_context(closing(socket.create_connection((where.hostname, where.port), PATIENCE_S)))

        def refused() -> dict | None:
            wire = crowd.enter_context(closing(socket.create_connection((where.hostname, where.port), PATIENCE_S)))
            wire.sendall(b"GET /api/health/live HTTP/1.1\r\nhost: localhost\r\n\r\n")
            head, _, body = wire.recv(65536).partition(b"\r\n\r\n")
            return json.loads(body) if b" 503 " in head and b"retry-after" in head else None

        assert until(refused, "the refusal")["type"] == "urn:coopnav:crowded"
        wire = crowd.enter_context(closing(socket.create_connection((where.hostname, where.port), PATIENCE_S)))
        assert answer(wire)[0] == 0, "one too many that says nothing is hung up on"
    until(lambda: httpx.get(f"{small.url}/api/health/live").status_code == 200, "room again")


def test_bodies_that_are_held_at_once_are_bounded(small: Live):
    where = urlsplit(small.url)
    head = b"POST /api/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-length: 900\r\n\r\n"
    with closing(socket.create_connection((where.hostname, where.port), PATIENCE_S)) as wire:
        wire.sendall(head)
        crowded = until(
            lambda: (a := httpx.post(f"{small.url}/api/jobs", content=b" " * 200)).status_code == 503 and a,
            "the refusal",
        )
        assert crowded.json()["type"] == "urn:coopnav:crowded" and "retry-after" in crowded.headers
    until(lambda: httpx.post(f"{small.url}/api/jobs", content=b" " * 200).status_code == 415, "room again")


def test_a_head_without_end_is_refused(live: Live):
    assert raw(live, "GET", "/", {"x-long": "x" * 200_000}, "")[0] in (0, 400, 431)


def test_a_websocket_message_too_long_ends_the_session(live: Live):
    with connect(f"{live.ws}/api/scenes/session", origin=live.url, max_size=None) as wire:
        wire.send("x" * 100_000)
        with pytest.raises(ConnectionClosed) as ended:
            wire.recv(timeout=PATIENCE_S)
    assert ended.value.rcvd is not None and ended.value.rcvd.code == 1009


def test_websockets_inflate_nothing(live: Live):
    with connect(f"{live.ws}/api/scenes/session", origin=live.url, compression="deflate") as wire:
        assert not wire.protocol.extensions


# --- without the token --------------------------------------------------------------------------------------------

PATHS = ["/", "/api/jobs", "/api/openapi.json", "/api/health", "/metrics", "/static/index.html", "/scenes/x/"]


@pytest.mark.parametrize("path", PATHS)
def test_without_the_token_nothing_is_told(walled: Live, path: str):
    assert httpx.get(walled.url + path).status_code == 401
    assert httpx.get(walled.url + path, headers={"authorization": "Basic eDp5"}).status_code == 401
    assert httpx.get(walled.url + path, cookies={f"coopnav-{urlsplit(walled.url).port}": TOKEN}).status_code == 401


def test_without_the_token_no_route_does_anything_but_say_that_the_server_lives(walled: Live):
    for path, methods in walled.app.openapi()["paths"].items():
        for method in methods:
            status = httpx.request(method, walled.url + path.replace("{", "").replace("}", "")).status_code
            assert status == 401 or path in OPEN, (method, path)
    for path in OPEN:
        assert httpx.get(walled.url + path).status_code in (200, 503)
        assert httpx.post(walled.url + path).status_code == 401
        assert httpx.request("GET", walled.url + path, content=b"x").status_code == 413


def test_without_the_token_no_websocket_is_opened_and_nothing_is_changed(walled: Live):
    for path in ("/api/scenes/session", f"/api/scenes/session?token={TOKEN}", "/scenes/guess"):
        with pytest.raises(InvalidStatus) as refused, connect(walled.ws + path):
            pass
        assert refused.value.response.status_code == 401
    assert httpx.post(f"{walled.url}/api/jobs?token={TOKEN}", json=SHORT).status_code == 401


def test_the_token_works_once_in_an_address_and_then_as_a_cookie(walled: Live):
    with httpx.Client(base_url=walled.url) as browser:
        first = browser.get(f"/?token={TOKEN}&job=1")
        assert first.status_code == 303 and first.headers["location"] == "/?job=1"
        assert TOKEN not in str(first.headers)
        assert browser.get("/").status_code == 200
        cookie = first.headers["set-cookie"].partition(";")[0]
        for others in ("a={b}; ", '"; ', 'x="\\"; ', "=; "):  # of other servers on this machine
            assert httpx.get(walled.url, headers={"cookie": others + cookie}).status_code == 200
    with connect(f"{walled.ws}/api/scenes/session", additional_headers={"cookie": cookie}):
        pass


def test_the_token_does_not_send_its_user_to_another_site(walled: Live):
    for path in ("//evil.example", "/\\evil.example", "//evil.example/%2e%2e"):
        answered = httpx.get(f"{walled.url}{path}?token={TOKEN}")
        assert answered.status_code in (303, 404)
        assert urlsplit(answered.headers.get("location", "/").replace("\\", "/")).netloc == ""


def test_guessing_the_token_is_slowed_down_while_those_inside_go_on(walled: Live):
    with httpx.Client(base_url=walled.url) as browser:
        browser.get(f"/?token={TOKEN}")
        answers = [httpx.get(f"{walled.url}/?token=guess{n}").status_code for n in range(FREE + 5)]
        assert answers[:FREE] == [401] * FREE and set(answers[FREE:]) == {429}
        late = httpx.get(f"{walled.url}/?token={TOKEN}")
        assert late.status_code == 429 and int(late.headers["retry-after"]) > 0
        assert browser.get("/").status_code == 200


def test_who_sends_a_wrong_token_cannot_say_that_it_was_somebody_else(walled: Live):
    answers = set()
    for n in range(2 * FREE):
        headers = {"x-forwarded-for": f"10.0.0.{n}"}
        answers.add(httpx.get(f"{walled.url}/?token=guess{n}", headers=headers).status_code)
    assert 429 in answers


# --- inside ports -------------------------------------------------------------------------------------------------


@pytest.fixture
def pane(live: Live) -> Iterator[int]:
    """The inner port of an open pane."""
    job = live.done(SHORT)["id"]
    with connect(f"{live.ws}/api/scenes/session", origin=live.url) as wire:
        wire.send(f'{{"type": "show", "job": "{job}", "panes": ["cekf"]}}')
        (found,) = until(lambda: list(live.app.state.site.scenes.panes.values()), "the pane")
        yield found.port


@pytest.mark.parametrize("secret", [{}, {inner.HEADER: "guess"}, {inner.HEADER: ""}])
def test_a_panes_inner_port_answers_to_nobody_but_the_relay(pane: int, secret: dict[str, str]):
    assert httpx.get(f"http://127.0.0.1:{pane}/", headers=secret).status_code == 403
    protocol = f"viser-v{viser.__version__}"
    with (
        pytest.raises(InvalidStatus) as refused,
        connect(f"ws://127.0.0.1:{pane}/", subprotocols=[protocol], additional_headers=secret),  # type: ignore[list-item]
    ):
        pass
    assert refused.value.response.status_code == 403


def test_a_viewer_gets_no_share_tunnel_even_when_its_request_hides_in_a_camera_message():
    """That the plain request does not get through is tested with the panes."""
    request = {"type": "ShareUrlRequest"}
    for disguise in (request, [request], {"type": "ViewerCameraMessage", "type ": "ShareUrlRequest"}):
        assert not relay.permitted(msgspec.msgpack.encode(disguise))
    twice = [msgspec.msgpack.encode(word) for word in ("type", "ViewerCameraMessage", "type", "ShareUrlRequest")]
    assert not relay.permitted(b"\x82" + b"".join(twice))


def test_dasks_ports_talk_to_nobody_without_this_runs_certificate(live: Live):
    """What they are sent is unpickled: whoever could talk to them could run code."""
    cluster = live.app.state.site.cluster
    addresses = [cluster.client.scheduler.address, *cluster.threads]
    stranger = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    stranger.check_hostname, stranger.verify_mode = False, ssl.CERT_NONE
    for address in addresses:
        assert address.startswith("tls://127.0.0.1:")
        where = ("127.0.0.1", int(address.rpartition(":")[2]))
        with closing(socket.create_connection(where, timeout=PATIENCE_S)) as wire, pytest.raises(OSError):
            secured = stranger.wrap_socket(wire)
            secured.sendall(b"x")
            if not secured.recv(1):
                raise ConnectionResetError


def test_dasks_web_servers_have_nothing_to_say(live: Live):
    """They ask nobody who he is, and would tell the names of jobs and what workers do."""
    site = live.app.state.site
    scheduler = site.cluster._own.scheduler
    ports = [scheduler.http_server.port]
    ports += [port for worker in scheduler.workers.values() for port in worker.services.values()]
    assert len(ports) > len(scheduler.workers)
    for port in ports:
        for path in (
            "/",
            "/info/main/workers.html",
            "/json/identity.json",
            "/metrics",
            "/proxy/80/localhost/",
            "/health",
        ):
            assert httpx.get(f"http://127.0.0.1:{port}{path}").status_code == 404, path


# --- files --------------------------------------------------------------------------------------------------------


def test_a_link_among_the_saved_scenarios_is_not_followed(live: Live, tmp_path: Path):
    text = live.http.get("/api/scenarios/first-look").json()["toml"]
    outside = tmp_path / "private.toml"
    outside.write_text(text)
    shelf = live.settings.data / "scenarios"
    shelf.mkdir(exist_ok=True)
    (shelf / "linked.toml").symlink_to(outside)
    try:
        assert live.http.get("/api/scenarios/linked").status_code == 404
        assert "linked" not in {entry["name"] for entry in live.http.get("/api/scenarios").json()}
        assert live.http.put("/api/scenarios/linked", content=text + "\n", headers=TOML).status_code in (200, 201)
        assert outside.read_text() == text and not (shelf / "linked.toml").is_symlink()
    finally:
        (shelf / "linked.toml").unlink()


def test_a_link_among_the_uploaded_logs_is_not_followed(live: Live, tmp_path: Path):
    shelf = live.settings.data / "scenarios"
    shelf.mkdir(exist_ok=True)
    (tmp_path / "x.csv").write_text("private\n1\n")
    (shelf / "linked-log").symlink_to(tmp_path)
    (shelf / "own-log").mkdir()
    (shelf / "own-log" / "x.csv").symlink_to(tmp_path / "x.csv")
    try:
        assert live.http.get("/api/logs/linked-log").status_code == 404
        assert live.http.put("/api/logs/linked-log/y.csv", content="a\n1\n").status_code == 403
        assert live.http.put("/api/logs/own-log/x.csv", content="a\n1\n").status_code == 403
        assert "private" not in live.http.get("/api/logs/own-log").text
        assert (tmp_path / "x.csv").read_text() == "private\n1\n" and not (tmp_path / "y.csv").exists()
    finally:
        (shelf / "linked-log").unlink()
        (shelf / "own-log" / "x.csv").unlink()
        (shelf / "own-log").rmdir()


def test_what_a_scenario_says_is_text_in_a_report_and_the_page_runs_nothing(live: Live):
    evil = "<img src=x onerror=alert(1)>\"'</title></pre><script>alert(1)</script>"
    scenario = live.http.get("/api/scenarios/first-look").json()["scenario"]
    claims = [claim | {"text": evil} for claim in scenario["claims"]]
    body = {"scenario": scenario | {"title": evil, "summary": evil, "source": evil, "claims": claims}}
    answer = live.http.get(f"/api/jobs/{live.done(SHORT | body)['id']}/report")
    assert "<img" not in answer.text and "<script" not in answer.text and "&lt;img src=x" in answer.text
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert 'http-equiv="content-security-policy" content="default-src \'none\'' in answer.text


class Bomb:
    """A pickle of this runs code when it is read."""

    def __reduce__(self):
        return (pytest.fail, ("a pickle was read",))


def test_a_shards_file_with_a_pickle_in_it_is_not_read(tmp_path: Path):
    hidden = io.BytesIO()
    np.savez(hidden, meta=np.array([Bomb()], dtype=object))
    (tmp_path / "shard.npz").write_bytes(hidden.getvalue())
    with pytest.raises(ValueError, match="allow_pickle"):
        artifacts.read_shard(tmp_path / "shard.npz")
