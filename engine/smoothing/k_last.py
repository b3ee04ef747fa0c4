"""k-last (W15 section IV-C): a packet carries the new launch's link and the k most recent links with priors."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from engine.navigation.mission import NavigationMission
from engine.registry import Algorithm, Progress
from engine.smoothing.fidelity import reconstruct
from engine.smoothing.fleet import make_nodes
from engine.smoothing.sender import choose_last
from engine.smoothing.story import smooth
from engine.tracks import Tracks


class Options(BaseModel):
    """What a scenario may choose for k-last, under [options.k_last]."""

    model_config = ConfigDict(extra="forbid")

    k: int = Field(2, ge=0, le=8, description="links with priors that each packet carries")
    consistent: bool = Field(False, description="keep the approximate chain from being more certain than the true one")
    reconstruct_only: bool = Field(
        False, description="only put the chains together and compare them with their targets, do not navigate"
    )


def run(mission: NavigationMission, progress: Progress) -> Tracks:
    """Run k-last on a mission with the scenario's options."""
    options = Options(**mission.options.get("k_last", {}))
    make = make_nodes(mission, options.k, choose_last, consistent=options.consistent)
    return (reconstruct if options.reconstruct_only else smooth)(mission, progress, make)


K_LAST = Algorithm(
    name="k_last",
    title="Factor composition, k-last",
    family="smoothing",
    summary="Every vehicle shares an approximate chain of its launches, repeating its latest priors, and smooths what "
    "it heard. Shown is what a vehicle knew at the time.",
    source="Walls, Cunningham and Eustice 2015, section IV",
    run=run,
    options=Options,
)
