"""Who may speak to the server, and from which page."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.guard import COOKIE, Guard
from server.settings import Settings, is_loopback


async def answer(_request):
    return PlainTextResponse("in")


async def socket(connection: WebSocket):
    await connection.accept()
    await connection.send_text("in")
    await connection.close()


def client(base_url: str = "http://127.0.0.1:8000", **settings) -> TestClient:
    app = Starlette(routes=[Route("/", answer, methods=["GET", "POST"]), WebSocketRoute("/ws", socket)])
    guarded = Guard(app, Settings(data=Path("unused"), **settings))
    return TestClient(guarded, base_url=base_url, follow_redirects=False)


@pytest.mark.parametrize("host", ["127.0.0.1:8000", "localhost:1", "[::1]:8000", "127.0.0.2"])
def test_loopback_names_are_ours(host: str):
    assert client().get("/", headers={"host": host}).text == "in"


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "localhost.evil.example:8000"])
def test_a_name_rebound_to_us_is_refused(host: str):
    assert client().get("/", headers={"host": host}).status_code == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:9999"])
def test_other_sites_change_nothing_and_open_no_socket(origin: str):
    mine = client()
    assert mine.post("/", headers={"origin": origin}).status_code == 403
    assert mine.get("/", headers={"origin": origin}).status_code == 200
    with pytest.raises(WebSocketDisconnect), mine.websocket_connect("/ws", headers={"origin": origin}):
        pass


def test_our_own_page_may_do_both():
    mine, headers = client(), {"origin": "http://127.0.0.1:8000", "host": "127.0.0.1:8000"}
    assert mine.post("/", headers=headers).text == "in"
    with mine.websocket_connect("/ws", headers=headers) as opened:
        assert opened.receive_text() == "in"


def test_elsewhere_a_token_is_asked_and_remembered():
    far = client("http://lab.example:8000", host="0.0.0.0", token="secret")
    assert far.get("/").status_code == 401
    assert far.get("/?token=wrong").status_code == 401
    with pytest.raises(WebSocketDisconnect), far.websocket_connect("/ws"):
        pass
    first = far.get("/?token=secret&x=1")
    assert first.status_code == 303 and first.headers["location"] == "/?x=1"
    cookie = first.headers["set-cookie"]
    assert cookie.startswith(COOKIE) and "HttpOnly" in cookie and "SameSite=strict" in cookie
    assert "secret" not in cookie
    assert far.get("/").text == "in"
    far.cookies.clear()
    assert far.get("/", headers={"authorization": "Bearer secret"}).text == "in"


def test_what_loopback_is():
    assert all(map(is_loopback, ("127.0.0.1", "::1", "localhost", "127.9.9.9")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "10.0.0.1", "lab.example", "")))


def test_every_answer_says_what_a_browser_may_do_with_it():
    headers = client().get("/").headers
    assert headers["x-content-type-options"] == "nosniff"
    assert "frame-ancestors 'self'" in headers["content-security-policy"]
