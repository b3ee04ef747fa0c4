"""What one node sent and heard in its first trial, kept for those who want to look into it afterwards."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engine.navigation.mission import Arrival
from engine.smoothing.composition import Relation
from engine.smoothing.reconstruction import ReceivedChain

#: Less information (1/m^2) about a position than this is no fix.
NOTHING = 1e-9


@dataclass(frozen=True)
class Sent:
    """A broadcast: the launch's index in the mission, its time (s), the packet's bytes (n,)."""

    index: int
    time_s: float
    data: np.ndarray


@dataclass(frozen=True)
class Reception:
    """A packet that arrived: which links told something new, and the odometry rebuilt from the last launch heard.

    number is the link number of the launch, `after` that of the one heard before it (None for the first);
    links counts what is known of the sender's chain now. residual_m (range less its expectation), sigma_m (what
    that should be) and used speak of the range, NaN and False where it could not be used.
    """

    index: int
    sender: int
    time_s: float
    number: int
    new: tuple[int, ...]
    after: int | None
    odometry: Relation | None
    links: int
    residual_m: float
    sigma_m: float
    used: bool


@dataclass(frozen=True)
class OwnPose:
    """An own pose of the graph: when, its unknowns, and whether fixes were taken since the one before."""

    time_s: float
    idx: np.ndarray
    fixed: bool


@dataclass
class Diary:
    """The entries of one node, in order of time."""

    sent: list[Sent] = field(default_factory=list)
    heard: list[Reception] = field(default_factory=list)
    own: list[OwnPose] = field(default_factory=list)

    def note(
        self,
        arrival: Arrival,
        number: int,
        told: dict[int, int],
        chain: ReceivedChain | None,
        seen: tuple[float, float, bool] | None = None,
    ) -> None:
        """Enter a reception: what was `told` of links before it, the sender's chain after it (None for a node that
        stays where it is), and what the range update saw (residual, its variance, used)."""
        after = self.last_heard(arrival.sender)
        residual, variance, used = seen if seen is not None else (np.nan, np.nan, False)
        self.heard.append(
            Reception(
                arrival.index,
                arrival.sender,
                arrival.time_s,
                number,
                (number,) if chain is None else news(told, chain),
                after,
                None if chain is None else rebuilt(chain, after, number),
                0 if chain is None else len(chain.links),
                float(residual),
                float(np.sqrt(variance)),
                bool(used),
            )
        )

    def last_heard(self, sender: int) -> int | None:
        """The launch of a sender heard last."""
        return next((h.number for h in reversed(self.heard) if h.sender == sender), None)


def told_by(chain: ReceivedChain | None) -> dict[int, int]:
    """By which packet each link of a chain was told last."""
    return {} if chain is None else {n: link.told for n, link in chain.links.items()}


def news(before: dict[int, int], chain: ReceivedChain) -> tuple[int, ...]:
    """Numbers of links that were not known, or whose prior was told later, than in {number: told} before."""
    return tuple(sorted(n for n, link in chain.links.items() if before.get(n, -2) != link.told))


def rebuilt(chain: ReceivedChain, after: int | None, number: int) -> Relation | None:
    """The odometry decomposed between two received launches, where they are of one stretch."""
    if after is None or after == number or after not in chain.links or not chain.tied(after, number):
        return None
    return chain.relation(after, number)
