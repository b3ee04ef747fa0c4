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

#: A Gaussian whose mean or standard deviation is so large, m, m/s or rad, is not of this world.
FARTHEST = 1e7
#: Variance times information of one state: beyond that a double does not keep both.
DIGITS = 1e14
#: Share of a standardized covariance that may be missing by round-off.
ROUND_OFF = 1e-6


class ServedFilter:
    """Own state, then one block per server heard so far, trials along the leading axis."""

    def __init__(self, member: Member) -> None:
        self.member = member
        self.own = slice(0, member.initial.mean.shape[-1])
        self.joint, self.scale = with_sound_speed(member.initial, member)
        self.servers: dict[int, slice] = {}

    def advance(self, step: Step) -> None:
        """Move on by a step of the own local log."""
        self.joint = advance(self.joint, self.own, step.at(self.joint.mean[..., self.own]))

    def server(self, sender: int, size: int) -> slice:
        """The block of a server, made at its first packet as a placeholder that no estimate depends on."""
        if sender not in self.servers:
            n = self.joint.mean.shape[-1]
            trials = self.member.trials
            blank = Moments(np.zeros((trials, size)), np.broadcast_to(np.eye(size), (trials, size, size)))
            self.joint = join(self.joint, blank)
            self.servers[sender] = slice(n, n + size)
        return self.servers[sender]

    def integrate(self, sender: int, link: Link, trials: np.ndarray) -> np.ndarray:
        """Add a server's delta information in the given trials (mask): its block moves to the new launch.

        Returns the trials in which it did: a packet that was changed on its way may have a right checksum, and what
        would not leave a Gaussian of this world is not added.
        """
        block = self.servers[sender]
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                moved = advance(self.joint, block, only_in(trials, link))
            except np.linalg.LinAlgError:  # in one of the trials, which must not spoil the others
                known = np.einsum("...ii->...", self.joint.cov[..., block, block])
                trials = trials & (known * np.einsum("...ii->...", link.J) < DIGITS)
                moved = advance(self.joint, block, only_in(trials, link))
        added = trials & _proper(moved)
        self.joint = Moments(
            np.where(added[:, None], moved.mean, self.joint.mean),
            np.where(added[:, None, None], moved.cov, self.joint.cov),
        )
        return added

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

    def start_again(self, trials: np.ndarray, alone: Moments) -> None:
        """Forget, in the trials of a mask, everything heard: `alone` is what the own sensors say by themselves."""
        fresh, _ = with_sound_speed(alone, self.member)
        n, known = self.joint.mean.shape[-1], fresh.mean.shape[-1]
        mean, cov = self.joint.mean.copy(), self.joint.cov.copy()
        mean[trials], cov[trials] = 0.0, np.eye(n)
        mean[trials, :known] = fresh.mean[trials]
        cov[trials, :known, :known] = fresh.cov[trials]
        self.joint = Moments(mean, cov)

    def belief(self) -> Moments:
        """Own position belief."""
        return Moments(self.joint.mean[..., XY], self.joint.cov[..., XY, XY])


def _proper(joint: Moments) -> np.ndarray:
    """In which trials a joint Gaussian is one: finite, of this world, its covariance without negative directions."""
    variance = np.einsum("...ii->...i", joint.cov)
    proper = np.isfinite(joint.cov).all(axis=(-1, -2)) & (np.abs(joint.mean) < FARTHEST).all(axis=-1)
    proper &= ((variance >= 0) & (variance < FARTHEST**2)).all(axis=-1)
    sigma = np.sqrt(np.where(proper[:, None] & (variance > 0), variance, 1.0))
    standard = np.where(proper[:, None, None], joint.cov / (sigma[:, :, None] * sigma[:, None, :]), 0.0)
    floor = ROUND_OFF * np.eye(standard.shape[-1])
    try:
        np.linalg.cholesky(standard + floor)
    except np.linalg.LinAlgError:
        proper &= np.linalg.eigvalsh(standard)[:, 0] > -ROUND_OFF
    return proper


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
