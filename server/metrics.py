"""The server's figures in Prometheus' text format (version 0.0.4)."""

from __future__ import annotations

import asyncio
import itertools
import shutil
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import psutil

from server.meter import BOUNDS_S, Tally
from server.site import Site

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"

Samples = Iterable[tuple[Mapping[str, object], float]]


async def text(site: Site) -> str:
    """Every figure there is now."""
    counts, free = await asyncio.to_thread(lambda: (site.jobs.store.counts(), shutil.disk_usage(site.settings.data)))
    process = psutil.Process()
    with process.oneshot():
        memory, cpu, started = process.memory_info().rss, process.cpu_times(), process.create_time()
    workers = site.cluster.threads
    parts = [
        _metric("coopnav_build_info", "gauge", "version", [({"version": version("coopnav")}, 1)]),
        _metric("coopnav_ready", "gauge", "1 while jobs can be run", [({}, bool(workers))]),
        _metric("coopnav_workers", "gauge", "worker processes", [({}, len(workers))]),
        _metric("coopnav_jobs", "gauge", "jobs by state", [({"state": s}, n) for s, n in counts.items()]),
        _metric("coopnav_panes", "gauge", "3D panes open", [({}, len(site.scenes.panes))]),
        *_requests(site.tally),
        _metric("coopnav_data_free_bytes", "gauge", "room left where jobs are kept", [({}, free.free)]),
        _metric("process_resident_memory_bytes", "gauge", "memory of the server's process", [({}, memory)]),
        _metric("process_cpu_seconds_total", "counter", "its processor time", [({}, cpu.user + cpu.system)]),
        _metric("process_start_time_seconds", "gauge", "its start, Unix time", [({}, started)]),
        _metric("process_threads", "gauge", "its threads", [({}, process.num_threads())]),
    ]
    if hasattr(process, "num_fds"):
        parts.append(_metric("process_open_fds", "gauge", "its open files", [({}, process.num_fds())]))
    return "".join(parts)


def _requests(tally: Tally) -> Iterator[str]:
    answers = [({"method": m, "route": r, "status": s}, n) for (m, r, s), n in tally.answers.copy().items()]
    yield _metric("coopnav_http_requests_total", "counter", "requests answered", answers)
    kinds = [({"kind": kind}, tally.streaming[kind]) for kind in ("events", "websocket")]
    yield _metric("coopnav_streams", "gauge", "event streams and websockets open", kinds)
    name = "coopnav_http_request_seconds"
    lines = [f"# HELP {name} time to answer\n# TYPE {name} histogram\n"]
    for route, classes in tally.durations.copy().items():
        for bound, count in zip([*map(str, BOUNDS_S), "+Inf"], itertools.accumulate(classes)):
            lines.append(_sample(f"{name}_bucket", {"route": route, "le": bound}, count))
        lines.append(_sample(f"{name}_sum", {"route": route}, tally.seconds[route]))
        lines.append(_sample(f"{name}_count", {"route": route}, sum(classes)))
    yield "".join(lines)


def _metric(name: str, kind: str, help: str, samples: Samples) -> str:
    return f"# HELP {name} {help}\n# TYPE {name} {kind}\n" + "".join(_sample(name, *sample) for sample in samples)


def _sample(name: str, labels: Mapping[str, Any], value: float) -> str:
    escaped = {k: str(v).replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n") for k, v in labels.items()}
    inside = ",".join(f'{key}="{value}"' for key, value in escaped.items())
    return f"{name}{{{inside}}} {float(value):.17g}\n" if inside else f"{name} {float(value):.17g}\n"
