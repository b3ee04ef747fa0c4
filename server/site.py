"""What the routers work with: one of everything a running server has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

from server.cluster import Cluster
from server.jobs import Jobs
from server.journal import Journal
from server.logbook import Logbook
from server.meter import Tally
from server.scenes.sessions import Sessions
from server.settings import Settings
from server.shelf import Shelf


@dataclass(frozen=True)
class Site:
    """One running server's parts."""

    settings: Settings
    journal: Journal
    cluster: Cluster
    jobs: Jobs
    shelf: Shelf
    logbook: Logbook
    scenes: Sessions
    tally: Tally


async def _site(connection: HTTPConnection) -> Site:  # what is not async has its turn in a thread, every time
    return connection.app.state.site


Here = Annotated[Site, Depends(_site)]
