"""What the store and the files keep."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
import pytest

from engine.notes import join
from engine.runner import Shard
from engine.tracks import Belief, Innovations, PacketCount, Reference, Samples, Series, Tracks
from server import artifacts
from server import store as store_module
from server.store import MIGRATIONS, Job, Store


def job(id: str, **values) -> Job:
    common = {"state": "queued", "title": "T", "scenario": None, "family": "navigation", "algorithms": ["cekf"]}
    common |= {"trials": 1, "seed": 1, "created_at": "2026-01-01T00:00:00.000Z", "toml": "", "digest": "d"}
    return Job(id=id, **(common | values))


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "jobs.sqlite")


def test_what_was_kept_is_there_after_opening_again(tmp_path: Path):
    first = Store(tmp_path / "jobs.sqlite")
    first.add(job("a", notes=["n"], error={"title": "t", "detail": "d"}))
    first.append([("a", "progress", "{}")])
    first.finish_shard("a", 3, "sum", 0.5)
    first.close()
    again = Store(tmp_path / "jobs.sqlite")
    found = again.job("a")
    assert found is not None and found.notes == ["n"] and found.progress == 0.5
    assert [e.kind for e in again.events("a")] == ["state", "progress"]
    assert again.shards("a") == {3: "sum"}


def test_the_store_is_as_durable_as_sqlite_can_be(store: Store):
    assert store._db.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
    assert store._db.execute("PRAGMA synchronous").fetchone()[0] == 2


def test_a_job_that_has_ended_does_not_change(store: Store):
    store.add(job("a"))
    assert store.change("a", state="cancelled") is not None
    assert store.change("a", state="done") is None
    assert store.change("b", state="done") is None
    found = store.job("a")
    assert found is not None and found.state == "cancelled"


def test_the_unfinished_are_the_accepted_without_an_end(store: Store):
    for id, state in (("a", "queued"), ("b", "done"), ("c", "running"), ("d", "failed")):
        store.add(job(id, state=state))
    assert [j.id for j in store.unfinished()] == ["a", "c"]
    assert [j.id for j in store.jobs()] == ["d", "c", "b", "a"]


def test_events_of_a_deleted_job_are_dropped(store: Store):
    store.add(job("a"))
    store.finish_shard("a", 0, "sum", 0.1)
    store.delete("a")
    store.append([("a", "progress", "{}")])
    assert store.events("a") == [] and store.shards("a") == {}


def test_a_store_of_every_earlier_version_is_brought_up_to_date_with_its_jobs(tmp_path: Path):
    """A database as each version of the schema left it, with a job of that time in it."""
    for version in range(1, len(MIGRATIONS)):
        path = tmp_path / f"{version}.sqlite"
        with sqlite3.connect(path) as db:
            for step in MIGRATIONS[:version]:
                db.executescript(step)
            db.execute(f"PRAGMA user_version={version}")
            db.execute(
                "INSERT INTO jobs (id, state, title, family, algorithms, trials, seed, created_at, progress, notes,"
                " toml, origin, digest) VALUES ('a','done','T','navigation','[\"cekf\"]',3,7,'',1,'[]','','','d')"
            )
        found = Store(path).job("a")
        assert found is not None and (found.state, found.trials, found.algorithms) == ("done", 3, ["cekf"])
        assert found.pinned is False and found.lost == []
        assert Store(path).job("a") == found


def test_a_migration_that_breaks_leaves_the_store_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "jobs.sqlite"
    Store(path).add(job("a"))
    steps = (*MIGRATIONS, "CREATE TABLE extra (x); ALTER TABLE nowhere ADD COLUMN y")
    with monkeypatch.context() as patched:
        patched.setattr(store_module, "MIGRATIONS", steps)
        patched.setattr(store_module, "VERSION", len(steps))
        with pytest.raises(sqlite3.OperationalError, match="nowhere"):
            Store(path)
    again = Store(path)
    assert again.job("a") == job("a")
    assert not again._db.execute("SELECT 1 FROM sqlite_master WHERE name='extra'").fetchall()


def test_a_later_versions_store_is_left_alone(tmp_path: Path):
    path = tmp_path / "jobs.sqlite"
    Store(path).close()
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version=99")
    with pytest.raises(RuntimeError, match="schema 99"):
        Store(path)


def test_a_finished_shard_is_read_back_exactly(tmp_path: Path):
    rng = np.random.default_rng(0)
    T = 4
    mean, cov = rng.normal(size=(2, T, 2)), rng.normal(size=(2, T, 2, 2))
    shard = Shard("cekf", (50, 51))
    reference = Reference(np.arange(4.0), {"a/b": rng.normal(size=(1, T, 2)), "c": rng.normal(size=(2, T, 2))})
    tracks = Tracks(
        beliefs={"a/b": Belief(mean, cov), "c": Belief(-mean, -cov)},
        packets=PacketCount(1, 2, 3, 4, 5),
        samples={"c": Samples(np.array([1.0]), rng.normal(size=(2, 1, 7, 2)))},
        innovations={
            "c": Innovations(np.array([0.5]), np.array([[np.nan], [1.0]]), np.ones((2, 1)), np.array([[True], [False]]))
        },
        series={"correlation/a~c": Series("Correlation", "1", rng.normal(size=(2, T)), ("a/b", "c"))},
        notes=("mind the gap",),
        cpu_s=1.25,
    )
    artifacts.write_shard(tmp_path / "s.npz", shard, reference, tracks)
    shard_, reference_, tracks_ = artifacts.read_shard(tmp_path / "s.npz")
    assert shard_ == shard and tracks_.packets == tracks.packets
    assert (tracks_.notes, tracks_.cpu_s) == (join(tracks.notes), tracks.cpu_s)
    np.testing.assert_array_equal(reference_.time_s, reference.time_s)
    for subject in reference.truth:
        np.testing.assert_array_equal(reference_.truth[subject], reference.truth[subject])
    for room in ("beliefs", "samples", "innovations", "series"):
        mine, theirs = getattr(tracks, room), getattr(tracks_, room)
        assert list(mine) == list(theirs)
        for key in mine:
            for name, value in vars(mine[key]).items():
                np.testing.assert_array_equal(value, getattr(theirs[key], name))


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path):
    path = tmp_path / "result.json"
    artifacts.write_text(path, "old")

    def breaks(file):
        file.write(b"half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        artifacts.write_whole(path, breaks)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
