"""A factor graph: variables of some kind, and the factors between them (C19 §4.3.1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from engine.slam.factors.factor import Factor
from engine.slam.variables import Kind


@dataclass
class Graph:
    """Variables in order of arrival and the factors that tie them."""

    kinds: dict[str, Kind] = field(default_factory=dict)
    factors: list[Factor] = field(default_factory=list)

    def add(self, kinds: dict[str, Kind], factors: Iterable[Factor]) -> None:
        """Grow by variables and factors; ValueError for a name in use or a factor on an unknown variable."""
        for name in kinds:
            if name in self.kinds:
                raise ValueError(f"the graph has a variable {name!r} already")
        known = self.kinds.keys() | kinds.keys()
        added = list(factors)
        for factor in added:
            for name in factor.variables:
                if name not in known:
                    raise ValueError(f"a {type(factor).__name__} factor names {name!r}, which is no variable")
        self.kinds |= kinds
        self.factors += added

    def forget(self, names: Iterable[str], instead: Factor) -> None:
        """Take variables out, with all factors on them, for which another factor comes first."""
        gone = set(names)
        self.factors = [instead, *(f for f in self.factors if not gone & set(f.variables))]
        self.kinds = {v: kind for v, kind in self.kinds.items() if v not in gone}

    def of(self, variable: str) -> list[int]:
        """Numbers of the factors on a variable."""
        return [i for i, f in enumerate(self.factors) if variable in f.variables]

    def ambiguous(self) -> list[str]:
        """Variables that no factor determines: a beacon known only by ranges may be in several places."""
        determined = {v for f in self.factors for v in f.determined}
        return [v for v in self.kinds if v not in determined]
