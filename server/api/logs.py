"""Recorded logs of one's own: upload files, see what is in them, try a mapping."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, ConfigDict
from starlette.concurrency import run_in_threadpool

from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.navigation import NavigationScenario
from engine.scenario.recording import CsvRecording, PyfgRecording
from server.inline import from_json
from server.preview import understood
from server.site import Here, Site

router = APIRouter(prefix="/api", tags=["logs"])


class Mapping(BaseModel):
    """A scenario that maps a log's files to sensors."""

    model_config = ConfigDict(extra="forbid")

    scenario: dict[str, Any]


@router.get("/logs")
def logs(here: Here) -> list[dict[str, Any]]:
    """All uploaded logs, their files, and the saved scenarios that use them."""
    return here.logbook.entries()


@router.get("/logs/{log}")
async def log(log: str, here: Here) -> dict[str, Any]:
    """A log's files: columns with samples, robots and points, or what is wrong with a file."""
    async with here.logbook.reading:
        return await run_in_threadpool(here.logbook.describe, log)


@router.put(
    "/logs/{log}/{file}",
    status_code=204,
    openapi_extra={"requestBody": {"required": True, "content": {"text/csv": {"schema": {"type": "string"}}}}},
)
async def keep(log: str, file: str, request: Request, here: Here) -> Response:
    """Keep a CSV or PyFG file as part of a log; 201 where it is a new one."""
    new = await run_in_threadpool(here.logbook.keep, log, file, await request.body())
    return Response(status_code=201 if new else 204)


@router.delete("/logs/{log}", status_code=204)
def delete(log: str, here: Here) -> None:
    """Forget a log that no saved scenario uses."""
    here.logbook.delete(log)


@router.post("/logs/{log}/preview")
async def preview(log: str, body: Mapping, here: Here) -> dict[str, Any]:
    """What a scenario makes of a log: vehicles, sensors, readings, ranges, tracks to draw."""
    async with here.logbook.reading:
        return await run_in_threadpool(_understood, log, body, here)


def _understood(log: str, body: Mapping, here: Site) -> dict[str, Any]:
    root = here.logbook.root(log)
    scenario = from_json(body.scenario)
    mission = getattr(scenario, "mission", None)
    if not isinstance(scenario, NavigationScenario) or not isinstance(mission, CsvRecording | PyfgRecording):
        raise ScenarioError([Problem("mission", "is not a recorded mission of navigation", "map CSV or PyFG files")])
    if mission.log != log:
        raise ScenarioError([Problem("mission.log", f"is {mission.log!r}", f"write log = {log!r}")])
    return understood(scenario, root)
