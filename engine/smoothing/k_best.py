"""k-best (W15 section IV-C): a packet repeats the k links whose priors tell most about the sender's present pose."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from engine.navigation.mission import NavigationMission
from engine.registry import Algorithm, Progress
from engine.smoothing.fidelity import reconstruct
from engine.smoothing.fleet import make_nodes
from engine.smoothing.sender import choose_best
from engine.smoothing.story import smooth
from engine.tracks import Tracks


class Options(BaseModel):
    """What a scenario may choose for k-best, under [options.k_best]."""

    model_config = ConfigDict(extra="forbid")

    k: int = Field(2, ge=0, le=8, description="links with priors that each packet carries")
    loss: float = Field(0.5, ge=0, lt=1, description="fraction of packets the sender expects to be lost, r of eq. 17")
    consistent: bool = Field(False, description="keep the approximate chain from being more certain than the true one")
    reconstruct_only: bool = Field(
        False, description="only put the chains together and compare them with their targets, do not navigate"
    )


def run(mission: NavigationMission, progress: Progress) -> Tracks:
    """Run k-best on a mission with the scenario's options."""
    options = Options(**mission.options.get("k_best", {}))
    choose = choose_best(options.loss)
    make = make_nodes(mission, options.k, choose, consistent=options.consistent)
    return (reconstruct if options.reconstruct_only else smooth)(mission, progress, make)


K_BEST = Algorithm(
    name="k_best",
    title="Factor composition, k-best",
    family="smoothing",
    summary="As k-last, but repeats the priors that tell most about the present pose, by mutual information. Shown is "
    "what a vehicle knew at the time.",
    source="Walls, Cunningham and Eustice 2015, section IV-C, eq. (17)",
    run=run,
    options=Options,
)
