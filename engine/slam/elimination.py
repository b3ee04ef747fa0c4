"""From a factor graph to a Bayes net: an elimination order and each variable's separator (C19 §4.3.1)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.linalg import splu


def order(variables: Sequence[str], scopes: Iterable[Sequence[str]], last: Sequence[str] = ()) -> list[str]:
    """An elimination order of small cliques (minimum degree), with `last` at its end in the order given.

    scopes: the variables of each factor. The constraint is CCOLAMD's: what is asked for most, the newest pose and
    the beacons, stays near the root.
    """
    free = [v for v in variables if v not in set(last)]
    at = {v: i for i, v in enumerate(free)}
    inside = [[at[v] for v in scope if v in at] for scope in scopes]
    rows = [i for scope in inside for i in scope for _ in scope]
    columns = [j for scope in inside for _ in scope for j in scope]
    if not free:
        return list(last)
    n = len(free)
    adjacency = coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n)).tocsc()
    adjacency.data[:] = 1.0
    dominant = csc_array(adjacency + (n + 1) * eye_array(n, format="csc"))
    found = splu(dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}).perm_c
    return [free[i] for i in np.argsort(found)] + list(last)


def separators(scopes: Iterable[Sequence[str]], order: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Eliminate variables in order: each with its separator, itself in elimination order (the Bayes net)."""
    position = {v: i for i, v in enumerate(order)}
    waiting: dict[str, list[frozenset[str]]] = {v: [] for v in order}
    for scope in scopes:
        if scope:
            waiting[min(scope, key=position.__getitem__)].append(frozenset(scope))
    net = []
    for v in order:
        rest = frozenset().union(*waiting[v]) - {v} if waiting[v] else frozenset()
        separator = tuple(sorted(rest, key=position.__getitem__))
        net.append((v, separator))
        if separator:
            waiting[separator[0]].append(rest)
    return net
