"""What a vehicle broadcasts of its own chain (W15 Algorithm 1): the new launch's link and k links with priors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engine.gaussian.forms import Moments, apply, symmetric
from engine.navigation import packets as records
from engine.smoothing import packets
from engine.smoothing.choice import k_best, k_last
from engine.smoothing.composition import Relation
from engine.smoothing.composition import compose as then
from engine.smoothing.local_chain import LocalChain
from engine.smoothing.packets import NONE, OLDEST, Lattice

#: Chooses among the links with priors of a sender, at a launch: link numbers (trials, k), -1 for none.
Choice = Callable[["PlaneSender", int, list[int]], np.ndarray]
#: Information (1/m^2, 1/rad^2) that every direction of a pose's prior gets, so that it has a covariance.
LEAST_PRIOR = 1e-9


class PlaneSender:
    """The approximate chain of a vehicle in the plane, composed on the lattice it is sent on.

    broadcasts (trials, K) counts how often each link's prior was sent in its present form.
    """

    def __init__(self, index: int, chain: LocalChain, trials: int, k: int, choice: Choice) -> None:
        self.index, self.chain, self.trials, self.k, self.choice = index, chain, trials, k, choice
        self.fields = packets.frame_fields(k)
        self.lattice: list[Lattice] = []
        self.stretch: list[int] = []
        self.broadcasts = np.zeros((trials, len(chain.links)), int)
        self._compose()

    def _compose(self) -> None:
        """Add the links up; where odometry is missing, or a stretch gets too old to be told apart, start a new one."""
        none = np.zeros((self.trials, 2, 2))
        for n, link in enumerate(self.chain.links):
            begun = self.stretch[-1] if n else 0
            too_old = begun > 0 and n - begun > OLDEST
            if link.odometry is None or too_old:
                here = link.prior_mean if link.prior_mean is not None else np.zeros((self.trials, 2))
                self.stretch.append(n)
                self.lattice.append(packets.onto_lattice(here, none, np.zeros(self.trials)))
                continue
            z, R = link.odometry.z, link.odometry.R
            if n == 0:
                self.lattice.append(packets.onto_lattice(z, R, np.zeros(self.trials)))
                self._exact = z.copy()
            else:
                last = self.lattice[-1]
                self._exact = (self._exact if begun == 0 else last.z()) + z
                self.lattice.append(packets.onto_lattice(self._exact, last.R() + R, last.exponent))
            self.stretch.append(begun)

    def prior(self, n: int, now: int) -> tuple[np.ndarray, np.ndarray] | None:
        """The prior of link n as it is known at launch `now`: information and mean, or None."""
        link = self.chain.links[n]
        if n == now:
            return self.chain.fresh[n]
        if link.prior_information is None or link.prior_mean is None:
            return None
        return link.prior_information, link.prior_mean

    def candidates(self, now: int) -> list[int]:
        """Links with priors that can be sent at a launch and are tied to it by odometry."""
        same = self.stretch[now]
        oldest = max(now - OLDEST, 0)
        return [n for n in range(oldest, now + 1) if self.stretch[n] == same and self.prior(n, now) is not None]

    def packet(self, now: int, depth_m: np.ndarray) -> np.ndarray:
        """Bytes (trials, n) of the packet of launch number `now`."""
        if now > 0 and self.chain.links[now - 1].prior_information is not None and self._grew(now - 1):
            self.broadcasts[:, now - 1] = 0
        values: dict[str, np.ndarray | int] = {
            "sender": self.index,
            "sequence": now % 2**16,
            "depth": np.rint(np.nan_to_num(depth_m) / packets.DEPTH_STEP_M).astype(np.int64),
            "stretch": NONE if self.stretch[now] == 0 else now - self.stretch[now],
        }
        values |= packets.odometry_values("new", self.lattice[now])
        candidates = self.candidates(now)
        chosen = self.choice(self, now, candidates) if candidates else np.full((self.trials, self.k), -1)
        for slot in range(self.k):
            values |= self._slot(slot, chosen[:, slot], now)
        return packets.write_bits(self.fields, self.trials, values)

    def _grew(self, n: int) -> bool:
        """Whether link n's prior gained from the window after its launch."""
        fresh, final = self.chain.fresh[n], self.chain.links[n].prior_information
        return fresh is None or fresh[0] is not final

    def _slot(self, slot: int, link: np.ndarray, now: int) -> dict[str, np.ndarray]:
        values: dict[str, np.ndarray] = {f"{slot}.age": np.full(self.trials, NONE)}
        for n in np.unique(link[link >= 0]):
            mine = link == n
            prior = self.prior(int(n), now)
            assert prior is not None
            near = self.lattice[n]
            cov = np.linalg.inv(prior[0])
            new = packets.odometry_values(str(slot), near) if n < now else {}
            new |= packets.prior_values(str(slot), prior[1], cov, near)
            new[f"{slot}.age"] = np.full(self.trials, now - n)
            for name, value in new.items():
                values[name] = np.where(mine, value, values.get(name, 0))
            self.broadcasts[mine, n] += 1
        return values


def choose_last(sender: PlaneSender, now: int, candidates: list[int]) -> np.ndarray:
    """k-last: the same in all trials."""
    chosen = np.full(sender.k, -1)
    latest = k_last(candidates, sender.k)
    chosen[: len(latest)] = latest
    return np.broadcast_to(chosen, (sender.trials, sender.k))


def choose_best(loss: float) -> Choice:
    """k-best, assuming that each packet is lost with probability `loss`."""

    def choose(sender: PlaneSender, now: int, candidates: list[int]) -> np.ndarray:
        R = np.stack([sender.lattice[n].R() for n in (*candidates, now)], axis=1)
        anchor = np.linalg.inv(R[:, 0]) if sender.stretch[now] == 0 else np.zeros_like(R[:, 0])
        information = []
        for n in candidates:
            prior = sender.prior(n, now)
            assert prior is not None
            information.append(prior[0])
        # Composition in the plane is addition: from one prior to the next is a difference of composed covariances.
        odometry = np.diff(R, axis=1)
        places = k_best(
            anchor, np.stack(information, axis=1), sender.broadcasts[:, candidates], odometry, sender.k, loss
        )
        return np.where(places >= 0, np.array(candidates)[np.maximum(places, 0)], -1)

    return choose


class PoseSender:
    """The approximate chain of a vehicle in SE(2), composed, in floats; priors chosen as k-last."""

    def __init__(self, index: int, chain: LocalChain, trials: int, k: int) -> None:
        self.index, self.chain, self.trials, self.k = index, chain, trials, k
        self.layout = pose_layout(k)
        self.whole: list[Relation] = []
        for n, link in enumerate(chain.links):
            assert link.odometry is not None
            self.whole.append(link.odometry if n == 0 else then(self.whole[-1], link.odometry))

    def packet(self, now: int, depth_m: np.ndarray) -> np.ndarray:
        """Bytes (trials, n) of the packet of launch number `now`."""
        links = np.zeros((self.trials, self.k + 1), packets.POSE_LINK)
        links["age"] = NONE
        with_prior = [n for n in range(max(now - OLDEST, 0), now) if self._prior(n, now) is not None]
        for slot, n in enumerate([now, *k_last(with_prior, self.k)]):
            upper = np.triu_indices(3)
            links["age"][:, slot] = now - n
            links["z"][:, slot] = self.whole[n].z
            links["R"][:, slot] = self.whole[n].R[:, upper[0], upper[1]]
            prior = self._prior(n, now)
            links["prior_cov"][:, slot] = np.inf
            if prior is not None:
                links["prior_mean"][:, slot] = prior[0]
                links["prior_cov"][:, slot] = prior[1][:, upper[0], upper[1]]
        return records.encode(
            self.layout,
            self.trials,
            sender=self.index,
            sequence=now % 2**16,
            depth=records.to_steps(depth_m, records.DEPTH_STEP_M, "<i2"),
            links=links,
        )

    def _prior(self, n: int, now: int) -> tuple[np.ndarray, np.ndarray] | None:
        """The prior of link n as it is known at launch `now`: mean and covariance, or None.

        A fix between two launches ties a pose's heading to its place and leaves one direction free: that direction's
        mean is where odometry leads, its variance large but finite.
        """
        link = self.chain.links[n]
        told = self.chain.fresh[n] if n == now else (link.prior_information, link.prior_mean)
        if told is None or told[0] is None or told[1] is None:
            return None
        information, near = told[0], self.whole[n].z
        cov = symmetric(np.linalg.inv(information + LEAST_PRIOR * np.eye(3)))
        return near + apply(cov, apply(information, told[1] - near)), cov


def pose_layout(k: int) -> np.dtype:
    """Record of a pose chain's packet."""
    return records.layout(("links", packets.POSE_LINK, (k + 1,)), *records.DEPTH)


class FixedSender:
    """A node that stays where it is says where it believes to be, as one link without odometry."""

    def __init__(self, index: int, beliefs: list[Moments], trials: int) -> None:
        self.index, self.beliefs, self.trials = index, beliefs, trials
        self.fields = packets.frame_fields(0)

    def packet(self, now: int, depth_m: np.ndarray) -> np.ndarray:
        """Bytes (trials, n) of the packet of launch number `now`."""
        here = packets.onto_lattice(self.beliefs[now].mean, self.beliefs[now].cov, np.zeros(self.trials))
        values: dict[str, np.ndarray | int] = {
            "sender": self.index,
            "sequence": now % 2**16,
            "depth": np.rint(np.nan_to_num(depth_m) / packets.DEPTH_STEP_M).astype(np.int64),
            "stretch": NONE,
        }
        return packets.write_bits(self.fields, self.trials, values | packets.odometry_values("new", here))
