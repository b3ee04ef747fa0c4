"""Pages, streams and scenes opened and closed again and again leave no file and no thread open."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import httpx
import psutil

from tests.server.living import LONG, PATIENCE_S, SHORT, Live, until
from tests.server.test_scenes import session, viewer
from tests.soak.rig import descriptors, rig
from tests.soak.sizes import size

#: Cycles until everything that is made once has been made.
WARM = 10
SLACK = 2


def cycle(live: Live, done: str, running: str) -> None:
    """A browser comes, looks at a page, a stream that goes on, and two scenes, and leaves."""
    with httpx.Client(base_url=live.url, timeout=PATIENCE_S) as browser:
        for path in ("/", "/static/main.js", "/api/jobs", f"/api/jobs/{done}/view"):
            assert browser.get(path).status_code == 200
        with browser.stream("GET", f"/api/jobs/{running}/events") as events:
            next(events.iter_lines())
    with session(live) as mine:
        for path in mine.show(done, "cekf", "nekf").values():
            with viewer(live, path) as socket:
                assert socket.recv(timeout=PATIENCE_S)


def test_files_and_threads_are_back_at_their_level_after_many_visits(tmp_path: Path, told: Callable[..., None]):
    with rig(tmp_path / "data") as it:
        live = it.live
        done, running = live.done(SHORT)["id"], live.submit(LONG)["id"]
        server = psutil.Process(it.server.process.pid)

        def open_panes() -> int:
            return live.http.get("/api/scenes").json()["open"]

        for _ in range(WARM):
            cycle(live, done, running)
        until(lambda: open_panes() == 0, "closed panes")
        before = descriptors(server)
        for _ in range(size("cycles")):
            cycle(live, done, running)
        until(lambda: open_panes() == 0, "closed panes")

        def level() -> bool:
            return all(abs(now - then) <= SLACK for now, then in zip(descriptors(server), before))

        until(level, f"files and threads as before, {before}; now {descriptors(server)}")
        told(cycles=size("cycles"), before=before, after=descriptors(server))
