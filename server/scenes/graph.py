"""The layer of a pane that shows the factor graph an estimator kept: poses, odometry, priors, ranges.

Poses received are solid, those that were lost hollow; a composed link that spans lost launches is an arc; a prior is a
square about its pose. Positions are those of the graph at the end, drawn as far as the moment shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from server.scenes import palette
from server.scenes.geometry import Chart, ellipses

#: Sizes of marks (scene units), steps of an arc and its height as a share of its span.
DOT, RING, SQUARE = 0.13, 0.07, 0.11
ARC_STEPS, ARC_HEIGHT = 12, 0.35
#: How far ranges and marginals go into the water's colour.
FAINT = 0.55
_RING = np.linspace(0.0, 2 * np.pi, 9)
_SQUARE = np.pi / 4 + np.linspace(0.0, 2 * np.pi, 5)


@dataclass(frozen=True)
class Graph:
    """One graph: of N poses time_s (N,), owner (N,) by subject number, xy (N, 2) m, cov (N, 3) m^2 or NaN, prior and
    kind (N,); odometry (E, 3) from, to, launches left out; ranges (R, 3) receiver, sender, used."""

    time_s: np.ndarray
    owner: np.ndarray
    xy: np.ndarray
    cov: np.ndarray
    prior: np.ndarray
    kind: np.ndarray
    odometry: np.ndarray
    ranges: np.ndarray


@dataclass(frozen=True)
class Drawing:
    """What there is to draw: dots (P, 3) with their colours (P, 3), and lines, each (M, 2, 3), with theirs."""

    dots: np.ndarray
    dot_colours: np.ndarray
    lines: list[np.ndarray]
    colours: list[palette.Rgb]
    ranges: list[np.ndarray]
    range_colours: list[palette.Rgb]


def read(told: Mapping[str, Any], names: list[str]) -> dict[str, Graph]:
    """Graphs by subject ("" where one is everybody's) from what an algorithm tells of its first trial."""
    number = {name: n for n, name in enumerate(names)}
    return {whose: _graph(graph, number) for whose, graph in told.get("graphs", {}).items()}


def _graph(told: Mapping[str, Any], number: Mapping[str, int]) -> Graph:
    poses = told["poses"]
    nothing = [None] * 3
    return Graph(
        np.array(poses["time_s"], float),
        np.array([number[owner] for owner in poses["owner"]], int),
        np.array(poses["xy"], float).reshape(-1, 2),
        np.array([nothing if cov is None else cov for cov in poses["cov"]], float).reshape(-1, 3),
        np.array(poses["prior"], bool),
        np.array(poses["kind"], str),
        np.array(told["odometry"], int).reshape(-1, 3),
        np.array(told["ranges"], int).reshape(-1, 3),
    )


def drawing(
    graph: Graph, moment_s: float, chart: Chart, depth: Callable[[int], float], look: palette.Look = palette.LIGHT
) -> Drawing:
    """The part of a graph that had happened at a moment; depth(subject) in metres."""
    begun = graph.time_s <= moment_s
    depths = np.array([depth(n) for n in range(int(graph.owner.max(initial=-1)) + 1)])
    at = chart.place(graph.xy, depths[graph.owner] if len(graph.owner) else 0.0)
    lines: list[np.ndarray] = []
    colours: list[palette.Rgb] = []
    ranges: list[np.ndarray] = []
    range_colours: list[palette.Rgb] = []
    solid = begun & np.isin(graph.kind, ("own", "heard"))
    for n in np.unique(graph.owner[begun]):
        mine, colour = begun & (graph.owner == n), palette.vehicle(int(n))
        lines.append(outlines(at[mine & ~solid], _RING, RING))
        lines.append(outlines(at[mine & graph.prior], _SQUARE, SQUARE))
        tied = graph.odometry[mine[graph.odometry[:, 1]]]
        direct = tied[tied[:, 2] == 0]
        lines.append(np.stack([at[direct[:, 0]], at[direct[:, 1]]], axis=1))
        lines.append(arcs(at, tied[tied[:, 2] > 0]))
        colours += [colour] * 4
        known = mine & np.isfinite(graph.cov[:, 0])
        faint = look.faded(colour, FAINT)
        lines.append(ellipses(chart, graph.xy[known], graph.cov[known], float(depths[n])).reshape(-1, 2, 3))
        colours.append(faint)
        heard = graph.ranges[mine[graph.ranges[:, 0]] & begun[graph.ranges[:, 1]]]
        for used, shade in ((True, faint), (False, look.lost)):
            ends = heard[(heard[:, 2] == 1) == used]
            ranges.append(np.stack([at[ends[:, 0]], at[ends[:, 1]]], axis=1))
            range_colours.append(shade)
    shades = np.array([palette.vehicle(int(n)) for n in graph.owner[solid]], np.uint8).reshape(-1, 3)
    return Drawing(at[solid], shades, lines, colours, ranges, range_colours)


def outlines(centres: np.ndarray, angles: np.ndarray, radius: float) -> np.ndarray:
    """Polygons about points (N, 3), as segments (M, 2, 3)."""
    corner = radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=-1)
    line = centres[:, None] + corner
    return np.stack([line[:, :-1], line[:, 1:]], axis=2).reshape(-1, 2, 3)


def arcs(at: np.ndarray, links: np.ndarray) -> np.ndarray:
    """Arcs that rise from one pose to another, links (E, 3), as segments (M, 2, 3)."""
    share = np.linspace(0.0, 1.0, ARC_STEPS + 1)
    start, end = at[links[:, 0]][:, None], at[links[:, 1]][:, None]
    line = start + (end - start) * share[None, :, None]
    height = ARC_HEIGHT * np.linalg.norm(end - start, axis=-1)
    line[..., 2] += height * 4 * share * (1 - share)
    return np.stack([line[:, :-1], line[:, 1:]], axis=2).reshape(-1, 2, 3)
