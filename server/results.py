"""The files of jobs, each in its job's folder: shards as they finish, results in the end, checked whenever read."""

from __future__ import annotations

import itertools
import json
import logging
import math
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from engine import runner, statistics
from engine.scenario.models import ScenarioBase
from server import artifacts, view, work
from server.problems import Refusal
from server.recovery import write_record
from server.store import Job, Store
from server.wire import dumps

log = logging.getLogger(__name__)

OUTLINE, VIEW = "outline.json", "view.json"
FILES = (artifacts.RESULT, artifacts.ARRAYS, artifacts.VERSIONS, VIEW)
#: So many files are remembered to be as they were written.
MOST_CHECKED = 2000


class NothingLeft(Exception):
    """Every block of trials lost a shard."""


class Results:
    """The folders of a store's jobs."""

    def __init__(self, store: Store, folders: Path) -> None:
        self.store, self.folders = store, folders
        self._checked: dict[Path, tuple[int, int, int]] = {}

    def find(self, id: str) -> Job:
        """The job of an id; Refusal 404 where there is none."""
        job = self.store.job(id)
        if job is None:
            raise Refusal(404, "unknown-job", "there is no such job")
        return job

    def artifact(self, id: str, name: str) -> Path:
        """A file of a finished job; Refusal 409 before it is there, 410 where it is not as it was written."""
        job = self.find(id)
        if job.state != "done":
            raise Refusal(409, "not-done", f"the job is {job.state}; it has no result")
        path = self.folders / job.id / name
        if not self._as_written(path):
            log.error("%s is not as it was written", path)
            raise Refusal(410, "damaged", f"{name} of this job was damaged on the disk; run the job again")
        return path

    def _as_written(self, path: Path) -> bool:
        """Whether a file has the checksum noted for it; it is read once for every time that it changes."""
        try:
            found = path.stat()
        except FileNotFoundError:
            return False
        version = (found.st_ino, found.st_size, found.st_mtime_ns)
        if self._checked.get(path) == version:
            return True
        noted = artifacts.read_sums(path.parent).get(path.name)
        if noted is not None and artifacts.sha256(path) != noted:
            return False
        if len(self._checked) >= MOST_CHECKED:
            self._checked.clear()
        self._checked[path] = version
        return True

    def view(self, id: str) -> str | None:
        """The view as JSON text: the finished one, or of what there is so far; None before anything."""
        job = self.find(id)
        if job.state == "done":
            return self.artifact(id, VIEW).read_text(encoding="utf-8")
        parts = self._parts(job)
        outline = self.outline(id)
        if outline is None or not parts:
            return None
        return dumps(view.build(outline, parts, job.algorithms))

    def outline(self, id: str) -> dict[str, Any] | None:
        """The outline of a job's mission once a worker has told it."""
        path = self.folders / id / OUTLINE
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None

    def note(self, id: str) -> None:
        """Note in a job's folder what the store knows of it."""
        job = self.store.job(id)
        with suppress(OSError):  # a copy without it computes the job again
            if job is not None:
                write_record(self.folders / id, job)

    def remove(self, id: str) -> None:
        """Delete a job's folder."""
        shutil.rmtree(self.folders / id, True)

    def shard_file(self, id: str, number: int) -> Path:
        return self.folders / id / f"shard-{number}.npz"

    def check_shards(self, id: str) -> None:
        """Forget finished shards whose files are not as they were written: they run again."""
        for number, digest in self.store.shards(id).items():
            path = self.shard_file(id, number)
            if not path.is_file() or artifacts.sha256(path) != digest:
                log.warning("job %s: the file of shard %d is damaged; it runs again", id, number)
                self.store.forget_shard(id, number)

    def drop_shards(self, id: str) -> None:
        """Delete the files of a job's shards."""
        for path in (self.folders / id).glob("shard-*.npz"):
            path.unlink(missing_ok=True)

    def assemble(
        self, job: Job, scenario: ScenarioBase, lost: Sequence[dict[str, Any]]
    ) -> tuple[list[str], dict[str, dict[str, float]]]:
        """Write the files of a finished job.

        Returns what its algorithms, and shards given up, want to be known, and the algorithms' errors by subject.
        """
        gaps = {entry["trials"][0] for entry in lost}
        parts = [part for part in self._parts(job) if part[0].trials[0] not in gaps]
        if not parts:
            raise NothingLeft("; ".join(map(_loss, lost)))
        folder = self.folders / job.id
        outline = self.outline(job.id) or work.outline(scenario)
        artifacts.write_text(folder / VIEW, dumps(view.build(outline, parts, job.algorithms)))
        notes = [_loss(entry) for entry in lost]
        if job.keep == "statistics":
            result = runner.gather(statistics.shown(scenario), parts, job.algorithms)
            artifacts.write_result(folder, result)
            told = statistics.told(scenario, result.time_s, self._totals(job, parts), lost)
            artifacts.write_statistics(folder, told)
            notes.append(f"figures are of {told['trials']} trials, tracks and curves of the first {result.trials}")
        else:
            result = runner.gather(scenario, parts, job.algorithms, lost)
            artifacts.write_result(folder, result)
            told = result.to_json()
        graphs = [artifacts.graph_file(name) for name, tracks in result.tracks.items() if tracks.graph]
        artifacts.write_sums(folder, [*FILES, *graphs])
        notes += [f"{name}: {note}" for name, answer in told["algorithms"].items() for note in answer["notes"]]
        return notes, {name: _errors(answer["subjects"]) for name, answer in told["algorithms"].items()}

    def _totals(self, job: Job, parts: view.Parts) -> statistics.Totals:
        """What all trials left: those kept whole, and one batch after the other."""
        whole = statistics.of_tracks(parts[0][1], {shard.algorithm: tracks for shard, _, tracks in parts})
        batches = (n for n in self.store.shards(job.id) if n >= len(job.algorithms))
        read = (artifacts.read_totals(self.shard_file(job.id, n)) for n in batches)
        return statistics.merged(itertools.chain([whole], read))

    def _parts(self, job: Job) -> view.Parts:
        with suppress(FileNotFoundError):
            whole = len(job.algorithms) if job.keep == "statistics" else math.inf
            return [artifacts.read_shard(self.shard_file(job.id, n)) for n in self.store.shards(job.id) if n < whole]
        return []


def _errors(subjects: dict[str, dict[str, Any]]) -> dict[str, float]:
    """RMS errors (m) by subject, of those that have one."""
    errors = {name: metrics.get("rmse_m") for name, metrics in subjects.items()}
    return {name: error for name, error in errors.items() if error is not None and math.isfinite(error)}


def _loss(lost: dict[str, Any]) -> str:
    """A shard that was given up, in words."""
    first, last = lost["trials"]
    return (
        f"{lost['algorithm']}: trials {first} to {last} of seed {lost['seed']} are missing from all figures: "
        f"given up after {lost['tries']} tries, {lost['reason']}"
    )
