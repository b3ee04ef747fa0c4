"""A vehicle's local chain and its approximation over launch poses alone (W15 section IV-B, Algorithm 1).

Between two launches the vehicle's own sensors leave a Gaussian over both launch poses. Without fixes it is one
composed odometry factor; without odometry the launches are independent and a prior holds what there is; with both it
is refactored into odometry and a prior on either pose. Velocities are kept inside a window and dropped at its ends,
which gives away a little information and never makes any.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np

from engine.gaussian.forms import Information as Info
from engine.gaussian.forms import Moments, apply, symmetric, to_moments, transpose
from engine.gaussian.links import Link, advance, compose, delta_information
from engine.mission.log import VehicleLog
from engine.navigation.chains import XY, Chain
from engine.smoothing.composition import Relation, between, between_jacobians
from engine.smoothing.composition import compose as then
from engine.smoothing.refactor import refactor
from engine.smoothing.trajectory import STEP_FLOOR, TURN_FLOOR, pieces

#: What a window knows of a velocity or heading before it looks: nothing worth mentioning (1/(m/s)^2).
_FLAT = 1e-6
#: Odometry or priors weaker than this (1/m^2) are none: a kilometre of uncertainty.
_NOTHING = 1e-6


@dataclass(frozen=True)
class ChainLink:
    """One launch pose of an approximate chain, in all trials: W15's link.

    odometry relates it to the launch before (to the frame's origin for the first), None where nothing was measured in
    between. prior_information (trials, d, d) and prior_mean (trials, d) hold its prior, None where it has none.
    """

    odometry: Relation | None
    prior_information: np.ndarray | None = None
    prior_mean: np.ndarray | None = None


@dataclass(frozen=True)
class Window:
    """The Gaussian over two consecutive launch poses that a vehicle's own sensors leave: information (trials, 2d, 2d)
    and vector (trials, 2d), positions in the world frame (displacements from `about` for SE(2) poses)."""

    information: np.ndarray
    vector: np.ndarray
    about: np.ndarray | None = None


@dataclass(frozen=True)
class LocalChain:
    """An approximate chain over all launches, first the way it starts, and what it approximates.

    links[k] is launch k with the final priors; fresh[k] its prior as it was known at its launch (later windows add to
    it), as (information, mean) or None. start is the belief at the first launch; windows[k] leads from launch k to
    k + 1.
    """

    dimension: int
    links: list[ChainLink]
    fresh: list[tuple[np.ndarray, np.ndarray] | None]
    start: Moments
    windows: list[Window]


def local_chain(
    log: VehicleLog, chain: Chain, launches_s: np.ndarray, trials: int, *, consistent: bool = False
) -> LocalChain:
    """Approximate a vehicle's own chain by one over its launches (K,), all among the chain's breakpoints."""
    ends = np.searchsorted(chain.times_s, launches_s)
    size = chain.initial.mean.shape[-1]
    state, windows, relations = chain.initial, [], []
    start = state
    previous = 0
    for k, end in enumerate(ends):
        links, parts = [], []
        before = state
        for step in chain.steps[previous:end]:
            link = step.at(state.mean)
            state = advance(state, slice(None), link)
            links.append(link)
            if size == 3:
                parts += pieces(step)
        previous = int(end)
        if k == 0:
            start = state
        elif size == 3:
            relations.append(_composed(parts, trials))
            windows.append(_pose_window(links, before, state, trials))
        else:
            relations.append(None)
            windows.append(_plane_window(links, trials, size))
    d = 3 if size == 3 else 2
    first = Moments(start.mean[..., :d], start.cov[..., :d, :d])
    measures = log.velocity is not None or log.odometry is not None or size == 2
    return _approximate(d, first, windows, relations, measures, consistent)


def _approximate(
    d: int,
    start: Moments,
    windows: list[Window],
    relations: list[Relation | None],
    measures: bool,
    consistent: bool,
) -> LocalChain:
    """Factors for all windows; those that have both odometry and fixes are refactored together."""
    odometry: list[Relation | None] = [Relation(start.mean, start.cov)]
    priors: list[Info | None] = [None]
    fresh: list[tuple[np.ndarray, np.ndarray] | None] = [None]
    eye = np.eye(d)
    ends = np.concatenate([-0.5 * eye, 0.5 * eye], axis=0)
    both = np.concatenate([eye, eye], axis=0)
    for window, relation in zip(windows, relations):
        L = window.information
        moves = np.linalg.eigvalsh((ends.T @ L @ ends)[..., :2, :2]).min()
        fixed = relation is None and np.abs(both[:, :2].T @ L @ both[:, :2]).max() > _NOTHING
        if relation is not None and window.about is None:
            odometry.append(relation)
            priors.append(None)
        elif relation is None and not fixed:
            C = symmetric(np.linalg.inv(L[:, d:, d:])) if moves > _NOTHING else None
            odometry.append(None if C is None else Relation(apply(C, window.vector[:, d:]), C))
            priors.append(None)
        elif not measures:
            odometry.append(None)
            seen = to_moments(Info(window.vector, L + _FLAT * np.eye(2 * d)))
            information = symmetric(np.linalg.inv(seen.cov[:, d:, d:]))
            priors.append(Info(apply(information, seen.mean[:, d:]), information))
        else:
            z, made = _refactored(window, consistent)
            odometry.append(Relation(z[0], symmetric(np.linalg.inv(made.odometry))))
            at = z[1], z[2]
            earlier = Info(apply(made.first, at[0]), made.first)
            last = priors[-1]
            priors[-1] = earlier if last is None else Info(last.vector + earlier.vector, last.matrix + earlier.matrix)
            priors.append(Info(apply(made.second, at[1]), made.second))
        latest = priors[-1]
        fresh.append(None if latest is None else (latest.matrix, _mean(latest)))
    links = [ChainLink(o) if p is None else ChainLink(o, p.matrix, _mean(p)) for o, p in zip(odometry, priors)]
    return LocalChain(d, links, fresh, start, windows)


def _mean(prior: Info) -> np.ndarray:
    return np.linalg.solve(prior.matrix, prior.vector[..., None])[..., 0]


def _refactored(window: Window, consistent: bool):
    """The window's factors: (z of the odometry, of the first prior, of the second) and their informations."""
    n = window.information.shape[-1]
    d = n // 2
    L = window.information
    if window.about is None:
        mean = np.linalg.solve(L, window.vector[..., None])[..., 0]
        J = np.concatenate([-np.eye(2), np.eye(2)], axis=1)[None]
    else:
        L = L + _FLAT * np.eye(n)
        mean = window.about + np.linalg.solve(L, window.vector[..., None])[..., 0]
        J = np.concatenate(between_jacobians(mean[..., :d], mean[..., d:]), axis=-1)
    made = refactor(symmetric(L), J, consistent=consistent)
    z = between(mean[..., :d], mean[..., d:])
    return (z, mean[..., :d], mean[..., d:]), made


def _plane_window(links: list[Link], trials: int, size: int) -> Window:
    """The information that composed links leave over both end positions, velocities unknown at either end."""
    link = reduce(compose, links)
    A, b, C, eta, J = (np.broadcast_to(x, (trials, *x.shape[1:])) for x in (link.A, link.b, link.C, link.eta, link.J))
    H = np.concatenate([-A[:, XY], np.broadcast_to(np.eye(2), (trials, 2, 2))], axis=-1)
    Y = np.linalg.inv(C[:, XY, XY] + STEP_FLOOR * np.eye(2))
    G = transpose(H) @ Y @ H
    g = apply(transpose(H) @ Y, b[:, XY])
    G[:, :size, :size] += J
    g[:, :size] += eta
    if size == 4:
        kept, gone = np.array([0, 1, 4, 5]), np.array([2, 3])
        V = np.linalg.inv(G[:, gone[:, None], gone] + _FLAT * np.eye(2))
        cross = G[:, kept[:, None], gone]
        g = g[:, kept] - apply(cross @ V, g[:, gone])
        G = G[:, kept[:, None], kept] - cross @ V @ transpose(cross)
    return Window(symmetric(G), g)


def _composed(parts: list, trials: int) -> Relation:
    """Consecutive pose increments as one relation."""
    steps = [Relation(np.broadcast_to(p.increment, (trials, 3)), np.broadcast_to(p.cov, (trials, 3, 3))) for p in parts]
    whole = reduce(then, steps)
    return Relation(whole.z, whole.R + np.diag([STEP_FLOOR, STEP_FLOOR, TURN_FLOOR]))


def _pose_window(links: list[Link], before: Moments, after: Moments, trials: int) -> Window:
    """The information that linearized odometry and fixes leave over both end poses; about None without a fix."""
    link = reduce(compose, links)
    if not link.J.any():
        return Window(np.zeros((trials, 6, 6)), np.zeros((trials, 6)))
    floor = np.diag([STEP_FLOOR, STEP_FLOOR, TURN_FLOOR])
    delta = delta_information(Link(link.A, link.b, link.C + floor, link.eta, link.J))
    swap = np.array([3, 4, 5, 0, 1, 2])
    information = delta.matrix[:, swap[:, None], swap]
    about = np.concatenate([before.mean, after.mean], axis=-1)
    return Window(information, delta.vector[:, swap] - apply(information, about), about)


def composed(links: list[ChainLink]) -> list[Relation | None]:
    """Every link's odometry composed to the origin of its stretch: the frame's for the first stretch, the stretch's
    own first pose after a gap without odometry (None there). W15 section IV-A."""
    whole: list[Relation | None] = []
    for link in links:
        last = whole[-1] if whole else None
        if link.odometry is None:
            whole.append(None)
        elif not whole:
            whole.append(link.odometry)
        else:
            whole.append(link.odometry if last is None else then(last, link.odometry))
    return whole
