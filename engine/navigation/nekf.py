"""Naively distributed EKF (W11 section II-B): everyone broadcasts their own belief, everyone trusts it as new.

The cross-correlation that ranges build between vehicles is held at zero, so information that returns to its
source is counted twice: overconfident wherever correlation would persist.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments, join, keep
from engine.gaussian.links import advance
from engine.navigation import packets
from engine.navigation.calibration import with_sound_speed
from engine.navigation.chains import XY, Step
from engine.navigation.mission import Arrival, Launch
from engine.navigation.network import Member, Packet, run_nodes, slant_to_horizontal
from engine.navigation.ranging import Innovation, update_range
from engine.registry import Algorithm

PACKET = packets.layout(*packets.POSITION, *packets.DEPTH)

#: W11 section IV-D and Table I: 2 for the mean, 3 for the covariance, 1 for the depth.
FLOATS = 6


class NekfNode:
    """One vehicle's filter over its own state (and, where asked for, its sound-speed error)."""

    def __init__(self, member: Member) -> None:
        self.member = member
        self.vehicle = slice(0, member.initial.mean.shape[-1])
        self.own, self.scale = with_sound_speed(member.initial, member)
        self.sequence = 0

    def advance(self, step: Step) -> None:
        self.own = advance(self.own, self.vehicle, step.at(self.own.mean[..., self.vehicle]))

    def transmit(self, launch: Launch) -> Packet:
        here = self.belief()
        data = packets.encode(
            PACKET,
            self.member.trials,
            sender=self.member.index,
            sequence=self.sequence,
            depth=packets.to_steps(launch.depth_m, packets.DEPTH_STEP_M, "<i2"),
            **packets.pack_position(here.mean, here.cov),
        )
        self.sequence = (self.sequence + 1) % 2**16
        return Packet(data, FLOATS)

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation:
        """W11 section II-B: append the sender's belief with zero cross-covariance, update by (6), drop it."""
        packet = packets.decode(PACKET, data)
        mean, cov, proper = packets.unpack_position(packet.record)
        range_m = slant_to_horizontal(arrival, packet.record["depth"] * packets.DEPTH_STEP_M)
        n = self.own.mean.shape[-1]
        joint, seen = update_range(
            join(self.own, Moments(mean, cov)),
            XY,
            slice(n, n + 2),
            np.where(packet.valid & proper, range_m, np.nan),
            self.member.log.range_sigma_m,
            scale=self.scale,
            gate_sigma=self.member.gate_sigma,
        )
        self.own = keep(joint, slice(0, n))
        return seen

    def belief(self) -> Moments:
        return Moments(self.own.mean[..., XY], self.own.cov[..., XY, XY])

    def notes(self) -> list[str]:
        return []


NEKF = Algorithm(
    name="nekf",
    title="Naive EKF",
    family="navigation",
    summary="Broadcasts mean and covariance, ignores cross-correlation: cheap, and overconfident.",
    source="Walls and Eustice 2011, section II-B",
    run=lambda mission, progress: run_nodes(mission, progress, NekfNode),
)
