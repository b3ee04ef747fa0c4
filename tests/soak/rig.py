"""A server in a process of its own, by itself or on a cluster of processes, that can be killed and comes back."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import httpx
import psutil

from tests.server.living import PATIENCE_S, Live, until


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Service:
    """A command that runs until it is killed, and is then started again by whoever looks after it."""

    def __init__(self, name: str, module: str, *arguments: str) -> None:
        self.name = name
        self._command = [sys.executable, "-m", module, *arguments]
        self._lock = threading.Lock()
        self.process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            self._command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )

    def kill(self) -> None:
        """End it as a power cut would: it alone, and at once."""
        with self._lock:
            self.process.kill()
            self.process.wait()

    def look_after(self) -> None:
        """Start it again if it has ended."""
        with self._lock:
            if self.process.poll() is not None:
                self.process = self._start()

    def family(self) -> list[psutil.Process]:
        with contextlib.suppress(psutil.NoSuchProcess):
            me = psutil.Process(self.process.pid)
            return [me, *me.children(recursive=True)]
        return []

    def end(self) -> None:
        """End it and what it started, and wait until all are gone."""
        family = self.family()
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGTERM)
        _, alive = psutil.wait_procs(family, timeout=PATIENCE_S)
        for each in alive:
            with contextlib.suppress(psutil.NoSuchProcess):
                each.kill()
        self.process.wait()
        assert not alive, f"{[p.pid for p in alive]} did not end"


class Rig:
    """A server with data in a folder; `services` are what keeps it going, the server first."""

    def __init__(self, data: Path, *options: str, cluster: bool = False, workers: int = 2) -> None:
        self.port = free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.services: list[Service] = []
        where: Sequence[str] = ["--workers", str(workers)]
        helpers: list[Service] = []
        if cluster:
            address = f"tcp://127.0.0.1:{free_port()}"
            port = address.rpartition(":")[2]
            scheduler = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"]
            helpers.append(Service("scheduler", *scheduler))
            worker = ["distributed.cli.dask_worker", address, "--host", "127.0.0.1", "--nthreads", "1"]
            for n in range(workers):
                helpers.append(Service(f"worker {n}", *worker, "--no-dashboard"))
            where = ["--cluster", address]
        serve = ["server", "serve", "--port", str(self.port), "--data", str(data), *where, *options]
        self.services = [Service("server", *serve), *helpers]
        self.http = httpx.Client(base_url=self.url, timeout=PATIENCE_S)
        self._ending = threading.Event()
        self._keeper = threading.Thread(target=self._keep, daemon=True)
        self._keeper.start()

    def _keep(self) -> None:
        """Start again whatever has ended, as a service manager does."""
        while not self._ending.wait(0.1):
            for service in self.services:
                service.look_after()

    @property
    def server(self) -> Service:
        return self.services[0]

    @property
    def live(self) -> Live:
        """The server as the tests of the server know it."""
        return Live(self.url, self.http, None, None)  # type: ignore[arg-type]

    def ready(self) -> float:
        """Wait until jobs can run; the seconds that took."""
        start = time.monotonic()

        def answers() -> bool:
            with contextlib.suppress(httpx.TransportError):
                # By a client that is there: to make one takes as much of a core as the server needs to begin.
                return self.http.get("/api/health/ready", timeout=5).status_code == 200
            return False

        until(answers, "a server that is ready")
        return time.monotonic() - start

    def workers(self) -> list[psutil.Process]:
        """The processes that run shards: of a server by itself copies of the one that has imported everything."""
        found = []
        for service in self.services:
            for process in service.family()[1:]:
                with contextlib.suppress(psutil.NoSuchProcess):
                    line, parent = " ".join(process.cmdline()), process.ppid()
                    if "spawn_main" in line or ("forkserver" in line and parent != service.process.pid):
                        found.append(process)
        return found

    def end(self) -> None:
        self._ending.set()
        self._keeper.join()
        self.http.close()
        for service in self.services:
            service.end()


@contextlib.contextmanager
def rig(data: Path, *options: str, cluster: bool = False, workers: int = 2) -> Iterator[Rig]:
    """A rig that is ready, ended at the end."""
    made = Rig(data, *options, cluster=cluster, workers=workers)
    try:
        made.ready()
        yield made
    finally:
        made.end()


def quantile(seconds: Sequence[float], q: float) -> float:
    """The smallest of these that at least a fraction q of them does not exceed."""
    ordered = sorted(seconds)
    return ordered[min(int(q * len(ordered)), len(ordered) - 1)]


def descriptors(process: psutil.Process) -> tuple[int, int]:
    """Open files and threads of a process."""
    return len(os.listdir(f"/proc/{process.pid}/fd")), process.num_threads()
