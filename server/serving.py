"""`coopnav serve`: the application on a port, until told to stop."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import os
import secrets
import socket
import sqlite3
import sys
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import uvicorn

from server import logs, recovery
from server.app import create_app
from server.connections import careful, most_connections
from server.settings import Settings

#: Where a token may be given that lasts longer than one run.
TOKEN_VARIABLE = "COOPNAV_TOKEN"
SHORTEST_TOKEN = 16
#: The file of a data folder that its server holds locked, with the server's process id.
LOCK = "coopnav.lock"
#: A thread that computes hands over to the one that answers so soon, s.
SWITCH_S = 0.0001
#: Proxies, by address, whose word is taken for where a request came from.
PROXIES_VARIABLE = "FORWARDED_ALLOW_IPS"


class CannotServe(Exception):
    """The server cannot start, and why."""


class _Server(uvicorn.Server):
    """Ends event streams before it waits for open connections."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        site = getattr(self.config.app.state, "site", None)  # pyright: ignore
        if site is not None:
            site.journal.close()
        await super().shutdown(sockets)


def given_token() -> str | None:
    """The token that the environment asks for; None where it asks for none."""
    token = os.environ.get(TOKEN_VARIABLE, "").strip()
    if token and (len(token) < SHORTEST_TOKEN or not token.isascii() or not token.isprintable()):
        found = "is short" if len(token) < SHORTEST_TOKEN else "cannot be sent in a header"
        raise CannotServe(f"the token in {TOKEN_VARIABLE} {found}; use at least {SHORTEST_TOKEN} letters and digits")
    return token or None


def listen(settings: Settings) -> socket.socket:
    """The listening socket; CannotServe where the address cannot be had."""
    try:
        family, _, _, _, address = socket.getaddrinfo(settings.host, settings.port, type=socket.SOCK_STREAM)[0]
        # asyncio sends at once (TCP_NODELAY) only where the protocol is named: a body would wait 40 ms for its head.
        listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(2048)
    except OSError as error:
        reason = error.strerror or str(error)
        raise CannotServe(
            f"cannot listen on {settings.host} port {settings.port}: {reason}; choose another with --port"
        ) from None
    return listener


def configured(app: Any, settings: Settings) -> uvicorn.Config:
    """How uvicorn serves the application, in tests as in use."""
    return uvicorn.Config(
        app,
        http=careful(settings.slowest_head_s, settings.most_connections),
        log_config=None,
        access_log=False,
        forwarded_allow_ips=os.environ.get(PROXIES_VARIABLE, ""),
        ws_max_size=1024 * 1024,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=5,
        server_header=False,
    )


def serve(settings: Settings, log_format: str = "text", log_level: str = "warning") -> None:
    """Serve until interrupted; prints the address to open."""
    given = settings.token is not None
    if not settings.loopback and not given:
        settings = replace(settings, token=secrets.token_urlsafe(24))
    with occupy(settings.data):
        listener = listen(settings)
        port, most = listener.getsockname()[1], most_connections(settings.most_connections)
        settings = replace(settings, port=port, most_connections=most)
        logs.write(log_format, log_level)
        sys.setswitchinterval(SWITCH_S)
        print(f"coopnav is open at {address(settings, shown=not given)}", flush=True)
        print(f"jobs and scenarios are kept in {settings.data}; Ctrl-C ends the server", file=sys.stderr, flush=True)
        config = configured(create_app(settings), settings)
        with contextlib.suppress(KeyboardInterrupt):
            asyncio.run(_Server(config).serve(sockets=[listener]))


def occupy(data: Path) -> IO[str]:
    """Take a data folder for one server alone, until the lock is closed; CannotServe where it is taken or no use."""
    try:
        data.mkdir(parents=True, exist_ok=True)
        lock = (data / LOCK).open("a+", encoding="utf-8")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            found = f"process {lock.read(20).strip()} keeps its data in {data}"
            raise CannotServe(f"{found}; end it, or choose another folder with --data") from None
        lock.truncate(0)
        lock.write(f"{os.getpid()}\n")
        lock.flush()
        recovery.open_store(data).close()
    except OSError as error:
        reason = error.strerror or str(error)
        raise CannotServe(f"cannot keep data in {data}: {reason}; choose another folder with --data") from None
    except (RuntimeError, sqlite3.Error) as error:
        raise CannotServe(f"cannot use the data in {data}: {error}; choose another folder with --data") from None
    return lock


def address(settings: Settings, shown: bool = True) -> str:
    """What to open in a browser; a token that was given from outside is not written into logs."""
    host = socket.gethostname() if settings.host in ("0.0.0.0", "::") else settings.host
    host = f"[{host}]" if ":" in host else host
    token = "/" if not settings.token else f"/?token={settings.token if shown else '…'}"
    return f"http://{host}:{settings.port}{token}"
