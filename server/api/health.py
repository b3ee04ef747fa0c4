"""Is the server there, are its workers, and how is it doing?"""

from __future__ import annotations

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from server import metrics
from server.problems import Refusal
from server.site import Here, Site

router = APIRouter(tags=["health"])


class Health(BaseModel):
    """How the server is."""

    live: bool = Field(description="it answers")
    ready: bool = Field(description="it can run jobs now")
    workers: int = Field(description="worker processes")
    problem: str | None = Field(description="what keeps it from running jobs")


@router.get("/api/health")
async def health(here: Here) -> Health:
    """Whether the server is live and can run jobs now, and what keeps it from it."""
    return await _health(here)


@router.get("/api/health/live")
async def live() -> dict[str, bool]:
    """200 as long as the server answers; asks for no token."""
    return {"live": True}


@router.get("/api/health/ready")
async def ready(here: Here) -> dict[str, bool]:
    """200 while the server can run jobs, else 503; asks for no token."""
    if not (await _health(here)).ready:
        raise Refusal(503, "not-ready", "there are no workers to run jobs on", headers={"retry-after": "2"})
    return {"ready": True}


@router.get("/metrics", response_class=Response)
async def figures(here: Here) -> Response:
    """The server's figures in Prometheus' text format."""
    return Response(await metrics.text(here), media_type=metrics.CONTENT_TYPE)


async def _health(here: Site) -> Health:
    there = here.cluster.ready.is_set()
    workers = len(await here.cluster.workers()) if there else 0
    return Health(live=True, ready=workers > 0, workers=workers, problem=here.cluster.failure)
