"""A shore station estimates from the messages it heard and commands the vehicles in a slot of its own (Fig. 3-4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.gaussian.forms import Moments
from engine.pursuit.diary import Diary, Slot, tracks
from engine.pursuit.messages import ENTRY_BYTES, ENTRY_FLOATS, WAYPOINT_BYTES, WAYPOINT_FLOATS, counted
from engine.pursuit.mission import PursuitMission
from engine.pursuit.options import PursuitOptions
from engine.pursuit.steering import Steering
from engine.pursuit.story import story
from engine.pursuit.tracker import Tracker, Update
from engine.pursuit.water import Water
from engine.registry import Progress
from engine.tracks import PacketCount, Tracks


def fly(mission: PursuitMission, options: PursuitOptions, progress: Progress) -> tuple[Diary, Tracks]:
    """A block of trials: an estimate when the last vehicle has spoken, a command in the slot after."""
    network, V = mission.scenario.network, len(mission.names)
    water, diary = Water(mission), Diary(mission)
    first = Moments(mission.first.mean[:, None], mission.first.cov[:, None])
    tracker = Tracker.of(mission, first, options)
    steering = Steering(mission, options)
    end_s = float(mission.time_s[-1])
    count = PacketCount()
    nothing = np.zeros((mission.trials, 1), int)
    cycle = 0
    while (start_s := cycle * network.slot_s * (V + 2)) < end_s:
        water.sail(start_s)
        tracker.advance(start_s)
        tracker.begin()
        ping = water.ping(cycle)
        diary.pings.append(ping)
        places = steering.places(ping, tracker, water)
        known = ping.heard[:, :, None] & np.eye(V, dtype=bool)
        ashore = np.zeros((mission.trials, 1, V), bool)
        decided = nothing
        for slot in range(V + 2):
            slot_s = start_s + slot * network.slot_s
            told_s = slot_s + (network.message_s if slot else 0.0)
            if told_s >= end_s:
                break
            water.sail(told_s)
            tracker.advance(told_s)
            spoke, heard, told = np.ones(mission.trials, bool), ping.heard, np.zeros_like(ashore)
            if 1 <= slot <= V:
                entries = known[:, slot - 1]
                spoke = np.any(entries, axis=-1, keepdims=True)[:, 0]
                heard = spoke[:, None] & water.chances.messages[:, cycle, slot]
                heard[:, slot - 1] = False
                known = known | (heard[:, :, None] & entries[:, None, :])
                landed = spoke & water.chances.shore[:, cycle, slot - 1]
                ashore = ashore | (landed[:, None] & entries)[:, None]
                heard = np.concatenate([heard, landed[:, None]], axis=1)
                told = ashore & (slot == V)  # the estimate waits for the last vehicle
                count += counted(entries.sum(axis=-1), heard, ENTRY_BYTES, ENTRY_FLOATS)
            kind, surprise = tracker.hear(steering.metres(ping)[:, None], told, places)
            steering.remember(tracker, kind)
            if slot == V:
                decided = kind
            if slot == V + 1:
                spoke = decided[:, 0] != Update.NONE
                heard = spoke[:, None] & water.chances.messages[:, cycle, 0]
                water.send(steering.waypoints(tracker), heard)
                count += counted(V * spoke, heard, WAYPOINT_BYTES, WAYPOINT_FLOATS)
            sender = V if slot == V + 1 else slot - 1
            aim, waypoints = steering.aim(tracker), water.fleet.waypoint
            note = Slot(cycle, slot, slot_s, told_s, sender, spoke, heard, kind, ashore, aim, waypoints)
            diary.note(note, tracker, surprise)
        cycle += 1
        progress(min(start_s / end_s, 1.0), None)
    water.sail(end_s)
    tracker.finish(end_s)
    count += PacketCount(mission_s=mission.trials * end_s)
    return diary, replace(tracks(diary, water, tracker, count), graph=story(diary, tracker.sigma_m))


def run(mission: PursuitMission, progress: Progress) -> Tracks:
    """Centralized pursuit."""
    options = PursuitOptions(**mission.options.get("centralized_pursuit", {}))
    return fly(mission, options, progress)[1]
