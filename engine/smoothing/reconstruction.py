"""A sender's chain put together again from whatever links arrived, in any order (W15 section IV-A, Algorithm 2).

Links hold composed odometry, so any two of one stretch decompose to a relation between them; a launch whose packet was
lost is simply not there, unless a later packet repeats its link.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from engine.gaussian.forms import Information, Moments, symmetric
from engine.gaussian.links import Link, compose
from engine.smoothing import packets
from engine.smoothing.composition import Relation, decompose
from engine.smoothing.packets import NONE


@dataclass(frozen=True)
class Received:
    """One link as received: composed z (d,), R (d, d) from the origin of its stretch, which begins at launch `stretch`
    (0: at the frame's origin); its prior (mean, cov) and the packet that told it, or None."""

    z: np.ndarray
    R: np.ndarray
    stretch: int
    prior: tuple[np.ndarray, np.ndarray] | None = None
    told: int = -1


@dataclass
class ReceivedChain:
    """Every link received of one sender in one trial, by launch number."""

    links: dict[int, Received] = field(default_factory=dict)

    def add(self, n: int, link: Received) -> bool:
        """Take in a link; whether it said anything new. A prior told later supersedes one told earlier."""
        known = self.links.get(n)
        if known is None:
            self.links[n] = link
            return True
        if link.prior is not None and link.told > known.told:
            self.links[n] = replace(known, prior=link.prior, told=link.told)
            return True
        return False

    def tied(self, a: int, b: int) -> bool:
        """Whether odometry joins two received links."""
        return self.links[a].stretch == self.links[b].stretch

    def relation(self, a: int, b: int) -> Relation:
        """The decomposed odometry between two received links of one stretch (W15 eq. 10-11)."""
        first, second = self.links[a], self.links[b]
        return decompose(Relation(first.z, first.R), Relation(second.z, second.R))

    def between(self, a: int, b: int) -> list[int]:
        """Launches known strictly between two, in order."""
        return sorted(n for n in self.links if a < n < b)

    def window(self, a: int, b: int) -> Link | None:
        """The link from a to b with the priors told in between, None where no odometry joins them; in the plane."""
        if not self.tied(a, b):
            return None
        whole, last = None, a
        for n in [*(n for n in self.between(a, b) if self.links[n].prior is not None), b]:
            step = _plain(self.relation(last, n))
            if whole is not None:
                mean, cov = self.links[last].prior  # type: ignore[misc]
                L = np.linalg.inv(cov)
                step = replace(step, eta=L @ mean, J=L)
            whole = step if whole is None else compose(whole, step)
            last = n
        return whole

    def anchor(self, b: int) -> Information | None:
        """What is known of link b's position by its own stretch up to it, its own prior left out; in the plane.

        None where that is nothing.
        """
        link = self.links[b]
        earlier = [n for n in self.between(-1, b) if self.tied(n, b) and self.links[n].prior is not None]
        information, last = None, None
        if link.stretch == 0:
            first = self.links[earlier[0]] if earlier else link
            information = Information(np.linalg.solve(first.R, first.z), np.linalg.inv(first.R))
            last = earlier[0] if earlier else b
        for n in earlier:
            if information is not None and last is not None and last != n:
                information = _carried(information, self.relation(last, n))
            mean, cov = self.links[n].prior  # type: ignore[misc]
            L = np.linalg.inv(cov)
            had = information or Information(np.zeros(2), np.zeros((2, 2)))
            information = Information(had.vector + L @ mean, had.matrix + L)
            last = n
        if information is not None and last is not None and last != b:
            information = _carried(information, self.relation(last, b))
        return information

    def chain(self, kept: list[int] | None = None) -> Information:
        """The Gaussian over the positions of the kept launches (default: all received), (2 n,) and (2 n, 2 n)."""
        kept = sorted(self.links) if kept is None else sorted(kept)
        size = 2 * len(kept)
        vector, matrix = np.zeros(size), np.zeros((size, size))
        for place, b in enumerate(kept):
            at = slice(2 * place, 2 * place + 2)
            window = self.window(kept[place - 1], b) if place else None
            if window is not None:
                L = np.linalg.inv(window.C)
                LA = L @ window.A
                pair = slice(2 * place - 2, 2 * place + 2)
                matrix[pair, pair] += np.block([[window.J + window.A.T @ LA, -LA.T], [-LA, L]])
                vector[pair] += np.concatenate([window.eta - LA.T @ window.b, L @ window.b])
            else:
                known = self.anchor(b)
                if known is not None:
                    matrix[at, at] += known.matrix
                    vector[at] += known.vector
            prior = self.links[b].prior
            if prior is not None:
                L = np.linalg.inv(prior[1])
                matrix[at, at] += L
                vector[at] += L @ prior[0]
        return Information(vector, symmetric(matrix))


def _plain(relation: Relation) -> Link:
    zero = np.zeros((2, 2))
    return Link(np.eye(2), relation.z, relation.R, np.zeros(2), zero)


def _carried(information: Information, odometry: Relation) -> Information:
    """What information about a position says about the one `odometry` leads to."""
    gain = np.linalg.inv(np.eye(2) + information.matrix @ odometry.R)
    matrix = symmetric(gain @ information.matrix)
    return Information(gain @ (information.vector + information.matrix @ odometry.z), matrix)


@dataclass(frozen=True)
class Opened:
    """A decoded packet of all trials: launch number, depth (trials,) m, which trials are valid, and the links in it:
    (launch numbers (trials,), -1 for none; the link of a trial)."""

    sequence: np.ndarray
    depth_m: np.ndarray
    valid: np.ndarray
    values: dict[str, np.ndarray]
    k: int

    def links(self, trial: int) -> list[tuple[int, Received]]:
        """The links of one trial's packet by launch number."""
        return _links(self, trial)


def open_packet(data: np.ndarray, k: int) -> Opened:
    """Decode packets (trials, n) of a sender in the plane with k slots."""
    values, valid = packets.read_bits(packets.frame_fields(k), data)
    new = packets.read_odometry("new", values)
    arrays = {"new.z": new.z(), "new.R": new.R(), "stretch": values["stretch"]}
    for slot in range(k):
        age = values[f"{slot}.age"]
        own = packets.read_odometry(str(slot), values)
        near = packets.Lattice(
            np.where((age == 0)[:, None], new.position, own.position),
            np.where((age == 0)[:, None], new.covariance, own.covariance),
            np.where(age == 0, new.exponent, own.exponent),
        )
        mean, cov = packets.read_prior(str(slot), values, near)
        arrays |= {
            f"{slot}.age": age,
            f"{slot}.z": near.z(),
            f"{slot}.R": near.R(),
            f"{slot}.mean": mean,
            f"{slot}.cov": cov,
        }
    return Opened(values["sequence"], values["depth"] * packets.DEPTH_STEP_M, valid, arrays, k)


def _links(packet: Opened, trial: int) -> list[tuple[int, Received]]:
    values, now = packet.values, int(packet.sequence[trial])
    age = int(values["stretch"][trial])
    stretch = 0 if age == NONE else now - age
    found = {now: Received(values["new.z"][trial], values["new.R"][trial], stretch)}
    for slot in range(packet.k):
        old = int(values[f"{slot}.age"][trial])
        if old == NONE or old > now:
            continue
        prior = values[f"{slot}.mean"][trial], values[f"{slot}.cov"][trial]
        found[now - old] = Received(values[f"{slot}.z"][trial], values[f"{slot}.R"][trial], stretch, prior, now)
    return sorted(found.items())


def target(start: Moments, windows: list, kept: list[int], trial: int) -> Information:
    """The Gaussian that a sender's own sensors leave over the positions of some launches (W15's target).

    start is its belief at the first launch; windows as in `LocalChain`; kept in order.
    """
    count = len(windows) + 1
    vector, matrix = np.zeros(2 * count), np.zeros((2 * count, 2 * count))
    L = np.linalg.inv(start.cov[trial])
    matrix[:2, :2] += L
    vector[:2] += L @ start.mean[trial]
    for k, window in enumerate(windows):
        pair = slice(2 * k, 2 * k + 4)
        matrix[pair, pair] += window.information[trial]
        vector[pair] += window.vector[trial]
    at = (np.array(kept)[:, None] * 2 + np.arange(2)).ravel()
    rest = np.setdiff1d(np.arange(2 * count), at)
    if not rest.size:
        return Information(vector, matrix)
    gain = np.linalg.solve(matrix[np.ix_(rest, rest)], matrix[np.ix_(rest, at)]).T
    return Information(
        vector[at] - gain @ vector[rest], symmetric(matrix[np.ix_(at, at)] - gain @ matrix[np.ix_(rest, at)])
    )
