"""Sum-product on the Bayes tree, for all kernels at once (C19 eqs. 4.93-4.95).

A kernel is one joint value of the ambiguous variables (beacons). Given it, every factor is linearized at that
kernel's own point, so that a clique's density over its remaining variables is Gaussian and a message is an
information matrix, vector and constant over the separator *jointly*. Nothing is smoothed between messages, hence no
excess of variance can pile up along a chain; what is non-Gaussian lives in the kernels and in their linearizations.

Messages and conditionals say about which points they are written, so that those of linear factors hold wherever the
kernels' points move: as a beacon is tried elsewhere, only what heard it is asked again, and what lies above.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from engine.slam.bayes_tree import BayesTree
from engine.slam.factors.factor import Factor
from engine.slam.graph import Graph


@dataclass(frozen=True)
class Message:
    """A clique's density over its separator: exp(const - d' Lam d / 2 + eta' d), d the way from `at` (1 or N, D).

    Lam (1 or N, D, D), eta (1 or N, D), const (1 or N,): one where it is the same for all kernels.
    """

    number: int
    at: np.ndarray
    Lam: np.ndarray
    eta: np.ndarray
    const: np.ndarray

    def about(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """eta and const of the same density, written about other points (1 or N, D)."""
        moved = at - self.at
        bent = (self.Lam @ moved[..., None])[..., 0]
        return self.eta - bent, self.const + ((self.eta - 0.5 * bent) * moved).sum(-1)


@dataclass(frozen=True)
class Conditional:
    """[frontals | separator]: mean m - G (separator - at) and covariance half half', shapes as in Message."""

    m: np.ndarray
    at: np.ndarray
    G: np.ndarray
    half: np.ndarray


@dataclass
class Points:
    """Where factors are linearized: values {variable: (1 or N, d)}, and a version that changes with each."""

    values: dict[str, np.ndarray] = field(default_factory=dict)
    versions: dict[str, int] = field(default_factory=dict)
    _counter: count = field(default_factory=lambda: count(1))

    def set(self, variable: str, value: np.ndarray) -> None:
        self.values[variable] = value
        self.versions[variable] = next(self._counter)

    def drop(self, variable: str) -> None:
        del self.values[variable], self.versions[variable]

    def take(self, kept: np.ndarray) -> None:
        """Keep these kernels (N,), numbers that may repeat; points shared by all stay as they are."""
        for variable, value in self.values.items():
            if len(value) > 1:
                self.set(variable, value[kept])


@dataclass(frozen=True)
class Up:
    """An up-pass: the conditionals by clique, the log evidence (1 or N,), and the number of each clique's message."""

    conditionals: list[Conditional]
    log_evidence: np.ndarray
    messages: dict[int, int]


class Propagation:
    """Passes messages over a tree; a clique whose factors, points and incoming messages stayed is not done again."""

    def __init__(self) -> None:
        self._kept: dict[tuple, tuple[Conditional, Message]] = {}
        #: How many messages were made; a clique is done anew whenever its own is.
        self.made = 0

    def up(self, graph: Graph, tree: BayesTree, points: Points, given: frozenset[str]) -> Up:
        """From the leaves to the roots, with the variables `given` (the kernels' own) held at their points."""
        homes: list[list[int]] = [[] for _ in tree.cliques]
        depth = _depths(tree)
        evidence: np.ndarray = np.zeros(1)
        for number, factor in enumerate(graph.factors):
            free = [v for v in factor.variables if v not in given]
            if free:
                homes[max((tree.home[v] for v in free), key=depth.__getitem__)].append(number)
            else:
                evidence = evidence + factor.log_density(*(points.values[v] for v in factor.variables))
        conditionals: list[Conditional] = [None] * len(tree.cliques)  # type: ignore[list-item]
        incoming: list[list[tuple[tuple[str, ...], Message]]] = [[] for _ in tree.cliques]
        kept: dict[tuple, tuple[Conditional, Message]] = {}
        messages: dict[int, int] = {}
        for i in reversed(range(len(tree.cliques))):
            clique = tree.cliques[i]
            frontals = [v for v in clique.frontals if v not in given]
            if not frontals:
                continue
            separator = tuple(v for v in clique.separator if v not in given)
            bending = sorted(v for f in map(graph.factors.__getitem__, homes[i]) for v in _bending(f, given))
            key = (
                tuple(frontals),
                separator,
                tuple(homes[i]),
                tuple(m.number for _, m in incoming[i]),
                tuple((v, points.versions[v]) for v in bending),
            )
            found = self._kept.get(key)
            if found is None:
                found = self.eliminate(graph, frontals, separator, homes[i], incoming[i], points, given)
            kept[key] = found
            conditionals[i], message = found
            messages[i] = message.number
            if separator:
                assert clique.parent is not None
                incoming[clique.parent].append((separator, message))
            else:
                evidence = evidence + message.const
        self._kept = kept
        return Up(conditionals, evidence, messages)

    def eliminate(
        self,
        graph: Graph,
        frontals: list[str],
        separator: tuple[str, ...],
        factors: list[int],
        incoming: list[tuple[tuple[str, ...], Message]],
        points: Points,
        given: frozenset[str],
    ) -> tuple[Conditional, Message]:
        """One clique: factors by number and messages on its variables, to its conditional and its own message."""
        place, D = {}, 0
        for v in (*frontals, *separator):
            place[v] = slice(D, D + graph.kinds[v].dim)
            D = place[v].stop
        F = place[frontals[-1]].stop
        told = [graph.factors[i] for i in factors]
        # Where all is linear any one point serves all kernels.
        alike = not any(v for f in told for v in _bending(f, given)) and all(len(m.eta) == 1 for _, m in incoming)
        at = {v: points.values[v][:1] if alike else points.values[v] for v in place}
        linearized = [
            (f.variables, *f.linearize(*(at[v] if v in at else points.values[v] for v in f.variables))) for f in told
        ]
        shifted = [
            (variables, message.Lam, *message.about(_joined([at[v] for v in variables])))
            for variables, message in incoming
        ]
        n = max([len(e) for _, e, _ in linearized] + [len(eta) for _, _, eta, _ in shifted], default=1)
        curved = max([len(Jv) for _, _, J in linearized for Jv in J if Jv.ndim == 3], default=1)
        rows = sum(e.shape[-1] for _, e, _ in linearized)
        A, residual, row = np.zeros((curved, rows, D)), np.zeros((n, rows)), 0
        for variables, e, J in linearized:
            stop = row + e.shape[-1]
            residual[:, row:stop] = e
            for v, Jv in zip(variables, J, strict=True):
                if v not in given:
                    A[:, row:stop, place[v]] = Jv
            row = stop
        transposed = np.swapaxes(A, -1, -2)
        Lam, eta = transposed @ A, -(transposed @ residual[..., None])[..., 0]
        const = -0.5 * np.square(residual).sum(-1)
        wide = max([len(Lam)] + [len(Lam_in) for _, Lam_in, _, _ in shifted])
        if wide > len(Lam):
            Lam = np.repeat(Lam, wide, axis=0)
        for variables, Lam_in, eta_in, const_in in shifted:
            index = np.concatenate([np.arange(place[v].start, place[v].stop) for v in variables])
            Lam[:, index[:, None], index] += Lam_in
            eta[:, index] += eta_in
            const = const + const_in
        try:
            low = np.linalg.cholesky(Lam[:, :F, :F])
        except np.linalg.LinAlgError:
            raise ValueError(f"nothing determines {', '.join(frontals)}: give it a prior or odometry") from None
        inverse_low = np.linalg.inv(low)
        half = np.swapaxes(inverse_low, -1, -2)
        cov = half @ inverse_low
        G = cov @ Lam[:, :F, F:]
        m = (cov @ eta[:, :F, None])[..., 0]
        const = const + 0.5 * (m * eta[:, :F]).sum(-1)
        const = const - np.log(np.diagonal(low, axis1=-2, axis2=-1)).sum(-1)
        rest = Lam[:, F:, F:] - np.swapaxes(Lam[:, :F, F:], -1, -2) @ G
        onward = eta[:, F:] - (np.swapaxes(G, -1, -2) @ eta[:, :F, None])[..., 0]
        self.made += 1
        beyond = _joined([at[v] for v in separator])
        message = Message(self.made, beyond, 0.5 * (rest + np.swapaxes(rest, -1, -2)), onward, const)
        return Conditional(_joined([at[v] for v in frontals]) + m, beyond, G, half), message


def down(
    graph: Graph,
    tree: BayesTree,
    up: Up,
    given: frozenset[str],
    kernels: int,
    rng: np.random.Generator | None,
) -> dict[str, np.ndarray]:
    """From the roots to the leaves: a joint draw of every variable (N, d) for each kernel, or the mean without rng."""
    found: dict[str, np.ndarray] = {}
    for i, clique in enumerate(tree.cliques):
        frontals = [v for v in clique.frontals if v not in given]
        if not frontals:
            continue
        conditional = up.conditionals[i]
        x = np.broadcast_to(conditional.m, (kernels, conditional.m.shape[-1]))
        separator = [v for v in clique.separator if v not in given]
        if separator:
            away = _joined([found[v] for v in separator]) - conditional.at
            x = x - (conditional.G @ away[..., None])[..., 0]
        if rng is not None:
            x = x + (conditional.half @ rng.standard_normal(x.shape)[..., None])[..., 0]
        start = 0
        for v in frontals:
            found[v] = x[:, start : start + graph.kinds[v].dim]
            start += graph.kinds[v].dim
    return found


def _bending(factor: Factor, given: frozenset[str]) -> Iterator[str]:
    """The variables whose points decide what a factor says of the others, more than where it is written about."""
    return (v for v in factor.variables if v in given or not factor.linear)


def _joined(values: list[np.ndarray]) -> np.ndarray:
    """Values (1 or N, d) side by side (1 or N, D)."""
    if not values:
        return np.zeros((1, 0))
    n = max(map(len, values))
    return np.concatenate([x if len(x) == n else np.broadcast_to(x, (n, x.shape[-1])) for x in values], axis=-1)


def _depths(tree: BayesTree) -> list[int]:
    depths = []
    for clique in tree.cliques:
        depths.append(0 if clique.parent is None else depths[clique.parent] + 1)
    return depths
