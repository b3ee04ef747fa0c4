"""The server as one ASGI application on one port."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
from collections.abc import AsyncIterator
from importlib.metadata import version

import anyio.to_thread
from fastapi import FastAPI
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import ASGIApp, Receive, Scope, Send

from engine import registry
from server import problems, recovery
from server.api import algorithms, docs, health, jobs, logs, marks, page, scenarios, scenes, tables, tracking
from server.cluster import Cluster
from server.guard import Guard
from server.jobs import Jobs
from server.journal import Journal
from server.logbook import Logbook
from server.meter import Meter, Tally
from server.scenes import inner
from server.scenes.sessions import Sessions
from server.settings import Settings
from server.shelf import Shelf
from server.site import Site
from server.wire import Json

#: Requests that are worked on at once in threads: more would only keep each other, and the event loop, waiting.
MOST_THREADS = 8

DESCRIPTION = """Compare cooperative underwater navigation estimators. Errors are problem+json
(type, title, status, detail, and the key paths of input at fault)."""


async def _prepare(ready: asyncio.Event) -> None:
    """Import what the first job and the first 3D pane need, as soon as jobs can run."""
    await ready.wait()
    await asyncio.to_thread(registry.algorithms)
    await asyncio.to_thread(inner.prepare)


class Heads:
    """ASGI middleware: HEAD is answered as GET is, and the connection leaves the body out."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["method"] == "HEAD":
            scope = {**scope, "method": "GET"}
        await self.app(scope, receive, send)


def create_app(settings: Settings) -> FastAPI:
    """The application; its store, cluster and scenes live from start-up to shutdown."""
    tally = Tally()

    @contextlib.asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        anyio.to_thread.current_default_thread_limiter().total_tokens = MOST_THREADS
        settings.data.mkdir(parents=True, exist_ok=True)
        store = recovery.open_store(settings.data)
        journal = Journal(store)
        cluster = Cluster(settings)
        work = Jobs(store, journal, cluster, settings)
        scenes = Sessions(settings, work)
        shelf = Shelf(settings.data / "scenarios")
        app.state.site = Site(settings, journal, cluster, work, shelf, Logbook(settings, shelf), scenes, tally)
        starting = asyncio.gather(cluster.start(work.hear), _prepare(cluster.ready))
        work.start()
        try:
            yield
        finally:
            journal.close()
            await scenes.close()
            await work.close()
            starting.cancel()
            await asyncio.gather(starting, return_exceptions=True)
            with contextlib.suppress(sqlite3.OperationalError):
                await journal.flush()
            await cluster.close()
            store.close()

    app = FastAPI(
        title="coopnav",
        version=version("coopnav"),
        description=DESCRIPTION,
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/openapi.json",
        default_response_class=Json,
    )
    problems.install(app)
    # A request is tried on their routes one by one: those that are asked for most come first.
    for room in (health, jobs, page, scenes, algorithms, scenarios, marks, tables, logs, tracking, docs):
        app.include_router(room.router, responses=problems.ANSWERS)
    app.add_middleware(GZipMiddleware, minimum_size=2000, compresslevel=5)
    app.add_middleware(Guard, settings=settings)
    app.add_middleware(Meter, tally=tally)
    app.add_middleware(Heads)
    return app
