"""How fast four panes follow the time slider, at the server and from the page and back."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import sync_playwright
from websockets.sync.client import connect

from tests.browser.conftest import FLAGS, SIZE, chromium
from tests.browser.serving import Server

#: Two hours, three vehicles, four filters.
RUN = {"scenario": "walls2011-topology-c", "trials": 2, "algorithms": ["dead_reckoning", "cekf", "nekf", "deif"]}
UPDATES_PER_S, ROUND_TRIP_S, SEEKS = 20, 0.1, 100

#: Notes how long each seek takes until the "at" of its moment comes back, ms.
NOTE = """
window.trips = [];
const send = WebSocket.prototype.send;
const left = new Map();
WebSocket.prototype.send = function (data) {
  const said = typeof data === "string" ? JSON.parse(data) : {};
  if (said.type === "seek") {
    left.set(said.time_s, performance.now());
    if (!this.noted) {
      this.noted = true;
      this.addEventListener("message", ({ data }) => {
        const { type, time_s } = JSON.parse(data);
        if (type !== "at" || !left.has(time_s)) return;
        trips.push(performance.now() - left.get(time_s));
        left.clear();
      });
    }
  }
  return send.call(this, data);
};
"""

DRAG = """async (seconds) => {
  const slider = document.querySelector("#time");
  const end = performance.now() + 1000 * seconds;
  trips.length = 0;
  while (performance.now() < end) {
    const share = 0.5 + 0.5 * Math.sin(performance.now() / 700);
    slider.value = String(share * Number(slider.max));
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    await new Promise((done) => requestAnimationFrame(done));
  }
  return trips;
}"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = Server(tmp_path_factory.mktemp("data"))
    server.start()
    yield server
    server.stop()


def test_the_server_updates_four_scenes(server: Server):
    job = server.finished(RUN)
    with connect(f"{server.url.replace('http', 'ws')}/api/scenes/session", max_size=None) as socket:
        socket.send(json.dumps({"type": "show", "job": job, "panes": RUN["algorithms"]}))

        def at(moment: float) -> None:
            socket.send(json.dumps({"type": "seek", "time_s": moment}))
            while (message := json.loads(socket.recv(timeout=60)))["type"] != "at" or message["time_s"] != moment:
                pass

        at(7199.0)
        start = time.perf_counter()
        for n in range(SEEKS):
            at(7000.0 * (n + 1) / SEEKS)
        rate = SEEKS / (time.perf_counter() - start)
    print(f"\npanes: {rate:.0f} updates of four scenes a second (wanted: {UPDATES_PER_S})")
    assert rate >= UPDATES_PER_S


def test_a_drag_goes_to_the_scenes_and_back(server: Server, tmp_path: Path):
    job = server.finished(RUN)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        page = browser.new_page(viewport=SIZE, base_url=server.url)  # type: ignore[arg-type]
        page.add_init_script(NOTE)
        page.goto(f"/#run={job}")
        page.locator(".pane[data-state=shown]").nth(3).wait_for(timeout=60_000)
        page.evaluate(DRAG, 3)
        trips = np.array(page.evaluate(DRAG, 8)) / 1000
        browser.close()
    median, slow = np.median(trips), np.quantile(trips, 0.95)
    rate = len(trips) / 8
    print(f"\npanes: page to scenes and back {median * 1e3:.0f} ms (95 %: {slow * 1e3:.0f} ms), {rate:.0f} a second")
    assert median < ROUND_TRIP_S
