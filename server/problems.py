"""Errors as problem+json (RFC 9457): what is wrong, where, and what would be right."""

from __future__ import annotations

import errno
import logging
import sqlite3
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.responses import Response
from starlette.routing import Match, Route
from uvicorn.protocols.utils import ClientDisconnected

from engine.scenario.errors import ScenarioError
from server.wire import dumps

log = logging.getLogger(__name__)


#: How the API's description speaks of errors.
ANSWERS: dict[int | str, dict[str, Any]] = {
    "4XX": {
        "description": "What is wrong with the request, as problem+json",
        "content": {
            "application/problem+json": {
                "schema": {
                    "type": "object",
                    "required": ["type", "title", "status", "detail"],
                    "properties": {
                        "type": {"type": "string"},
                        "title": {"type": "string"},
                        "status": {"type": "integer"},
                        "detail": {"type": "string"},
                        "errors": {"type": "array", "items": {"type": "object"}},
                    },
                }
            }
        },
    }
}


def disk_full(error: BaseException) -> bool:
    """Whether an error says that there is no room left to write."""
    if isinstance(error, sqlite3.OperationalError):
        return "full" in str(error) or "disk I/O" in str(error)
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


@dataclass
class Refusal(Exception):
    """A request that cannot be met: HTTP status, kind of problem, and what to tell the person.

    errors: {"key", "message", "remedy"} each, for input at fault.
    """

    status: int
    kind: str
    detail: str
    errors: list[dict[str, Any]] = field(default_factory=list)
    headers: dict[str, str] = field(default_factory=dict)


def response(refusal: Refusal) -> Response:
    """The answer that tells of a refusal."""
    body: dict[str, Any] = {
        "type": f"urn:coopnav:{refusal.kind}",
        "title": HTTPStatus(refusal.status).phrase,
        "status": refusal.status,
        "detail": refusal.detail,
    }
    if refusal.errors:
        body["errors"] = refusal.errors
    return Response(
        dumps(body), status_code=refusal.status, media_type="application/problem+json", headers=refusal.headers
    )


def of_scenario(error: ScenarioError) -> Refusal:
    """A scenario's problems, each with its key path."""
    errors = [{"key": p.key, "message": p.message, "remedy": p.remedy} for p in error.problems]
    return Refusal(422, "scenario", str(error), errors)


def _of_validation(request: Request, error: RequestValidationError) -> Refusal:
    """What the request's shape got wrong; never what it said, which may not even be JSON."""
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if given != "application/json" and any(e["loc"] == ("body",) for e in error.errors()):
        return Refusal(415, "media-type", "send a JSON object, with content-type: application/json")
    errors = [
        {
            "key": ".".join(str(part) for part in e["loc"][1:]) or str(e["loc"][0]),
            "message": e["msg"],
            "remedy": "",
            "type": e["type"],
        }
        for e in error.errors()
    ]
    detail = "; ".join(f"{e['key']}: {e['message']}" for e in errors[:5])
    return Refusal(422, "request", detail, errors)


def _of_http(request: Request, error: HTTPException) -> Refusal:
    kind, detail = "http", str(error.detail)
    if error.status_code == 404:
        kind, detail = "unknown", f"there is nothing at {request.url.path[:200]}; what there is, /api/docs says"
    elif error.status_code == 405:
        kind, detail = "method", f"{request.method[:20]} is not possible here; what is, /api/docs says"
        return Refusal(405, kind, detail, headers={"allow": ", ".join(sorted(_methods(request)))})
    return Refusal(error.status_code, kind, detail, headers=dict(error.headers or {}))


def _methods(request: Request) -> set[str]:
    """What can be asked of an address: each of its methods is a route of its own."""
    here = [r for r in request.app.routes if isinstance(r, Route) and r.matches(request.scope)[0] is not Match.NONE]
    return {method for route in here for method in route.methods or ()}


def _name(asked: HTTPConnection) -> str:
    """A request, or a websocket, in the log."""
    return f"{asked.scope.get('method', 'websocket')} {asked.url.path}"


def install(app: FastAPI) -> None:
    """Answer every error of an app as a problem."""

    async def refused(_: Request, error: Exception) -> Response:
        assert isinstance(error, Refusal)
        return response(error)

    async def bad_scenario(_: Request, error: Exception) -> Response:
        assert isinstance(error, ScenarioError)
        return response(of_scenario(error))

    async def bad_request(request: Request, error: Exception) -> Response:
        assert isinstance(error, RequestValidationError)
        return response(_of_validation(request, error))

    async def bad_http(request: Request, error: Exception) -> Response:
        assert isinstance(error, HTTPException)
        return response(_of_http(request, error))

    async def gone(asked: HTTPConnection, _: Exception) -> None:
        log.info("%s: the client went away", _name(asked))

    async def stored(asked: HTTPConnection, error: Exception) -> Response:
        if not disk_full(error):
            return await broken(asked, error)
        log.error("%s: %s", _name(asked), error)
        return response(Refusal(507, "storage", "the disk is full; delete jobs that are no longer needed"))

    async def broken(asked: HTTPConnection, error: Exception) -> Response:
        log.error("%s failed", _name(asked), exc_info=error)
        return response(Refusal(500, "internal", "the server failed to answer this; its log says why"))

    app.add_exception_handler(Refusal, refused)
    app.add_exception_handler(ScenarioError, bad_scenario)
    app.add_exception_handler(RequestValidationError, bad_request)
    app.add_exception_handler(HTTPException, bad_http)
    app.add_exception_handler(ClientDisconnected, gone)  # pyright: ignore[reportArgumentType]
    app.add_exception_handler(sqlite3.OperationalError, stored)  # pyright: ignore[reportArgumentType]
    app.add_exception_handler(OSError, stored)  # pyright: ignore[reportArgumentType]
    app.add_exception_handler(Exception, broken)  # pyright: ignore[reportArgumentType]
