"""The Bayes tree: cliques of a Bayes net, with frontal and separator variables (C19 Algorithm 5)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from engine.slam.elimination import separators


@dataclass
class Clique:
    """Frontal variables, in elimination order, given the separator; `parent` and `children` are places in the tree."""

    frontals: list[str]
    separator: tuple[str, ...]
    parent: int | None
    children: list[int] = field(default_factory=list)

    @property
    def variables(self) -> tuple[str, ...]:
        return (*self.frontals, *self.separator)


@dataclass(frozen=True)
class BayesTree:
    """Cliques, parents before children; `home` says in which clique a variable is frontal."""

    cliques: list[Clique]
    home: dict[str, int]

    @property
    def roots(self) -> list[int]:
        return [i for i, c in enumerate(self.cliques) if c.parent is None]


def tree(scopes: Iterable[Sequence[str]], order: Sequence[str]) -> BayesTree:
    """Algorithm 5: conditionals in reverse elimination order join their parent's clique or begin their own.

    The parent holds the first eliminated variable of the separator as a frontal. With the order x3, l2, l1, x1, x2
    of the thesis' Fig. 4-21 this gives three cliques, since {l2, x3} and {l1, l2} are both maximal; the figure's
    caption counts two.
    """
    cliques: list[Clique] = []
    home: dict[str, int] = {}
    for variable, separator in reversed(separators(scopes, order)):
        if not separator:
            home[variable] = len(cliques)
            cliques.append(Clique([variable], (), None))
            continue
        parent = home[separator[0]]
        if set(cliques[parent].variables) == set(separator):
            cliques[parent].frontals.insert(0, variable)
            home[variable] = parent
        else:
            home[variable] = len(cliques)
            cliques[parent].children.append(len(cliques))
            cliques.append(Clique([variable], separator, parent))
    return BayesTree(cliques, home)


def untouched(tree: BayesTree, touched: Iterable[str]) -> list[str]:
    """The variables whose conditionals stay when factors on `touched` are added, in an order that leads to the same.

    A new factor changes the cliques of its variables and those that messages from there pass through (C19 Fig. 4-28).
    """
    changed, stay = {tree.home[v] for v in touched if v in tree.home}, []
    for i in reversed(range(len(tree.cliques))):
        clique = tree.cliques[i]
        if i not in changed:
            stay += clique.frontals
        elif clique.parent is not None:
            changed.add(clique.parent)
    return stay
