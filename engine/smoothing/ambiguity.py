"""Several starts where ranges alone could mean two places, and a word when they do.

Ranges from a nearly straight track fit a node on either side of it. A node whose position is hardly known before is
therefore tried where its ranges put it and at that place's mirror image in the track; the likelier end wins, and where
the other is nearly as likely, that is said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.smoothing.band import NotPositiveDefinite
from engine.smoothing.graph import Graph
from engine.smoothing.smoother import Solution, smooth

#: A prior wider than this (m) does not tell the sides of a track apart.
WIDE_M = 20.0
#: Solutions whose log-likelihoods differ by less than this are both possible (about 5 % of the likelihood each way).
DECISIVE = 3.0
#: Two solutions closer than this (m) everywhere are the same.
SAME_M = 1.0


@dataclass(frozen=True)
class Judged:
    """The likeliest of several solutions, and the largest distance (m) of another that is nearly as likely, or None."""

    solution: Solution
    rival_m: float | None


def locate(receivers: np.ndarray, ranges: np.ndarray) -> np.ndarray | None:
    """Where ranges (F,) from positions (F, 2) put a node: (2,), by linear least squares, None from too few."""
    if len(ranges) < 3:
        return None
    centre = receivers.mean(axis=0)
    at = receivers - centre
    # |p - a|^2 = r^2 is linear in p and |p|^2.
    A = np.concatenate([-2 * at, np.ones((len(at), 1))], axis=1)
    found = np.linalg.lstsq(A, ranges**2 - (at**2).sum(axis=1), rcond=1e-6)[0]
    _, _, axes = np.linalg.svd(at, full_matrices=False)
    along, across = axes[0], np.array([-axes[0][1], axes[0][0]])
    # Across a straight track the linear answer is worth little: the mean square range says how far off it lies.
    x = found[:2] @ along
    off = np.mean(ranges**2 - (at @ along - x) ** 2)
    y = np.sqrt(max(off, 0.0)) * (1.0 if found[:2] @ across >= 0 else -1.0)
    return centre + along * x + across * y


def mirrored(receivers: np.ndarray, position: np.ndarray) -> np.ndarray:
    """A position's mirror image (2,) in the line that fits positions (F, 2) best."""
    centre = receivers.mean(axis=0)
    _, _, axes = np.linalg.svd(receivers - centre, full_matrices=False)
    along = axes[0]
    d = position - centre
    return centre + 2 * (d @ along) * along - d


def starts(graph: Graph, nodes: list[np.ndarray], x: np.ndarray) -> list[np.ndarray]:
    """x, and x with each of some nodes (unknowns (2,)) where its ranges put it, and mirrored."""
    found = [x]
    for node in nodes:
        parts = [
            (x[r.receiver[mine]], r.value[mine])
            for r in graph.ranges
            for mine in [(r.sender == node).all(axis=1)]
            if mine.any()
        ]
        if not parts:
            continue
        receivers, ranges = (np.concatenate(p) for p in zip(*parts))
        place = locate(receivers, ranges)
        if place is None:
            continue
        for candidate in (place, mirrored(receivers, place)):
            start = x.copy()
            start[node] = candidate
            found.append(start)
    return found


def likeliest(graph: Graph, tried: list[np.ndarray], **settings) -> Judged:
    """Smooth from every start and keep the likeliest end (settings as of `smooth`)."""
    solutions = []
    for start in tried:
        try:
            solutions.append(smooth(graph, start, **settings))
        except NotPositiveDefinite:
            if len(tried) == 1:
                raise
    if not solutions:
        raise NotPositiveDefinite("no start led to a solution")
    solutions.sort(key=_badness)
    best = solutions[0]
    rivals = [
        float(np.abs(s.x - best.x).max())
        for s in solutions[1:]
        if _badness(s) - _badness(best) < DECISIVE and np.abs(s.x - best.x).max() > SAME_M
    ]
    return Judged(best, max(rivals, default=None))


#: What refusing a range costs, in units of log-likelihood: as much as one at four and a half sigma.
_REFUSAL = 10.0


def _badness(solution: Solution) -> float:
    """Negative log-likelihood with refused ranges charged, so that refusing them all does not pay."""
    return solution.cost + _REFUSAL * sum(float((w == 0).sum()) for w in solution.weights)
