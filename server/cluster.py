"""The Dask cluster that shards run on: our own processes, or somebody's by address."""

from __future__ import annotations

import asyncio
import logging
import secrets
from collections.abc import Callable
from typing import Any

import dask.config
from distributed import Client, LocalCluster

from engine.runner import Shard
from engine.tracks import Reference, Tracks
from server import work
from server.settings import Settings

log = logging.getLogger(__name__)


#: Pause between attempts to reach somebody's cluster.
AGAIN_S = 2.0
#: Dask makes glibc give memory back at once, which costs arrays of many megabytes a third of their speed.
MEMORY = {
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**26,
}


async def _own_cluster(workers: int) -> LocalCluster:
    """Worker processes of our own that listen on loopback alone and show no dashboard."""
    with dask.config.set(MEMORY):
        return await LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,  # pyright: ignore[reportArgumentType]
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            silence_logs=logging.CRITICAL,
            asynchronous=True,
        )  # pyright: ignore[reportGeneralTypeIssues]


class Cluster:
    """A client of a Dask cluster, on the event loop it was started on."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._topic = f"coopnav-{secrets.token_hex(8)}"
        self._own: LocalCluster | None = None
        self._client: Client | None = None
        self.ready = asyncio.Event()
        self.failure: str | None = None

    async def start(self, hear: Callable[[dict[str, Any]], None]) -> None:
        """Start or join the cluster, trying again until it is there; `hear` gets what running shards tell."""
        address: Any = self._settings.cluster
        if address is None:
            address = self._own = await _own_cluster(self._settings.workers)
        while self._client is None:
            try:
                self._client = await Client(address, asynchronous=True, name="coopnav", timeout=5)  # pyright: ignore
            except (OSError, ValueError) as error:
                self.failure = f"the Dask cluster at {address} does not answer: {error}"
                log.warning("%s", self.failure)
                await asyncio.sleep(AGAIN_S)
        self._client.subscribe_topic(self._topic, lambda event: hear(event[1]))
        await self._client.register_plugin(work.Prepared())  # pyright: ignore
        self.failure = None
        self.ready.set()

    async def close(self) -> None:
        """Leave the cluster, and end its processes where they are ours."""
        if self._client is not None:
            await self._client.close()  # pyright: ignore
        if self._own is not None:
            await self._own.close()  # pyright: ignore

    @property
    def client(self) -> Client:
        assert self._client is not None, "the cluster has not been started"
        return self._client

    async def workers(self) -> list[str]:
        """Addresses of the workers there are now."""
        return sorted(await self.client.nthreads())  # pyright: ignore

    async def run(
        self, job: str, number: int, text: str, origin: str, shard: Shard, worker: str | None
    ) -> tuple[Reference, Tracks] | None:
        """Run a shard, if possible on a certain worker; None where its job was cancelled meanwhile."""
        future = self.client.submit(
            work.run,
            self._topic,
            job,
            number,
            text,
            origin,
            shard,
            key=f"coopnav-{job}-{number}-{secrets.token_hex(4)}",
            workers=[worker] if worker else None,
            allow_other_workers=bool(worker),
            priority=1 if shard.trials[0] == 0 else 0,
            pure=False,
        )
        try:
            return await future
        except asyncio.CancelledError:
            future.release()
            raise

    async def cancel(self, job: str) -> None:
        """Stop the shards of a job that are running."""
        await self.client.run(work.cancel, job)  # pyright: ignore
