"""viser servers that answer to our relay alone.

viser listens on a loopback port where any program of this machine, and any page in its browsers, can knock, and has no
setting for who may enter: the call with which it starts its websocket server gets a check of the first request added.
"""

from __future__ import annotations

import hmac
import threading
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from websockets.asyncio import server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

if TYPE_CHECKING:
    import viser

HEADER = "x-coopnav-pane"

_starting = threading.Lock()


def prepare() -> None:
    """Import viser, which takes half as long as all else that a server imports: only the first pane waits for it."""
    import_module("viser")


def start(secret: str) -> viser.ViserServer:
    """A viser server on a free loopback port that refuses every request without the secret in its header."""
    import viser  # see `prepare`

    serve, checked = server.serve, threading.Event()

    def guarded(*arguments: Any, **options: Any) -> Any:
        checked.set()
        return serve(*arguments, **options | {"process_request": _check(secret)})

    with _starting:
        server.serve = guarded  # pyright: ignore[reportAttributeAccessIssue]
        try:
            started = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        finally:
            server.serve = serve
    if not checked.is_set():
        started.stop()
        raise RuntimeError(f"viser {viser.__version__} starts its server in a way that cannot be guarded")
    return started


def _check(secret: str) -> Callable[[ServerConnection, Request], Response | None]:
    def check(connection: ServerConnection, request: Request) -> Response | None:
        given = request.headers.get_all(HEADER)
        if len(given) == 1 and hmac.compare_digest(given[0].encode(), secret.encode()):
            return None
        return connection.respond(403, "this is the inside of coopnav\n")

    return check
