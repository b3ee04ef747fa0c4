"""The client side of the DEIF family: a vehicle's own state jointly with the launch states of those it hears.

Each server it hears has one block, that server's state at the last launch whose packet was integrated; older
launch states are marginalized out, which loses nothing (W12 section 3.1). Adding a delta information packet is
the same as carrying that block through the packet's link, so the filter is kept in moments: equal to the
information form, and cheaper for few states.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments, join
from engine.gaussian.links import Link, advance
from engine.navigation.calibration import with_sound_speed
from engine.navigation.chains import XY, Step
from engine.navigation.network import Member
from engine.navigation.ranging import Innovation, update_range


class ServedFilter:
    """Own state, then one block per server heard so far, trials along the leading axis."""

    def __init__(self, member: Member) -> None:
        self.member = member
        self.own = slice(0, member.initial.mean.shape[-1])
        self.joint, self.scale = with_sound_speed(member.initial, member)
        #: The own sensors alone: what is left when nothing that was heard can be trusted any more.
        self.alone = member.initial
        self.servers: dict[int, slice] = {}

    def advance(self, step: Step) -> None:
        """Move on by a step of the own local log."""
        self.joint = advance(self.joint, self.own, step.at(self.joint.mean[..., self.own]))
        self.alone = advance(self.alone, slice(None), step.at(self.alone.mean))

    def server(self, sender: int, size: int) -> slice:
        """The block of a server, made at its first packet as a placeholder that no estimate depends on."""
        if sender not in self.servers:
            n = self.joint.mean.shape[-1]
            trials = self.member.trials
            blank = Moments(np.zeros((trials, size)), np.broadcast_to(np.eye(size), (trials, size, size)))
            self.joint = join(self.joint, blank)
            self.servers[sender] = slice(n, n + size)
        return self.servers[sender]

    def integrate(self, sender: int, link: Link, trials: np.ndarray) -> None:
        """Add a server's delta information in the given trials (mask): its block moves to the new launch."""
        block = self.servers[sender]
        self.joint = advance(self.joint, block, only_in(trials, link))

    def update(self, sender: int, range_m: np.ndarray) -> Innovation:
        """Condition on the range to a server's launch state (W11 eq. 6); NaN where there is none."""
        start = self.servers[sender].start
        self.joint, seen = update_range(
            self.joint,
            XY,
            slice(start, start + 2),
            range_m,
            self.member.log.range_sigma_m,
            scale=self.scale,
            gate_sigma=self.member.gate_sigma,
        )
        return seen

    def start_again(self, trials: np.ndarray) -> None:
        """Forget, in the given trials, everything heard: back to the own sensors alone, servers unknown."""
        mean, cov = self.joint.mean.copy(), self.joint.cov.copy()
        n = self.own.stop
        fresh, self_scale = with_sound_speed(self.alone, self.member)
        size = fresh.mean.shape[-1]
        blank_mean = np.zeros_like(mean)
        blank_cov = np.broadcast_to(np.eye(mean.shape[-1]), cov.shape).copy()
        blank_mean[:, :size] = fresh.mean
        blank_cov[:, :size, :size] = fresh.cov
        assert n <= size and self_scale == self.scale
        self.joint = Moments(
            np.where(trials[:, None], blank_mean, mean), np.where(trials[:, None, None], blank_cov, cov)
        )

    def belief(self) -> Moments:
        """Own position belief."""
        return Moments(self.joint.mean[..., XY], self.joint.cov[..., XY, XY])


def only_in(trials: np.ndarray, link: Link) -> Link:
    """The link where `trials` (mask) is set, and a link that changes nothing elsewhere."""
    one, two = trials[:, None], trials[:, None, None]
    eye = np.eye(link.A.shape[-1])
    return Link(
        A=np.where(two, link.A, eye),
        b=np.where(one, link.b, 0.0),
        C=np.where(two, link.C, 0.0),
        eta=np.where(one, link.eta, 0.0),
        J=np.where(two, link.J, 0.0),
    )
