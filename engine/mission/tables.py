"""Columns of a person's CSV file, checked: every complaint says which file, line and column."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from engine.scenario.errors import Problem, ScenarioError

MAX_ROWS = 3_000_000
PER_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


@dataclass(frozen=True)
class Sheet:
    """One file's rows as text, with the line each came from; `key` is where the scenario names the file.

    count: rows of the file, of which `rows` may be the first ones only.
    """

    key: str
    file: str
    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    count: int

    def fault(self, row: int, column: str, message: str, remedy: str) -> ScenarioError:
        """The error about one cell."""
        return ScenarioError(
            [Problem(self.key, f"{self.file} line {self.lines[row]}, column {column!r}: {message}", remedy)]
        )

    def text(self, column: str) -> list[str]:
        """A column as it stands, without surrounding blanks."""
        at = self._at(column)
        return [row[at].strip() for row in self.rows]

    def numbers(self, column: str, *, empty: bool = False) -> np.ndarray:
        """A column of finite numbers (N,); where `empty` is allowed, an empty cell is NaN."""
        at = self._at(column)
        out = np.empty(len(self.rows))
        for i, row in enumerate(self.rows):
            cell = row[at].strip()
            if empty and not cell:
                out[i] = math.nan
                continue
            try:
                out[i] = float(cell)
            except ValueError:
                found = "is empty" if not cell else f"{cell[:40]!r} is no number"
                raise self.fault(i, column, found, "write a number there, with a point for the decimals") from None
            if not math.isfinite(out[i]):
                raise self.fault(i, column, f"{cell[:40]!r} is not finite", "leave out the row")
        return out

    def times(self, column: str, unit: str, *, repeats: bool = False) -> np.ndarray:
        """A column of times (N,) in seconds, ascending; equal ones only where they may repeat."""
        time_s = self.numbers(column)
        if unit != "s":
            time_s = time_s / PER_SECOND[unit]
        step = np.diff(time_s)
        wrong = np.flatnonzero(step < 0 if repeats else step <= 0)
        if wrong.size:
            row = int(wrong[0]) + 1
            how = "repeats the time before" if step[row - 1] == 0 else "is earlier than the line before"
            raise self.fault(row, column, f"{time_s[row]:.17g} s {how}", "sort the file by time, each time once")
        return time_s

    def sorted_by(self, column: str) -> Sheet:
        """The same rows in order of a column of numbers."""
        order = np.argsort(self.numbers(column), kind="stable").tolist()
        return replace(self, rows=[self.rows[i] for i in order], lines=[self.lines[i] for i in order])

    def _at(self, column: str) -> int:
        try:
            return self.header.index(column)
        except ValueError:
            message = f"{self.file} has no column {column!r}"
            raise ScenarioError([Problem(self.key, message, f"its columns are: {', '.join(self.header)}")]) from None


def sheet(path: Path, key: str, most: int = MAX_ROWS) -> Sheet:
    """Read a file with a header line, separated by comma, semicolon or tab. Raises ScenarioError.

    most: rows to keep; the others are looked at and counted, and take no memory.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            first = file.readline()
            separator = max(",;\t", key=first.count)
            file.seek(0)
            return _rows(csv.reader(file, delimiter=separator), path.name, key, most)
    except UnicodeDecodeError:
        problem = Problem(key, f"{path.name} is not UTF-8 text", "save it as UTF-8")
    except csv.Error as error:
        problem = Problem(key, f"{path.name} is not CSV: {error}", "write one line per reading")
    except OSError as error:
        problem = Problem(key, f"{path.name} cannot be read: {error.strerror}", "check the file")
    raise ScenarioError([problem])


def _rows(reader, file: str, key: str, most: int) -> Sheet:
    header = [h.strip() for h in next(reader, [])]
    rows: list[list[str]] = []
    lines: list[int] = []
    count = 0
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            message = f"{file} line {reader.line_num} has {len(row)} cells, the header {len(header)}"
            raise ScenarioError([Problem(key, message, "give every column a cell")])
        count += 1
        if count > MAX_ROWS:
            raise ScenarioError([Problem(key, f"{file} has more than {MAX_ROWS} rows", "cut the log")])
        if count <= most:
            rows.append(row)
            lines.append(reader.line_num)
    if not rows:
        raise ScenarioError([Problem(key, f"{file} has no rows", "give a header line and at least one row")])
    return Sheet(key, file, header, rows, lines, count)


def stacked(sheet: Sheet, columns: Sequence[str]) -> np.ndarray:
    """Several columns of numbers side by side (N, columns)."""
    return np.stack([sheet.numbers(c) for c in columns], axis=-1)
