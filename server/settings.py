"""What one running server is told: where it listens, where it keeps things, how much it accepts."""

from __future__ import annotations

import ipaddress
import os
from dataclasses import dataclass
from pathlib import Path

import platformdirs


def default_data() -> Path:
    """The platform's folder for a user's data."""
    return Path(platformdirs.user_data_dir("coopnav", appauthor=False))


@dataclass(frozen=True)
class Settings:
    """Host and port, data folder, Dask scheduler address (None: a cluster of our own), and limits.

    token, where set, is asked of everyone. cluster_ca, cluster_cert and cluster_key are PEM files for a scheduler at a
    tls:// address. workers counts the processes of our own cluster, worker_memory (bytes; None: their share of the
    machine's) is what one of them may use. most_trials is of a job that keeps tracks, most_trials_summed of one that
    keeps statistics alone. most_work is trials x vehicles x mission seconds x algorithms of one job;
    jobs that ended keep_days ago, and the oldest while all take more than keep_bytes, are deleted unless pinned;
    least_free_disk (bytes) stays free on the disk of the data folder; of uploaded logs one file may have
    largest_log_file bytes, all together largest_logs. Bodies of requests held at once have largest_bodies bytes
    together; slowest_head_s and slowest_body_s are how long the head and the body of one may take to arrive.
    """

    data: Path
    host: str = "127.0.0.1"
    port: int = 8000
    cluster: str | None = None
    cluster_ca: Path | None = None
    cluster_cert: Path | None = None
    cluster_key: Path | None = None
    token: str | None = None
    workers: int = max(os.cpu_count() or 1, 2)
    worker_memory: int | None = None
    largest_body: int = 2 * 1024 * 1024
    largest_bodies: int = 512 * 1024 * 1024
    largest_log_file: int = 64 * 1024 * 1024
    largest_logs: int = 2 * 1024**3
    most_connections: int = 1000
    slowest_head_s: float = 20.0
    slowest_body_s: float = 60.0
    most_trials: int = 100_000
    most_trials_summed: int = 1_000_000
    largest_result: int = 2 * 1024**3
    most_work: float = 2e11
    most_jobs_waiting: int = 400
    most_jobs_of_client: int = 250
    least_free_disk: int = 256 * 1024**2
    keep_days: float | None = None
    keep_bytes: int | None = None
    longest_job_s: float = 24 * 3600.0
    panes_per_session: int = 6
    panes_altogether: int = 48

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach the server."""
        return is_loopback(self.host)


def is_loopback(host: str) -> bool:
    """Whether a host name or address means this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
