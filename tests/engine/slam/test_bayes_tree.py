"""The thesis' worked examples: graphs, orders, cliques and separators."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.slam.bayes_tree import BayesTree, tree, untouched
from engine.slam.elimination import order, separators

#: Fig. 4-19: [X2][Z1|X1,X2][Z2|X1,L1][Z3|X2,L1][Z4|L1,L2][Z5|L2,X3].
EXAMPLE = [("x2",), ("x1", "x2"), ("x1", "l1"), ("x2", "l1"), ("l1", "l2"), ("l2", "x3")]
#: Fig. 4-23: nine poses in a row, fixes at both ends, ranges to l1 from x1, x4 and x7.
MARINE = [
    ("x1",),
    ("x9",),
    *((f"x{i}", f"x{i + 1}") for i in range(1, 9)),
    *((f"x{i}", "l1") for i in (1, 4, 7)),
]


def shape(found: BayesTree) -> set[tuple[frozenset[str], tuple[str, ...]]]:
    return {(frozenset(c.frontals), c.separator) for c in found.cliques}


def test_elimination_leaves_the_separators_of_figure_4_20():
    net = dict(separators(EXAMPLE, ["x3", "l2", "l1", "x1", "x2"]))
    assert net == {"x3": ("l2",), "l2": ("l1",), "l1": ("x1", "x2"), "x1": ("x2",), "x2": ()}


def test_the_order_of_figure_4_21_gives_its_root_and_chain():
    """The root {x2, x1, l1} as printed. The figure counts one leaf; Algorithm 5 finds two cliques, since {l1, l2} and
    {l2, x3} are both maximal in the chordal graph."""
    found = tree(EXAMPLE, ["x3", "l2", "l1", "x1", "x2"])
    assert shape(found) == {
        (frozenset({"x2", "x1", "l1"}), ()),
        (frozenset({"l2"}), ("l1",)),
        (frozenset({"x3"}), ("l2",)),
    }


def test_the_order_of_figure_4_22_gives_the_cliques_of_equations_4_87_to_4_89():
    found = tree(EXAMPLE, ["x2", "x3", "x1", "l2", "l1"])
    assert shape(found) == {
        (frozenset({"l1", "l2"}), ()),
        (frozenset({"x1", "x2"}), ("l1",)),
        (frozenset({"x3"}), ("l2",)),
    }
    assert [found.cliques[i].parent for i in range(3)] == [None, 0, 0]


def test_the_beacon_at_the_leaf_of_figure_4_24_talks_to_the_poses_it_was_heard_from():
    sequence = ["l1", "x1", "x9", "x2", "x3", "x8", "x5", "x6", "x4", "x7"]
    found = tree(MARINE, sequence)
    leaf = found.cliques[found.home["l1"]]
    assert (leaf.frontals, set(leaf.separator)) == (["l1"], {"x1", "x4", "x7"})
    parent = found.cliques[leaf.parent]
    assert parent.frontals == ["x1"] and {"x2", "x4", "x7"} == set(parent.separator)
    left = found.cliques[found.home["x9"]]
    assert (left.frontals, left.separator) == (["x9"], ("x8",))


def test_a_new_variable_leaves_the_sibling_clique_of_figure_4_28_as_it_was():
    before = tree(EXAMPLE, ["x2", "x3", "x1", "l2", "l1"])
    grown = tree([*EXAMPLE, ("x3", "x4"), ("x4", "l2")], ["x2", "x4", "x3", "x1", "l2", "l1"])
    kept = (frozenset({"x1", "x2"}), ("l1",))
    assert kept in shape(before) and kept in shape(grown)
    assert (frozenset({"x3"}), ("l2",)) not in shape(grown)
    assert untouched(before, ["x3", "l2"]) == ["x1", "x2"] or untouched(before, ["x3", "l2"]) == ["x2", "x1"]


@settings(max_examples=60, deadline=None)
@given(st.integers(2, 30), st.integers(0, 20), st.integers(0, 10_000))
def test_every_factor_fits_a_clique_and_separators_lie_in_their_parents(size: int, more: int, seed: int):
    rng = np.random.default_rng(seed)
    names = [f"v{i}" for i in range(size)]
    scopes = list(pairwise(names))
    scopes += [tuple(rng.choice(names, 2, replace=False)) for _ in range(more)]
    sequence = order(names, scopes, last=names[-2:])
    assert sorted(sequence) == sorted(names) and sequence[-2:] == names[-2:]
    found = tree(scopes, sequence)
    assert sorted(v for c in found.cliques for v in c.frontals) == sorted(names)
    for scope in scopes:
        assert any(set(scope) <= set(c.variables) for c in found.cliques)
    for clique in found.cliques:
        if clique.parent is not None:
            assert set(clique.separator) <= set(found.cliques[clique.parent].variables)


@settings(max_examples=60, deadline=None)
@given(st.integers(4, 30), st.integers(0, 15), st.integers(0, 10_000))
def test_a_tree_that_grows_keeps_the_cliques_that_no_new_factor_reaches(size: int, more: int, seed: int):
    """Whatever the graph: cliques of untouched variables are the same afterwards, and the order is still one of all."""
    rng = np.random.default_rng(seed)
    names = [f"v{i}" for i in range(size)]
    scopes = list(pairwise(names))
    scopes += [tuple(rng.choice(names, 2, replace=False)) for _ in range(more)]
    before = tree(scopes, order(names, scopes, last=names[-1:]))
    touched = [names[-1], "new", *rng.choice(names, 2)]
    kept = untouched(before, touched)
    assert not set(kept) & set(touched)
    grown = [*scopes, (names[-1], "new"), tuple(touched[-2:])]
    sequence = order([*names, "new"], grown, ["new"], first=names[: size // 2], kept=kept)
    assert sorted(sequence) == sorted([*names, "new"]) and sequence[: len(kept)] == kept
    after = tree(grown, sequence)
    net_before, net_after = dict(separators(scopes, _sequence(before))), dict(separators(grown, sequence))
    for v in kept:
        assert set(net_before[v]) == set(net_after[v])
    for scope in grown:
        assert any(set(scope) <= set(c.variables) for c in after.cliques)


def _sequence(found: BayesTree) -> list[str]:
    """An order that leads to a tree."""
    return [v for clique in reversed(found.cliques) for v in clique.frontals]


def test_what_comes_first_lies_below_the_rest():
    """A chain of which every tenth pose was heard: no pose between two of those is above any of them."""
    names = [f"x{i}" for i in range(100)]
    scopes, heard = list(pairwise(names)), set(names[::10])
    sequence = order(names, scopes, names[-1:], first=set(names) - heard)
    net = dict(separators(scopes, sequence))
    assert all(set(net[v]) <= heard | {names[-1]} for v in heard)
    assert max(map(len, net.values())) <= 2


def test_a_chain_is_ordered_without_fill():
    names = [f"x{i}" for i in range(200)]
    scopes = list(pairwise(names))
    assert max(len(s) for _, s in separators(scopes, order(names, scopes))) <= 2


def test_an_empty_graph_has_an_empty_tree():
    assert order([], []) == [] and tree([], []).cliques == []


@pytest.mark.parametrize("last", [["l1"], ["l1", "l2"]])
def test_what_is_asked_for_stays_at_the_root(last: list[str]):
    found = tree(EXAMPLE, order(["x1", "x2", "x3", "l1", "l2"], EXAMPLE, last))
    assert last[-1] in found.cliques[0].frontals
