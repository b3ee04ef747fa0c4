"""Beliefs of all variables of a growing factor graph, by kernels that each hold one joint value of the beacons.

The state of a kernel is a value of every *ambiguous* variable (one that no prior or odometry determines). What the
other variables are, given it, the Bayes tree says in closed form (propagation.py), and with it how well that value
explains everything measured: its evidence. When factors arrive, kernels are weighted by what they add to the
evidence. Once the weights are uneven, kernels are resampled and moved by Markov chain steps that leave the posterior
as it is (iterated batch importance sampling, Chopin 2002): draws towards one beacon from the factors on it (batch
Gibbs, C19 eq. 4.99), differences between other kernels, and new labels of mixtures. The more is known, the less a
factor adds and the rarer that is. Poses are drawn in the end, jointly, from the root down.

With a lag, poses that are older are drawn and marginalized: what they said of those that stay and of the beacons
becomes one Gaussian for each kernel, linearized where the kernel then was. Work and memory no longer grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from engine.slam.around import Around
from engine.slam.bayes_tree import BayesTree, tree, untouched
from engine.slam.elimination import order
from engine.slam.factors.factor import Factor
from engine.slam.factors.remembered import remembered
from engine.slam.graph import Graph
from engine.slam.misfit import Misfit, misfit
from engine.slam.propagation import Points, Propagation, Up, down
from engine.slam.variables import LABEL, Kind

#: The most factors that refine where a beacon is drawn anew.
REFINERS = 10
#: Sweeps for each that draws beacons anew; the others move them by differences between kernels.
REDRAWS = 3
#: Newton steps that settle the poses for a proposed beacon, and for new factors, at most.
SETTLINGS, LONG_SETTLINGS = 2, 30
#: How many times more kernels first look for a new beacon, all around.
SCOUTS = 8
#: Share of the kernels that must count; with fewer they are resampled and moved.
COUNTING = 0.8
#: The spreads between which a kernel's step is drawn when it does not follow the others, m, and the share of those.
STEPS_M, OWN_STEPS = (0.02, 3.0), 0.3
#: Poses marginalized at a time, in one dense step.
AT_ONCE = 16
#: Distance (in each coordinate) below which a point of linearization is left where it is.
SETTLED = 1e-3
#: Change of all kernels' evidence with which their poses count as settled.
SETTLED_NATS = 0.05


@dataclass(frozen=True)
class Step:
    """What one extension did: its tree and which cliques were not done again, effective kernels, share of moves taken.

    accepted is nan where the weights stayed even enough for kernels not to be moved.
    """

    tree: BayesTree
    reused: frozenset[int]
    effective: float
    accepted: float


class Solver:
    """Grows a graph and keeps its beliefs; the same seed and extensions give the same kernels."""

    def __init__(
        self, kernels: int = 100, seed: int | np.random.SeedSequence = 0, sweeps: int = 4, lag: int | None = None
    ) -> None:
        if kernels < 4:
            raise ValueError(f"a belief needs at least 4 kernels, got {kernels}")
        if lag is not None and lag < 2:
            raise ValueError(f"at least 2 poses must stay, got a lag of {lag}")
        self.kernels, self.sweeps, self.lag = kernels, sweeps, lag
        self.graph = Graph()
        self.tree = BayesTree([], {})
        self._rng = np.random.default_rng(seed)
        self._points = Points()
        self._propagation = Propagation()
        self._given: frozenset[str] = frozenset()
        self._past: dict[str, np.ndarray] = {}
        self._evidence = np.zeros(kernels)
        self._log_weight = np.zeros(kernels)
        self._up: Up | None = None

    @property
    def beacons(self) -> list[str]:
        """The ambiguous variables that are places, in order of arrival."""
        return [v for v in self.graph.kinds if v in self._given and self.graph.kinds[v] is not LABEL]

    def extend(self, kinds: dict[str, Kind], factors: Iterable[Factor]) -> Step:
        """Add variables and factors and bring the beliefs up to date."""
        added, made = list(factors), self._propagation.made
        self.graph.add(kinds, added)
        before = self._given
        self._given = frozenset(self.graph.ambiguous())
        wanted = self.kernels
        new = any(v in self._given for v in kinds)
        if new:
            self.kernels = SCOUTS * wanted
            self._take(np.repeat(np.arange(wanted), SCOUTS))
        log_q = self._evidence + self._enter(kinds, added)
        self._grow(kinds, added)
        self._evidence = self._settle(LONG_SETTLINGS)
        # Where a beacon has become determined, what its kernels' values were drawn by has no weight against others.
        placed = not before <= self._given
        self._log_weight = self._log_weight + (0.0 if placed else self._evidence - log_q)
        weights = np.exp(self._log_weight - self._log_weight.max())
        effective = float(weights.sum() ** 2 / np.square(weights).sum())
        grown, messages = self.tree, self._up.messages if self._up else {}
        reused = frozenset(clique for clique, number in messages.items() if number <= made)
        accepted = np.nan
        self.kernels = wanted
        if self._given and (new or placed or effective < COUNTING * wanted):
            self._take(self._evenly())
            self._log_weight = np.zeros(wanted)
            accepted = float(np.mean([self._sweep(n % REDRAWS == 0) for n in range(self.sweeps)]))
        if self.lag is not None:
            self._forget(self.lag)
        return Step(grown, reused, effective, accepted)

    def beliefs(self, variables: Iterable[str] | None = None) -> dict[str, np.ndarray]:
        """Joint draws (N, d) of these variables, all of the same weight; of all variables without an argument.

        Of poses older than the lag they are those of when they were marginalized.
        """
        found, chosen = self._past | self._draws(), self._evenly()
        return {v: found[v][chosen] for v in (variables if variables is not None else found)}

    def misfit(self) -> Misfit:
        """How badly the measurements fit the mode that each kernel leads to."""
        mean = down(self.graph, self.tree, self._pass(), self._given, self.kernels, None)
        return misfit(self.graph, mean | {v: self._points.values[v] for v in self._given}, self.kernels)

    def _draws(self) -> dict[str, np.ndarray]:
        """A joint value (N, d) of all variables for each kernel."""
        drawn = down(self.graph, self.tree, self._pass(), self._given, self.kernels, self._rng)
        return drawn | {v: self._points.values[v] for v in self._given}

    def _grow(self, kinds: dict[str, Kind], added: list[Factor]) -> None:
        """The tree with these variables and factors, without another order where they do not reach.

        The newest pose and the beacons stay near the root, and poses that only linear factors tie lie at the leaves:
        as beacons move, what is known of those is not asked again.
        """
        scopes = [f.variables for f in self.graph.factors]
        newest = [v for v in kinds or self.graph.kinds if v not in self._given][-1:]
        last = newest + [v for v in self.graph.kinds if v in self._given]
        curved = {v for f in self.graph.factors if not f.linear for v in f.variables}
        touched = {*last, *kinds, *(v for f in added for v in f.variables)}
        sequence = order(
            list(self.graph.kinds),
            scopes,
            last,
            first=self.graph.kinds.keys() - curved,
            kept=untouched(self.tree, touched),
        )
        self.tree = tree(scopes, sequence)

    # -- entering variables

    def _enter(self, kinds: dict[str, Kind], added: list[Factor]) -> np.ndarray:
        """Give every new variable a first point.

        The log density (N,), up to a constant, with which those that are the kernels' own were drawn.
        """
        waiting, log_q = list(kinds), np.zeros(self.kernels)
        strata = (np.arange(self.kernels) + 0.5) / self.kernels
        known: list[Factor] = []
        sources: list[Factor] = []
        drawn: dict[str, np.ndarray] | None = None
        while waiting:
            ready = [(v, f) for v in waiting if (f := self._source(v, waiting, added)) is not None]
            if not ready:
                raise ValueError(f"nothing says where {', '.join(waiting)} might be")
            # What is determined first, so that beacons are drawn from poses, each kernel's its own.
            v, source = min(ready, key=lambda pair: pair[0] in self._given)
            towards = source.variables.index(v)
            values = [self._points.values.get(u, np.zeros((1, self.graph.kinds[u].dim))) for u in source.variables]
            if v not in self._given:
                strata_here = np.zeros(max(len(x) for x in values))
            elif self.graph.kinds[v] is LABEL:
                # By the odds of its mixture, which the density leaves out.
                strata_here = self._rng.permutation(strata)
            else:
                strata_here = self._rng.permutation(strata)
                if drawn is None:
                    known = [f for f in self.graph.factors if not set(waiting) & set(f.variables)]
                    with self._only(known):
                        drawn = down(self.graph, self.tree, self._pass(), self._given, self.kernels, self._rng)
                values = [drawn.get(u, x) for u, x in zip(source.variables, values, strict=True)]
            self._points.set(v, source.sample(towards, values, strata_here, self._rng))
            waiting.remove(v)
            if v in self._given and self.graph.kinds[v] is not LABEL:
                values[towards] = self._points.values[v]
                proposal = source.log_proposal(towards, values)
                if proposal is None:
                    sources.append(source)
                else:
                    log_q = log_q + proposal
        if sources:
            log_q = log_q + self._evidence_of([*known, *sources]) - self._evidence_of(known)
        return log_q

    def _source(self, v: str, waiting: list[str], added: list[Factor]) -> Factor | None:
        """A factor that can draw v from what is known; one that determines it where there is one."""
        able = [f for f in added if v in f.variables and all(u == v or u not in waiting for u in f.variables)]
        if self.graph.kinds[v] is LABEL:
            return next((f for f in added if f.variables[-1] == v), None)
        if v in self._given:
            return next(iter(able), None)
        return next((f for f in able if v in f.determined), None)

    @contextmanager
    def _only(self, factors: list[Factor]) -> Iterator[None]:
        """The graph as if it had these factors alone."""
        kept = self.graph.factors, self.tree, self._propagation
        scopes = [f.variables for f in factors]
        named = list(dict.fromkeys(v for scope in scopes for v in scope))
        self.graph.factors, self._propagation = factors, Propagation()
        self.tree = tree(scopes, order(named, scopes, [v for v in named if v in self._given]))
        try:
            yield
        finally:
            self.graph.factors, self.tree, self._propagation = kept

    def _evidence_of(self, factors: list[Factor]) -> np.ndarray:
        """The evidence (N,) of these factors alone."""
        with self._only(factors):
            return self._settle(LONG_SETTLINGS)

    # -- evidence

    def _pass(self) -> Up:
        self._up = self._propagation.up(self.graph, self.tree, self._points, self._given)
        return self._up

    def _curved(self) -> list[str]:
        """Variables, other than the kernels' own, whose factors depend on where they are linearized."""
        return list(
            dict.fromkeys(v for f in self.graph.factors if not f.linear for v in f.variables if v not in self._given)
        )

    def _settle(self, most: int = SETTLINGS) -> np.ndarray:
        """Move the points of linearization to the mode of the poses given each kernel, in at most so many steps.

        The evidence (N,) there. Away from the mode it is too high, so where a kernel's poses go to and fro between two
        points (an array's records may fit two peaks each) it is that of the lesser.
        """
        curved, up = self._curved(), self._pass()
        evidence = before = now = self._of_all(up)
        for n in range(most):
            mean = down(self.graph, self.tree, up, self._given, self.kernels, None)
            moved = [v for v in curved if np.abs(mean[v] - self._points.values[v]).max() > SETTLED]
            if not moved:
                break
            for v in moved:
                self._points.set(v, mean[v])
            up = self._pass()
            earlier, before, now = before, now, self._of_all(up)
            evidence = np.minimum(before, now) if n else now
            if min(np.abs(now - before).max(), np.abs(now - earlier).max() if n > 1 else np.inf) < SETTLED_NATS:
                break
        return evidence

    def _of_all(self, up: Up) -> np.ndarray:
        """The evidence (N,) of a pass, for each kernel."""
        return np.broadcast_to(up.log_evidence, (self.kernels,)).copy()

    def _evenly(self) -> np.ndarray:
        """Numbers (N,) of kernels, each about as often as its weight says (systematic resampling)."""
        weights = np.exp(self._log_weight - self._log_weight.max())
        aims = (np.arange(self.kernels) + self._rng.random()) / self.kernels
        return np.minimum(np.searchsorted(np.cumsum(weights / weights.sum()), aims), len(weights) - 1)

    def _take(self, kept: np.ndarray) -> None:
        """Keep these kernels (N,), numbers that may repeat."""
        self._points.take(kept)
        self._evidence, self._log_weight = self._evidence[kept], self._log_weight[kept]
        self._past = {v: drawn[kept] for v, drawn in self._past.items()}
        self.graph.factors = [f.taken(kept) for f in self.graph.factors]

    # -- forgetting

    def _forget(self, lag: int) -> None:
        """Marginalize all but the newest poses, each kernel's about the mode given its beacons."""
        old = [v for v in self.graph.kinds if v not in self._given][:-lag]
        if not old:
            return
        drawn = self._draws()
        self._past |= {v: drawn[v] for v in old}
        self._settle()
        while old:
            gone, old = old[:AT_ONCE], old[AT_ONCE:]
            told = [i for i, f in enumerate(self.graph.factors) if set(gone) & set(f.variables)]
            named = {v for i in told for v in self.graph.factors[i].variables}
            labels = {v for v in named if self.graph.kinds[v] is LABEL}
            rest = [v for v in self.graph.kinds if v in named and v not in labels and v not in gone]
            _, message = Propagation().eliminate(
                self.graph, gone, tuple(rest), told, [], self._points, frozenset(labels)
            )
            at = [self._points.values[v] for v in rest]
            self.graph.forget([*gone, *labels], remembered(rest, at, message.Lam, message.eta))
        self._given -= {v for v in self._given if v not in self.graph.kinds}
        for v in self._points.values.keys() - self.graph.kinds.keys():
            self._points.drop(v)
        self._propagation, self.tree = Propagation(), BayesTree([], {})
        self._grow({}, [])
        self._evidence = self._settle(LONG_SETTLINGS)

    # -- moves

    def _sweep(self, anew: bool) -> float:
        taken = []
        beacons = self.beacons
        if beacons:
            taken.append(self._cross(beacons))
        for beacon in beacons if anew else []:
            factors = [f for f in map(self.graph.factors.__getitem__, self.graph.of(beacon)) if not f.costly]
            if factors:
                taken.append(self._redraw(beacon, factors))
        for label in [v for v in self._given if self.graph.kinds[v] is LABEL]:
            self._relabel(label)
        return float(np.mean(taken)) if taken else 1.0

    def _try(self, proposed: dict[str, np.ndarray], odds: Callable[[], np.ndarray] | None = None) -> float:
        """Propose values; keep each kernel's where its evidence and the odds of the way back (log, N) say so."""
        old, before = dict(self._points.values), self._evidence
        for v, value in proposed.items():
            self._points.set(v, value)
        after = self._settle()
        gain = after - before
        if odds is not None:
            gain = gain + odds()
        keep = np.log(self._rng.random(self.kernels)) < np.where(np.isfinite(gain), gain, -np.inf)
        for v, value in self._points.values.items():
            if value is not old[v]:
                self._points.set(v, np.where(keep[:, None], value, old[v]))
        self._evidence = np.where(keep, after, before)
        return float(keep.mean())

    def _cross(self, beacons: list[str]) -> float:
        """Step all beacons by the difference of two kernels (differential evolution, ter Braak 2006), or by chance."""
        N = self.kernels
        state = np.concatenate([self._points.values[b] for b in beacons], axis=-1)
        a, b = self._rng.integers(N, size=N), self._rng.integers(N, size=N)
        scale = np.where(self._rng.random(N) < 0.2, 1.0, 2.38 / np.sqrt(2 * state.shape[-1]))
        own = np.exp(self._rng.uniform(*np.log(STEPS_M), size=N))[:, None] * self._rng.standard_normal(state.shape)
        others = scale[:, None] * (state[a] - state[b]) + STEPS_M[0] * self._rng.standard_normal(state.shape)
        moved = state + np.where(self._rng.random((N, 1)) < OWN_STEPS, own, others)
        parts = np.split(moved, np.cumsum([self.graph.kinds[b].dim for b in beacons])[:-1], axis=-1)
        return self._try(dict(zip(beacons, parts, strict=True)))

    def _relabel(self, label: str) -> None:
        """Another component, by its odds; the evidence decides."""
        factor = next(f for f in self.graph.factors if f.variables[-1] == label)
        values = [self._points.values[v] for v in factor.variables]
        drawn = factor.sample(len(values) - 1, values, self._rng.random(self.kernels), self._rng)
        self._try({label: drawn})

    def _redraw(self, beacon: str, factors: list[Factor]) -> float:
        """Draw a beacon from kernels around the places that factors on it, given the poses, agree on."""
        source = factors[self._rng.integers(len(factors))]
        if len(factors) > REFINERS:
            factors = [factors[i] for i in self._rng.choice(len(factors), REFINERS, replace=False)]
        seed = int(self._rng.integers(2**32))

        def around() -> Around:
            return Around(beacon, source, factors, self._points, self.kernels, np.random.default_rng(seed))

        now = around()
        proposed = now.draw(self._rng)
        current = self._points.values[beacon]
        there = now.log_density(proposed)
        return self._try({beacon: proposed}, lambda: around().log_density(current) - there)
