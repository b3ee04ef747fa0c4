"""Interleaved update (W11 section II-C; Bahr, Walter and Leonard 2009): never fuse what might be correlated.

A node keeps one filter per subset of the other vehicles, and every filter carries its origins: the vehicles whose
information may be in it. Two filters of two vehicles may meet in a range update only if their origins are
disjoint; the result belongs to the union. The vehicle's own estimate is its most certain filter. Consistent by
construction, better than dead reckoning, and unbounded without a fix, since what was learnt from a neighbour can
never be combined with what that neighbour learns later.

The literature's count of filters is inconsistent (W11 has 2n-1 in the text and two or three for n = 2); with one
per subset it is 2^(n-1), of which the one with everybody in it is of no use to anybody and is not sent.
"""

from __future__ import annotations

import numpy as np

from engine.gaussian.forms import Moments
from engine.gaussian.links import advance
from engine.navigation import packets
from engine.navigation.chains import XY, Step
from engine.navigation.mission import Arrival, Launch
from engine.navigation.network import Member, Packet, run_nodes, slant_to_horizontal
from engine.navigation.ranging import Innovation, update_range
from engine.registry import Algorithm

#: A bank for six vehicles has 32 filters, a packet of 475 bytes: more would fit no acoustic channel.
MOST_VEHICLES = 6

#: Per filter: 2 for the mean, 3 for the covariance (W11 section IV-D).
FLOATS_PER_FILTER = 5


def packet_layout(filters: int) -> np.dtype:
    """A packet with a bank of position filters, each with its origins as a bit mask."""
    entry = np.dtype([("origins", "u1"), *packets.POSITION])
    return packets.layout(("filters", entry, (filters,)), *packets.DEPTH)


class InterleavedUpdateNode:
    """One vehicle's bank of filters, stacked along a leading axis: mean (filters, trials, n)."""

    def __init__(self, member: Member) -> None:
        vehicles = len(member.names)
        if vehicles > MOST_VEHICLES:
            raise ValueError(
                f"interleaved_update keeps 2^(n-1) filters and is limited to {MOST_VEHICLES} vehicles; "
                f"this mission has {vehicles}"
            )
        self.member = member
        self.me = 1 << member.index
        everybody = range(1 << vehicles)
        #: Origins of each filter as bit masks, its own vehicle always among them, fewest first.
        self.origins = sorted((o for o in everybody if o & self.me), key=lambda o: (o.bit_count(), o))
        n = len(self.origins)
        self.bank = Moments(
            np.repeat(member.initial.mean[None], n, axis=0), np.repeat(member.initial.cov[None], n, axis=0)
        )
        self.layout = packet_layout(max(n - 1, 1))
        self.sequence = 0

    def advance(self, step: Step) -> None:
        links = step.at(self.bank.mean)
        self.bank = advance(self.bank, slice(None), links)

    def transmit(self, launch: Launch) -> Packet:
        sent = self.origins[: self.layout["filters"].shape[0]]
        record = np.zeros((self.member.trials, len(sent)), self.layout["filters"].base)
        for n, origins in enumerate(sent):
            record["origins"][:, n] = origins
            belief = packets.pack_position(self.bank.mean[n][..., XY], self.bank.cov[n][..., XY, XY])
            for name, value in belief.items():
                record[name][:, n] = value
        data = packets.encode(
            self.layout,
            self.member.trials,
            sender=self.member.index,
            sequence=self.sequence,
            filters=record,
            depth=packets.to_steps(launch.depth_m, packets.DEPTH_STEP_M, "<i2"),
        )
        self.sequence = (self.sequence + 1) % 2**16
        return Packet(data, 1 + FLOATS_PER_FILTER * len(sent))

    def receive(self, arrival: Arrival, data: np.ndarray) -> Innovation | None:
        """Offer every admissible pair of filters to the filters that may hold its result; the most certain stays."""
        packet = packets.decode(self.layout, data)
        range_m = slant_to_horizontal(arrival, packet.record["depth"] * packets.DEPTH_STEP_M)
        range_m = np.where(packet.valid, range_m, np.nan)
        sender = 1 << int(arrival.sender)
        first: Innovation | None = None
        offers: list[tuple[int, Moments]] = []
        for column, theirs in enumerate(self._agreed_origins(sender)):
            entry = packet.record["filters"][:, column]
            mean, cov, proper = packets.unpack_position(entry)
            usable = proper & (entry["origins"] == theirs)
            mine = [k for k, origins in enumerate(self.origins) if not origins & theirs]
            if not mine:
                continue
            after, seen = self._update(mine, Moments(mean, cov), np.where(usable, range_m, np.nan))
            if first is None:
                first = Innovation(seen.value[0], seen.variance[0], seen.accepted[0])
            for row, k in enumerate(mine):
                offers.append((self.origins[k] | theirs, Moments(after.mean[row], after.cov[row])))
        self._keep_the_best(offers)
        return first

    def _agreed_origins(self, sender: int) -> list[int]:
        """Origins of the filters in a packet of `sender`: the same subsets in the same order as at home."""
        everybody = range(1 << len(self.member.names))
        theirs = sorted((o for o in everybody if o & sender), key=lambda o: (o.bit_count(), o))
        return theirs[: self.layout["filters"].shape[0]]

    def _update(self, mine: list[int], theirs: Moments, range_m: np.ndarray) -> tuple[Moments, Innovation]:
        """Range updates of several own filters with one of the sender's, as W11's NEKF does one."""
        mean, cov = self.bank.mean[mine], self.bank.cov[mine]
        n = mean.shape[-1]
        joint_mean = np.concatenate([mean, np.broadcast_to(theirs.mean, (*mean.shape[:-1], 2))], axis=-1)
        joint_cov = np.zeros((*cov.shape[:-2], n + 2, n + 2))
        joint_cov[..., :n, :n] = cov
        joint_cov[..., n:, n:] = theirs.cov
        after, seen = update_range(
            Moments(joint_mean, joint_cov),
            XY,
            slice(n, n + 2),
            range_m,
            self.member.log.range_sigma_m,
            gate_sigma=self.member.gate_sigma,
        )
        return Moments(after.mean[..., :n], after.cov[..., :n, :n]), seen

    def _keep_the_best(self, offers: list[tuple[int, Moments]]) -> None:
        """Each filter becomes the most certain of itself and the offers whose origins it may hold, per trial."""
        mean, cov = self.bank.mean.copy(), self.bank.cov.copy()
        for k, origins in enumerate(self.origins):
            size = _area(cov[k])
            for offered, belief in offers:
                if offered & ~origins:
                    continue
                better = _area(belief.cov) < size
                mean[k] = np.where(better[:, None], belief.mean, mean[k])
                cov[k] = np.where(better[:, None, None], belief.cov, cov[k])
                size = np.where(better, _area(belief.cov), size)
        self.bank = Moments(mean, cov)

    def belief(self) -> Moments:
        """The filter with the smallest position covariance, per trial."""
        best = _area(self.bank.cov).argmin(axis=0)
        trial = np.arange(self.member.trials)
        return Moments(self.bank.mean[best, trial][..., XY], self.bank.cov[best, trial][..., XY, XY])

    def notes(self) -> list[str]:
        if self.member.sound_speed_sigma_mps > 0:
            return ["takes the sound speed as known: a calibrated scale would correlate all of its filters"]
        return []


def _area(cov: np.ndarray) -> np.ndarray:
    """Determinant of the position covariance."""
    return cov[..., 0, 0] * cov[..., 1, 1] - cov[..., 0, 1] ** 2


INTERLEAVED_UPDATE = Algorithm(
    name="interleaved_update",
    title="Interleaved update",
    family="navigation",
    summary="A filter per subset of the others; fuses only what cannot be correlated. Consistent, but unbounded.",
    source="Walls and Eustice 2011, section II-C; Bahr, Walter and Leonard 2009",
    run=lambda mission, progress: run_nodes(mission, progress, InterleavedUpdateNode),
    assumes=(f"at most {MOST_VEHICLES} vehicles",),
)
