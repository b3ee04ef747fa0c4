"""Runs opened one after another in one page: neither the page nor the server's scenes keep what has gone."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil
from playwright.sync_api import CDPSession, Page, sync_playwright

from tests.browser.conftest import FLAGS, SIZE, chromium
from tests.server.living import until
from tests.soak.rig import descriptors, rig
from tests.soak.sizes import size

#: Three runs with other estimators each, so that every opening ends panes and makes new ones.
RUNS = [
    {"scenario": "first-look", "trials": 3, "algorithms": ["dead_reckoning", "cekf"]},
    {"scenario": "first-look", "trials": 3, "algorithms": ["nekf"]},
    {"scenario": "walls2012-two-node", "trials": 3, "algorithms": ["mdeif", "deif"]},
]
#: Growth that is allowed.
ALLOWED = 0.10
COUNTED = ("JSHeapUsedSize", "Nodes", "JSEventListeners", "Documents", "Frames")


def counts(devtools: CDPSession) -> dict[str, float]:
    """What is left in the page's process when its garbage has been collected."""
    for _ in range(3):
        devtools.send("HeapProfiler.collectGarbage")
    told = devtools.send("Performance.getMetrics")["metrics"]
    return {each["name"]: each["value"] for each in told if each["name"] in COUNTED}


def resident(browser: psutil.Process) -> float:
    """Memory of the browser's processes, bytes."""
    return float(sum(each.memory_info().rss for each in browser.children(recursive=True) if each.is_running()))


def opened(page: Page, run: str, panes: int) -> None:
    """Open a run as its link does, until its table, its plots and all its panes are there."""
    page.evaluate("run => void (location.hash = `#run=${run}`)", run)
    page.wait_for_function(
        """panes => document.querySelectorAll(".pane").length === panes
          && document.querySelectorAll(".pane[data-state=shown]").length === panes
          && document.querySelectorAll(".plot .js-line").length >= panes""",
        arg=panes,
        timeout=120_000,
    )


def growth(levels: list[float]) -> float:
    """Of the last fifth of the openings over the fifth after the first."""
    fifth = max(len(levels) // 5, 1)
    return statistics.median(levels[-fifth:]) / statistics.median(levels[fifth : 2 * fifth]) - 1


def test_nothing_stays_of_runs_that_were_open(tmp_path: Path, told: Callable[..., None]):
    opens = size("opens")
    with rig(tmp_path / "data") as it, sync_playwright() as playwright:
        runs = [(it.live.done(run)["id"], len(run["algorithms"])) for run in RUNS]
        server = psutil.Process(it.server.process.pid)
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        page = browser.new_page(viewport=SIZE, base_url=it.url)  # type: ignore[arg-type]
        devtools = page.context.new_cdp_session(page)
        devtools.send("Performance.enable")
        page.goto("/")
        page.locator(".mission").first.wait_for()
        levels: dict[str, list[float]] = {}
        for n in range(opens):
            opened(page, *runs[n % len(runs)])
            if n % len(runs):
                continue
            files, threads = descriptors(server)
            scenes = it.live.http.get("/api/scenes").json()["open"]
            now: dict[str, Any] = counts(devtools) | {
                "browser": resident(psutil.Process()),
                "server": server.memory_info().rss,
                "files": files,
                "threads": threads,
                "scenes": scenes,
            }
            for name, value in now.items():
                levels.setdefault(name, []).append(value)
        browser.close()
        until(lambda: it.live.http.get("/api/scenes").json()["open"] == 0, "closed panes")
    grown = {name: growth(values) for name, values in levels.items()}
    told(
        opens=opens,
        first_middle_last={n: [round(v) for v in (x[0], x[len(x) // 2], x[-1])] for n, x in levels.items()},
        growth_percent={name: round(100 * g, 1) for name, g in grown.items()},
    )
    assert all(g < ALLOWED for g in grown.values()), grown
