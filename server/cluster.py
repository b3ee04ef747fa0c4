"""The Dask cluster that shards run on: our own processes, or somebody's by address."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import Callable
from typing import Any

import dask.config
from distributed import CancelledError as Dropped
from distributed import Client, KilledWorker, LocalCluster
from distributed.comm.core import CommClosedError
from distributed.scheduler import DEFAULT_EXTENSIONS
from distributed.security import Security

from server import nursery, work
from server.settings import Settings
from server.work import Answer, Piece

log = logging.getLogger(__name__)

# Dask gives a process up that is not there so long after it ended once, even if it is just ending for the second time.
dask.config.set({"distributed.deploy.lost-worker-timeout": "1000 days"})

#: Pause between attempts to reach somebody's cluster.
AGAIN_S = 0.3
#: The cluster is looked at this often, besides being told of changes.
LOOK_S = 0.5
#: A run that was stopped has this long to leave its worker; then the worker is started again.
GRACE_S = 0.6
STOP_POLL_S = 0.1
#: A worker that reaches its memory limit is ended, not slowed down. What Dask remembers for its own dashboard,
#: estimates told by our runs among it, fills memory; nobody looks at it here. Its schedulers and workers have web
#: servers that ask nobody who he is: they are left with nothing to say.
PROCESSES = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.admin.log-length": 500,
    "distributed.admin.low-level-log-length": 50,
    "distributed.diagnostics.computations.max-history": 5,
    "distributed.diagnostics.erred-tasks.max-history": 5,
    "distributed.worker.profile.enabled": False,
    "distributed.nanny.pre-spawn-environ": nursery.ENVIRONMENT,
    "distributed.worker.multiprocessing-method": nursery.METHOD,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
}
#: What our scheduler does besides scheduling: all but spans, which keep something of every task there ever was.
EXTENSIONS = {name: made for name, made in DEFAULT_EXTENSIONS.items() if name != "spans"}


class WorkerDied(Exception):
    """The worker went away, unasked, while it ran a piece."""


class ClusterLost(Exception):
    """The cluster went away while it ran a piece, or the worker left as planned: nobody's fault."""


async def _own_cluster(settings: Settings) -> LocalCluster:
    """Worker processes of our own that listen on loopback alone and show no dashboard.

    What they are sent is code to them: TLS with credentials of this run keeps other programs of the machine out.
    """
    nursery.prepare()
    with dask.config.set(PROCESSES):
        return await LocalCluster(
            n_workers=settings.workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            protocol="tls",
            security=Security.temporary(),
            memory_limit=settings.worker_memory or "auto",
            dashboard_address=None,  # pyright: ignore[reportArgumentType]
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0", "extensions": EXTENSIONS},
            extensions={},  # a worker's half of the spans
            silence_logs=logging.CRITICAL + 1,
            asynchronous=True,
        )  # pyright: ignore[reportGeneralTypeIssues]


def _security(settings: Settings) -> Security | None:
    """The certificates to show a cluster that asks for TLS."""
    if settings.cluster_ca is None:
        return None
    return Security(
        require_encryption=True,
        tls_ca_file=str(settings.cluster_ca),
        tls_client_cert=str(settings.cluster_cert),
        tls_client_key=str(settings.cluster_key),
    )


class Cluster:
    """A client of a Dask cluster, on the event loop it was started on.

    threads {address: number} are the workers there are now; `changed` is called when they change.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._topic = f"coopnav-{secrets.token_hex(8)}"
        self._own: LocalCluster | None = None
        self._client: Client | None = None
        self._running: dict[str, tuple[str, asyncio.Future[None]]] = {}
        self.threads: dict[str, int] = {}
        self.changed: Callable[[], None] = lambda: None
        self.ready = asyncio.Event()
        self.failure: str | None = None

    async def start(self, hear: Callable[[dict[str, Any]], None]) -> None:
        """Start or join the cluster and stay with it, again whenever it was lost; `hear` gets what shards tell."""
        address: Any = self._settings.cluster
        if address is None:
            address = self._own = await _own_cluster(self._settings)
        while True:
            try:
                await self._join(address, hear)
                self.failure = None
                self.ready.set()
                await self._stay()
                self.failure = f"the Dask cluster at {address} went away"
            except (OSError, ValueError, RuntimeError, CommClosedError) as error:
                self.failure = f"the Dask cluster at {address} does not answer: {error}"
            log.warning("%s", self.failure)
            self.ready.clear()
            await self._leave()
            await asyncio.sleep(AGAIN_S)

    async def _join(self, address: Any, hear: Callable[[dict[str, Any]], None]) -> None:
        self._client = Client(address, asynchronous=True, name="coopnav", timeout=5, security=_security(self._settings))
        await self._client  # pyright: ignore[reportGeneralTypeIssues]
        self.client.subscribe_topic(self._topic, lambda event: hear(event[1]))
        self.client.subscribe_topic("all", lambda event: self._told(event[1]))
        await self.client.register_plugin(work.Prepared(self._own is not None))  # pyright: ignore
        await self._look()

    async def _stay(self) -> None:
        """Return when the connection is lost."""
        while self.client.status == "running":
            await asyncio.sleep(LOOK_S)
            self._refill()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._look(), 5)

    def _refill(self) -> None:
        """Start processes of our own in place of those whose nanny gave up."""
        if self._own is None or len(self._own.workers) >= self._settings.workers:
            return
        log.warning("%d of %d workers are left; others are started", len(self._own.workers), self._settings.workers)
        self._own.scale(self._settings.workers)

    async def _look(self) -> None:
        """See which workers there are."""
        threads = dict(await self.client.nthreads())  # pyright: ignore
        if self.client.status == "running" and threads != self.threads:
            for worker in set(self.threads) - set(threads):
                self._end_runs(worker, WorkerDied(f"worker {worker} went away"))
            self.threads = threads
            self.changed()

    def _told(self, news: dict[str, Any]) -> None:
        """Take in what the scheduler tells of its workers."""
        if news.get("action") != "remove-worker" or news["worker"] not in self.threads:
            return
        self.threads = {a: n for a, n in self.threads.items() if a != news["worker"]}
        planned = news.get("expected", False)
        reason = ClusterLost("the worker left") if planned else WorkerDied(f"worker {news['worker']} went away")
        self._end_runs(news["worker"], reason)
        self.changed()

    def _end_runs(self, worker: str | None, reason: Exception) -> None:
        for where, gone in self._running.values():
            if worker in (None, where) and not gone.done():
                gone.set_exception(reason)

    async def _leave(self) -> None:
        self.threads = {}
        self._end_runs(None, ClusterLost("the cluster went away"))
        client, self._client = self._client, None
        if client is not None:
            with contextlib.suppress(Exception):
                await asyncio.wait_for(client.close(), 5)  # pyright: ignore

    async def close(self) -> None:
        """Leave the cluster, and end its processes where they are ours."""
        await self._leave()
        if self._own is not None:
            await self._own.close()  # pyright: ignore

    @property
    def client(self) -> Client:
        assert self._client is not None, "the cluster has not been started"
        return self._client

    async def workers(self) -> list[str]:
        """Addresses of the workers there are now."""
        return sorted(self.threads)

    async def run(self, piece: Piece, key: str, worker: str) -> Answer:
        """Run a piece on a worker under a key of its own. Raises WorkerDied, ClusterLost, and what the piece raised."""
        if self._client is None or worker not in self.threads:
            raise ClusterLost("the worker left")
        gone = asyncio.get_running_loop().create_future()
        self._running[key] = worker, gone
        try:
            future = self._client.submit(
                work.run, self._topic, key, piece, key=key, workers=[worker], allow_other_workers=False, pure=False
            )
            result = asyncio.ensure_future(_result(future))
            try:
                await asyncio.wait({result, gone}, return_when=asyncio.FIRST_COMPLETED)
                answer = result.result() if result.done() else gone.result()
            finally:
                result.cancel()
                future.release()
        except KilledWorker:
            raise WorkerDied(f"worker {worker} went away") from None
        except (Dropped, CommClosedError) as error:
            raise ClusterLost(str(error)) from None
        finally:
            del self._running[key]
            gone.cancel()
        if answer is None:
            raise ClusterLost("the run was stopped")
        return answer

    async def free(self, key: str, worker: str) -> None:
        """Make a worker stop a run; return when it has left the worker, or the worker is gone."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + GRACE_S
        while worker in self.threads and self._client is not None:
            with contextlib.suppress(TimeoutError, OSError, Dropped):
                answer: Any = self._client.run(work.stop, key, workers=[worker], on_error="return")
                if (await asyncio.wait_for(answer, GRACE_S)).get(worker) is False:
                    return
            if loop.time() > deadline:
                await self._restart(worker)
                deadline = loop.time() + 10 * GRACE_S
            await asyncio.sleep(STOP_POLL_S)

    async def _restart(self, worker: str) -> None:
        """End a worker's process by its nanny, which starts another; a worker without a nanny cannot be helped."""
        log.warning("worker %s does not stop; it is started again", worker)
        with contextlib.suppress(Exception):
            ending: Any = self.client.run(work.end, workers=[worker], nanny=True, on_error="return")
            await asyncio.wait_for(ending, GRACE_S)


async def _result(future: Any) -> Any:
    return await future
