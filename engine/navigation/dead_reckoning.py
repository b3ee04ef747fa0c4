"""Dead reckoning: own sensors and own fixes only; what every cooperative estimator must beat."""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments
from engine.gaussian.links import advance
from engine.navigation.chains import XY, Step
from engine.navigation.mission import Arrival, Launch
from engine.navigation.network import Member, Packet, run_nodes
from engine.navigation.ranging import Innovation
from engine.registry import Algorithm


class DeadReckoningNode:
    """A vehicle that neither speaks nor listens."""

    def __init__(self, member: Member) -> None:
        self.own = member.initial

    def advance(self, step: Step) -> None:
        self.own = advance(self.own, slice(None), step.at(self.own.mean))

    def transmit(self, launch: Launch) -> Packet | None:
        return None

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation | None:
        return None

    def belief(self) -> Moments:
        return Moments(self.own.mean[..., XY], self.own.cov[..., XY, XY])

    def notes(self) -> list[str]:
        return []


DEAD_RECKONING = Algorithm(
    name="dead_reckoning",
    title="Dead reckoning",
    family="navigation",
    summary="Own velocity, heading and fixes only; hears nobody. Error grows without bound between fixes.",
    source="Walls and Eustice 2011, section I",
    run=lambda mission, progress: run_nodes(mission, progress, DeadReckoningNode),
)
