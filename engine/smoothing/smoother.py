"""The batch smoother: nonlinear least squares over a graph in order of time (W15 eq. 3).

Gauss-Newton with Levenberg-Marquardt damping where a step would climb; each step is one banded Cholesky. Gross range
errors are dealt with by truncated least squares, approached by graduated non-convexity (Yang et al. 2020).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.smoothing.band import (
    BandInverse,
    Factor,
    Pattern,
    System,
    factorize,
    half_bandwidth,
    solve,
)
from engine.smoothing.graph import Graph

MAX_STEPS = 100
#: A step shorter than this (m, rad, m/s) ends the iteration, unless asked otherwise.
SETTLED = 1e-6
#: Where no step goes downhill any more although less than this part of the cost was to be gained, it is round-off.
NOTHING_LEFT = 1e-9
_DAMPING_STEPS = 12
#: How often ranges are judged anew, and the rest solved again.
MAX_JUDGEMENTS = 10


@dataclass(frozen=True)
class Solution:
    """The most likely x (n,), the Cholesky factor of its information, and how the solver got there.

    weights holds, per group of ranges, 0 for those refused as gross and 1 for the others. status is "converged",
    "steps" (gave up after MAX_STEPS) or "stuck" (no damped step went downhill); cost is the negative log-likelihood
    but for a constant. In a graph that leaves something undetermined there is none: NotPositiveDefinite.
    """

    x: np.ndarray
    factor: Factor
    cost: float
    weights: list[np.ndarray]
    status: str
    steps: int

    def inverse(self, first: int = 0) -> BandInverse:
        """Marginal covariances, of unknowns from `first` on."""
        return BandInverse(self.factor, first)


class _Problem:
    """A graph with its storage patterns, and its constant part assembled once."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        n, m = graph.banded, graph.border
        groups = [f.idx for f in (*graph.gaussians, *graph.betweens, *graph.ranges)]
        width = half_bandwidth(groups, n)
        self.between_patterns = [Pattern.of(b.idx, n, m, width) for b in graph.betweens]
        self.range_patterns = [Pattern.of(r.idx, n, m, width) for r in graph.ranges]
        self.constant = System.zero(n, m, width)
        for g in graph.gaussians:
            self.constant.add(Pattern.of(g.idx, n, m, width), g.matrix, g.vector)

    def cost(self, x: np.ndarray, weights: list[np.ndarray]) -> float:
        """Negative log-likelihood of x but for a constant, with the ranges weighted."""
        graph, d = self.graph, x - self.graph.reference
        total = float(d @ (0.5 * self.constant.times(d) - self.constant.rhs))
        total += sum(b.cost(x) for b in graph.betweens)
        return total + sum(r.cost(x, w) for r, w in zip(graph.ranges, weights))

    def linearize(self, x: np.ndarray, weights: list[np.ndarray]) -> System:
        """The system whose solution is the Gauss-Newton step from x."""
        graph, system = self.graph, self.constant.copy()
        system.rhs -= self.constant.times(x - graph.reference)
        for b, pattern in zip(graph.betweens, self.between_patterns):
            system.add(pattern, *b.linearize(x))
        for r, pattern, w in zip(graph.ranges, self.range_patterns, weights):
            system.add(pattern, *r.linearize(x, w))
        return system


def smooth(
    graph: Graph,
    start: np.ndarray | None = None,
    *,
    weights: list[np.ndarray] | None = None,
    gate_sigma: float | None = None,
    settled: float = SETTLED,
) -> Solution:
    """The most likely unknowns of a graph, from `start` or its reference.

    With gate_sigma ranges whose residual is larger than that many standard deviations count as gross. Where somebody
    already judged them, `weights` says so (per group of ranges, 1 or 0) and the solution starts from there; else it
    starts from all of them, made gradually less convex. Raises NotPositiveDefinite where the factors leave something
    undetermined.
    """
    problem = _Problem(graph)
    x = graph.reference.copy() if start is None else start.copy()
    if gate_sigma is None or not graph.ranges:
        return _descend(problem, x, [np.ones(len(r.value)) for r in graph.ranges], settled=settled)
    if weights is None:
        x, weights = _graduate(problem, x, [np.ones(len(r.value)) for r in graph.ranges], gate_sigma)
    solution = _descend(problem, x, weights, settled=settled)
    for _ in range(MAX_JUDGEMENTS):
        x, judged = solution.x, [_inlying(r.normalized(solution.x), gate_sigma) for r in graph.ranges]
        if all(np.array_equal(w, j) for w, j in zip(weights, judged)):
            break
        weights = judged
        solution = _descend(problem, x, weights, settled=settled)
    return solution


def _inlying(normalized: np.ndarray, gate_sigma: float) -> np.ndarray:
    return (np.abs(normalized) <= gate_sigma).astype(float)


def _descend(
    problem: _Problem,
    x: np.ndarray,
    weights: list[np.ndarray],
    max_steps: int = MAX_STEPS,
    settled: float = SETTLED,
) -> Solution:
    """Gauss-Newton steps until they no longer move, damped where they would climb."""
    cost = problem.cost(x, weights)
    status, steps = "steps", 0
    system = problem.linearize(x, weights)
    factor = factorize(system)
    while steps < max_steps:
        steps += 1
        step = solve(factor, system)
        longest = np.abs(step).max(initial=0.0)
        promised = 0.5 * float(step @ system.rhs)
        tried = problem.cost(x + step, weights)
        damping = 1e-4
        for _ in range(_DAMPING_STEPS):
            if tried <= cost + 1e-9 * abs(cost) + 1e-9:
                break
            damped = system.damped(damping)
            step = solve(factorize(damped), damped)
            tried = problem.cost(x + step, weights)
            damping *= 10.0
        else:
            status = "converged" if promised < NOTHING_LEFT * (1 + abs(cost)) else "stuck"
            break
        x, cost = x + step, tried
        if longest < settled:
            status = "converged"
            break
        system = problem.linearize(x, weights)
        factor = factorize(system)
    return Solution(x, factor, cost, weights, status, steps)


def _graduate(
    problem: _Problem, x: np.ndarray, weights: list[np.ndarray], gate_sigma: float
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Truncated least squares by graduated non-convexity: nearly quadratic first, in the end weights of 0 or 1."""
    graph, c2 = problem.graph, gate_sigma**2
    largest = max(float((r.normalized(x) ** 2).max(initial=0.0)) for r in graph.ranges)
    mu = c2 / (2 * largest - c2) if largest > c2 else np.inf
    while mu < 1e3:
        weights = [_truncated_weight(r.normalized(x) ** 2, c2, mu) for r in graph.ranges]
        x = _descend(problem, x, weights, max_steps=2).x
        mu *= 1.6
    return x, [_inlying(r.normalized(x), gate_sigma) for r in graph.ranges]


def _truncated_weight(square: np.ndarray, c2: float, mu: float) -> np.ndarray:
    """Weights of Yang et al. (2020) eq. 14 for squared residuals, threshold c2 and control parameter mu."""
    between = np.sqrt(c2 * mu * (mu + 1) / np.maximum(square, 1e-12)) - mu
    return np.where(square <= mu / (mu + 1) * c2, 1.0, np.where(square >= (mu + 1) / mu * c2, 0.0, between))
