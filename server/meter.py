"""What is measured of the requests: how many, how they ended, how long they took; and one log line each."""

from __future__ import annotations

import bisect
import logging
import random
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server import logs

log = logging.getLogger("server.requests")

#: Upper ends of the latency histogram's classes, s.
BOUNDS_S = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)


METHODS = {"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH"}


@dataclass(frozen=True)
class Tally:
    """What was counted since the start.

    answers {(method, route, status): requests}; durations {route: requests by class of BOUNDS_S, and above};
    seconds {route: their sum}; streaming {kind: event streams and websockets now open}. Routes are templates such as
    /api/jobs/{id}, so that there are few of them whatever is asked.
    """

    answers: Counter[tuple[str, str, int]] = field(default_factory=Counter)
    durations: defaultdict[str, list[int]] = field(
        default_factory=lambda: defaultdict(lambda: [0] * (len(BOUNDS_S) + 1))
    )
    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    streaming: Counter[str] = field(default_factory=Counter)


class Meter:
    """ASGI middleware around everything, the guard too, that keeps a tally."""

    def __init__(self, app: ASGIApp, tally: Tally) -> None:
        self.app, self.tally = app, tally

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            self.tally.streaming["websocket"] += 1
            try:
                await self.app(scope, receive, send)
            finally:
                self.tally.streaming["websocket"] -= 1
        else:
            await self._answer(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        id = f"{random.getrandbits(48):012x}"  # a name, no secret: the system's randomness would cost a call to it
        known = logs.request.set(id)
        start, head_s, status, stream = time.perf_counter(), 0.0, 500, False

        async def answer(message: Message) -> None:
            nonlocal head_s, status, stream
            if message["type"] == "http.response.start":
                head_s, status = time.perf_counter() - start, message["status"]
                headers = MutableHeaders(scope=message)
                headers["x-request-id"] = id
                if not stream and headers.get("content-type", "").startswith("text/event-stream"):
                    stream = True
                    self.tally.streaming["events"] += 1
            await send(message)

        try:
            await self.app(scope, receive, answer)
        finally:
            # A stream is open as long as its job runs: what counts is when it began to answer.
            taken_s = head_s if stream else time.perf_counter() - start
            if stream:
                self.tally.streaming["events"] -= 1
            self._count(scope, status, taken_s)
            logs.request.reset(known)

    def _count(self, scope: Scope, status: int, taken_s: float) -> None:
        route = getattr(scope.get("route"), "path", "other")
        method = scope["method"] if scope["method"] in METHODS else "other"
        self.tally.answers[method, route, status] += 1
        self.tally.durations[route][bisect.bisect_left(BOUNDS_S, taken_s)] += 1
        self.tally.seconds[route] += taken_s
        fields = {
            "method": method,
            "route": route,
            "path": scope["path"][:200],
            "status": status,
            "seconds": round(taken_s, 6),
            "client": (scope.get("client") or ("",))[0],
        }
        job = scope.get("path_params", {}).get("id") if route.startswith("/api/jobs/") else None
        fields |= {"job": job} if job else {}
        log.info("%s %s %d %.1f ms", method, fields["path"], status, 1e3 * taken_s, extra={"fields": fields})
