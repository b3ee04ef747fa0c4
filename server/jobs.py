"""The life of a job: accepted, split into shards, run, put together; or failed, or cancelled."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import logging
import math
import secrets
import shutil
import sqlite3
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, TypeVar

from engine import runner, statistics
from engine.scenario import toml
from engine.scenario.errors import ScenarioError
from engine.scenario.models import ScenarioBase
from engine.statistics import Batch
from server import cost, logs
from server.cluster import Cluster
from server.flow import Flow
from server.journal import Journal
from server.plan import Plan
from server.problems import Refusal, disk_full
from server.recovery import write_record
from server.results import OUTLINE, NothingLeft, Results
from server.retention import superfluous
from server.settings import Settings
from server.store import FINAL, Job, Store
from server.watch import Watch

log = logging.getLogger(__name__)

T = TypeVar("T")

#: Old jobs are looked for this often at least.
TIDY_S = 3600.0
#: A what-if job that takes more worker seconds stands in line like any other.
WHAT_IF_S = 120.0
#: Submissions that are worked on at once.
MOST_ACCEPTING = 2
#: Pause between attempts to record what a full disk did not take.
AGAIN_S = 1.0


class TimeIsUp(Exception):
    """The job ran as long as it may."""


def now() -> str:
    """The time in UTC, ISO 8601 to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@dataclass(frozen=True)
class Wanted:
    """A job somebody wants: a scenario and its name if it has one, and how to run it.

    body is what was sent, the same for the same job under one idempotency key; client is whose turn it takes.
    """

    scenario: ScenarioBase
    name: str | None
    body: Any
    algorithms: list[str] | None = None
    key: str | None = None
    client: str = ""
    purpose: str = "run"
    limit_s: float | None = None
    keep: str = "tracks"


class Jobs:
    """Runs jobs on a cluster; what it knows for good is in the store and in the data folder."""

    def __init__(self, store: Store, journal: Journal, cluster: Cluster, settings: Settings) -> None:
        self.store, self.journal = store, journal
        self.results = Results(store, settings.data / "jobs")
        self._cluster, self._settings = cluster, settings
        self._flow = Flow(cluster)
        # Python's threads take turns with the event loop: few at work on jobs leave it time to answer.
        self.accepting = asyncio.Semaphore(MOST_ACCEPTING)
        self._planning, self._assembling = asyncio.Semaphore(1), asyncio.Semaphore(1)
        self._ended = asyncio.Event()
        self._tidying: asyncio.Task[None] | None = None
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._clients: dict[str, str] = {}
        self._running: dict[str, Watch] = {}

    def start(self) -> None:
        """Take up the jobs accepted before a restart; they run once the cluster is ready."""
        for job in self.store.unfinished():
            self._begin(job)
        self._tidying = asyncio.create_task(self.tidy())

    async def close(self) -> None:
        """Stop working; unfinished jobs stay accepted."""
        tasks = [*self._tasks.values(), *([self._tidying] if self._tidying else [])]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await self._flow.close()

    def admit(self, client: str) -> None:
        """Refusal 429 where as many jobs wait as may, altogether or of one client."""
        most, of_client = self._settings.most_jobs_waiting, self._settings.most_jobs_of_client
        mine = sum(owner == client for owner in self._clients.values())
        if len(self._clients) >= most or mine >= of_client:
            found = f"{len(self._clients)} jobs" if len(self._clients) >= most else f"{mine} jobs of yours"
            raise Refusal(429, "busy", f"{found} are waiting already; try again later", headers={"retry-after": "10"})

    def estimate(self, scenario: ScenarioBase, algorithms: list[str] | None, keep: str = "tracks") -> dict[str, Any]:
        """What a job would cost, and whether it would be accepted; ScenarioError for what cannot run."""
        names = runner.chosen(scenario, algorithms)
        found = cost.estimate(scenario, names, self.store.rates(scenario.family), keep)
        return cost.told(found, self._settings, sum(self._cluster.threads.values()), len(self._tasks), keep)

    async def submit(self, wanted: Wanted) -> Job:
        """Accept a job, or find the one accepted before under the same idempotency key.

        Raises ScenarioError for what cannot run or is too much, Refusal 409 for a key used with another body, 429 where
        too many jobs wait, 507 where the disk has no room.
        """
        scenario = wanted.scenario
        names = await asyncio.to_thread(runner.chosen, scenario, wanted.algorithms)
        digest = hashlib.sha256(json.dumps(wanted.body, sort_keys=True).encode()).hexdigest()
        known = await asyncio.to_thread(self.store.keyed, wanted.key) if wanted.key is not None else None
        if known is not None:
            return _same(known, digest)
        rates = await asyncio.to_thread(self.store.rates, scenario.family)
        price = cost.estimate(scenario, names, rates, wanted.keep)
        problems = cost.problems(price, self._settings, wanted.keep)
        if problems:
            raise ScenarioError(problems)
        self.admit(wanted.client)
        id = secrets.token_hex(8)
        self._clients[id] = wanted.client  # from here on it counts
        folder = self.results.folders / id
        try:
            await asyncio.to_thread(self._check_room, price)
            job = Job(
                id=id,
                state="queued",
                title=scenario.title,
                scenario=wanted.name,
                family=scenario.family,
                algorithms=names,
                trials=scenario.trials,
                seed=scenario.seed,
                created_at=now(),
                toml=toml.dumps(scenario),
                origin=scenario.origin,
                idempotency_key=wanted.key,
                digest=digest,
                client=wanted.client,
                purpose="what-if" if wanted.purpose == "what-if" and price.worker_s <= WHAT_IF_S else "run",
                limit_s=wanted.limit_s,
                changes=wanted.body.get("set", {}),
                keep=wanted.keep,
            )
            await asyncio.to_thread(write_record, folder, job)
            kept, new = await asyncio.to_thread(self.store.add, job)
            if not new:
                return _same(kept, digest)
            logs.job.set(id)
            log.info("job %s is accepted", id)
            self._begin(kept)
            return kept
        finally:
            if id not in self._tasks:
                del self._clients[id]
                await asyncio.to_thread(self.results.remove, id)

    def _check_room(self, price: cost.Cost) -> None:
        """Refusal 507 where the disk has no room for a result and its shards."""
        free = shutil.disk_usage(self._settings.data).free
        if free - 2 * price.result_bytes < self._settings.least_free_disk:
            raise Refusal(
                507,
                "storage",
                f"the disk has {free / 1e9:.2f} GB left, which is too little for a result of about "
                f"{price.result_bytes / 1e9:.2f} GB; delete jobs that are no longer needed",
            )

    async def cancel(self, id: str) -> Job:
        """End a job now; one that has ended stays as it is."""
        found = self.find(id)
        if found.state in FINAL:
            return found
        # Shards may still be telling; nothing may be recorded after the final state.
        self._running.pop(id, None)
        await self.journal.flush()
        changed = await asyncio.to_thread(self.store.change, id, state="cancelled", finished_at=now())
        self.journal.wake()
        task = self._tasks.get(id)
        if changed is not None and task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            await asyncio.to_thread(self.results.drop_shards, id)
            await asyncio.to_thread(self.results.note, id)
        return self.find(id)

    async def delete(self, id: str) -> None:
        """Forget a job and its files, after ending it."""
        await self.cancel(id)
        await asyncio.to_thread(self.store.delete, id)
        self.journal.wake()
        await asyncio.to_thread(self.results.remove, id)

    def mark(self, id: str, **marks: Any) -> Job:
        """Keep a person's marks on a job; Refusal 404 where there is none."""
        self.store.mark(id, **marks)
        job = self.find(id)
        self.results.note(id)
        return job

    async def tidy(self) -> None:
        """Delete the jobs that are to make room, now and whenever one has ended or an hour has passed."""
        while True:
            going = await asyncio.to_thread(superfluous, self.store, self.results.folders, self._settings)
            for job in going:
                if await asyncio.to_thread(self.store.drop, job.id):
                    log.info("job %s is old and makes room", job.id)
                    await asyncio.to_thread(self.results.remove, job.id)
            self._ended.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._ended.wait(), TIDY_S)

    def find(self, id: str) -> Job:
        """The job of an id; Refusal 404 where there is none."""
        return self.results.find(id)

    def hear(self, message: dict[str, Any]) -> None:
        """Take in what a running shard tells."""
        watch = self._running.get(message["job"])
        if watch is not None:
            watch.hear(message)

    def _begin(self, job: Job) -> None:
        task = asyncio.create_task(self._run(job), name=f"job {job.id}")
        self._tasks[job.id], self._clients[job.id] = task, job.client
        task.add_done_callback(lambda _: (self._tasks.pop(job.id, None), self._clients.pop(job.id, None)))

    async def _run(self, job: Job) -> None:
        logs.job.set(job.id)
        try:
            await self._compute(job)
        except asyncio.CancelledError:
            raise
        except Exception as error:
            log.exception("job %s failed", job.id, exc_info=error)
            # Other shards may still be telling; nothing may be recorded after the final state.
            self._running.pop(job.id, None)
            await asyncio.to_thread(self.results.drop_shards, job.id)
            await self._record(job.id, state="failed", finished_at=now(), error=_told(error))
        finally:
            self._running.pop(job.id, None)

    async def _record(self, id: str, **values: Any) -> None:
        """Change a job for good, waiting for room on the disk if need be."""
        while True:
            try:
                await self.journal.flush()
                await asyncio.to_thread(self.store.change, id, **values)
                log.info("job %s is %s", id, values["state"])
            except sqlite3.OperationalError as error:
                log.error("job %s: cannot record %s: %s", id, values.get("state"), error)
                await asyncio.sleep(AGAIN_S)
            else:
                break
        await asyncio.to_thread(self.results.note, id)
        self.journal.wake()
        self._ended.set()

    async def _compute(self, job: Job) -> None:
        folder = self.results.folders / job.id
        await asyncio.to_thread(folder.mkdir, parents=True, exist_ok=True)
        async with self._planning:
            scenario, shards = await asyncio.to_thread(_planned, job)
            await asyncio.to_thread(self.results.check_shards, job.id)
        finished = {*self.store.shards(job.id), *self.store.lost(job.id)}
        watch = self._running[job.id] = Watch(job, len(shards), finished, self.journal, folder / OUTLINE)
        watch.resume(self.store)
        plan = Plan(job, shards, self.store, watch, lambda number: self.results.shard_file(job.id, number))
        self._flow.join(plan)
        limit_s = min(job.limit_s or math.inf, self._settings.longest_job_s)
        limit = asyncio.timeout(limit_s)
        try:
            await plan.started.wait()
            if job.state == "queued":
                await asyncio.to_thread(self.store.change, job.id, state="running", started_at=now())
                log.info("job %s is running", job.id)
                self.journal.wake()
            async with limit:
                await plan.ended
        except TimeoutError:
            if limit.expired():
                raise TimeIsUp(f"it ran for {limit_s:g} s, which is its limit") from None
            raise
        finally:
            self._flow.leave(plan)
            await plan.settled.wait()
        async with self._assembling:
            lost = list(self.store.lost(job.id).values())
            notes, rmse_m = await _to_the_end(self.results.assemble, job, scenario, lost)
        for algorithm, (done, seconds) in plan.cost.items():
            await asyncio.to_thread(self.store.worked, algorithm, job.family, done, seconds)
        await self._record(job.id, state="done", progress=1.0, finished_at=now(), notes=notes, lost=lost, rmse_m=rmse_m)
        await asyncio.to_thread(self.results.drop_shards, job.id)


def _planned(job: Job) -> tuple[ScenarioBase, list[runner.Shard | Batch]]:
    """A job's scenario and its shards; of one that keeps statistics first the trials kept whole, then batches."""
    scenario = toml.loads(job.toml, origin=job.origin)
    if job.keep == "tracks":
        return scenario, [*runner.shards(scenario, job.algorithms)]
    whole = runner.shards(statistics.shown(scenario), job.algorithms)
    return scenario, [*whole, *statistics.batches(scenario, job.algorithms)]


async def _to_the_end(function: Callable[..., T], *arguments: Any) -> T:
    """Run a function in a thread; a cancellation takes effect when it has ended."""
    task = asyncio.ensure_future(asyncio.to_thread(function, *arguments))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait({task})
        raise


def _same(known: Job, digest: str) -> Job:
    """The job of an idempotency key, if it was asked for in the same words."""
    if known.digest != digest:
        raise Refusal(409, "idempotency", "this Idempotency-Key was used for another job; take a new one")
    return known


def _told(error: BaseException) -> dict[str, str]:
    """A failure in the words of the person who ran the job."""
    if isinstance(error, ScenarioError):
        return {"title": "The scenario cannot be run", "detail": str(error)}
    if isinstance(error, NothingLeft):
        return {"title": "Its workers died", "detail": str(error)}
    if isinstance(error, TimeIsUp):
        return {"title": "Its time is up", "detail": str(error)}
    if disk_full(error):
        return {"title": "The disk is full", "detail": "there was no room for its results; make room and run it again"}
    if isinstance(error, FileNotFoundError):
        return {"title": "A file is missing", "detail": str(error)}
    return {"title": "An estimator failed", "detail": f"{type(error).__name__}: {error}"}
