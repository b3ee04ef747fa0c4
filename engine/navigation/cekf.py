"""Centralized EKF (W11 section II-A): sees every sensor of every vehicle; the benchmark, realizable afterwards.

The joint state holds all vehicles and, from a broadcast's launch until its last possible arrival, the sender's
state at the launch, so that ranges relate the states they were measured between.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments, augment, drop, join
from engine.gaussian.links import advance
from engine.navigation.calibration import with_sound_speed
from engine.navigation.chains import Step
from engine.navigation.mission import Arrival, Launch
from engine.navigation.network import Member, correlation_of, run_fleet
from engine.navigation.ranging import Innovation, horizontal_range, update_range
from engine.registry import Algorithm


class CekfFleet:
    """The joint filter of all vehicles, their launch states and one sound-speed error."""

    def __init__(self, members: list[Member]) -> None:
        self.members = members
        self.joint = members[0].initial
        self.vehicles = [slice(0, self.joint.mean.shape[-1])]
        for member in members[1:]:
            n = self.joint.mean.shape[-1]
            self.joint = join(self.joint, member.initial)
            self.vehicles.append(slice(n, self.joint.mean.shape[-1]))
        self.joint, self.scale = with_sound_speed(self.joint, members[0])
        self.launched: list[tuple[Launch, int]] = []

    def advance(self, vehicle: int, step: Step) -> None:
        block = self.vehicles[vehicle]
        self.joint = advance(self.joint, block, step.at(self.joint.mean[..., block]))

    def launch(self, launch: Launch) -> None:
        """Augment the joint state by the sender's position at the launch."""
        if launch.audience:
            start = self.joint.mean.shape[-1]
            self.joint = augment(self.joint, _xy(self.vehicles[launch.vehicle]))
            self.launched.append((launch, start))

    def receive(self, arrival: Arrival) -> Innovation:
        """Update with the range (W11 eq. 6); after its last arrival the launch state is marginalized out."""
        launch, start = next(entry for entry in self.launched if entry[0].index == arrival.index)
        delayed = slice(start, start + 2)
        receiver = self.members[arrival.vehicle]
        self.joint, seen = update_range(
            self.joint,
            _xy(self.vehicles[arrival.vehicle]),
            delayed,
            horizontal_range(arrival.slant_m, arrival.depth_m - launch.depth_m),
            receiver.log.range_sigma_m,
            scale=self.scale,
            gate_sigma=receiver.gate_sigma,
        )
        if arrival.last:
            self.joint = drop(self.joint, delayed)
            self.launched = [(other, at - 2 if at > start else at) for other, at in self.launched if at != start]
        return seen

    def belief(self, vehicle: int) -> Moments:
        xy = _xy(self.vehicles[vehicle])
        return Moments(self.joint.mean[..., xy], self.joint.cov[..., xy, xy])

    def correlation(self, first: int, second: int) -> np.ndarray:
        return correlation_of(self.joint, _xy(self.vehicles[first]), _xy(self.vehicles[second]))

    def notes(self) -> list[str]:
        return []


def _xy(block: slice) -> slice:
    return slice(block.start, block.start + 2)


CEKF = Algorithm(
    name="cekf",
    title="Centralized EKF",
    family="navigation",
    summary="Every sensor of every vehicle in one filter, launch states included: the benchmark.",
    source="Walls and Eustice 2011, section II-A",
    run=lambda mission, progress: run_fleet(mission, progress, CekfFleet),
    centralized=True,
    assumes=("all sensor data of all vehicles in one place: post-processing only",),
)
