"""From metres to the scene: scale, tracks as line segments, ellipses."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

#: A mission is drawn this wide (scene units): viser's camera, grid and labels are made for such sizes.
SPAN = 10.0
#: Depths are stretched until the deepest subject is this far down (scene units), but at most tenfold.
DEPTH_SHOWN, DEPTH_STRETCH = 0.7, 10.0
#: chi-square with 2 degrees of freedom at 95 %: Mahalanobis radius of the ellipses.
RADIUS_95 = float(np.sqrt(-2.0 * np.log(0.05)))
CORNERS = 24
#: Off by less than this (scene units) nobody sees a line to be: a pixel where a mission fills a large screen.
UNSEEN = SPAN / 1000
#: A dashed line has no more dashes and gaps than this.
DASHES = 240


@dataclass(frozen=True)
class Chart:
    """Where metres are in the scene: centre (east, north) m, scale in units per metre, stretch of depths."""

    centre: tuple[float, float]
    scale: float
    stretch: float

    def place(self, xy_m: np.ndarray, depth_m: float | np.ndarray = 0.0) -> np.ndarray:
        """Scene positions (..., 3) of points (..., 2) m at a depth."""
        flat = (np.asarray(xy_m, dtype=float) - self.centre) * self.scale
        down = np.broadcast_to(-np.asarray(depth_m, dtype=float) * self.scale * self.stretch, flat.shape[:-1])
        return np.concatenate([flat, down[..., None]], axis=-1)


def chart(points_m: np.ndarray, deepest_m: float, stretch: float = 0.0) -> Chart:
    """The chart that shows points (N, 2) m, NaN among them allowed, in a square of SPAN; stretch 0 is what suits."""
    known = points_m[np.isfinite(points_m).all(axis=-1)]
    low, high = (known.min(axis=0), known.max(axis=0)) if len(known) else (np.full(2, -500.0), np.full(2, 500.0))
    scale = SPAN / max(float((high - low).max()), 10.0)
    suits = min(max(DEPTH_SHOWN / (deepest_m * scale), 1.0), DEPTH_STRETCH) if deepest_m > 0 else 1.0
    east, north = (low + high) / 2
    return Chart((float(east), float(north)), scale, stretch or suits)


def segments(line: np.ndarray) -> np.ndarray:
    """A line through points (N, 3) as segments (M, 2, 3), left out where a point is not finite."""
    pairs = np.stack([line[:-1], line[1:]], axis=1) if len(line) > 1 else np.zeros((0, 2, 3))
    return pairs[np.isfinite(pairs.sum(axis=(1, 2)))]


def essential(line: np.ndarray, most: int) -> np.ndarray:
    """Indices of the points that a line (N, 3) needs to look as it does: none that is left out lies further than
    UNSEEN from what is drawn, unless that takes more than `most` points (Douglas and Peucker 1973, the worst first).

    Points that are not finite are kept: a line has a gap there.
    """
    gaps = np.flatnonzero(~np.isfinite(line.sum(axis=1)))
    weight = np.full(len(line), 0.0)
    weight[gaps] = np.inf
    ends = np.unique(np.concatenate([[0], gaps - 1, gaps + 1, [len(line) - 1]]).clip(0, max(len(line) - 1, 0)))
    weight[ends[: len(line)]] = np.inf
    rest = [(int(i), int(j), np.inf) for i, j in pairwise(ends) if j - i > 1]
    while rest:
        first, last, limit = rest.pop()
        inner, way = line[first + 1 : last] - line[first], line[last] - line[first]
        share = np.clip(inner @ way / max(way @ way, np.finfo(float).tiny), 0.0, 1.0)
        away = np.linalg.norm(inner - share[:, None] * way, axis=1)
        worst = int(away.argmax())
        if away[worst] <= UNSEEN:
            continue
        split = first + 1 + worst
        weight[split] = limit = min(limit, float(away[worst]))
        rest += [(i, j, limit) for i, j in ((first, split), (split, last)) if j - i > 1]
    needed = np.flatnonzero(weight > 0)
    return needed if len(needed) <= most else np.sort(np.argsort(-weight, kind="stable")[:most])


def dashes(line: np.ndarray) -> np.ndarray:
    """The segments (M, 2, 3) of a dashed line: dashes and gaps of one length, which is longer where there were many."""
    pairs = segments(line)
    length = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=-1)
    pairs, length = pairs[length > 0], length[length > 0]
    end = np.cumsum(length)
    if not len(end):
        return pairs
    dash = max(SPAN / 80, end[-1] / DASHES)
    cuts = np.unique(np.concatenate([[0.0], end, np.arange(dash, end[-1], dash)]))
    low, high = cuts[:-1], cuts[1:]
    middle = (low + high) / 2
    drawn = (middle // dash % 2 == 0) & (high - low > 1e-9)
    low, high, of = low[drawn], high[drawn], np.searchsorted(end, middle[drawn])
    start, way = pairs[of, 0], pairs[of, 1] - pairs[of, 0]
    share = (np.stack([low, high], axis=1) - (end - length)[of, None]) / length[of, None]
    return start[:, None] + share[..., None] * way[:, None]


def radius(sigma: float) -> float:
    """Mahalanobis radius of an ellipse of so many standard deviations; 95 is for the 95 % region."""
    return RADIUS_95 if sigma == 95 else float(sigma)


def ellipses(
    chart: Chart, mean_m: np.ndarray, cov_m2: np.ndarray, depth_m: float, radius: float = RADIUS_95
) -> np.ndarray:
    """Ellipses of beliefs, mean (N, 2) m and cov (N, 3) as xx xy yy, as segments (N, CORNERS, 2, 3)."""
    xx, xy, yy = cov_m2[:, 0], cov_m2[:, 1], cov_m2[:, 2]
    matrix = np.stack([np.stack([xx, xy], -1), np.stack([xy, yy], -1)], -2)
    sound = np.isfinite(matrix.sum(axis=(1, 2))) & np.isfinite(mean_m.sum(axis=1))
    value, vector = np.linalg.eigh(np.where(sound[:, None, None], matrix, 0.0))
    axes = vector * np.sqrt(np.maximum(value, 0.0))[:, None, :] * radius
    angle = np.linspace(0.0, 2 * np.pi, CORNERS + 1)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    outline = np.swapaxes(axes @ circle, 1, 2) + np.where(sound[:, None], mean_m, 0.0)[:, None, :]
    ring = chart.place(outline, depth_m)
    return np.stack([ring[:, :-1], ring[:, 1:]], axis=2)[sound]


def round_length(metres: float) -> float:
    """The next smaller of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(metres))
    return float(max(m for m in (power, 2 * power, 5 * power) if m <= metres * (1 + 1e-9)))


def scale_bar(chart: Chart) -> tuple[np.ndarray, float]:
    """A bar of a round length, in the north-west of the surface, as segments (M, 2, 3), and its length in metres."""
    length_m = round_length(SPAN / chart.scale / 4)
    west, north = -0.62 * SPAN, 0.61 * SPAN
    east, tick = west + length_m * chart.scale, 0.012 * SPAN
    ends = [((west, north), (east, north))]
    ends += [((x, north - tick), (x, north + tick)) for x in (west, (west + east) / 2, east)]
    return np.array([[(*a, 0.0), (*b, 0.0)] for a, b in ends]), length_m


def compass() -> np.ndarray:
    """An arrow to the north in the north-east of the surface, as segments (M, 2, 3), the first from tail to head."""
    x, tail, head, wing = 0.69 * SPAN, 0.5 * SPAN, 0.62 * SPAN, 0.02 * SPAN
    ends = [((x, tail), (x, head)), ((x - wing, head - 2 * wing), (x, head)), ((x + wing, head - 2 * wing), (x, head))]
    return np.array([[(*a, 0.0), (*b, 0.0)] for a, b in ends])
