"""A person's marks on jobs, and the scenarios that jobs ran."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from engine.scenario import toml
from server.site import Here

router = APIRouter(prefix="/api", tags=["jobs"])

Tag = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=40)]


class Marks(BaseModel):
    """What a person notes on a job; what is left out stays as it is."""

    model_config = ConfigDict(extra="forbid")

    tags: list[Tag] | None = Field(None, max_length=20)
    pinned: bool | None = Field(None, description="a baseline to compare with")


@router.patch("/jobs/{id}")
def mark(id: str, body: Marks, here: Here) -> dict[str, Any]:
    """Tag a job or pin it."""
    marks = body.model_dump(exclude_none=True)
    if "tags" in marks:
        marks["tags"] = list(dict.fromkeys(marks["tags"]))
    return here.jobs.mark(id, **marks).public()


@router.get("/jobs/{id}/scenario")
def scenario(id: str, here: Here) -> dict[str, Any]:
    """The scenario that a job runs, as JSON and as TOML, with what it was changed by; name is the library's, if any."""
    job = here.jobs.find(id)
    found = toml.loads(job.toml, origin=job.origin)
    return {
        "name": job.scenario,
        "changes": job.changes,
        "scenario": found.model_dump(mode="json", by_alias=True, exclude_none=True),
        "toml": job.toml,
    }
