"""The layer of a pane that shows localization by sound: densities of beacons, the arrays' beams, the drifted track."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from server.scenes import palette
from server.scenes.ensemble import contours
from server.scenes.geometry import Chart, dashes, segments

#: Shares of a belief inside its lines (C19 Figs. 5-10 to 5-17), and how faint each is drawn.
SHARES, FAINT = (0.8, 0.6, 0.4, 0.2), (0.36, 0.24, 0.12, 0.0)
#: Length of a beam's main lobe, as a share of the scene's extent.
BEAM = 0.16
#: Beams of arrays before the newest are drawn this faint.
PAST = 0.7
#: The drifted track is drawn this faint.
DRIFT = 0.35


@dataclass(frozen=True)
class Sound:
    """Moments at time_s (K,), each with what was told of it; the track (P, 2) m by odometry, and its times (P,)."""

    time_s: np.ndarray
    moments: list[dict[str, Any]]
    drift_s: np.ndarray
    drifted: np.ndarray

    def last(self, moment_s: float) -> int:
        """The number of the last moment until then, -1 before the first."""
        return int(np.searchsorted(self.time_s, moment_s + 1e-9, side="right")) - 1

    def modes(self, moment_s: float) -> dict[str, np.ndarray]:
        """The densest place (2,) m of each beacon."""
        last = self.last(moment_s)
        told = self.moments[last]["beacons"] if last >= 0 else {}
        return {name: np.array(belief["mode_m"], float) for name, belief in told.items()}

    def clouds(self) -> list[np.ndarray]:
        """Places (N, 2) m that were believed in, of each moment and beacon, and the drifted track."""
        told = [belief["points_m"] for moment in self.moments for belief in moment["beacons"].values()]
        return [cloud for cloud in (self.drifted, *(np.array(points, float) for points in told)) if len(cloud)]


@dataclass(frozen=True)
class Drawing:
    """Lines, each (M, 2, 3), with their colours: of densities, of beams, and of the drifted track."""

    levels: list[np.ndarray]
    level_colours: list[palette.Rgb]
    beams: list[np.ndarray]
    beam_colours: list[palette.Rgb]
    drifts: list[np.ndarray]
    drift_colours: list[palette.Rgb]


def read(told: Mapping[str, Any]) -> Sound:
    """The growth of beliefs that an algorithm tells of its first trial."""
    drift = told.get("drifted", {"time_s": [], "points_m": []})  # runs kept before there was one
    return Sound(
        np.array([m["time_s"] for m in told["moments"]], float),
        list(told["moments"]),
        np.array(drift["time_s"], float),
        np.array(drift["points_m"], float).reshape(-1, 2),
    )


def drawing(
    sound: Sound,
    moment_s: float,
    chart: Chart,
    look: palette.Look,
    names: list[str],
    depths: Mapping[str, float],
    extent_m: float,
) -> Drawing:
    """Beliefs as of the last moment told, the beams of all arrays until then, the newest strongest; the drift, dashed.

    The drifted track is what odometry tells from fix to fix, which SLAM corrects (C19 Figs. 5-10 to 5-17).
    """
    drawn = Drawing([], [], [], [], [], [])
    drift = chart.place(sound.drifted[sound.drift_s <= moment_s + 1e-9])
    if len(drift) > 1:
        drawn.drifts.append(dashes(drift))
        drawn.drift_colours.append(look.faded(look.truth, DRIFT))
    last = sound.last(moment_s)
    if last < 0:
        return drawn
    for name, belief in sound.moments[last]["beacons"].items():
        colour = palette.vehicle(names.index(name)) if name in names else look.truth
        points = np.array(belief["points_m"], float)
        lines = contours(points, SHARES, np.array(belief["bandwidth_m"], float))
        for line, faint in zip(lines, FAINT):
            drawn.levels.append(chart.place(line, depths.get(name, 0.0)))
            drawn.level_colours.append(look.faded(colour, faint))
    for k, moment in enumerate(sound.moments[: last + 1]):
        array = moment["array"]
        if array is None:
            continue
        centre = np.mean(np.array(array["places_m"], float), axis=0)
        look_rad = np.array(array["look_rad"], float)
        reach = BEAM * extent_m * np.array(array["beam"], float)
        rim = centre + reach[:, None] * np.stack([np.cos(look_rad), np.sin(look_rad)], axis=-1)
        drawn.beams.append(segments(chart.place(np.concatenate([rim, rim[:1]]))))
        drawn.beam_colours.append(look.faded(look.truth, 0.0 if k == last else PAST))
        drawn.beams.append(segments(chart.place(np.array(array["places_m"], float))))
        drawn.beam_colours.append(look.truth if k == last else look.faded(look.truth, PAST / 2))
    return drawn
