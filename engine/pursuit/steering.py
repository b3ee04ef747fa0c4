"""From an estimate of the target to waypoints in formation, and to the places where arrivals are taken to be heard."""

from __future__ import annotations

import numpy as np

from engine.pursuit.mission import PursuitMission
from engine.pursuit.options import PursuitOptions
from engine.pursuit.tracker import Tracker, Update
from engine.pursuit.water import Ping, Water


class Steering:
    """What the holders of estimates (trials, H, ...) make of them; one holder decides for all vehicles."""

    def __init__(self, mission: PursuitMission, options: PursuitOptions) -> None:
        self._offsets, self._options = mission.offsets, options
        self._depths, self._d = mission.depths_m, mission.dimensions
        self._c = mission.scenario.network.sound_speed_mps
        self._steered_by: np.ndarray | None = None

    def metres(self, ping: Ping) -> np.ndarray:
        """A ping's arrivals (trials, V) as distances, m."""
        return self._c * ping.arrival_s

    def aim(self, tracker: Tracker) -> np.ndarray:
        """Where the holders take the target to be when they steer, (trials, H, 2) m."""
        return (tracker.now if self._options.steer_by == "present" else tracker.fix).mean[..., :2]

    def waypoints(self, tracker: Tracker) -> np.ndarray:
        """A waypoint for every vehicle, (trials, V, 2) m."""
        return self.aim(tracker) + self._offsets

    def send(self, water: Water, tracker: Tracker, kind: np.ndarray) -> None:
        """Waypoints to the vehicles that have just updated, kind (trials, V)."""
        self.remember(tracker, kind)
        water.send(self.waypoints(tracker), kind != Update.NONE)

    def remember(self, tracker: Tracker, kind: np.ndarray) -> None:
        """Keep what the holders steer by since they updated, kind (trials, H)."""
        aim = self.aim(tracker)
        before = aim if self._steered_by is None else self._steered_by
        self._steered_by = np.where((kind != Update.NONE)[..., None], aim, before)

    def places(self, ping: Ping, tracker: Tracker, water: Water) -> np.ndarray:
        """Where the arrivals of a ping are taken to have been heard, (trials, 1 or H, V, d) m."""
        if self._options.assumed_places == "reported":
            return ping.places[:, None]
        centre = self.aim(tracker) if self._steered_by is None else self._steered_by
        assumed = centre[:, :, None] + self._offsets
        if self._d == 2:
            return assumed
        depth = np.broadcast_to(self._depths[:, None], (*assumed.shape[:-1], 1))
        return np.concatenate([assumed, depth], axis=-1)
