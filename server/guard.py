"""The door: who may speak to the server, from which page, and how much at once."""

from __future__ import annotations

import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, urlencode, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.problems import Refusal, response
from server.settings import Settings, is_loopback

COOKIE = "coopnav-token"
#: A body of up to this many times the limit is heard to its end before it is refused.
PATIENCE = 8
SAFE_METHODS = {"GET", "HEAD", "OPTIONS"}

PAGE_POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; frame-src 'self'; frame-ancestors 'self'; base-uri 'none'; object-src 'none'"
)
HEADERS = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "SAMEORIGIN",
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "content-security-policy": PAGE_POLICY,
}


class Guard:
    """ASGI middleware; a refused request gets a problem, a refused websocket is not opened."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app, self.settings = app, settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        refusal = self._host(headers) or self._origin(scope, headers)
        if refusal is None and self.settings.token and not self._known(headers):
            offered = dict(parse_qsl(scope["query_string"].decode("latin-1"))).get("token", "")
            if scope["type"] == "http" and self._matches(offered):
                await self._let_in(scope, receive, send)
                return
            refusal = Refusal(401, "token", "open the address with ?token=… that the server printed at its start")
        if scope["type"] == "websocket":
            if refusal is None:
                await self.app(scope, receive, send)
            else:
                await receive()
                await send({"type": "websocket.close", "code": 1008, "reason": refusal.detail[:120]})
            return
        answer = _with_headers(send)
        if refusal is None:
            body = await self._body(headers, receive)
            if isinstance(body, bytes):
                await self.app(scope, _replay(body, receive), answer)
                return
            refusal = body
        await response(refusal)(scope, receive, answer)

    def _host(self, headers: Headers) -> Refusal | None:
        """On loopback only loopback names are ours: another name means a page rebound its DNS to us."""
        host = urlsplit(f"//{headers.get('host', '')}").hostname or ""
        if self.settings.loopback and not is_loopback(host):
            return Refusal(403, "host", "this server answers to localhost and 127.0.0.1 only")
        return None

    def _origin(self, scope: Scope, headers: Headers) -> Refusal | None:
        """A page of another site may neither change anything here nor open a websocket."""
        origin = headers.get("origin")
        if origin is None or (scope["type"] == "http" and scope["method"] in SAFE_METHODS):
            return None
        if urlsplit(origin).netloc.lower() != headers.get("host", "").lower():
            return Refusal(403, "origin", "requests from pages of other sites are refused")
        return None

    def _known(self, headers: Headers) -> bool:
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self._matches(given.strip()):
            return True
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return cookie is not None and self._matches(cookie.value)

    def _matches(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), (self.settings.token or "").encode())

    async def _let_in(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Remember the token in a cookie and take it out of the address."""
        rest = [(k, v) for k, v in parse_qsl(scope["query_string"].decode("latin-1")) if k != "token"]
        answer = RedirectResponse(scope["path"] + (f"?{urlencode(rest)}" if rest else ""), status_code=303)
        answer.set_cookie(COOKIE, self.settings.token or "", httponly=True, samesite="strict", path="/")
        await answer(scope, receive, _with_headers(send))

    async def _body(self, headers: Headers, receive: Receive) -> bytes | Refusal:
        """The whole body, or the refusal of one too large; no request here needs to be streamed in.

        What is too large is still taken in for a while and thrown away: a client that is busy sending would
        not hear the answer.
        """
        limit = self.settings.largest_body
        length = headers.get("content-length", "0")
        declared = int(length) if length.isdigit() and len(length) < 20 else limit + 1
        parts: list[bytes] = []
        size = 0
        while declared <= PATIENCE * limit and size <= PATIENCE * limit:
            message = await receive()
            if message["type"] != "http.request":
                return b""
            size += len(message.get("body", b""))
            if max(size, declared) <= limit:
                parts.append(message.get("body", b""))
            if not message.get("more_body"):
                break
        if max(size, declared) <= limit:
            return b"".join(parts)
        found = f"a request may carry at most {limit} bytes"
        return Refusal(413, "too-large", found, headers={"connection": "close"})


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
            headers = MutableHeaders(scope=message)
            for key, value in HEADERS.items():
                headers.setdefault(key, value)
        await send(message)

    return answer
