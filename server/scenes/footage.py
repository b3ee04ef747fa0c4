"""What panes draw from: a job's mission, and its estimates as far as they have come."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from server.scenes.graph import Graph
from server.scenes.pursuit import Pursuit
from server.scenes.sound import Sound


@dataclass(frozen=True)
class Track:
    """One algorithm's estimates of trial 0: time_s (n,), mean {S: (n, 2)} m, cov {S: (n, 3)} m^2 (xx xy yy).

    It stays as it is, for panes are drawn in other threads while estimates arrive; `grown` is another.
    """

    time_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    mean: dict[str, np.ndarray] = field(default_factory=dict)
    cov: dict[str, np.ndarray] = field(default_factory=dict)

    def grown(self, news: dict[str, Any]) -> Track:
        """The track with an `estimates` event appended."""

        def appended(mine: dict[str, np.ndarray], theirs: dict[str, Any], width: int) -> dict[str, np.ndarray]:
            before = {subject: mine.get(subject, np.zeros((0, width))) for subject in theirs}
            return mine | {s: np.concatenate([before[s], numbers(rows, width)]) for s, rows in theirs.items()}

        time_s = np.concatenate([self.time_s, numbers(news["time_s"], 0)])
        return Track(time_s, appended(self.mean, news["mean"], 2), appended(self.cov, news["cov"], 3))


#: A belief this near a true track is always shown, m.
LEAST_REACH_M = 100.0


@dataclass(frozen=True)
class Packet:
    """A broadcast on its way from one subject to another, both by number."""

    sender: int
    receiver: int
    tol_s: float
    toa_s: float
    heard: bool


@dataclass(frozen=True)
class Footage:
    """A job's mission: report times, subjects, truth {S: (T, 2)} m of trial 0, packets by time of launch; and, of the
    algorithms that keep them, factor graphs {algorithm: {subject: graph}}, pursuits and sounds {algorithm: ...}."""

    time_s: np.ndarray
    subjects: list[dict[str, Any]]
    truth: dict[str, np.ndarray]
    packets: list[Packet]
    tracks: dict[str, Track]
    graphs: dict[str, dict[str, Graph]] = field(default_factory=dict)
    pursuits: dict[str, Pursuit] = field(default_factory=dict)
    sounds: dict[str, Sound] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        return [s["name"] for s in self.subjects]

    @property
    def latest_s(self) -> float:
        """The time that the furthest estimate has reached."""
        return max((float(t.time_s[-1]) for t in self.tracks.values() if len(t.time_s)), default=0.0)

    def points(self) -> np.ndarray:
        """Positions (N, 2) m, for the extent.

        What is believed farther from the true tracks than those are wide is left out: one wild estimate would leave
        all others no room.
        """
        true = np.concatenate([np.zeros((0, 2)), *self.truth.values()])
        known = true[np.isfinite(true).all(axis=-1)]
        believed = [m for t in self.tracks.values() for m in t.mean.values()]
        clouds = [cloud for sound in self.sounds.values() for cloud in sound.clouds()]
        if len(known):
            low, high = known.min(axis=0), known.max(axis=0)
            reach = max(float((high - low).max()), LEAST_REACH_M)
            believed = [m[((m >= low - reach) & (m <= high + reach)).all(axis=-1)] for m in believed]
            middles = [np.median(cloud, axis=0) for cloud in clouds]
            near = [bool(((m >= low - reach) & (m <= high + reach)).all()) for m in middles]
            clouds = [cloud for cloud, stays in zip(clouds, near, strict=True) if stays]
        return np.concatenate([known, *believed, *clouds])


def footage(view: dict[str, Any], algorithms: list[str]) -> Footage:
    """The footage of a view, or of an outline, which has no estimates yet."""
    names = [s["name"] for s in view["subjects"]]
    number = {name: n for n, name in enumerate(names)}
    time_s = numbers(view["time_s"], 0)
    tracks = {}
    for name in algorithms:
        subjects = view.get("algorithms", {}).get(name, {"subjects": {}})["subjects"]
        told = {subject: found for subject, found in subjects.items() if found["mean"]}
        mean = {subject: numbers(found["mean"], 2) for subject, found in told.items()}
        cov = {subject: numbers(found["cov"], 3) for subject, found in told.items()}
        tracks[name] = Track(time_s, mean, cov) if told else Track()
    packets = [
        Packet(number[e["from"]], number[e["to"]], e["tol_s"], e["toa_s"], e["heard"])
        for e in view["events"]
        if e["kind"] == "packet" and e["from"] in number and e["to"] in number
    ]
    truth = {s: numbers(p, 2) for s, p in view["truth"].items()}
    return Footage(time_s, view["subjects"], truth, sorted(packets, key=lambda p: p.tol_s), tracks)


def numbers(rows: Any, width: int) -> np.ndarray:
    """Rows of JSON as floats (n, width), (n,) for width 0; null is NaN."""
    array = np.array(rows, dtype=float)
    return array.reshape(-1, width) if width else array.reshape(-1)


def at(time_s: np.ndarray, rows: np.ndarray, moment_s: float) -> np.ndarray:
    """Rows (n, k) at times (n,) interpolated at a moment, held before the first and after the last."""
    if not len(time_s):
        return np.full(rows.shape[1], np.nan)
    n = int(np.searchsorted(time_s, moment_s, side="right"))
    if n == 0 or n == len(time_s):
        return rows[max(n - 1, 0)]
    share = (moment_s - time_s[n - 1]) / (time_s[n] - time_s[n - 1])
    if not np.isfinite(rows[n]).all():
        return rows[n - 1]
    return rows[n - 1] + share * (rows[n] - rows[n - 1])
