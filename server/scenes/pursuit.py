"""The layer of a pane that shows a pursuit: formation and waypoints, messages under way, hyperbolas of what is known.

A hyperbola is where two arrivals' difference puts the target; beside it, fainter, two sigmas of that difference either
way. The formation that is wanted about the true target is dashed, the one that is kept is drawn through.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from server.scenes import palette
from server.scenes.geometry import Chart, dashes, segments
from server.scenes.graph import outlines

#: Half the size of a waypoint's mark (scene units).
SQUARE = 0.07
#: How long a message is seen after it has come, s.
LINGERS_S = 2.0
#: A hyperbola is drawn this many formation lengths from the middle of its receivers, in so many steps.
REACH, STEPS = 2.5, 60
#: Faint lines go into the water's colour by this share.
FAINT = 0.55
_CORNERS = np.pi / 4 + np.linspace(0.0, 2 * np.pi, 5)


@dataclass(frozen=True)
class Pursuit:
    """What an algorithm told of its schedule; numbers of vehicles are those of the subjects.

    end_s (S,) of slots in order of time; waypoints_m (S, V, 2); known (S, H, V) arrivals; ping_s (C,), arrivals_m
    (C, V) and where they were heard, places_m (C, V, 2).
    """

    vehicles: list[str]
    numbers: list[int]
    holders: list[str]
    offsets_m: np.ndarray
    sigma_m: float
    flat: bool
    message_s: float
    start_s: np.ndarray
    end_s: np.ndarray
    slots: list[dict[str, Any]]
    waypoints_m: np.ndarray
    known: np.ndarray
    places_m: np.ndarray
    arrivals_m: np.ndarray


@dataclass(frozen=True)
class Drawing:
    """Lines, each (M, 2, 3), with their colours: of what vehicles are about, and of what is faint or thin."""

    lines: list[np.ndarray]
    colours: list[palette.Rgb]
    thin: list[np.ndarray]
    thin_colours: list[palette.Rgb]


def read(told: Mapping[str, Any], names: list[str]) -> Pursuit | None:
    """The pursuit of what an algorithm tells of its first trial; None where it tells of no schedule."""
    if not told.get("slots") or not set(told["vehicles"]) <= set(names):
        return None
    slots, pings, V = told["slots"], told["pings"], len(told["vehicles"])
    return Pursuit(
        vehicles=told["vehicles"],
        numbers=[names.index(name) for name in told["vehicles"]],
        holders=told["holders"],
        offsets_m=np.array(told["offsets_m"], float).reshape(V, 2),
        sigma_m=told["sigma_m"],
        flat=told["dimensions"] == 2,
        message_s=told["message_s"],
        start_s=np.array([slot["start_s"] for slot in slots]),
        end_s=np.array([slot["end_s"] for slot in slots]),
        slots=slots,
        waypoints_m=np.array([slot["waypoints_m"] for slot in slots], float),
        known=np.array([slot["known"] for slot in slots], bool),
        places_m=np.array([ping["places_m"] for ping in pings], float),
        arrivals_m=np.array([ping["arrivals_m"] for ping in pings], float),
    )


def drawing(
    pursuit: Pursuit,
    moment_s: float,
    chart: Chart,
    look: palette.Look,
    whose: str | None,
    now: Mapping[str, np.ndarray],
    target: np.ndarray | None,
) -> Drawing:
    """The pursuit at a moment: now {subject: (2,) m} as estimated, target (2,) m where it truly is.

    whose names a vehicle, or the target as one knows it, whose hyperbolas to draw; None draws everybody's but those.
    """
    drawn = Drawing([], [], [], [])
    last = int(np.searchsorted(pursuit.end_s, moment_s + 1e-9, side="right")) - 1
    here = np.array([now.get(name, np.full(2, np.nan)) for name in pursuit.vehicles])
    inks = [palette.vehicle(number) for number in pursuit.numbers]
    _formation(drawn, chart, look, here, None if target is None else target + pursuit.offsets_m)
    if last < 0:
        return drawn
    for place, waypoint, ink in zip(here, pursuit.waypoints_m[last], inks):
        drawn.lines.append(outlines(chart.place(waypoint[None]), _CORNERS, SQUARE))
        drawn.colours.append(ink)
        drawn.thin.append(dashes(chart.place(np.stack([place, waypoint]))))
        drawn.thin_colours.append(ink)
    _messages(drawn, pursuit, moment_s, chart, look, dict(zip(pursuit.vehicles, here)), target)
    holder = _holder(pursuit, whose)
    if holder is not None and pursuit.flat:
        _hyperbolas(drawn, pursuit, last, holder, chart, look)
    return drawn


def _holder(pursuit: Pursuit, whose: str | None) -> int | None:
    """The number of the holder whose knowledge a subject goes by."""
    name = (whose or "").removeprefix("target-")
    if name not in pursuit.vehicles:
        return None
    return pursuit.holders.index(name) if name in pursuit.holders else 0


def _formation(drawn: Drawing, chart: Chart, look: palette.Look, here: np.ndarray, wanted: np.ndarray | None) -> None:
    shade = look.faded(look.truth, FAINT)
    drawn.thin.append(segments(chart.place(np.concatenate([here, here[:1]]))))
    drawn.thin_colours.append(look.faded(look.truth, 0.25))
    if wanted is not None:
        drawn.thin.append(dashes(chart.place(np.concatenate([wanted, wanted[:1]]))))
        drawn.thin_colours.append(shade)


def _messages(
    drawn: Drawing,
    pursuit: Pursuit,
    moment_s: float,
    chart: Chart,
    look: palette.Look,
    places: Mapping[str, np.ndarray],
    target: np.ndarray | None,
) -> None:
    """Lines from who speaks to who hears it, the sender's colour, or grey where it is lost."""
    begun = int(np.searchsorted(pursuit.start_s, moment_s + 1e-9, side="right")) - 1
    slot = pursuit.slots[begun] if begun >= 0 else None
    if slot is None or not slot["spoke"] or moment_s > slot["start_s"] + pursuit.message_s + LINGERS_S:
        return
    start = target if slot["sender"] == "target" else places.get(slot["sender"])
    if start is None:
        return
    sender = slot["sender"]
    ink = palette.vehicle(pursuit.numbers[pursuit.vehicles.index(sender)]) if sender in pursuit.vehicles else look.truth
    for name, place in places.items():
        if name == sender:
            continue
        drawn.lines.append(segments(chart.place(np.stack([start, place]))))
        drawn.colours.append(look.faded(ink, 0.35) if name in slot["heard"] else look.lost)


def _hyperbolas(drawn: Drawing, pursuit: Pursuit, last: int, holder: int, chart: Chart, look: palette.Look) -> None:
    """Of every arrival the holder knows against the first it knows."""
    cycle = pursuit.slots[last]["cycle"]
    if cycle >= len(pursuit.places_m):
        return
    known = np.flatnonzero(pursuit.known[last, holder])
    places, arrivals = pursuit.places_m[cycle], pursuit.arrivals_m[cycle]
    reach = REACH * float(np.hypot(*pursuit.offsets_m.T).mean())
    for other in known[1:]:
        first, ink = known[0], palette.vehicle(pursuit.numbers[other])
        nearer_by = arrivals[other] - arrivals[first]
        for sigmas in (-2.0, 0.0, 2.0):
            farther_m = nearer_by + sigmas * np.sqrt(2.0) * pursuit.sigma_m
            line = segments(chart.place(hyperbola(places[first], places[other], farther_m, reach)))
            if sigmas:
                drawn.thin.append(line)
                drawn.thin_colours.append(look.faded(ink, FAINT))
            else:
                drawn.lines.append(line)
                drawn.colours.append(ink)


def hyperbola(near: np.ndarray, far: np.ndarray, farther_m: float, reach_m: float) -> np.ndarray:
    """Points (N, 2) m that are farther_m farther from `far` than from `near`, within reach_m of the middle of the two.

    None of them where the difference is no smaller than the distance of the two.
    """
    apart = far - near
    length = float(np.hypot(*apart))
    a, c = 0.5 * farther_m, 0.5 * length
    if not abs(a) < c:
        return np.zeros((0, 2))
    along = apart / length
    across = np.array([-along[1], along[0]])
    b = np.sqrt(c * c - a * a)
    most = np.arcsinh(np.sqrt(max(reach_m**2 - a * a, 0.0)) / c)
    t = np.linspace(-most, most, STEPS + 1)[:, None]
    return 0.5 * (near + far) - a * np.cosh(t) * along + b * np.sinh(t) * across
