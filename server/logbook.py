"""Recorded logs that a person has uploaded: folders of CSV or PyFG files beside the scenarios that use them."""

from __future__ import annotations

import asyncio
import os
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from engine.mission import pyfg, tables
from engine.scenario.errors import ScenarioError
from server.artifacts import write_whole
from server.problems import Refusal
from server.settings import Settings
from server.shelf import NAME, Shelf

FILE = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\.(csv|tsv|txt|pyfg|fg)")
PYFG = (".pyfg", ".fg")
#: Files of one log, and logs altogether.
MOST_FILES, MOST_LOGS = 64, 500
#: Rows that columns are described by, rows shown, distinct values told.
ROWS, SHOWN, DISTINCT = 20_000, 5, 12


@dataclass(frozen=True)
class Logbook:
    """Logs by name, each a folder where saved scenarios look for theirs; nothing outside is read or written.

    reading: held by the request that reads whole files, for one in memory is enough.
    """

    settings: Settings
    shelf: Shelf
    reading: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(1))

    def entries(self) -> list[dict[str, Any]]:
        """Every log with its files and the saved scenarios that use it."""
        users = self._users()
        return [
            {
                "name": name,
                "files": [{"name": f.name, "bytes": f.stat().st_size} for f in self._files(name)],
                "used_by": users.get(name, []),
            }
            for name in self._names()
        ]

    def describe(self, log: str) -> dict[str, Any]:
        """What is in every file of a log: columns with samples, or robots and points; or what is wrong with it."""
        self._folder(log)
        return {"name": log, "files": [_described(path) for path in self._files(log)]}

    def keep(self, log: str, file: str, body: bytes) -> bool:
        """Keep a file; whether it is a new one. Refusal for what is no name, no text or too much."""
        folder, path = self._path(log, file)
        try:
            text = body.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise _wrong(
                file, f"byte {error.start} is not UTF-8 text", "save it as UTF-8, or export it as CSV"
            ) from None
        if "\0" in text or not text.strip():
            raise _wrong(file, "is empty" if not text.strip() else "is not text", "give a CSV or PyFG file")
        new = not path.exists()
        if new and folder.is_dir() and len(self._files(log)) >= MOST_FILES:
            raise Refusal(422, "files", f"a log holds at most {MOST_FILES} files; join some")
        if not folder.is_dir() and len(self._names()) >= MOST_LOGS:
            raise Refusal(422, "logs", f"{MOST_LOGS} logs are kept already; delete some")
        self._check_room(len(body))
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(path, lambda handle: handle.write(body))
        return new

    def delete(self, log: str) -> None:
        """Forget a log, unless a saved scenario uses it."""
        folder = self._folder(log)
        users = self._users().get(log, [])
        if users:
            raise Refusal(409, "in-use", f"{log} is used by {', '.join(users)}; delete that first")
        shutil.rmtree(folder)

    def root(self, log: str) -> Path:
        """The folder in which a log's folder is; Refusal 404 where there is no such log."""
        return self._folder(log).parent

    def _check_room(self, size: int) -> None:
        kept = sum(f.stat().st_size for name in self._names() for f in self._files(name))
        if kept + size > self.settings.largest_logs:
            raise Refusal(507, "storage", f"the logs may take {self.settings.largest_logs // 10**6} MB; delete some")
        self.shelf.folder.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(self.shelf.folder).free - size < self.settings.least_free_disk:
            raise Refusal(507, "storage", "the disk is full; delete jobs or logs that are no longer needed")

    def _names(self) -> list[str]:
        if not self.shelf.folder.is_dir():
            return []
        entries = sorted(os.scandir(self.shelf.folder), key=lambda e: e.name)
        return [e.name for e in entries if NAME.fullmatch(e.name) and e.is_dir(follow_symlinks=False)]

    def _files(self, log: str) -> list[Path]:
        entries = sorted(os.scandir(self.shelf.folder / log), key=lambda e: e.name)
        return [Path(e.path) for e in entries if FILE.fullmatch(e.name) and e.is_file(follow_symlinks=False)]

    def _folder(self, log: str) -> Path:
        if not NAME.fullmatch(log) or log not in self._names():
            raise Refusal(404, "unknown-log", f"there is no log named {log[:80]!r}")
        return self.shelf.folder / log

    def _path(self, log: str, file: str) -> tuple[Path, Path]:
        if not NAME.fullmatch(log):
            raise _wrong("log", "is no name", "use up to 64 lower-case letters, digits and hyphens")
        if not FILE.fullmatch(file):
            remedy = "use letters, digits, dot, hyphen and underscore, ending in .csv, .tsv, .txt, .pyfg or .fg"
            raise _wrong("file", f"{file[:80]!r} is no name for a file of a log", remedy)
        folder = self.shelf.folder / log
        if folder.is_symlink() or (folder / file).is_symlink():
            raise Refusal(403, "link", "links are not followed")
        return folder, folder / file

    def _users(self) -> dict[str, list[str]]:
        found: dict[str, list[str]] = {}
        for name, shipped in self.shelf.names():
            if not shipped:
                try:
                    mission = getattr(self.shelf.find(name), "mission", None)
                except (ScenarioError, Refusal):
                    continue
                if getattr(mission, "kind", None) == "recorded":
                    found.setdefault(mission.log, []).append(name)  # pyright: ignore[reportOptionalMemberAccess]
        return found


def _wrong(key: str, message: str, remedy: str) -> Refusal:
    problem = {"key": key, "message": message, "remedy": remedy}
    return Refusal(422, "log", f"{key}: {message}; {remedy}", [problem])


def _described(path: Path) -> dict[str, Any]:
    told: dict[str, Any] = {"name": path.name, "bytes": path.stat().st_size}
    try:
        return told | (_graph(path) if path.suffix in PYFG else _sheet(path))
    except ScenarioError as error:
        first = error.problems[0]
        problem = {"key": path.name, "message": first.message, "remedy": first.remedy}
        return told | {"format": "pyfg" if path.suffix in PYFG else "csv", "problem": problem}


def _sheet(path: Path) -> dict[str, Any]:
    sheet = tables.sheet(path, path.name, most=ROWS)
    columns = [_column(name, [row[n].strip() for row in sheet.rows]) for n, name in enumerate(sheet.header)]
    return {"format": "csv", "rows": sheet.count, "columns": columns, "sample": sheet.rows[:SHOWN]}


def _column(name: str, cells: list[str]) -> dict[str, Any]:
    """A column: whether of numbers, their extent and order, and its values where they are few."""
    filled = [c for c in cells if c]
    told: dict[str, Any] = {"name": name, "empty": len(cells) - len(filled)}
    distinct = list(dict.fromkeys(filled))
    if len(distinct) <= DISTINCT:
        told["values"] = [v[:40] for v in distinct]
    try:
        numbers = np.array(filled, dtype=float)
    except ValueError:
        return told | {"kind": "text"}
    if not len(numbers) or not np.isfinite(numbers).all():
        return told | {"kind": "text"}
    ascending = bool((np.diff(numbers) >= 0).all()) and len(filled) == len(cells)
    return told | {"kind": "number", "min": numbers.min(), "max": numbers.max(), "ascending": ascending}


def _graph(path: Path) -> dict[str, Any]:
    graph = pyfg.parse(path)
    poses: dict[str, int] = {}
    for key in graph.poses:
        poses[key[0]] = poses.get(key[0], 0) + 1
    times = [pose[0] for pose in graph.poses.values()]
    ranged = {target for _, target, _ in graph.ranges}
    return {
        "format": "pyfg",
        "robots": poses,
        "points": sorted(key for key in graph.points if key in ranged and key not in graph.priors)[:200],
        "moving_points": sum(key in ranged for key in graph.priors),
        "landmarks": sum(key not in ranged for key in graph.points),
        "odometry": len(graph.odometry),
        "ranges": len(graph.ranges),
        "from_s": min(times),
        "to_s": max(times),
    }
