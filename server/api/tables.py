"""Tables made of several finished jobs."""

from __future__ import annotations

import json
from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from engine.evaluation import comparison
from server import artifacts
from server.problems import Refusal
from server.site import Here, Site

router = APIRouter(prefix="/api/tables", tags=["tables"])


class Runs(BaseModel):
    """The finished jobs that W11's Table I is made of."""

    model_config = ConfigDict(extra="forbid")

    lossless: dict[str, str] = Field(max_length=10, description="job of each topology without loss, by scenario name")
    lossy: str = Field(max_length=100, description="job of the fully connected topology with loss")


@router.get("/walls2011-table-1")
def plan() -> dict[str, Any]:
    """The runs that the table needs: submit them as jobs, then post their ids."""
    return {
        "algorithms": comparison.ALGORITHMS,
        "lossless": comparison.TOPOLOGIES,
        "lossy": {"scenario": comparison.LOSSY, "set": {"network.loss": comparison.LOSS}},
        "columns": comparison.COLUMNS,
    }


@router.post("/walls2011-table-1")
def table_1(runs: Runs, here: Here) -> list[dict[str, Any]]:
    """W11's Table I from finished jobs, every cell with the figure that decides it and what the paper says."""
    missing = [name for name in comparison.TOPOLOGIES if name not in runs.lossless]
    if missing:
        raise Refusal(422, "missing-runs", f"lossless has no job for {', '.join(missing)}")
    lossless = {name: _result(here, runs.lossless[name], name) for name in comparison.TOPOLOGIES}
    return comparison.table_1(lossless, _result(here, runs.lossy, comparison.LOSSY))


def _result(here: Site, job: str, scenario: str) -> dict[str, Any]:
    """result.json of a job, which must be of that scenario and have the algorithms others are compared with."""
    result = json.loads(here.jobs.results.artifact(job, artifacts.RESULT).read_text())
    if here.jobs.find(job).public()["scenario"] != scenario:
        raise Refusal(422, "wrong-run", f"job {job} is not a run of {scenario}")
    absent = [name for name in ("dead_reckoning", "cekf") if name not in result["algorithms"]]
    if absent:
        raise Refusal(422, "wrong-run", f"job {job} did not run {', '.join(absent)}, which the table compares with")
    return result
