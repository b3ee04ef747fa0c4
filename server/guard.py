"""The door: who may speak to the server, from which page, how much at once and how slowly."""

from __future__ import annotations

import asyncio
import hmac
import logging
import secrets
import time
from collections.abc import Callable
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.requests import cookie_parser
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.attempts import Attempts
from server.problems import Refusal, response
from server.settings import Settings, is_loopback

log = logging.getLogger(__name__)

#: The cookie's name, before the port: servers on one machine's ports share its cookies.
COOKIE = "coopnav"
#: A body of up to this many times the limit is heard to its end before it is refused.
PATIENCE = 8
SAFE_METHODS = {"GET", "HEAD", "OPTIONS"}
#: What anybody who reaches the server may ask: those who watch over it carry no token.
OPEN = {"/api/health/live", "/api/health/ready"}

PAGE_POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; "
    "frame-src 'self'; frame-ancestors 'self'; base-uri 'none'; object-src 'none'; form-action 'self'"
)
#: What every answer says that does not say otherwise itself.
HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"content-security-policy", PAGE_POLICY.encode()),
)


class Guard:
    """ASGI middleware; a refused request gets a problem, a refused websocket is not opened.

    Where a token is asked, the cookie that stands for it afterwards is a secret of this run of the server: guessing
    tokens is slowed down by address without slowing down those who are in.
    """

    def __init__(self, app: ASGIApp, settings: Settings, clock: Callable[[], float] = time.monotonic) -> None:
        self.app, self.settings = app, settings
        self.cookie = f"{COOKIE}-{settings.port}"
        self._pass = secrets.token_urlsafe(32)
        self._held = 0
        self._attempts = Attempts(clock)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal = _ambiguous(headers) or self._host(headers) or self._origin(scope, headers)
        if refusal is None and self.settings.token and not _open(scope) and not self._inside(headers):
            refusal = self._stranger(scope, headers)
            if refusal is None and not _bearer(headers):
                await self._let_in(scope, headers)(scope, receive, _with_headers(send))
                return
        if refusal is not None:
            await response(refusal)(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await self.app(scope, receive, send)
        else:
            await self._with_body(scope, headers, receive, _with_headers(send))

    def _host(self, headers: Headers) -> Refusal | None:
        """On loopback only loopback names are ours: another name means a page rebound its DNS to us."""
        try:
            host = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        except ValueError:
            host = ""
        if len(headers.getlist("host")) > 1 or (self.settings.loopback and not is_loopback(host)):
            return Refusal(403, "host", "this server answers to localhost and 127.0.0.1 only")
        return None

    def _origin(self, scope: Scope, headers: Headers) -> Refusal | None:
        """A page of another site may neither change anything here nor open a websocket."""
        origin = headers.get("origin")
        if origin is None or (scope["type"] == "http" and scope["method"] in SAFE_METHODS):
            return None
        try:
            ours = urlsplit(origin).netloc.lower() == headers.get("host", "").lower()
        except ValueError:
            ours = False
        return None if ours else Refusal(403, "origin", "requests from pages of other sites are refused")

    def _inside(self, headers: Headers) -> bool:
        """Whether the cookie is there."""
        return _same(cookie_parser(headers.get("cookie", "")).get(self.cookie, ""), self._pass)

    def _stranger(self, scope: Scope, headers: Headers) -> Refusal | None:
        """Why one without a cookie may not enter; None with the right token, in a header or in a page's address."""
        given = _bearer(headers)
        if not given and scope["type"] == "http" and scope["method"] in ("GET", "HEAD"):
            given = dict(_query(scope)).get("token", "")
        if not given:
            return Refusal(401, "token", "open the address with ?token=… that the server printed at its start")
        address = (scope.get("client") or ("", 0))[0]
        wait_s = self._attempts.wait_s(address)
        if wait_s > 0:
            found = f"too many wrong tokens from {address}; wait {wait_s:.0f} s"
            return Refusal(429, "attempts", found, headers={"retry-after": f"{wait_s:.0f}"})
        if _same(given, self.settings.token or ""):
            return None
        self._attempts.failed(address)
        log.warning("a wrong token from %s", address)
        return Refusal(401, "token", "this is not the token that the server printed at its start")

    def _let_in(self, scope: Scope, headers: Headers) -> Response:
        """Remember who gave the token by a cookie, and take the token out of the address."""
        rest = urlencode([(k, v) for k, v in _query(scope) if k != "token"])
        clean = "/" + scope["path"].lstrip("/\\") + (f"?{rest}" if rest else "")
        answer: Response = RedirectResponse(clean, status_code=303)
        if headers.get("sec-fetch-site") == "cross-site":
            # A link in somebody's mail: the browser would not send a strict cookie along a redirect.
            page = "<!doctype html><title>coopnav</title>"
            answer = HTMLResponse(page, headers={"refresh": f"0; url={answer.headers['location']}"})
        answer.headers["cache-control"] = "no-store"
        secure = scope.get("scheme") == "https"
        answer.set_cookie(self.cookie, self._pass, httponly=True, samesite="strict", secure=secure, path="/")
        return answer

    async def _with_body(self, scope: Scope, headers: Headers, receive: Receive, send: Send) -> None:
        """Let the app answer once it has the whole body; no request here needs to be streamed in."""
        limit = self._largest(scope)
        length = _length(headers, limit)
        share = length if length <= limit else 0  # what is too large is not kept
        if self._held + share > self.settings.largest_bodies:
            found = "too much is being sent at once; try again"
            await response(Refusal(503, "crowded", found, headers={"retry-after": "5"}))(scope, receive, send)
            return
        self._held += share
        try:
            body = await self._body(limit, length, receive)
            if isinstance(body, bytes):
                await self.app(scope, _replay(body, receive), send)
            else:
                await response(body)(scope, receive, send)
        finally:
            self._held -= share

    def _largest(self, scope: Scope) -> int:
        """Bytes that a request's body may have: a file of a recorded log more than others, a stranger's none."""
        if _open(scope):
            return 0
        uploads = scope["method"] == "PUT" and scope["path"].startswith("/api/logs/")
        return self.settings.largest_log_file if uploads else self.settings.largest_body

    async def _body(self, limit: int, declared: int, receive: Receive) -> bytes | Refusal:
        """The whole body, or the refusal of one too large or too slow.

        What is too large is still taken in for a while and thrown away: a client that is busy sending would
        not hear the answer.
        """
        parts: list[bytes] = []
        size = 0
        try:
            async with asyncio.timeout(self.settings.slowest_body_s):
                while declared <= PATIENCE * limit and size <= PATIENCE * limit:
                    message = await receive()
                    if message["type"] != "http.request":
                        return b""
                    size += len(message.get("body", b""))
                    if max(size, declared) <= limit:
                        parts.append(message.get("body", b""))
                    if not message.get("more_body"):
                        break
        except TimeoutError:
            found = f"the body did not arrive within {self.settings.slowest_body_s:g} s"
            return Refusal(408, "too-slow", found, headers={"connection": "close"})
        if max(size, declared) <= limit:
            return b"".join(parts)
        found = f"a request may carry at most {limit} bytes"
        return Refusal(413, "too-large", found, headers={"connection": "close"})


def _ambiguous(headers: Headers) -> Refusal | None:
    """Of two lengths a proxy before us may believe the other one, and take the rest for the next request."""
    if "transfer-encoding" in headers and "content-length" in headers:
        found = "a request gives its length once: by content-length or by transfer-encoding"
        return Refusal(400, "http", found, headers={"connection": "close"})
    return None


def _open(scope: Scope) -> bool:
    """Whether anybody may ask this."""
    return scope["type"] == "http" and scope["method"] == "GET" and scope["path"] in OPEN


def _length(headers: Headers, limit: int) -> int:
    """Bytes of a body by the sender's word: of one sent in parts it may be all, of a word that is none too many."""
    if "transfer-encoding" in headers:
        return limit
    length = headers.get("content-length", "0")
    return int(length) if length.isascii() and length.isdigit() and len(length) < 20 else limit + 1


def _same(given: str, right: str) -> bool:
    return hmac.compare_digest(given.encode(), right.encode())


def _bearer(headers: Headers) -> str:
    scheme, _, given = headers.get("authorization", "").partition(" ")
    return given.strip() if scheme.lower() == "bearer" else ""


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope["query_string"].decode("latin-1"))


def _replay(body: bytes, receive: Receive) -> Receive:
    told = False

    async def replay() -> Message:
        nonlocal told
        if told:
            return await receive()
        told = True
        return {"type": "http.request", "body": body, "more_body": False}

    return replay


def _with_headers(send: Send) -> Send:
    async def answer(message: Message) -> None:
        if message["type"] == "http.response.start":
            said = {name for name, _ in message["headers"]}
            message["headers"] = [*message["headers"], *(h for h in HEADERS if h[0] not in said)]
        await send(message)

    return answer
