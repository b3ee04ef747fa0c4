"""What goes wrong is said: where it is at fault, what to do, and when it is over."""

from __future__ import annotations

import json
import re
from pathlib import Path

import httpx
from playwright.sync_api import Browser, BrowserContext, Page, Route, expect

from tests.browser.conftest import SIZE, SOLO, Watch
from tests.browser.eyes import difference, pixels, see_the_vehicles, settled
from tests.browser.serving import Server, held, until


def test_bad_input_names_its_key(page: Page, server: Server, watch: Watch, keep):
    watch.refusals.add(422)
    page.goto("/")
    expect(page.locator("#run")).to_be_enabled()
    before = len(server.get("/api/jobs"))
    refusal = page.locator("#refusal")
    for field, value in (("trials", "0"), ("trials", "many"), ("seed", "-1"), ("network.loss", "1.5")):
        entry = page.locator(f"[id='field-{field}']")
        kept = entry.input_value()
        entry.fill(value)
        page.locator("#run").click()
        expect(entry).to_have_attribute("aria-invalid", "true")
        expect(refusal.locator("code").first).to_have_text(field)
        expect(entry).to_be_focused()
        if value == "1.5":
            keep(page)
        entry.fill(kept)
    assert len(server.get("/api/jobs")) == before, "nothing was accepted"


def test_packet_loss_can_be_overridden(page: Page, server: Server):
    page.goto("/")
    page.locator("#field-trials").fill("1")
    page.locator("[id='field-network.loss']").fill("1")
    page.locator("#run").click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    expect(page.locator(".lane-keys")).to_contain_text("0 heard")


def test_a_long_run_can_be_cancelled(page: Page, server: Server, keep):
    page.goto("/")
    page.locator(".mission", has_text="topology C").click()
    page.locator("#field-trials").fill("2000")
    page.locator("#run").click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "running")
    expect(page).to_have_url(re.compile("run="))
    id = page.url.rpartition("run=")[2].partition("&")[0]
    page.locator("#cancel").click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "cancelled")
    expect(page.locator("#cancel")).to_be_hidden()
    expect(page.locator("#progress")).to_be_hidden()
    assert server.get(f"/api/jobs/{id}")["state"] == "cancelled"
    keep(page)


def test_a_run_that_is_gone_is_said_to_be_gone(page: Page, watch: Watch):
    watch.refusals.add(404)
    page.goto("/#run=nosuchrun")
    expect(page.locator("#notices")).to_contain_text("This run does not exist")
    expect(page.locator("#empty")).to_be_visible()


def test_a_run_that_failed_says_why(page: Page, server: Server, solo: str):
    job = server.get(f"/api/jobs/{solo}")
    job |= {"state": "failed", "error": {"title": "The run failed", "detail": "cekf left no estimate"}}
    page.route(f"**/api/jobs/{solo}", lambda route: route.fulfill(json=job))
    page.route(
        f"**/api/jobs/{solo}/events",
        lambda route: route.fulfill(
            body=f"id: 1\nevent: state\ndata: {json.dumps(job)}\n\n", content_type="text/event-stream"
        ),
    )
    page.goto(f"/#run={solo}")
    expect(page.locator("#notices")).to_contain_text("The run failed")
    expect(page.locator("#notices")).to_contain_text("cekf left no estimate")
    expect(page.locator("#headline .state")).to_have_text("failed")
    expect(page.locator(".pane .veil")).to_have_text("No estimates were made.")
    expect(page.locator("#table")).to_contain_text("The run failed before there were figures.")


def test_where_there_is_nothing_yet_the_page_says_what_to_do(page: Page):
    page.route("**/api/jobs", lambda route: route.fulfill(json=[]))
    release = held(page, "**/api/scenarios")
    page.goto("/")
    expect(page.locator("#empty")).to_have_text("Reading the library…")
    page.get_by_role("tab", name="Runs").click()
    expect(page.locator("#panel-runs")).to_contain_text("No runs yet")
    release()
    expect(page.get_by_role("heading", name="First look")).to_be_visible()
    page.get_by_role("link", name="Runs", exact=True).click()
    expect(page.locator("#runs-room")).to_contain_text("Pick a mission in the workbench and press Run")


def test_a_broken_event_stream_goes_on_where_it_stopped(page: Page, server: Server):
    """The first connection breaks after one event; the next asks for what came after it."""
    asked: list[str | None] = []

    def breaking(route: Route) -> None:
        asked.append(route.request.headers.get("last-event-id"))
        if len(asked) == 1:
            body = 'id: 1\nevent: progress\ndata: {"fraction": 0.25, "shards_done": 0, "shards": 4}\n\n'
            route.fulfill(body=body, content_type="text/event-stream")
        else:
            route.continue_()

    page.route("**/events", breaking)
    page.goto("/")
    page.locator("#run").click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    assert asked[:2] == [None, "1"]


def test_titles_are_text_whatever_they_contain(page: Page, server: Server):
    scenario = server.get("/api/scenarios/first-look")["scenario"]
    scenario["title"] = "<img src=x onerror=document.title='taken'> & <b>bold</b>"
    saved = httpx.put(f"{server.url}/api/scenarios/hostile", json=scenario, timeout=20)
    assert saved.is_success, saved.text
    try:
        page.goto("/")
        mission = page.locator(".mission[data-name=hostile]")
        expect(mission.locator(".title")).to_contain_text(scenario["title"])
        mission.click()
        expect(page.locator("#empty h1")).to_have_text(scenario["title"])
        assert page.locator("img[src=x], .title b").count() == 0
        assert page.title() == "coopnav"
    finally:
        httpx.delete(f"{server.url}/api/scenarios/hostile", timeout=20)


def test_without_webgl_the_rest_remains(context: BrowserContext, run: str, keep):
    context.add_init_script(
        """const get = HTMLCanvasElement.prototype.getContext;
        HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
          return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest);
        };"""
    )
    page = context.new_page()
    page.goto(f"/#run={run}")
    expect(page.locator("#panes .note")).to_contain_text("WebGL")
    expect(page.locator(".pane[data-state=shown] canvas.plan")).to_have_count(3)
    assert page.locator("iframe").count() == 0
    for quantity in ("sigma_m", "error_m"):
        expect(page.locator(f".plot[data-quantity={quantity}] .js-line")).to_have_count(3)
    expect(page.locator("#table tbody tr")).to_have_count(6)
    keep(page)


def test_two_tabs_do_not_share_a_scene(context: BrowserContext, solo: str):
    one, other = context.new_page(), context.new_page()
    scenes = []
    for page in (one, other):
        page.goto(f"/#run={solo}")
        see_the_vehicles(page, ["cekf"])
        scenes.append(set(page.locator("iframe").evaluate_all("all => all.map(f => f.src)")))
    assert len(scenes[0]) == len(scenes[1]) == 1
    assert not scenes[0] & scenes[1]
    before = settled(other, "cekf")
    one.bring_to_front()
    at_the_end = settled(one, "cekf")
    one.locator("#stage").focus()
    one.keyboard.press("Home")
    until(lambda: difference(at_the_end, pixels(one, "cekf")) > 0.005, "the first tab to move")
    other.bring_to_front()
    assert difference(before, settled(other, "cekf")) < 0.001


def test_a_lost_server_is_told_and_found_again(browser: Browser, tmp_path: Path, keep):
    server = Server(tmp_path)
    server.start()
    context = browser.new_context(viewport=SIZE, base_url=server.url)  # type: ignore[arg-type]
    try:
        run = server.finished(SOLO)
        page = context.new_page()
        page.goto(f"/#run={run}")
        see_the_vehicles(page, ["cekf"])
        lost = page.get_by_role("alert").filter(has_text="does not answer")
        expect(lost).to_be_hidden()
        server.stop()
        expect(lost).to_be_visible()
        expect(page.locator("#table tbody tr")).to_have_count(2)
        keep(page)
        server.start()
        expect(lost).to_be_hidden()
        scene = page.locator(".pane[data-algorithm=cekf] iframe")
        until(lambda: httpx.get(server.url + str(scene.get_attribute("src"))).status_code == 200, "new scenes")
        see_the_vehicles(page, ["cekf"])
    finally:
        context.close()
        server.stop()
