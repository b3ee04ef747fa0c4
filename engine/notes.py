"""What an estimator noticed and a person should know, with figures that blocks of trials join into one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


class Least(float):
    """A figure of which the smallest over all trials is told."""


class Most(float):
    """A figure of which the largest over all trials is told."""


class Example(str):
    """One of several: the first over all trials is told."""


#: A name, a count (which adds up over trials), or another figure.
Figure = str | int | Least | Most | Example
_NAMED = {kind.__name__: kind for kind in (Least, Most, Example)}


@dataclass(frozen=True, init=False)
class Note:
    """Words with a place for each of the figures: Note("refused {} ranges of {}", 5, "ship")."""

    words: str
    figures: tuple[Figure, ...]

    def __init__(self, words: str, *figures: Figure) -> None:
        object.__setattr__(self, "words", words)
        object.__setattr__(self, "figures", figures)

    def __str__(self) -> str:
        return self.words.format(*self.figures)

    def about(self, name: str) -> Note:
        """The same of somebody."""
        return Note("{}: " + self.words, name, *self.figures)

    def plain(self) -> list[Any]:
        """The note in JSON's types."""
        return [self.words, *([type(f).__name__, f] if type(f) in _NAMED.values() else f for f in self.figures)]


def of_plain(written: list[Any]) -> Note:
    """The note that `Note.plain` wrote."""
    words, *figures = written
    return Note(words, *(_NAMED[f[0]](f[1]) if isinstance(f, list) else f for f in figures))


def join(notes: Iterable[Note | str]) -> tuple[Note, ...]:
    """The notes of several blocks of trials, each kind once, in the order they were first made."""
    kinds: dict[tuple[str, ...], Note] = {}
    for given in notes:
        note = Note("{}", given) if isinstance(given, str) else given
        kind = (note.words, *(f for f in note.figures if isinstance(f, str) and not isinstance(f, Example)))
        had = kinds.get(kind)
        kinds[kind] = note if had is None else Note(note.words, *map(_joined, had.figures, note.figures))
    return tuple(kinds.values())


def _joined(a: Any, b: Any) -> Figure:
    if isinstance(a, str):
        return a
    if isinstance(a, float):
        return min(a, b) if isinstance(a, Least) else max(a, b)
    return a + b
