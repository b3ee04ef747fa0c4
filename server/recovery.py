"""The store as a server finds it: its own, or in a data folder that was copied while a server was running.

A copy of a database in use may be torn. Every job's folder therefore holds a record of the job, written whole before
the job is accepted and again when it ends; and checksums of its results. From these a torn store is made anew, and what
the copy missed of a result is computed again.
"""

from __future__ import annotations

import contextlib
import json
import logging
import shutil
import sqlite3
from dataclasses import asdict, fields
from pathlib import Path

from server import artifacts
from server.store import FINAL, Job, Store

log = logging.getLogger(__name__)

DATABASE, RECORD = "coopnav.sqlite", "job.json"


def write_record(folder: Path, job: Job) -> None:
    """Note in a job's own folder what the store knows of it."""
    folder.mkdir(parents=True, exist_ok=True)
    artifacts.write_json(folder / RECORD, asdict(job))


def open_store(data: Path) -> Store:
    """The store of a data folder; repaired where the folder is a copy, rid of leftovers where it is not.

    Raises RuntimeError for a store of a later version.
    """
    path, folders = data / DATABASE, data / "jobs"
    store = _sound(path)
    place = _place(path)
    if store.noted("place") == place:
        _sweep(store, folders)
        return store
    _adopt(store, folders)
    for job in store.ended():
        if job.state == "done" and not artifacts.sound(folders / job.id):
            log.warning("job %s: its results are not whole; it runs again", job.id)
            store.run_again(job.id)
    store.note("place", place)
    return store


def _sound(path: Path) -> Store:
    """The store of a file; a new one, the file set aside, where it cannot be trusted."""
    existed = path.exists()
    store = None
    with contextlib.suppress(sqlite3.DatabaseError):
        store = Store(path)
        if not existed or store.noted("place") == _place(path) or store.consistent():
            return store
    if store is not None:
        store.close()
    log.error("%s is damaged; it is set aside and made anew from the records of the jobs", path)
    for suffix in ("", "-wal", "-shm"):
        part = path.with_name(path.name + suffix)
        if part.exists():
            part.replace(path.with_name(path.name + ".damaged" + suffix))
    return Store(path)


def _place(path: Path) -> str:
    """Where a file is on its disk: another file, be it a copy, is elsewhere."""
    found = path.stat()
    return f"{found.st_dev}:{found.st_ino}"


def _adopt(store: Store, folders: Path) -> None:
    """Take in the jobs that have a record and are not in the store, and the ends it has missed."""
    for record in sorted(folders.glob(f"*/{RECORD}"), key=lambda p: p.stat().st_mtime_ns):
        known = {f.name for f in fields(Job)}
        try:
            values = json.loads(record.read_text(encoding="utf-8"))
            job = Job(**{k: v for k, v in values.items() if k in known})
        except (ValueError, TypeError) as error:
            log.error("%s cannot be read: %s", record, error)
            continue
        there = store.job(job.id)
        if there is None:
            store.add(job)
        elif there.state not in FINAL and job.state in FINAL:
            store.change(
                job.id,
                state=job.state,
                finished_at=job.finished_at,
                error=job.error,
                notes=job.notes,
                rmse_m=job.rmse_m,
            )


def _sweep(store: Store, folders: Path) -> None:
    """Remove the folders of jobs that were never accepted, or deleted, before the server was killed."""
    for folder in folders.glob("*"):
        if store.job(folder.name) is None:
            shutil.rmtree(folder, ignore_errors=True)
