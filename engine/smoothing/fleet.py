"""One smoothing node per vehicle of a mission, each with the sender of its own chain."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engine.gaussian.forms import Moments
from engine.gaussian.links import advance
from engine.navigation.chains import Chain
from engine.navigation.mission import Launch, NavigationMission
from engine.navigation.network import Member
from engine.smoothing.local_chain import local_chain
from engine.smoothing.node import Sender, SmootherNode
from engine.smoothing.sender import Choice, FixedSender, PlaneSender, PoseSender


def make_nodes(
    mission: NavigationMission, k: int, choice: Choice, *, consistent: bool = False
) -> Callable[[Member], SmootherNode]:
    """A function from a vehicle's own knowledge to its node; every sender's chain comes from its own log alone."""

    def make(member: Member) -> SmootherNode:
        return SmootherNode(member, make_sender(mission, member, k, choice, consistent), k)

    return make


def launches_of(mission: NavigationMission, vehicle: int) -> np.ndarray:
    """The times a vehicle broadcasts."""
    return np.array([e.time_s for e in mission.events if isinstance(e, Launch) and e.vehicle == vehicle])


def make_sender(mission: NavigationMission, member: Member, k: int, choice: Choice, consistent: bool) -> Sender:
    """What a vehicle will broadcast, from its own chain."""
    v, chain, trials = member.index, mission.chains[member.index], mission.trials
    times = launches_of(mission, v)
    if member.sizes[v] == 2:
        return FixedSender(v, _beliefs(chain, times), trials)
    local = local_chain(member.log, chain, times, trials, consistent=consistent)
    if local.dimension == 3:
        return PoseSender(v, local, trials, k)
    return PlaneSender(v, local, trials, k, choice)


def _beliefs(chain: Chain, times: np.ndarray) -> list[Moments]:
    """What a vehicle believes of itself by its own sensors at some of its breakpoints."""
    state, at, found = chain.initial, 0, []
    for time_s in times:
        while at + 1 < len(chain.times_s) and chain.times_s[at + 1] <= time_s:
            state = advance(state, slice(None), chain.steps[at].at(state.mean))
            at += 1
        found.append(state)
    return found
