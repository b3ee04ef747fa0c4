"""Names to algorithms and scenario families: ours, and what third parties add by entry point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from pydantic import BaseModel

from engine.tracks import Tracks

ENTRY_POINT_GROUP = "coopnav.algorithms"

#: Called by a running estimator with its fraction done (0..1) and, where it has them, the beliefs so far.
Progress = Callable[[float, "dict[str, Any] | None"], None]


def silent(_fraction: float, _partial: dict[str, Any] | None = None) -> None:
    """The progress callback of someone who is not watching."""


@dataclass(frozen=True)
class Algorithm:
    """One estimator as the user meets it.

    `run(mission, progress)` takes what the family's `fly` produced for a block of trials and returns its
    Tracks. `centralized` marks benchmarks that see what no vehicle could; `assumes` says in words what the
    algorithm needs of the network (topology, loss, direction); `options` is the model of what a scenario may
    choose for it under [options.NAME].
    """

    name: str
    title: str
    family: str
    summary: str
    source: str
    run: Callable[[Any, Progress], Tracks]
    centralized: bool = False
    assumes: tuple[str, ...] = ()
    options: type[BaseModel] | None = None


@dataclass(frozen=True)
class Outline:
    """What a mission looks like to someone watching its first trial, in JSON's own types.

    subjects: {"name", "kind", "depth_m"} each, and "label" where something else than the name, or nothing, is to stand
    beside it; events in order of time: {"kind": "packet", "from", "to", "tol_s", "toa_s", "heard"} and {"kind":
    "fix", "subject", "time_s"}, the latter at most one a second.
    """

    subjects: list[dict[str, Any]]
    events: list[dict[str, Any]]


@dataclass(frozen=True)
class Family:
    """A kind of mission: `fly(scenario, trials)` makes the data every algorithm of the family works on.

    What `fly` returns has `time_s` (T,) and `truth` {subject: (trials or 1, T, 2)}; the rest is the family's own.
    `outline(mission)` is for watchers. `accepts` names the families whose algorithms can run on it too.
    """

    name: str
    title: str
    fly: Callable[[Any, Sequence[int]], Any]
    outline: Callable[[Any], Outline]
    accepts: tuple[str, ...] = ()


_FAMILY_MODULES = ("engine.navigation", "engine.pursuit", "engine.slam", "engine.smoothing", "engine.tracking")


def _module_members(kind: type) -> list[Any]:
    members: list[Any] = []
    for module in map(import_module, _FAMILY_MODULES):
        members += [m for m in module.REGISTERED if isinstance(m, kind)]
    return members


@cache
def families() -> dict[str, Family]:
    """Every family by name."""
    return {f.name: f for f in _module_members(Family)}


@cache
def algorithms() -> dict[str, Algorithm]:
    """Every installed algorithm by name, ours first; a plug-in may not take a name that is in use."""
    found: dict[str, Algorithm] = {a.name: a for a in _module_members(Algorithm)}
    for point in entry_points(group=ENTRY_POINT_GROUP):
        algorithm = point.load()
        if not isinstance(algorithm, Algorithm):
            raise TypeError(f"entry point {point.name!r} of {ENTRY_POINT_GROUP} is not an engine.registry.Algorithm")
        if algorithm.name in found:
            raise ValueError(f"entry point {point.name!r}: an algorithm named {algorithm.name!r} already exists")
        found[algorithm.name] = algorithm
    return found


def algorithm(name: str) -> Algorithm:
    """The algorithm of that name; ValueError with the known names where there is none."""
    try:
        return algorithms()[name]
    except KeyError:
        raise ValueError(f"no algorithm named {name!r}; there are: {', '.join(sorted(algorithms()))}") from None
