"""Is the server there, and are its workers?"""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from server.site import Here

router = APIRouter(prefix="/api", tags=["health"])


@router.get("/health")
async def health(here: Here) -> dict[str, Any]:
    """Whether the server is live and can run jobs now, and what keeps it from it."""
    ready = here.cluster.ready.is_set()
    workers = await here.cluster.workers() if ready else []
    return {"live": True, "ready": bool(workers), "workers": len(workers), "problem": here.cluster.failure}
