"""What a watcher is told of the first trial: the schedule slot by slot, who knew what, where everybody was sent."""

from __future__ import annotations

from typing import Any

import numpy as np

from engine.pursuit.diary import Diary, Slot, responses
from engine.pursuit.response import break_frequency

TARGET, SHORE = "target", "shore"
#: No more cycles than these are told.
MOST_CYCLES = 2000


def story(diary: Diary, sigma_m: float) -> dict[str, Any]:
    """Pings, slots and responses in JSON's own types; places in m, to the centimetre, kinds as in `tracker.Update`.

    holders names whose estimates there are, a vehicle's each or the shore's; sigma_m is the noise they assume of an
    arrival. Of an estimate in space its horizontal part is told.
    """
    mission = diary.mission
    names = list(mission.names)
    holders = names if diary.slots and diary.slots[0].kind.shape[1] == len(names) else [SHORE]
    told = [slot for slot in diary.slots if slot.cycle < MOST_CYCLES]
    network = mission.scenario.network
    return {
        "vehicles": names,
        "holders": holders,
        "slot_s": network.slot_s,
        "message_s": network.message_s,
        "cycle_s": network.slot_s * (len(names) + 1 + (holders == [SHORE])),
        "sigma_m": sigma_m,
        "dimensions": mission.dimensions,
        "offsets_m": _cm(mission.offsets),
        "pings": [
            {
                "time_s": float(ping.start_s),
                "places_m": _cm(ping.places[0, :, :2]),
                "arrivals_m": _cm(network.sound_speed_mps * ping.arrival_s[0]),
                "heard": ping.heard[0].tolist(),
            }
            for ping in diary.pings[:MOST_CYCLES]
        ],
        "slots": [_slot(slot, names) for slot in told],
        "responses": _responses(diary, holders),
    }


def _slot(slot: Slot, names: list[str]) -> dict[str, Any]:
    everybody = [TARGET, *names, SHORE]
    return {
        "cycle": slot.cycle,
        "number": slot.number,
        "start_s": float(slot.start_s),
        "end_s": float(slot.end_s),
        "sender": everybody[slot.sender + 1],
        "spoke": bool(slot.spoke[0]),
        "heard": [name for name, got in zip([*names, SHORE], slot.heard[0]) if got],
        "kinds": [int(kind) for kind in slot.kind[0]],
        "known": slot.known[0].tolist(),
        "aim_m": _cm(slot.aim[0]),
        "waypoints_m": _cm(slot.waypoints[0]),
    }


def _responses(diary: Diary, holders: list[str]) -> dict[str, Any]:
    """Of every holder the smoothed gain of this block of trials, and the mean break of its trials."""
    found = {}
    for h, name in enumerate(holders):
        followed = responses(diary, h)
        if followed is not None:
            found[name] = {
                "frequency_rps": [round(float(w), 6) for w in followed.frequency_rps],
                "gain_m_per_rps": [round(float(g), 3) for g in followed.smoothed],
                "break_rps": round(float(np.mean(break_frequency(followed))), 5),
                "trials": len(followed.gain),
            }
    return found


def _cm(places: np.ndarray) -> list[Any]:
    return np.round(places, 2).tolist()
