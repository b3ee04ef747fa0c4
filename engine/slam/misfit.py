"""Residuals of a solved graph against what its model expects of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from engine.slam.factors.heard import Heard
from engine.slam.graph import Graph
from engine.slam.variables import LABEL


@dataclass(frozen=True)
class Misfit:
    """What speaks against a model.

    squares is the sum of squared residuals that should about equal freedom, the degrees of freedom; refused of ranges
    were taken to be wrong altogether, which each is with the chance doubt.
    """

    squares: float
    freedom: int
    refused: int
    ranges: int
    doubt: float


def misfit(graph: Graph, at: Mapping[str, np.ndarray], kernels: int) -> Misfit:
    """How badly a graph's measurements fit values {variable: (1 or N, d)}, by the median over kernels."""
    squares, rows, refused = np.zeros(kernels), np.zeros(kernels), np.zeros(kernels)
    doubts = []
    for f in graph.factors:
        e, J = f.linearize(*(at[v] for v in f.variables))
        felt = np.any(np.stack(np.broadcast_arrays(*(np.abs(Jv).max(-1) > 0 for Jv in J))), axis=0)
        squares += np.where(felt, np.square(e), 0.0).sum(-1)
        rows += np.broadcast_to(felt, e.shape).sum(-1)
        if isinstance(f, Heard):
            refused += f.refused(*(at[v] for v in f.variables))
            doubts.append(f.doubt)
    free = sum(k.dim for k in graph.kinds.values() if k is not LABEL)
    return Misfit(
        squares=float(np.median(squares)),
        freedom=round(float(np.median(rows))) - free,
        refused=round(float(np.median(refused))),
        ranges=len(doubts),
        doubt=float(np.mean(doubts)) if doubts else 0.0,
    )
