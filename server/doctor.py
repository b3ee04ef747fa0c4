"""`coopnav doctor`: what the dashboard needs of a machine, tried out."""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal

import psutil

from engine import registry
from engine.scenario import library
from engine.scenario.errors import ScenarioError
from server import assets, serving
from server.artifacts import write_text
from server.cluster import Cluster
from server.scenes.pane import Pane
from server.settings import Settings
from server.store import Store

#: Disk and memory below which a large job will not end well.
LOW_DISK, LOW_MEMORY = 2 * 10**9, 10**9
#: How long the workers and the browser may take to start.
PATIENCE_S = 60
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge", "firefox")
PAGE = "<body><script>document.body.append(document.createElement('canvas').getContext('webgl2')?'3D':'flat')</script>"


@dataclass(frozen=True)
class Finding:
    """What was looked at, what was found, and whether that is well, worth knowing, or fatal."""

    mark: Literal["ok", "note", "FAIL"]
    what: str
    found: str


def findings(settings: Settings) -> Iterator[Finding]:
    """Every check in turn, each ended before the next begins."""
    checks: list[tuple[str, Callable[[Settings], Finding]]] = [
        ("software", _software),
        ("page", _page),
        ("algorithms", _algorithms),
        ("scenarios", _scenarios),
        ("port", _port),
        ("data", _data),
        ("disk", _disk),
        ("memory", _memory),
        ("workers", _workers),
        ("3D panes", _panes),
        ("browser", _browser),
    ]
    for what, check in checks:
        try:
            yield check(settings)
        except Exception as error:
            yield Finding("FAIL", what, f"{type(error).__name__}: {error}")


def _software(_: Settings) -> Finding:
    names = ("coopnav", "numpy", "scipy", "distributed", "viser", "fastapi", "uvicorn")
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in names)
    return Finding("ok", "software", f"Python {sys.version.split()[0]}, {versions}")


def _page(_: Settings) -> Finding:
    index = assets.static_directory() / "index.html"
    assets.plotly_js()
    assets.viser_client()
    return Finding("ok" if index.is_file() else "FAIL", "page", str(index.parent))


def _algorithms(_: Settings) -> Finding:
    return Finding("ok", "algorithms", f"{len(registry.algorithms())} installed")


def _scenarios(_: Settings) -> Finding:
    names, without = library.names(), []
    for name in names:
        try:
            if library.missing(library.shipped(name)):
                without.append(name)
        except ScenarioError as error:
            return Finding("FAIL", "scenarios", f"{name}: {error}")
    if without:
        return Finding("note", "scenarios", f"{len(names)} shipped; no data for {', '.join(without)}")
    return Finding("ok", "scenarios", f"{len(names)} shipped")


def _port(settings: Settings) -> Finding:
    try:
        serving.listen(settings).close()
    except serving.CannotServe as error:
        return Finding("FAIL", "port", str(error))
    asked = "open to this machine" if settings.loopback else "open to others, who will be asked for a token"
    return Finding("ok", "port", f"{settings.host} port {settings.port} is free, {asked}")


def _data(settings: Settings) -> Finding:
    existing = next(p for p in (settings.data, *settings.data.absolute().parents) if p.is_dir())
    if existing != settings.data:
        mark = "ok" if os.access(existing, os.W_OK) else "FAIL"
        return Finding(mark, "data", f"{settings.data} will be made in {existing}")
    with tempfile.TemporaryDirectory(dir=existing) as place:
        write_text(Path(place) / "probe", "x")
    database = settings.data / "coopnav.sqlite"
    if not database.is_file():
        return Finding("ok", "data", f"{settings.data} can be written to; no jobs yet")
    with tempfile.TemporaryDirectory() as place:
        for file in settings.data.glob("coopnav.sqlite*"):
            shutil.copy(file, place)
        store = Store(Path(place) / database.name)
        counts = store.counts()
        store.close()
    return Finding("ok", "data", f"{settings.data} can be written to; {sum(counts.values())} jobs, {counts}")


def _disk(settings: Settings) -> Finding:
    existing = next(p for p in (settings.data, *settings.data.absolute().parents) if p.is_dir())
    free = shutil.disk_usage(existing).free
    return Finding("ok" if free > LOW_DISK else "note", "disk", f"{free / 1e9:.1f} GB free at {existing}")


def _memory(settings: Settings) -> Finding:
    free = psutil.virtual_memory().available
    mark = "ok" if free > LOW_MEMORY * settings.workers else "note"
    return Finding(mark, "memory", f"{free / 1e9:.1f} GB free for {settings.workers} workers")


def _workers(settings: Settings) -> Finding:
    return asyncio.run(_try_cluster(settings))


async def _try_cluster(settings: Settings) -> Finding:
    where = settings.cluster or "processes of our own"
    cluster = Cluster(settings)
    starting = asyncio.create_task(cluster.start(lambda _: None))
    try:
        await asyncio.wait_for(cluster.ready.wait(), PATIENCE_S)
        there = await cluster.workers()
    except TimeoutError:
        return Finding("FAIL", "workers", cluster.failure or f"none within {PATIENCE_S} s, {where}")
    finally:
        starting.cancel()
        await asyncio.gather(starting, return_exceptions=True)
        await cluster.close()
    return Finding("ok" if there else "FAIL", "workers", f"{len(there)}, {where}")


def _panes(_: Settings) -> Finding:
    pane = Pane()
    pane.close()
    return Finding("ok", "3D panes", "their servers start, and answer to nobody but coopnav")


def _browser(_: Settings) -> Finding:
    found = [path for name in BROWSERS if (path := shutil.which(name))]
    if not found:
        return Finding("note", "browser", "none found on this machine; the page can be opened from another")
    if Path(found[0]).name == "firefox":
        return Finding("ok", "browser", found[0])
    try:
        if _draws(found[0]):
            return Finding("ok", "browser", f"{found[0]} draws in 3D")
        if _draws(found[0], "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"):
            return Finding("ok", "browser", f"{found[0]} draws in 3D, without a graphics card: slowly")
    except subprocess.TimeoutExpired:
        return Finding("note", "browser", f"{found[0]} did not start within {PATIENCE_S} s")
    return Finding("note", "browser", f"{found[0]} has no WebGL 2 here, which the 3D panes need")


def _draws(browser: str, *flags: str) -> bool:
    """Whether a page in this browser gets a WebGL 2 context."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        page = Path(profile) / "page.html"
        page.write_text(PAGE)
        command = [browser, "--headless", "--dump-dom", "--no-sandbox", "--use-gl=angle", *flags]
        command += [f"--user-data-dir={profile}", page.as_uri()]
        return ">3D" in subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S).stdout
