"""Jobs, their events and their finished shards in SQLite: committed means kept."""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from server.wire import dumps

FINAL = frozenset({"done", "failed", "cancelled"})

#: What takes the database from each version of its schema to the next, in order; add to the end, change nothing.
MIGRATIONS = (
    """
CREATE TABLE jobs (
    id TEXT PRIMARY KEY, state TEXT NOT NULL, title TEXT NOT NULL, scenario TEXT, family TEXT NOT NULL,
    algorithms TEXT NOT NULL, trials INTEGER NOT NULL, seed INTEGER NOT NULL,
    created_at TEXT NOT NULL, started_at TEXT, finished_at TEXT,
    progress REAL NOT NULL, error TEXT, notes TEXT NOT NULL,
    toml TEXT NOT NULL, origin TEXT NOT NULL,
    idempotency_key TEXT UNIQUE, digest TEXT NOT NULL
);
CREATE TABLE events (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    job TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE, kind TEXT NOT NULL, data TEXT NOT NULL
);
CREATE INDEX events_of_job ON events(job, id);
CREATE TABLE shards (
    job TEXT NOT NULL REFERENCES jobs(id) ON DELETE CASCADE, number INTEGER NOT NULL,
    PRIMARY KEY (job, number)
);
""",
    # Blocks of trials were cut differently before, so the shards of unfinished jobs are computed again.
    """
ALTER TABLE jobs ADD COLUMN client TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN purpose TEXT NOT NULL DEFAULT 'run';
ALTER TABLE jobs ADD COLUMN limit_s REAL;
ALTER TABLE jobs ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN lost TEXT NOT NULL DEFAULT '[]';
DELETE FROM shards;
ALTER TABLE shards ADD COLUMN sha256 TEXT NOT NULL DEFAULT '';
ALTER TABLE shards ADD COLUMN lost TEXT;
CREATE TABLE rates (
    algorithm TEXT NOT NULL, family TEXT NOT NULL, work REAL NOT NULL, seconds REAL NOT NULL,
    PRIMARY KEY (algorithm, family)
);
""",
    """
ALTER TABLE jobs ADD COLUMN tags TEXT NOT NULL DEFAULT '[]';
ALTER TABLE jobs ADD COLUMN changes TEXT NOT NULL DEFAULT '{}';
""",
    """
CREATE TABLE notes (key TEXT PRIMARY KEY, value TEXT NOT NULL)
""",
    """
ALTER TABLE jobs ADD COLUMN keep TEXT NOT NULL DEFAULT 'tracks'
""",
    """
ALTER TABLE jobs ADD COLUMN rmse_m TEXT NOT NULL DEFAULT '{}'
""",
)
VERSION = len(MIGRATIONS)


@dataclass(frozen=True)
class Job:
    """A job as the store has it; `public` is what its owner sees.

    purpose is "run" or "what-if", which goes before others; limit_s bounds the time it may run; lost tells of the
    shards that were given up: {"algorithm", "trials", "seed", "tries", "reason"} each. tags and pinned are its owner's
    marks; changes are the values by key path that its scenario was given on submission. keep is "tracks", or
    "statistics" where of most trials only figures over them are kept. rmse_m tells each algorithm's error by subject
    once the job is done, where there was something to compare with.
    """

    id: str
    state: str
    title: str
    scenario: str | None
    family: str
    algorithms: list[str]
    trials: int
    seed: int
    created_at: str
    toml: str
    digest: str
    origin: str = ""
    idempotency_key: str | None = None
    started_at: str | None = None
    finished_at: str | None = None
    progress: float = 0.0
    error: dict[str, str] | None = None
    notes: list[str] = field(default_factory=list)
    client: str = ""
    purpose: str = "run"
    limit_s: float | None = None
    pinned: bool = False
    lost: list[dict[str, Any]] = field(default_factory=list)
    tags: list[str] = field(default_factory=list)
    changes: dict[str, Any] = field(default_factory=dict)
    keep: str = "tracks"
    rmse_m: dict[str, dict[str, float]] = field(default_factory=dict)

    def public(self) -> dict[str, Any]:
        """The job as REST shows it."""
        hidden = {"toml", "digest", "origin", "idempotency_key", "client"}
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in hidden}


@dataclass(frozen=True)
class Event:
    """Something that happened to a job: an ever increasing id, a kind, and JSON text."""

    id: int
    kind: str
    data: str


_JSON = {"algorithms", "error", "notes", "lost", "tags", "changes", "rmse_m"}
_FINAL = ",".join(f"'{state}'" for state in sorted(FINAL))
_COLUMNS = [f.name for f in fields(Job)]


class Store:
    """The database in a file; safe to use from any thread."""

    def __init__(self, path: Path) -> None:
        self._lock, self._read_lock = threading.RLock(), threading.RLock()
        self._db, self._reader = _connect(path), _connect(path)
        try:
            for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=5000"):
                self._db.execute(f"PRAGMA {pragma}")
            self._migrate(path)
            self._reader.execute("PRAGMA query_only=ON")
        except BaseException:
            self.close()
            raise

    def _migrate(self, path: Path) -> None:
        """Take the database to the newest schema, one whole step at a time; a later version's is left alone."""
        found = self._db.execute("PRAGMA user_version").fetchone()[0]
        if found > VERSION:
            raise RuntimeError(f"{path} was written by a later version of coopnav (schema {found}, here {VERSION})")
        for version in range(found, VERSION):
            with self._transaction() as db:
                for statement in MIGRATIONS[version].split(";"):
                    db.execute(statement)
                db.execute(f"PRAGMA user_version={version + 1}")

    def close(self) -> None:
        with self._lock, self._read_lock:
            self._reader.close()
            self._db.close()

    def consistent(self) -> bool:
        """Whether the whole file is as SQLite writes it; reads all of it."""
        with self._lock:
            found = self._db.execute("PRAGMA integrity_check(1)").fetchall()
            return [row[0] for row in found] == ["ok"] and not self._db.execute("PRAGMA foreign_key_check").fetchall()

    def noted(self, key: str) -> str | None:
        """What was noted of the store itself."""
        with self._reading() as db:
            row = db.execute("SELECT value FROM notes WHERE key=?", (key,)).fetchone()
        return row["value"] if row is not None else None

    def note(self, key: str, value: str) -> None:
        with self._transaction() as db:
            db.execute("INSERT OR REPLACE INTO notes VALUES (?,?)", (key, value))

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """For a statement that sees what was committed, without waiting for the disk to take what is being written."""
        with self._read_lock:
            yield self._reader

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield self._db
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:  # a full disk has ended it already
                    self._db.execute("ROLLBACK")
                raise

    def add(self, job: Job) -> tuple[Job, bool]:
        """Keep a new job and its first event; the earlier job and False where its idempotency key is known."""
        with self._transaction() as db:
            if job.idempotency_key is not None:
                row = db.execute("SELECT * FROM jobs WHERE idempotency_key=?", (job.idempotency_key,)).fetchone()
                if row is not None:
                    return _job(row), False
            values = [_text(name, getattr(job, name)) for name in _COLUMNS]
            places = ",".join("?" * len(_COLUMNS))
            db.execute(f"INSERT INTO jobs ({','.join(_COLUMNS)}) VALUES ({places})", values)
            _append(db, job.id, "state", dumps(job.public()))
        return job, True

    def job(self, id: str) -> Job | None:
        with self._reading() as db:
            row = db.execute("SELECT * FROM jobs WHERE id=?", (id,)).fetchone()
        return _job(row) if row is not None else None

    def keyed(self, key: str) -> Job | None:
        """The job accepted under an idempotency key."""
        with self._reading() as db:
            row = db.execute("SELECT * FROM jobs WHERE idempotency_key=?", (key,)).fetchone()
        return _job(row) if row is not None else None

    def jobs(self, limit: int = 200) -> list[Job]:
        """The newest jobs first."""
        with self._reading() as db:
            rows = db.execute("SELECT * FROM jobs ORDER BY rowid DESC LIMIT ?", (limit,)).fetchall()
        return [_job(row) for row in rows]

    def counts(self) -> dict[str, int]:
        """How many jobs there are in each state."""
        with self._reading() as db:
            rows = db.execute("SELECT state, count(*) AS n FROM jobs GROUP BY state").fetchall()
        return {row["state"]: row["n"] for row in rows}

    def unfinished(self) -> list[Job]:
        """Accepted jobs without an end, oldest first."""
        with self._reading() as db:
            rows = db.execute("SELECT * FROM jobs WHERE state IN ('queued','running') ORDER BY rowid").fetchall()
        return [_job(row) for row in rows]

    def ended(self) -> list[Job]:
        """Jobs with an end, oldest first."""
        with self._reading() as db:
            rows = db.execute(f"SELECT * FROM jobs WHERE state IN ({_FINAL}) ORDER BY rowid").fetchall()
        return [_job(row) for row in rows]

    def run_again(self, id: str) -> None:
        """Take a job back to its beginning: its results are lost."""
        with self._transaction() as db:
            db.execute("UPDATE jobs SET state='queued', progress=0, finished_at=NULL, error=NULL WHERE id=?", (id,))
            db.execute("DELETE FROM shards WHERE job=?", (id,))
            row = db.execute("SELECT * FROM jobs WHERE id=?", (id,)).fetchone()
            _append(db, id, "state", dumps(_job(row).public()))

    def drop(self, id: str) -> bool:
        """Delete a job that has ended and is not pinned; whether it was."""
        with self._transaction() as db:
            done = db.execute(f"DELETE FROM jobs WHERE id=? AND pinned=0 AND state IN ({_FINAL})", (id,))
            return done.rowcount > 0

    def change(self, id: str, **values: Any) -> Job | None:
        """Change a job and tell so in a state event; None where it is gone or already at its end."""
        with self._transaction() as db:
            row = db.execute("SELECT * FROM jobs WHERE id=?", (id,)).fetchone()
            if row is None or row["state"] in FINAL:
                return None
            sets = ",".join(f"{name}=?" for name in values)
            db.execute(f"UPDATE jobs SET {sets} WHERE id=?", [*(_text(n, v) for n, v in values.items()), id])
            job = _job(db.execute("SELECT * FROM jobs WHERE id=?", (id,)).fetchone())
            _append(db, id, "state", dumps(job.public()))
        return job

    def mark(self, id: str, **marks: Any) -> Job | None:
        """Set tags or pinned, which may change after a job's end; None where it is gone."""
        with self._transaction() as db:
            for name, value in marks.items():
                db.execute(f"UPDATE jobs SET {name}=? WHERE id=?", (_text(name, value), id))
            row = db.execute("SELECT * FROM jobs WHERE id=?", (id,)).fetchone()
        return _job(row) if row is not None else None

    def delete(self, id: str) -> None:
        with self._transaction() as db:
            db.execute("DELETE FROM jobs WHERE id=?", (id,))

    def finish_shard(self, id: str, number: int, sha256: str, progress: float) -> None:
        """Keep that a shard's file is complete, and its checksum; nothing where the job has ended."""
        self._end_shard(id, number, sha256, None, progress)

    def lose_shard(self, id: str, number: int, lost: dict[str, Any], progress: float) -> None:
        """Keep that a shard was given up, and what of."""
        self._end_shard(id, number, "", dumps(lost), progress)

    def _end_shard(self, id: str, number: int, sha256: str, lost: str | None, progress: float) -> None:
        with self._transaction() as db:
            row = db.execute("SELECT state FROM jobs WHERE id=?", (id,)).fetchone()
            if row is None or row["state"] in FINAL:
                return
            db.execute(
                "INSERT OR REPLACE INTO shards (job, number, sha256, lost) VALUES (?,?,?,?)", (id, number, sha256, lost)
            )
            db.execute("UPDATE jobs SET progress=max(progress,?) WHERE id=?", (progress, id))

    def forget_shard(self, id: str, number: int) -> None:
        """A finished shard's file turned out to be damaged: it has to run again."""
        with self._transaction() as db:
            db.execute("DELETE FROM shards WHERE job=? AND number=?", (id, number))

    def shards(self, id: str) -> dict[int, str]:
        """Shards whose files are complete, by number in order, with the files' checksums."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT number, sha256 FROM shards WHERE job=? AND lost IS NULL ORDER BY number", (id,)
            ).fetchall()
        return {row["number"]: row["sha256"] for row in rows}

    def lost(self, id: str) -> dict[int, dict[str, Any]]:
        """Shards that were given up, by number in order, with what is known of each."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT number, lost FROM shards WHERE job=? AND lost IS NOT NULL ORDER BY number", (id,)
            ).fetchall()
        return {row["number"]: json.loads(row["lost"]) for row in rows}

    def worked(self, algorithm: str, family: str, work: float, seconds: float) -> None:
        """Learn from a finished shard what work (trials x subjects x mission seconds) costs; the past fades."""
        with self._transaction() as db:
            db.execute(
                "INSERT INTO rates VALUES (?,?,?,?) ON CONFLICT DO UPDATE "
                "SET work=0.9*work+excluded.work, seconds=0.9*seconds+excluded.seconds",
                (algorithm, family, work, seconds),
            )

    def rates(self, family: str) -> dict[str, float]:
        """Worker seconds that a unit of work costs in a family, by algorithm, as far as it has been seen."""
        with self._reading() as db:
            rows = db.execute("SELECT * FROM rates WHERE family=?", (family,)).fetchall()
        return {row["algorithm"]: row["seconds"] / row["work"] for row in rows if row["work"] > 0}

    def append(self, events: Iterable[tuple[str, str, str]]) -> None:
        """Keep events (job, kind, JSON text) in one commit; those of a job since ended or deleted are dropped."""
        with self._transaction() as db:
            for job, kind, data in events:
                row = db.execute("SELECT state FROM jobs WHERE id=?", (job,)).fetchone()
                if row is not None and row["state"] not in FINAL:
                    _append(db, job, kind, data)

    def events(self, id: str, after: int = 0, limit: int = 100) -> list[Event]:
        """The next events of a job after an event id."""
        with self._reading() as db:
            rows = db.execute(
                "SELECT id, kind, data FROM events WHERE job=? AND id>? ORDER BY id LIMIT ?", (id, after, limit)
            ).fetchall()
        return [Event(row["id"], row["kind"], row["data"]) for row in rows]


def _connect(path: Path) -> sqlite3.Connection:
    db = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
    db.row_factory = sqlite3.Row
    return db


def _append(db: sqlite3.Connection, job: str, kind: str, data: str) -> None:
    db.execute("INSERT INTO events (job, kind, data) VALUES (?,?,?)", (job, kind, data))


def _text(name: str, value: Any) -> Any:
    return dumps(value) if name in _JSON and value is not None else value


def _job(row: sqlite3.Row) -> Job:
    values = {name: row[name] for name in _COLUMNS}
    for name in _JSON:
        if values[name] is not None:
            values[name] = json.loads(values[name])
    values["pinned"] = bool(values["pinned"])
    return Job(**values)
