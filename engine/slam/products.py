"""Draws from a product of kernel densities by multi-scale Gibbs sampling of labels (C19 §4.3.2, eqs. 4.105-4.109).

One kernel of each factor is chosen in turn given the others', at first among coarse groups of kernels and then among
ever finer ones, so that chains do not stay with the mode they began in (Ihler, Sudderth, Freeman and Willsky, 2003).
The thesis prints (4.106) with covariances where information adds, L^-1 = sum L_k^-1, and (4.105) divides by the
product's density at its own mean.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from engine.slam.densities import Kde

#: Gibbs sweeps over all factors at each scale, and at the finest.
SWEEPS, LAST_SWEEPS = 2, 12


def product(factors: Sequence[Kde], count: int, rng: np.random.Generator) -> np.ndarray:
    """Draws (count, d) from the normalized product of two or more densities on the same coordinates."""
    if len(factors) == 1:
        return factors[0].sample(count, rng)
    scales = [_scales(f) for f in factors]
    depth = max(len(s) for s in scales)
    labels = np.zeros((len(factors), count), dtype=int)
    for level in range(depth):
        layer = [s[min(level, len(s) - 1)] for s in scales]
        for k, (s, groups) in enumerate(zip(scales, layer, strict=True)):
            if 0 < level < len(s):
                labels[k] = _descend(groups.parents, labels[k], rng)
        for _ in range(SWEEPS if level < depth - 1 else LAST_SWEEPS):
            for k, groups in enumerate(layer):
                P, h = _information(layer, labels, [j for j in range(len(layer)) if j != k])
                labels[k] = _choose(groups, P, h, rng)
    last = [s[-1] for s in scales]
    P, h = _information(last, labels, range(len(last)))
    return h / P + rng.standard_normal(h.shape) / np.sqrt(P)


class _Groups:
    """Kernels of one scale: mean (M, d), var (M, d), weight (M,), and each one's group in the scale above (M,)."""

    def __init__(self, mean: np.ndarray, var: np.ndarray, weight: np.ndarray, parents: np.ndarray) -> None:
        self.mean, self.var, self.weight, self.parents = mean, var, weight, parents


def _scales(kde: Kde) -> list[_Groups]:
    """The kernels grouped by halving along their widest side, from one group to single kernels."""
    groups = [np.arange(len(kde.points))]
    parents = np.zeros(1, dtype=int)
    scales = []
    while True:
        mean = np.stack([kde.points[g].mean(0) for g in groups])
        var = np.stack([kde.points[g].var(0) for g in groups]) + np.square(kde.bandwidth)
        weight = np.array([len(g) for g in groups]) / len(kde.points)
        scales.append(_Groups(mean, var, weight, parents))
        if all(len(g) == 1 for g in groups):
            return scales
        halves, above = [], []
        for number, g in enumerate(groups):
            if len(g) == 1:
                halves.append(g)
                above.append(number)
                continue
            side = np.argmax(np.ptp(kde.points[g], axis=0))
            ranked = g[np.argsort(kde.points[g, side], kind="stable")]
            halves += [ranked[: len(g) // 2], ranked[len(g) // 2 :]]
            above += [number, number]
        groups, parents = halves, np.array(above)


def _descend(parents: np.ndarray, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A child of each label, at random; children of a group stand together."""
    first = np.searchsorted(parents, labels, side="left")
    beyond = np.searchsorted(parents, labels, side="right")
    return first + (rng.random(len(labels)) * (beyond - first)).astype(int)


def _information(layer: list[_Groups], labels: np.ndarray, some: Iterable[int]) -> tuple[np.ndarray, np.ndarray]:
    """Precision and information vector (count, d) of the product of some factors' chosen kernels (4.106-4.107)."""
    pairs = [(layer[j].mean[labels[j]], layer[j].var[labels[j]]) for j in some]
    return np.sum([1.0 / var for _, var in pairs], axis=0), np.sum([mean / var for mean, var in pairs], axis=0)


def _choose(groups: _Groups, P: np.ndarray, h: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A label for each draw: weight times the overlap with the other factors' product (eq. 4.105)."""
    var = groups.var + 1.0 / P[:, None]
    away = np.square(groups.mean - (h / P)[:, None])
    log = np.log(groups.weight) - 0.5 * (away / var + np.log(var)).sum(-1)
    cumulative = np.cumsum(np.exp(log - log.max(-1, keepdims=True)), axis=-1)
    aim = rng.random(len(log)) * cumulative[:, -1]
    return np.minimum((cumulative < aim[:, None]).sum(-1), len(groups.weight) - 1)
