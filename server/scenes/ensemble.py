"""All trials of one algorithm at once: a cloud of points, the envelope of most of them, lines of equal density."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from server.view import thinned

#: Trials that are drawn, and moments at which they are kept.
TRIALS, MOMENTS = 300, 400
#: Share of the trials inside the envelope, and inside each line of equal density.
WITHIN, DENSITIES = 0.9, (0.9, 0.5)
#: Cells, least and most, of the grid on which densities are computed, and its reach beyond the points (kernel widths).
CELLS, MOST_CELLS, MARGIN = 44, 160, 3.0


@dataclass(frozen=True)
class Ensemble:
    """Where the trials' estimates would be around the truth drawn: time_s (K,), points {S: (trials, K, 2)} m."""

    time_s: np.ndarray
    points: dict[str, np.ndarray]

    def at(self, subject: str, moment_s: float) -> np.ndarray:
        """The trials' points (N, 2) m of a subject at the last moment kept; empty before there is one."""
        found = self.points.get(subject)
        k = int(np.searchsorted(self.time_s, moment_s + 1e-9, side="right")) - 1
        if found is None or k < 0:
            return np.zeros((0, 2))
        here = found[:, k]
        return here[np.isfinite(here).all(axis=1)]


def read(path: Path, algorithms: list[str], shown: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> dict[str, Ensemble]:
    """Ensembles of a finished job from its arrays.npz.

    shown {S: (time_s, xy)} is the truth that is drawn: where trials have truths of their own, it is the errors about
    it that make the cloud.
    """
    with np.load(path, allow_pickle=False) as arrays:
        time_s = arrays["time_s"]
        keep = thinned(len(time_s), MOMENTS)
        found = {}
        for name in algorithms:
            points = {}
            for key in arrays.files:
                if key.startswith(f"{name}/") and key.endswith("/mean"):
                    subject = key[len(name) + 1 : -len("/mean")]
                    points[subject] = _about(arrays[key][:TRIALS][:, keep], arrays, subject, time_s[keep], keep, shown)
            found[name] = Ensemble(time_s[keep], points)
    return found


def _about(mean: np.ndarray, arrays, subject: str, time_s: np.ndarray, keep: np.ndarray, shown) -> np.ndarray:
    key = f"truth/{subject}"
    if key not in arrays.files or subject not in shown:
        return mean
    truth = arrays[key][:TRIALS][:, keep]
    times, drawn = shown[subject]
    if len(times) == 0:
        return mean
    here = np.stack([np.interp(time_s, times, drawn[:, i]) for i in range(2)], axis=-1)
    return mean - truth + here


def envelope(points: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Mean (2,) m and covariance (3,) as xx xy yy of the ellipse (one sigma) that holds WITHIN of points (N, 2).

    The ellipse has the shape of the sample covariance and the size of the percentile of its Mahalanobis distances.
    None for fewer than three points.
    """
    if len(points) < 3:
        return None
    mean = points.mean(axis=0)
    away = points - mean
    cov = away.T @ away / (len(points) - 1)
    if np.linalg.det(cov) <= 1e-12 * max(np.trace(cov) ** 2, 1e-300):
        return None
    distance = np.einsum("ni,ij,nj->n", away, np.linalg.inv(cov), away)
    cov = cov * np.quantile(distance, WITHIN)
    return mean, np.array([cov[0, 0], cov[0, 1], cov[1, 1]])


def contours(
    points: np.ndarray, shares: tuple[float, ...] = DENSITIES, width: np.ndarray | None = None
) -> list[np.ndarray]:
    """Lines of equal density, each (M, 2, 2) m, that hold such shares of a kernel density estimate of points (N, 2).

    A Gaussian kernel of the width (2,) given, else Scott's, on a grid; the level of a share p is the density that p of
    the points exceed (Hyndman 1996).
    """
    if len(points) < 5:
        return []
    kernel = scotts(points) if width is None else width
    # A cell no wider than a kernel shows every mode; a ring of thin kernels takes more cells than a blot.
    extent = np.ptp(points, axis=0) + 2 * MARGIN * kernel
    cells = np.clip((1.5 * extent / kernel).astype(int), CELLS, MOST_CELLS)
    axes = [
        np.linspace(points[:, i].min() - MARGIN * kernel[i], points[:, i].max() + MARGIN * kernel[i], cells[i])
        for i in range(2)
    ]

    def kernels(at: np.ndarray, i: int) -> np.ndarray:
        return np.exp(-0.5 * ((at[:, None] - points[None, :, i]) / kernel[i]) ** 2)

    density = kernels(axes[0], 0) @ kernels(axes[1], 1).T
    own = np.mean(kernels(points[:, 0], 0) * kernels(points[:, 1], 1), axis=1) * len(points)
    return [level_line(axes[0], axes[1], density, float(np.quantile(own, 1 - share))) for share in shares]


def scotts(points: np.ndarray) -> np.ndarray:
    """Scott's widths (2,) m of a kernel density estimate of points (N, 2) m."""
    spread = np.maximum(points.std(axis=0, ddof=1), 1e-6 * max(float(np.ptp(points)), 1e-6))
    return spread * len(points) ** (-1 / 6)


def level_line(x: np.ndarray, y: np.ndarray, z: np.ndarray, level: float) -> np.ndarray:
    """Segments (M, 2, 2) of the line z = level on a grid, z (len(x), len(y)), by marching triangles."""
    i, j = np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij")
    i, j = i.ravel(), j.ravel()
    corner = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
    segments = []
    for a, b, c in ((0, 1, 2), (0, 2, 3)):
        at = np.stack([np.stack([x[corner[k][0]], y[corner[k][1]]], axis=-1) for k in (a, b, c)], axis=1)
        over = np.stack([z[corner[k]] for k in (a, b, c)], axis=1) - level
        above = over > 0
        mixed = above.any(axis=1) & ~above.all(axis=1)
        at, over, above = at[mixed], over[mixed], above[mixed]
        # The corner that is on its own side; the line crosses the two edges from it.
        lone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
        rows = np.arange(len(lone))
        ends = []
        for other in ((lone + 1) % 3, (lone + 2) % 3):
            share = over[rows, lone] / (over[rows, lone] - over[rows, other])
            ends.append(at[rows, lone] + share[:, None] * (at[rows, other] - at[rows, lone]))
        segments.append(np.stack(ends, axis=1))
    return np.concatenate(segments)
