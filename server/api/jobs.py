"""Jobs: to submit, to watch, to end, and what came of them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.responses import FileResponse, HTMLResponse, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.concurrency import run_in_threadpool

from engine.scenario.models import ScenarioBase
from server import artifacts, report, tum
from server.inline import from_json, with_values
from server.jobs import Wanted
from server.problems import Refusal
from server.shelf import unavailable
from server.site import Here, Site

router = APIRouter(prefix="/api", tags=["jobs"])


class Submission(BaseModel):
    """What to run: a scenario by name or written out, and what to change in it."""

    model_config = ConfigDict(extra="forbid")

    scenario: str | dict[str, Any]
    algorithms: list[str] | None = Field(None, max_length=100)
    trials: int | None = Field(None, ge=1)
    seed: int | None = Field(None, ge=0)
    set: dict[str, Any] = Field({}, max_length=200, description="key paths and their values, as in network.loss: 0.4")
    purpose: Literal["run", "what-if"] = Field("run", description="a small what-if goes before other jobs")
    keep: Literal["tracks", "statistics"] = Field(
        "tracks", description="statistics: of all trials but the first few only figures over them; up to a million"
    )
    limit_s: float | None = Field(None, gt=0, allow_inf_nan=False, description="end it if it runs longer, s")


@router.post("/jobs", status_code=202)
async def submit(
    body: Submission,
    request: Request,
    response: Response,
    here: Here,
    idempotency_key: Annotated[str | None, Header(max_length=200)] = None,
    coopnav_client: Annotated[str | None, Header(max_length=100)] = None,
) -> dict[str, Any]:
    """Accept a job; the same Idempotency-Key with the same body answers with the same job.

    Clients take turns: a client is what Coopnav-Client says, else a network address.
    """
    client = coopnav_client or (request.client.host if request.client else "")
    if idempotency_key is None:
        here.jobs.admit(client)
    async with here.jobs.accepting:
        job = await here.jobs.submit(
            Wanted(
                scenario=await run_in_threadpool(_wanted, body, here),
                name=body.scenario if isinstance(body.scenario, str) else None,
                body=body.model_dump(mode="json"),
                algorithms=body.algorithms,
                key=idempotency_key,
                client=client,
                purpose=body.purpose,
                limit_s=body.limit_s,
                keep=body.keep,
            )
        )
    response.headers["location"] = f"/api/jobs/{job.id}"
    return job.public()


@router.post("/jobs/estimate")
def estimate(body: Submission, here: Here) -> dict[str, Any]:
    """What a job would cost (worker seconds, bytes of result and memory) and whether it would be accepted."""
    return here.jobs.estimate(_wanted(body, here), body.algorithms, body.keep)


@router.get("/jobs")
def jobs(here: Here) -> list[dict[str, Any]]:
    """The newest 200 jobs, newest first."""
    return [job.public() for job in here.jobs.store.jobs()]


@router.get("/jobs/{id}")
async def job(id: str, here: Here) -> dict[str, Any]:
    """A job's state."""
    return here.jobs.find(id).public()


@router.delete("/jobs/{id}", status_code=204)
async def delete(id: str, here: Here) -> None:
    """Forget a job and its files; one that runs is ended."""
    await here.jobs.delete(id)


@router.post("/jobs/{id}/cancel")
async def cancel(id: str, here: Here) -> dict[str, Any]:
    """End a job; one that has ended stays as it is."""
    return (await here.jobs.cancel(id)).public()


@router.get("/jobs/{id}/events", response_class=StreamingResponse)
async def events(id: str, here: Here, last_event_id: Annotated[str, Header()] = "0") -> StreamingResponse:
    """Server-sent events: state, progress and estimates; resumable by Last-Event-ID; ends with the job."""
    here.jobs.find(id)
    after = int(last_event_id) if last_event_id.isascii() and last_event_id.isdigit() else 0
    return StreamingResponse(
        _stream(here, id, min(after, 2**62)),
        media_type="text/event-stream",
        headers={"cache-control": "no-store", "x-accel-buffering": "no"},
    )


@router.get("/jobs/{id}/result", response_class=Response)
async def result(id: str, here: Here) -> Response:
    """result.json of a finished job."""
    # Here and now: it is small and asked for often, and a thread's turn would take longer than reading it.
    text = here.jobs.results.artifact(id, artifacts.RESULT).read_bytes()
    return Response(text, media_type="application/json")


@router.get("/jobs/{id}/arrays", response_class=FileResponse)
def arrays(id: str, here: Here) -> FileResponse:
    """arrays.npz of a finished job."""
    path = here.jobs.results.artifact(id, artifacts.ARRAYS)
    return FileResponse(path, media_type="application/octet-stream", filename=f"{id}-{artifacts.ARRAYS}")


@router.get("/jobs/{id}/tracks", response_class=Response)
def tracks(id: str, here: Here, trial: Annotated[int, Query(ge=0)] = 0) -> Response:
    """A trial of a finished job as TUM text files in a ZIP, which evo and its like read."""
    content = tum.zipped(here.jobs.results.artifact(id, artifacts.ARRAYS), trial)
    named = {"content-disposition": f'attachment; filename="{id}-tracks.zip"'}
    return Response(content, media_type="application/zip", headers=named)


@router.get("/jobs/{id}/graphs/{algorithm}", response_class=FileResponse)
def graphs(id: str, algorithm: str, here: Here) -> FileResponse:
    """Factor graphs and broadcasts of a finished job's first trial, of an algorithm whose view says it has them."""
    written = artifacts.read_sums(here.jobs.results.artifact(id, artifacts.RESULT).parent)
    name = artifacts.graph_file(algorithm)
    if name not in written:
        raise Refusal(404, "no-graph", f"{algorithm!r} tells of no factor graph in this job")
    return FileResponse(here.jobs.results.artifact(id, name), media_type="application/json")


@router.get("/jobs/{id}/report", response_class=HTMLResponse)
def job_report(id: str, here: Here) -> HTMLResponse:
    """A finished job as one HTML page that needs nothing else."""
    here.jobs.results.artifact(id, artifacts.ARRAYS)
    folder = here.jobs.results.artifact(id, artifacts.RESULT).parent
    return HTMLResponse(report.of_directory(folder), headers={"content-security-policy": report.POLICY})


@router.get("/jobs/{id}/view")
def view(id: str, here: Here) -> Response:
    """A run thinned for display, as far as it has come; 204 while there is nothing to see."""
    headers = {"cache-control": "no-store"}
    text = here.jobs.results.view(id)
    if text is None:
        return Response(status_code=204, headers=headers)
    return Response(text, media_type="application/json", headers=headers)


def _wanted(body: Submission, here: Site) -> ScenarioBase:
    scenario = here.shelf.find(body.scenario) if isinstance(body.scenario, str) else from_json(body.scenario)
    scenario = with_values(scenario, body.set)
    if body.trials is not None:
        scenario = with_values(scenario, {"trials": body.trials})
    if body.seed is not None:
        scenario = with_values(scenario, {"seed": body.seed})
    missing = unavailable(scenario)
    if missing is not None:
        raise Refusal(422, "missing-data", missing)
    return scenario


async def _stream(here: Site, id: str, after: int) -> AsyncIterator[str]:
    async for event in here.journal.follow(id, after):
        if event is None:
            yield ": still here\n\n"
        else:
            yield f"id: {event.id}\nevent: {event.kind}\ndata: {event.data}\n\n"
