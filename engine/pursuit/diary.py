"""What happened in a pursuit, slot by slot, and the tracks made of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engine.pursuit.arrivals import Surprise
from engine.pursuit.mission import PursuitMission, subject
from engine.pursuit.response import Response, break_frequency, response
from engine.pursuit.tracker import Tracker, Update
from engine.pursuit.water import Ping, Water
from engine.tracks import Belief, Innovations, PacketCount, Series, Tracks

#: Units of figures by how their keys end; others are shares.
UNITS = {"m": "m", "s": "s", "rps": "rad/s"}
#: What a vehicle's own satellite position is good for, m, one sigma of each axis (RTK).
GPS_SIGMA_M = 0.02


@dataclass(frozen=True)
class Slot:
    """One slot: sender's number (-1 the target, V the shore); who spoke (trials,), who heard (trials, V or V + 1),
    kind of update (trials, H) and known arrivals (trials, H, V) at its end; aim (trials, H, 2), what the holders
    steer by then, and the vehicles' waypoints (trials, V, 2)."""

    cycle: int
    number: int
    start_s: float
    end_s: float
    sender: int
    spoke: np.ndarray
    heard: np.ndarray
    kind: np.ndarray
    known: np.ndarray
    aim: np.ndarray
    waypoints: np.ndarray


@dataclass
class Diary:
    """Of every slot of a block of trials what was said and heard and what came of it.

    error_m: of the estimate for the present, trailing_m: of the position at the ping, taken for the present, fix_m: of
    that position against where the target was when the ping was due; each (trials, H) per slot, NaN without an update.
    """

    mission: PursuitMission
    pings: list[Ping] = field(default_factory=list)
    slots: list[Slot] = field(default_factory=list)
    error_m: list[np.ndarray] = field(default_factory=list)
    trailing_m: list[np.ndarray] = field(default_factory=list)
    fix_m: list[np.ndarray] = field(default_factory=list)
    surprises: list[Surprise] = field(default_factory=list)

    def note(self, slot: Slot, tracker: Tracker, surprise: Surprise) -> None:
        """Write a slot down, at its end."""
        here, d = self.mission.target_at(slot.end_s)[:, None], self.mission.dimensions
        there = self.mission.target_at(tracker.ping_s)[:, None]
        for errors, estimate, truth in (
            (self.error_m, tracker.now, here),
            (self.trailing_m, tracker.fix, here),
            (self.fix_m, tracker.fix, there),
        ):
            away = np.linalg.norm(estimate.mean[..., :d] - truth, axis=-1)
            errors.append(np.where(slot.kind == Update.NONE, np.nan, away))
        self.slots.append(slot)
        self.surprises.append(surprise)


def tracks(diary: Diary, water: Water, tracker: Tracker, packets: PacketCount) -> Tracks:
    """The target as every vehicle knows it, where the vehicles went, and the figures of C19 section 3.4 as series.

    Where one station holds the estimate, it is every vehicle's.
    """
    mission = diary.mission
    holders = np.arange(len(mission.names)) % tracker.mean.shape[1]
    path = water.path(mission.time_s)
    own = np.broadcast_to(GPS_SIGMA_M**2 * np.eye(2), (*path.shape[:1], path.shape[2], 2, 2))
    beliefs = {name: Belief(path[:, i], own.copy()) for i, name in enumerate(mission.names)}
    series, heard = {}, {}
    end_s = np.array([s.end_s for s in diary.slots])
    for i, (name, h) in enumerate(zip(mission.names, holders)):
        beliefs[subject(name)] = Belief(tracker.mean[:, h, :, :2].copy(), tracker.cov[:, h, :, :2, :2].copy())
        truth = mission.truth[subject(name)]
        away = np.linalg.norm(path[:, i] - truth - mission.offsets[i], axis=-1)
        series[f"formation_error_m/{name}"] = Series(f"Formation error of {name}", "m", away, (name,))
        for key, (title, value) in _figures(diary, int(h)).items():
            unit = UNITS.get(key.rpartition("_")[2], "1")
            series[f"{key}/{name}"] = Series(f"{title} of {name}", unit, value, (subject(name),))
        heard[subject(name)] = innovations(end_s, diary.surprises, int(h))
    return Tracks(beliefs=beliefs, packets=packets, innovations=heard, series=series)


def _figures(diary: Diary, h: int) -> dict[str, tuple[str, np.ndarray]]:
    """Series over report times, NaN but at the report that follows an update, by key: title and (trials, T).

    Behind the target is a fix by its distance from where the target has got to by the time it is made (C19 Table 3.1).
    """
    time_s = diary.mission.time_s
    kind = np.stack([s.kind[:, h] for s in diary.slots], axis=1)
    end_s = np.array([s.end_s for s in diary.slots])
    ping_s = np.array([diary.pings[s.cycle].start_s for s in diary.slots])
    column = np.searchsorted(time_s, end_s - 1e-9)
    inside = column < len(time_s)

    def placed(value: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        out = np.full((value.shape[0], len(time_s)), np.nan)
        for n in np.flatnonzero(inside):
            row = wanted[:, n]
            out[row, column[n]] = value[row, n]
        return out

    def at_updates(errors: list[np.ndarray], wanted: np.ndarray) -> np.ndarray:
        return placed(np.stack([e[:, h] for e in errors], axis=1), wanted)

    full, partial, any_kind = kind == Update.FULL, kind == Update.PARTIAL, kind != Update.NONE
    delay = np.broadcast_to(end_s - ping_s, kind.shape)
    found = {
        "full_error_m": ("Full update: error", at_updates(diary.error_m, full)),
        "full_trailing_m": ("Full update: fix behind target", at_updates(diary.trailing_m, full)),
        "full_fix_error_m": ("Full update: error at the ping", at_updates(diary.fix_m, full)),
        "full_delay_s": ("Full update: time since the ping", placed(delay, full)),
        "partial_error_m": ("Partial update: error", at_updates(diary.error_m, partial)),
        "partial_trailing_m": ("Partial update: fix behind target", at_updates(diary.trailing_m, partial)),
        "first_delay_s": ("First update: time since the ping", placed(delay, _first_of_cycle(diary, kind))),
    }
    length = np.hypot(*diary.mission.offsets.T).mean()
    near = [np.where(np.isfinite(away), away < length, np.nan) for away in diary.trailing_m]
    quarters = {"early": ("Second quarter", 0.25, 0.5), "late": ("Last quarter", 0.75, 1.0)}
    for key, (when, low, high) in quarters.items():
        within = any_kind & (end_s > low * time_s[-1]) & (end_s <= high * time_s[-1])
        found[f"{key}_trailing_m"] = (f"{when}: fix behind target", at_updates(diary.trailing_m, within))
        found[f"{key}_kept"] = (f"{when}: fixes within a formation length", at_updates(near, within))
    followed = responses(diary, h)
    if followed is not None:
        value = np.full((kind.shape[0], len(time_s)), np.nan)
        value[:, -1] = break_frequency(followed)
        found["break_rps"] = ("Break of the transfer function", value)
    return found


def responses(diary: Diary, h: int) -> Response | None:
    """How one holder's full-information fixes follow the target's turns, in every trial (C19 Fig. 3-12)."""
    step_s, end_s = diary.mission.scenario.step_s, np.array([s.end_s for s in diary.slots])
    turn_rps = np.diff(diary.mission.target[..., -1], axis=1)[:, : int(diary.mission.time_s[-1] / step_s)] / step_s
    full = np.stack([s.kind[:, h] for s in diary.slots], axis=1) == Update.FULL
    error_m = np.where(full, np.stack([e[:, h] for e in diary.trailing_m], axis=1), np.nan)
    return response(turn_rps, step_s, end_s, error_m)


def _first_of_cycle(diary: Diary, kind: np.ndarray) -> np.ndarray:
    first = np.zeros(kind.shape, bool)
    cycles = np.array([s.cycle for s in diary.slots])
    for c in np.unique(cycles):
        mine = np.flatnonzero(cycles == c)
        updated = kind[:, mine] != Update.NONE
        any_of = updated.any(axis=1)
        first[any_of, mine[np.argmax(updated, axis=1)][any_of]] = True
    return first


def innovations(moments_s: np.ndarray, surprises: list[Surprise], h: int) -> Innovations:
    """One holder's whitened innovations, those of one update side by side; they have variance one."""
    value = np.concatenate([s.white[:, h] for s in surprises], axis=1)
    time_s = np.repeat(moments_s, surprises[0].white.shape[-1])
    return Innovations(time_s, value, np.where(np.isfinite(value), 1.0, np.nan), np.ones(value.shape, bool))
