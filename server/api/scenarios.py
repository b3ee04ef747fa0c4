"""Scenarios: the shipped ones to read, one's own to keep."""

from __future__ import annotations

import json
from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.concurrency import run_in_threadpool

from engine.scenario import toml
from engine.scenario.families import MODELS
from engine.scenario.models import ScenarioBase
from server.inline import from_json, with_values
from server.problems import Refusal
from server.site import Here

router = APIRouter(prefix="/api", tags=["scenarios"])


@router.get("/scenarios")
def scenarios(here: Here) -> list[dict[str, Any]]:
    """All scenarios in brief; `missing` says why one cannot run on this machine."""
    return here.shelf.entries()


@router.get("/scenarios/{name}")
def scenario(name: str, here: Here) -> dict[str, Any]:
    """A scenario as JSON and as the TOML of its file."""
    return _shown(name, here.shelf.find(name), here)


class Edits(BaseModel):
    """What to change in a scenario."""

    model_config = ConfigDict(extra="forbid")

    set: dict[str, Any] = Field({}, max_length=200, description="key paths and their values, as in network.loss: 0.4")


@router.post("/scenarios/{name}/edited")
def edited(name: str, body: Edits, here: Here) -> dict[str, Any]:
    """A scenario with some keys changed, as JSON and TOML; nothing is kept."""
    return _shown(name, with_values(here.shelf.find(name), body.set), here)


@router.get("/schemas/{family}")
def schema(family: str) -> dict[str, Any]:
    """The JSON schema of a family's scenarios: keys, bounds, defaults, and what each means."""
    if family not in MODELS:
        raise Refusal(404, "unknown-family", f"there is no family {family[:80]!r}; there are {', '.join(MODELS)}")
    return MODELS[family].model_json_schema()


@router.put(
    "/scenarios/{name}",
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                "application/json": {"schema": {"type": "object"}},
                "application/toml": {"schema": {"type": "string"}},
            },
        }
    },
)
async def save(name: str, request: Request, response: Response, here: Here) -> dict[str, Any]:
    """Keep a scenario, given as JSON, or as TOML with content type application/toml."""
    try:
        text = (await request.body()).decode("utf-8")
    except UnicodeDecodeError:
        raise Refusal(422, "encoding", "the body is not UTF-8 text") from None
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    given = await run_in_threadpool(_read, text, kind)
    new = await run_in_threadpool(here.shelf.save, name, given)
    response.status_code = 201 if new else 200
    return _shown(name, given, here)


@router.delete("/scenarios/{name}", status_code=204)
def delete(name: str, here: Here) -> None:
    """Forget a scenario of one's own."""
    here.shelf.delete(name)


def _read(text: str, kind: str) -> ScenarioBase:
    if kind == "application/toml":
        return toml.loads(text)
    if kind != "application/json":
        raise Refusal(415, "media-type", "send application/json or application/toml")
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Refusal(422, "json", f"the body is not JSON: {error}") from None
    return from_json(value)


def _shown(name: str, scenario: ScenarioBase, here: Here) -> dict[str, Any]:
    return {
        "name": name,
        "shipped": here.shelf.is_shipped(name),
        "scenario": scenario.model_dump(mode="json", by_alias=True, exclude_none=True),
        "toml": toml.dumps(scenario),
    }
