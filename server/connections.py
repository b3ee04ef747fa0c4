"""Connections as this server keeps them: not too many, none that dawdles, and refused in its own words."""

from __future__ import annotations

import asyncio
import resource
from contextlib import suppress
from http import HTTPStatus

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server.problems import Refusal, response

#: One connection too many has this long to send its request and be told so, s.
CROWDED_S = 1.0
#: Files that a process of this server would like to have open at most: connections, panes, workers, results.
FILES = 8192

CROWDED = Refusal(503, "crowded", "too many connections are open; try again", headers={"retry-after": "2"})
GARBLED = Refusal(400, "http", "this is no HTTP request")


def most_connections(wanted: int) -> int:
    """So many connections that half of the files this process may open are left for its work; it may open more now."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, min(FILES, hard)), hard))
    return min(wanted, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 2)


def careful(head_s: float, most: int) -> type[H11Protocol]:
    """uvicorn's HTTP protocol for at most so many connections, each with some seconds for the head of a request."""

    class Careful(H11Protocol):
        _deadline: asyncio.TimerHandle | None = None
        _crowded = False

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._crowded = len(self.connections) > most
            self._await_head(min(head_s, CROWDED_S) if self._crowded else head_s)

        def data_received(self, data: bytes) -> None:
            if self._crowded:
                self._refuse(CROWDED)
                return
            super().data_received(data)
            if self.conn.their_state is not h11.IDLE:
                self._forget()
            elif self._deadline is None:
                self._await_head(head_s)

        def connection_lost(self, exc: Exception | None) -> None:
            self._forget()
            super().connection_lost(exc)

        def send_400_response(self, msg: str) -> None:
            if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
                self._refuse(GARBLED)
            else:  # an answer is on its way already
                self.transport.close()

        def _refuse(self, refusal: Refusal) -> None:
            told = response(refusal)
            lines = [f"HTTP/1.1 {refusal.status} {HTTPStatus(refusal.status).phrase}".encode(), b"connection: close"]
            lines += [name + b": " + value for name, value in told.raw_headers]
            self.transport.write(b"\r\n".join([*lines, b"", bytes(told.body)]))
            self.transport.close()

        def _await_head(self, seconds: float) -> None:
            self._deadline = self.loop.call_later(seconds, self.transport.close)

        def _forget(self) -> None:
            if self._deadline is not None:
                self._deadline.cancel()
                self._deadline = None

    return Careful
