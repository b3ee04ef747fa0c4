"""From a factor graph to a Bayes net: an elimination order and each variable's separator (C19 §4.3.1)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.linalg import splu


def order(
    variables: Sequence[str],
    scopes: Iterable[Sequence[str]],
    last: Sequence[str] = (),
    *,
    first: Iterable[str] = (),
    kept: Sequence[str] = (),
) -> list[str]:
    """An elimination order of small cliques (minimum degree), with `last` at its end in the order given.

    scopes: the variables of each factor. The constraint is CCOLAMD's: what is asked for most, the newest pose and
    the beacons, stays near the root. `kept` begins the order as it is given; of the others, those in `first` come
    before the rest, so that what changes often lies above what does not.
    """
    early, done = set(first), {*kept, *last}
    stages = ([v for v in variables if v not in done and (v in early) is now] for now in (True, False))
    sequence, left = list(kept), _eliminate(scopes, kept)[1]
    for stage in stages:
        ordered = _minimum_degree(stage, left)
        left = _eliminate(left, ordered)[1]
        sequence += ordered
    return sequence + list(last)


def separators(scopes: Iterable[Sequence[str]], order: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Eliminate variables in order: each with its separator, itself in elimination order (the Bayes net)."""
    return _eliminate(scopes, order)[0]


def _eliminate(
    scopes: Iterable[Iterable[str]], order: Sequence[str]
) -> tuple[list[tuple[str, tuple[str, ...]]], list[frozenset[str]]]:
    """The Bayes net of some variables, and the scopes that are left for the others, in any order after them."""
    position = {v: i for i, v in enumerate(order)}
    waiting: dict[str, list[frozenset[str]]] = {v: [] for v in order}
    left: list[frozenset[str]] = []

    def hand_on(scope: frozenset[str]) -> None:
        following = min((v for v in scope if v in position), key=position.__getitem__, default=None)
        (left if following is None else waiting[following]).append(scope)

    for scope in scopes:
        if scope:
            hand_on(frozenset(scope))
    net = []
    for v in order:
        rest = frozenset().union(*waiting[v]) - {v}
        net.append((v, tuple(sorted(rest, key=lambda u: position.get(u, len(position))))))
        if rest:
            # It holds no variable from before v: what has been eliminated is in no scope any more.
            hand_on(rest)
    return net, left


def _minimum_degree(free: Sequence[str], scopes: Iterable[Iterable[str]]) -> list[str]:
    """These variables in an order of small cliques, as far as the scopes tie them to each other."""
    if not free:
        return []
    at = {v: i for i, v in enumerate(free)}
    inside = [[at[v] for v in scope if v in at] for scope in scopes]
    rows = [i for scope in inside for i in scope for _ in scope]
    columns = [j for scope in inside for _ in scope for j in scope]
    n = len(free)
    adjacency = coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsc()
    adjacency.data[:] = 1.0
    dominant = csc_array(adjacency + (n + 1) * eye_array(n, format="csc"))
    found = splu(dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).perm_c
    return [free[int(i)] for i in np.argsort(found)]
