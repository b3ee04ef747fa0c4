"""What is wrong with a scenario, said to the person who wrote it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One fault: the key path (`network.links[2]`, or a file and line), what was found, and what would be right."""

    key: str
    message: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.key}: {self.message}; {self.remedy}" if self.key else f"{self.message}; {self.remedy}"


class ScenarioError(ValueError):
    """A scenario that cannot be used, with every problem found; str(error) is what a person reads."""

    def __init__(self, problems: Sequence[Problem], origin: str = "") -> None:
        self.problems = list(problems)
        self.origin = origin
        super().__init__(self.problems, origin)

    def __str__(self) -> str:
        lines = [str(p) for p in self.problems]
        if self.origin:
            lines.insert(0, f"{self.origin}:")
        return "\n".join(lines)
