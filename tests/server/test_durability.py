"""Nothing accepted is lost: full disks are told, damage is noticed, a copied data folder is as good as the first."""

from __future__ import annotations

import errno
import json
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from server import artifacts, recovery
from server.recovery import DATABASE, RECORD
from server.retention import superfluous
from server.settings import Settings
from server.store import Store
from tests.server.living import SHORT, Live, start, until
from tests.server.test_store import job

MANY = SHORT | {"trials": 100, "algorithms": ["dead_reckoning", "cekf"]}


@pytest.fixture(scope="module")
def frail(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    """A server of which these tests may spoil the disk."""
    yield from start(Settings(data=tmp_path_factory.mktemp("frail"), port=0, workers=2))


def figures(live: Live, id: str) -> dict:
    """The numbers of a job's result, without the time they took."""
    told = live.http.get(f"/api/jobs/{id}/result").json()["algorithms"]
    return {name: (answer["subjects"], answer["packets"]) for name, answer in told.items()}


def test_a_store_without_room_accepts_nothing_and_says_so(frail: Live):
    """SQLite's own limit of pages stands for the disk's."""
    store = frail.app.state.site.jobs.store
    before = frail.http.get("/api/jobs").json(), sorted((frail.settings.data / "jobs").glob("*"))
    pages = store._db.execute("PRAGMA page_count").fetchone()[0]
    store._db.execute(f"PRAGMA max_page_count={pages}")
    try:
        answers = [frail.http.post("/api/jobs", json=SHORT | {"seed": n}) for n in range(40)]
    finally:
        store._db.execute("PRAGMA max_page_count=1073741823")
    refused = [a for a in answers if a.status_code != 202]
    assert refused and all(a.status_code == 507 and a.json()["type"] == "urn:coopnav:storage" for a in refused)
    accepted = {a.json()["id"] for a in answers if a.status_code == 202}
    assert {j["id"] for j in frail.http.get("/api/jobs").json()} == {j["id"] for j in before[0]} | accepted
    assert {p.name for p in (frail.settings.data / "jobs").glob("*")} == {p.name for p in before[1]} | accepted
    for id in accepted:
        assert frail.finished(id)["state"] == "done"


def test_a_job_on_a_full_disk_fails_in_words_and_leaves_nothing_half_written(frail: Live, monkeypatch):
    whole = artifacts.write_arrays

    def full(path: Path, arrays: dict) -> str:
        def breaks(file):
            file.write(b"half")
            raise OSError(errno.ENOSPC, "No space left on device")

        return artifacts.write_whole(path, breaks) if path.name.startswith("shard-3") else whole(path, arrays)

    with monkeypatch.context() as patched:
        patched.setattr(artifacts, "write_arrays", full)
        told = frail.finished(frail.submit(MANY)["id"])
    assert told["state"] == "failed" and told["error"]["title"] == "The disk is full"
    folder = frail.settings.data / "jobs" / told["id"]
    until(lambda: {p.name for p in folder.iterdir()} == {RECORD, "outline.json"}, "nothing but the record")
    frail.done(SHORT)


def test_the_end_of_a_job_is_recorded_when_there_is_room_again(frail: Live, monkeypatch):
    """The store takes nothing for a while after the job was accepted."""
    store = frail.app.state.site.jobs.store
    refused = []

    def full(*_arguments, **_values):
        refused.append(1)
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patched:
        for name in ("change", "append", "finish_shard"):
            patched.setattr(store, name, full)
        id = frail.submit(SHORT)["id"]
        until(lambda: len(refused) > 4, "attempts to record")
    told = frail.finished(id)
    assert told["state"] == "failed" and told["error"]["title"] == "The disk is full"


def test_too_little_room_for_a_result_is_refused_beforehand(frail: Live, monkeypatch):
    jobs = frail.app.state.site.jobs
    monkeypatch.setattr(jobs, "_settings", Settings(data=frail.settings.data, least_free_disk=2**60))
    answer = frail.http.post("/api/jobs", json=SHORT)
    assert answer.status_code == 507 and "GB left" in answer.json()["detail"]


def test_a_damaged_result_is_not_served(frail: Live):
    id = frail.done(SHORT)["id"]
    folder = frail.settings.data / "jobs" / id
    assert artifacts.sound(folder)
    for name, paths in (
        ("arrays.npz", ("arrays", "tracks", "report")),
        ("result.json", ("result",)),
        ("view.json", ("view",)),
    ):
        data = bytearray((folder / name).read_bytes())
        data[len(data) // 2] ^= 1
        (folder / name).write_bytes(data)
        for path in paths:
            answer = frail.http.get(f"/api/jobs/{id}/{path}")
            assert answer.status_code == 410 and name in answer.json()["detail"]


def copied(source: str, target: str) -> None:
    """As cp and rsync do: what vanishes meanwhile is left out."""
    with suppress(FileNotFoundError):
        shutil.copy2(source, target)


def test_data_copied_while_jobs_run_has_them_all_with_the_same_numbers(frail: Live, tmp_path: Path):
    """Copied file by file with no regard to the server; one copy's database is torn besides."""
    ids = [frail.submit(MANY | {"seed": n})["id"] for n in (1, 2, 3)]
    store = frail.app.state.site.jobs.store
    until(lambda: store.shards(ids[1]), "a finished shard of the second job")
    copies = [tmp_path / "copy", tmp_path / "torn"]
    for copy in copies:
        shutil.copytree(frail.settings.data, copy, copy_function=copied, ignore=shutil.ignore_patterns(".*"))
    torn = copies[1] / DATABASE
    torn.write_bytes(torn.read_bytes()[:100] + b"\xff" * (torn.stat().st_size - 100))
    (copies[1] / f"{DATABASE}-wal").unlink(missing_ok=True)

    expected = {id: (frail.finished(id), figures(frail, id))[1] for id in ids}
    for copy in copies:
        server = start(Settings(data=copy, port=0, workers=2))
        live = next(server)
        for id in ids:
            assert live.finished(id)["state"] == "done"
            assert figures(live, id) == expected[id]
        assert (copy / f"{DATABASE}.damaged").exists() == (copy == copies[1])
        assert next(server, None) is None


def test_a_copy_that_missed_a_result_computes_it_again(tmp_path: Path):
    store = recovery.open_store(tmp_path)
    folder = tmp_path / "jobs" / "a"
    done = job("a", state="done", finished_at="2026-01-01T00:00:01.000Z")
    recovery.write_record(folder, done)
    store.add(done)
    artifacts.write_text(folder / "result.json", "{}")
    artifacts.write_sums(folder, ["result.json"])
    store.close()
    copy = tmp_path / "copy"
    shutil.copytree(tmp_path, copy, ignore=shutil.ignore_patterns("copy"))
    whole = recovery.open_store(copy)
    assert [j.id for j in whole.ended()] == ["a"] and whole.unfinished() == []
    whole.close()

    shutil.copytree(tmp_path, tmp_path / "copy2", ignore=shutil.ignore_patterns("copy*", "result.json"))
    lacking = recovery.open_store(tmp_path / "copy2")
    assert [j.id for j in lacking.unfinished()] == ["a"] and lacking.ended() == []
    lacking.close()


def test_jobs_without_a_database_are_taken_in_again(tmp_path: Path):
    recovery.open_store(tmp_path).close()
    pinned = job("a", state="failed", pinned=True, tags=["kept"], error={"title": "t", "detail": "d"})
    recovery.write_record(tmp_path / "jobs" / "a", pinned)
    for path in tmp_path.glob(f"{DATABASE}*"):
        path.unlink()
    (tmp_path / "jobs" / "b").mkdir()
    (tmp_path / "jobs" / "b" / RECORD).write_text("{ not json")
    store = recovery.open_store(tmp_path)
    assert store.job("a") == pinned
    assert (tmp_path / "jobs" / "b" / RECORD).exists()


def test_leftovers_of_jobs_that_were_never_accepted_are_removed(tmp_path: Path):
    store = recovery.open_store(tmp_path)
    store.add(job("kept"))
    store.close()
    for id in ("kept", "never"):
        recovery.write_record(tmp_path / "jobs" / id, job(id))
    recovery.open_store(tmp_path)
    assert [p.name for p in (tmp_path / "jobs").iterdir()] == ["kept"]


def test_old_jobs_make_room_but_pinned_ones_stay(tmp_path: Path):
    now = datetime(2026, 6, 1, tzinfo=UTC)
    store = Store(tmp_path / "jobs.sqlite")
    for n, (id, pinned, state) in enumerate(
        [("old", False, "done"), ("pinned", True, "done"), ("newer", False, "failed"), ("newest", False, "done")]
    ):
        ended = (now - timedelta(days=40 - 10 * n)).isoformat()
        store.add(job(id, state=state, pinned=pinned, finished_at=ended, created_at=ended))
        (tmp_path / id).mkdir()
        (tmp_path / id / "arrays.npz").write_bytes(bytes(1000))
    store.add(job("running", state="running"))

    def going(**limits) -> list[str]:
        return [j.id for j in superfluous(store, tmp_path, Settings(data=tmp_path, **limits), now)]

    assert going() == []
    assert going(keep_days=15) == ["old", "newer"]
    assert going(keep_days=35) == ["old"]
    assert going(keep_bytes=2500) == ["old", "newer"]
    assert going(keep_bytes=0) == ["old", "newer", "newest"]
    assert going(keep_days=35, keep_bytes=2500) == ["old", "newer"]
    assert not store.drop("pinned") and not store.drop("running") and store.drop("old")


def test_the_server_deletes_what_is_too_much_when_a_job_ends(tmp_path: Path):
    server = start(Settings(data=tmp_path, port=0, workers=2, keep_bytes=0))
    live = next(server)
    id = live.submit(SHORT)["id"]
    until(lambda: live.http.get(f"/api/jobs/{id}").status_code == 404, "the job's removal")
    until(lambda: not (tmp_path / "jobs" / id).exists(), "its files' removal")
    pinned = live.submit(SHORT | {"trials": 300})["id"]
    assert live.http.patch(f"/api/jobs/{pinned}", json={"pinned": True}).status_code == 200
    assert live.finished(pinned)["state"] == "done"
    record = json.loads((tmp_path / "jobs" / pinned / RECORD).read_text())
    assert record["pinned"] is True
    assert next(server, None) is None
