"""What SLAM tells of its first trial, for people to look into: beliefs, beams, records and the tree as they grew.

All in JSON's own types and of bounded size: `moments` in order of time, each {time_s, pose, beacons {name: {points_m,
bandwidth_m, mean_m, mode_m}}, divergence {name: nats}, errors {poses_m, beacons {name: {mean_m, mode_m}}} where the
truth is known, factors [[first pose, last pose, beacon, or null of a fix]] that were added, tree {parents, cliques,
reused} or null, array {places_m, look_rad, beam, ranges_m, records} or null}.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from typing import Any

import numpy as np

from engine.acoustics.beamformer import azimuths
from engine.acoustics.synthetic_array import SyntheticArray
from engine.slam.bayes_tree import BayesTree
from engine.slam.densities import fit, from_gaussian
from engine.slam.factors.factor import Factor

#: Kernels told of a belief, looks of a beam, columns of a record, cliques of a tree that is told.
POINTS, LOOKS, COLUMNS, CLIQUES = 150, 120, 160, 1500


def told_beliefs(beacons: dict[str, np.ndarray], seed: int) -> dict[str, Any]:
    """Kernels (N, 2), bandwidths and densest place of each beacon; how far it is from a Gaussian (C19 eq. 5.3)."""
    told, apart = {}, {}
    for name, points in beacons.items():
        kde = fit(points)
        kept = points[np.linspace(0, len(points) - 1, min(len(points), POINTS)).round().astype(int)]
        told[name] = {
            "points_m": _rounded(kept, 2),
            "bandwidth_m": _rounded(kde.bandwidth, 4),
            "mean_m": _rounded(points.mean(0), 2),
            "mode_m": _rounded(kde.mode, 2),
        }
        apart[name] = round(from_gaussian(kde, np.random.default_rng(seed)), 3)
    return {"beacons": told, "divergence": apart}


def told_errors(
    track: np.ndarray,
    true_track: np.ndarray | None,
    beacons: Mapping[str, Mapping[str, Any]],
    truth: Mapping[str, np.ndarray],
    pose: int,
) -> dict[str, Any]:
    """How far the poses (K, 2) are off on average (C19's e_p), and each beacon's mean and densest place (e_b), m.

    beacons as told_beliefs tells of them at a pose of this number; truth {name: (P, 2)}. None where it has no number.
    """

    def off(place: Any, true: np.ndarray) -> float | None:
        away = float(np.linalg.norm(np.asarray(place) - true, axis=-1).mean())
        return round(away, 3) if np.isfinite(away) else None

    return {
        "poses_m": None if true_track is None else off(track, true_track[: len(track)]),
        "beacons": {
            name: {key: off(told[key], truth[name][pose]) for key in ("mean_m", "mode_m")}
            for name, told in beacons.items()
            if name in truth
        },
    }


def told_factors(factors: Iterable[Factor], pose_of: Mapping[str, int], beacons: Container[str]) -> list[list[Any]]:
    """The poses [first, last] that each fix and each measurement is about, and the beacon it ties them to, if any."""
    told = []
    for factor in factors:
        poses = [pose_of[v] for v in factor.variables if v in pose_of]
        beacon = next((v for v in factor.variables if v in beacons), None)
        if poses and (beacon is not None or len(factor.variables) == 1):
            told.append([min(poses), max(poses), beacon])
    return told


def told_tree(tree: BayesTree, reused: frozenset[int]) -> dict[str, Any] | None:
    """Each clique's parent (-1 for a root), its variables as "frontals | separator", and whether it was not done again.

    The separator is what its message to the parent is about. None for a very large tree.
    """
    if len(tree.cliques) > CLIQUES:
        return None
    return {
        "parents": [-1 if c.parent is None else c.parent for c in tree.cliques],
        "cliques": [f"{' '.join(c.frontals)} | {' '.join(c.separator)}".rstrip(" |") for c in tree.cliques],
        "reused": [int(i in reused) for i in range(len(tree.cliques))],
    }


def told_array(array: SyntheticArray, places_m: np.ndarray) -> dict[str, Any]:
    """Beam of an array whose elements are at (m, 2), and its records' filter output, the loudest of each 1."""
    look = azimuths(LOOKS)
    beam = array.power(places_m[None], look)[0]
    loud = np.abs(array.envelope)
    edges = np.linspace(0, loud.shape[1], COLUMNS + 1).astype(int)[:-1]
    columns = np.maximum.reduceat(loud, edges, axis=1)
    return {
        "places_m": _rounded(places_m, 2),
        "look_rad": _rounded(look, 4),
        "beam": _rounded(beam / beam.max(), 3),
        "ranges_m": [round(float(array.ranges_m[0]), 2), round(float(array.ranges_m[-1]), 2)],
        "records": _rounded(columns / columns.max(axis=1, keepdims=True), 2),
    }


def _rounded(x: np.ndarray, digits: int) -> list[Any]:
    return np.round(np.asarray(x, dtype=float), digits).tolist()
