"""Every vehicle estimates the target for itself, from what it has heard so far, and steers by that (C19 Fig. 3-3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.gaussian.forms import Moments
from engine.pursuit.diary import Diary, Slot, tracks
from engine.pursuit.messages import ENTRY_BYTES, ENTRY_FLOATS, counted
from engine.pursuit.mission import PursuitMission
from engine.pursuit.options import PursuitOptions
from engine.pursuit.steering import Steering
from engine.pursuit.story import story
from engine.pursuit.tracker import Tracker
from engine.pursuit.water import Water
from engine.registry import Progress
from engine.tracks import PacketCount, Tracks


def fly(mission: PursuitMission, options: PursuitOptions, partial: bool, progress: Progress) -> tuple[Diary, Tracks]:
    """A block of trials; without partial, vehicles act only on a cycle's full information."""
    network, V = mission.scenario.network, len(mission.names)
    water, diary = Water(mission), Diary(mission)
    first = Moments(np.repeat(mission.first.mean[:, None], V, axis=1), np.repeat(mission.first.cov[:, None], V, axis=1))
    tracker = Tracker.of(mission, first, options)
    steering = Steering(mission, options)
    end_s = float(mission.time_s[-1])
    count = PacketCount()
    cycle = 0
    while (start_s := cycle * network.slot_s * (V + 1)) < end_s:
        water.sail(start_s)
        tracker.advance(start_s)
        tracker.begin()
        ping = water.ping(cycle)
        diary.pings.append(ping)
        known = ping.heard[:, :, None] & np.eye(V, dtype=bool)
        places = steering.places(ping, tracker, water)
        for slot in range(V + 1):
            slot_s = start_s + slot * network.slot_s
            told_s = slot_s + (network.message_s if slot else 0.0)
            if told_s >= end_s:
                break
            water.sail(told_s)
            tracker.advance(told_s)
            spoke, heard = np.ones(mission.trials, bool), ping.heard
            if slot:
                spoke = np.any(known[:, slot - 1], axis=-1, keepdims=True)[:, 0]
                heard = spoke[:, None] & water.chances.messages[:, cycle, slot]
                heard[:, slot - 1] = False
                count += counted(known[:, slot - 1].sum(axis=-1), heard, ENTRY_BYTES, ENTRY_FLOATS)
                known = known | (heard[:, :, None] & known[:, slot - 1, None, :])
            usable = known if partial else known & known.all(axis=-1, keepdims=True)
            kind, surprise = tracker.hear(steering.metres(ping)[:, None], usable, places)
            steering.send(water, tracker, kind)
            aim, waypoints = steering.aim(tracker), water.fleet.waypoint
            note = Slot(cycle, slot, slot_s, told_s, slot - 1, spoke, heard, kind, known, aim, waypoints)
            diary.note(note, tracker, surprise)
        cycle += 1
        progress(min(start_s / end_s, 1.0), None)
    water.sail(end_s)
    tracker.finish(end_s)
    count += PacketCount(mission_s=mission.trials * end_s)
    return diary, replace(tracks(diary, water, tracker, count), graph=story(diary, tracker.sigma_m))


def run(mission: PursuitMission, progress: Progress) -> Tracks:
    """Decentralized pursuit with partial updates."""
    options = PursuitOptions(**mission.options.get("decentralized_pursuit", {}))
    return fly(mission, options, True, progress)[1]


def run_full_only(mission: PursuitMission, progress: Progress) -> Tracks:
    """Decentralized pursuit that waits for a cycle's full information."""
    options = PursuitOptions(**mission.options.get("full_information_pursuit", {}))
    return fly(mission, options, False, progress)[1]
