"""Estimated tracks with the ellipses along them: placed in the scene once, cut off at the moment that is shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from server.scenes.footage import Track
from server.scenes.geometry import Chart, ellipses, essential, segments
from server.view import thinned

#: A line is drawn through what it needs of so many reports.
REPORTS = 600
#: Ellipses narrower than this (scene units) are not worth their lines, and narrower than that have half the corners.
SMALLEST, SMALL = 0.02, 0.6


@dataclass(frozen=True)
class Trail:
    """Scene positions points (K, 3) of reports at time_s (K,), and segments (M, 2, 3) of ellipses at ring_s (M,)."""

    time_s: np.ndarray
    points: np.ndarray
    ring_s: np.ndarray
    rings: np.ndarray

    def until(self, moment_s: float, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Segments (M, 2, 3) of the line up to the place (3,) at a moment, and those of the ellipses passed."""
        past = int(np.searchsorted(self.time_s, moment_s, side="right"))
        line = np.concatenate([self.points[:past], place[None]])
        passed = int(np.searchsorted(self.ring_s, moment_s, side="right"))
        return segments(line), self.rings[:passed]


def trail(
    chart: Chart, track: Track, subject: str, depth_m: float, radius: float, *, reports: int, most: tuple[int, int]
) -> Trail:
    """The trail of a subject of a track that will have so many reports; at most so many points, and rings, of all."""
    mean, cov, known = track.mean[subject], track.cov[subject], len(track.time_s)
    shown, ringed = (kept[kept < known] for kept in (thinned(reports, count) for count in (REPORTS, most[1])))
    ringed = ringed[np.isfinite(mean[ringed]).all(axis=-1) & np.isfinite(cov[ringed]).all(axis=-1)]
    rings = ellipses(chart, mean[ringed], cov[ringed], depth_m, radius)
    wide = np.ptp(rings[..., 0, :2], axis=1).max(axis=-1, initial=0.0) if len(rings) else np.zeros(0)
    lines = [ring if w > SMALL else _coarse(ring) for ring, w in zip(rings, wide) if w > SMALLEST]
    placed = chart.place(mean[shown], depth_m)
    needed = essential(placed, most[0])
    return Trail(
        track.time_s[shown][needed],
        placed[needed],
        np.repeat(track.time_s[ringed[wide > SMALLEST]], [len(line) for line in lines]),
        np.concatenate([np.zeros((0, 2, 3)), *lines]),
    )


def _coarse(ring: np.ndarray) -> np.ndarray:
    """A ring (CORNERS, 2, 3) with every second corner."""
    corners = ring[::2, 0]
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
