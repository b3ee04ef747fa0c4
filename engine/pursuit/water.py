"""The true world of a pursuit in the loop: vehicles under way, pings and messages through the water."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.pursuit import helm
from engine.pursuit.messages import rounded
from engine.pursuit.mission import Chances, PursuitMission


@dataclass(frozen=True)
class Ping:
    """One ping of the target: arrival_s (trials, V) from the start of the cycle, heard there, and the places then."""

    start_s: float
    arrival_s: np.ndarray
    heard: np.ndarray
    places: np.ndarray


class Water:
    """Vehicles and target of a block of trials, from the start of the mission on."""

    def __init__(self, mission: PursuitMission) -> None:
        assert mission.chances is not None, "a recorded mission has no water"
        self.mission = mission
        self.chances: Chances = mission.chances
        self.fleet = helm.at_rest(mission.starts())
        self.now_s = 0.0
        self._craft = mission.craft
        self._moments, self._places = [0.0], [self.fleet.place]

    def sail(self, until_s: float) -> None:
        """Let the vehicles drive until a moment."""
        steps = int(np.ceil((until_s - self.now_s) / self.mission.scenario.step_s - 1e-9))
        begun = self.now_s
        for n in range(steps):
            self.fleet = helm.sail(self.fleet, self._craft, (until_s - begun) / steps)
            self.now_s = begun + (until_s - begun) * (n + 1) / steps
            self._moments.append(self.now_s)
            self._places.append(self.fleet.place)

    def send(self, waypoints: np.ndarray, which: np.ndarray) -> None:
        """New waypoints (trials, V, 2) for the vehicles named by which (trials, V)."""
        self.fleet = helm.send(self.fleet, waypoints, which)

    def places(self) -> np.ndarray:
        """Where the vehicles are, (trials, V, d) m."""
        return self._with_depth(self.fleet.place)

    def _with_depth(self, place: np.ndarray) -> np.ndarray:
        if self.mission.dimensions == 2:
            return place
        depth = np.broadcast_to(self.mission.depths_m[:, None], (*place.shape[:-1], 1))
        return np.concatenate([place, depth], axis=-1)

    def ping(self, cycle: int) -> Ping:
        """The target pings now, give or take its clock; arrivals are those at the places the vehicles have got to."""
        jitter = self.chances.jitter_s[:, cycle]
        source = self.mission.target_at(self.now_s + jitter)[:, None]
        way = self.fleet.speed[..., None] * np.stack([np.cos(self.fleet.heading), np.sin(self.fleet.heading)], -1)
        c = self.mission.scenario.network.sound_speed_mps
        place = self.fleet.place
        travel = np.zeros(place.shape[:-1])
        for _ in range(3):  # converges by the ratio of the vehicle's speed to that of sound
            place = self.fleet.place + (jitter[:, None] + travel)[..., None] * way
            travel = np.linalg.norm(self._with_depth(place) - source, axis=-1) / c
        arrival = jitter[:, None] + travel + self.chances.noise_m[:, cycle] / c
        arrival, place = rounded(arrival, place)
        return Ping(self.now_s, arrival, self.chances.pings[:, cycle], self._with_depth(place))

    def path(self, time_s: np.ndarray) -> np.ndarray:
        """Where the vehicles were at moments (T,) that have passed, (trials, V, T, 2) m."""
        moments = np.array(self._moments)
        n = np.clip(np.searchsorted(moments, time_s, side="right") - 1, 0, len(moments) - 2)
        share = np.clip((time_s - moments[n]) / (moments[n + 1] - moments[n]), 0.0, 1.0)[:, None, None, None]
        before = np.stack([self._places[k] for k in n])
        after = np.stack([self._places[k + 1] for k in n])
        return np.moveaxis(before + share * (after - before), 0, 2)
