"""A pursuit's own views: the layer in the panes, the schedule under the slider, the transfer function."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser import eyes
from tests.browser.serving import Server, until

NAMES = ["decentralized_pursuit", "centralized_pursuit"]
CHASE = {
    "scenario": "cheung2019-pursuit-inner",
    "trials": 2,
    "algorithms": NAMES,
    "set": {"duration_s": 1400, "network.loss": 0.1},
}


@pytest.fixture(scope="module")
def chased(server: Server) -> str:
    """Id of a finished run of both architectures, with enough loss to see some."""
    return server.finished(CHASE)


def show(page: Page, run: str, layout: str = "plan") -> None:
    page.goto(f"/#run={run}&layout={layout}")
    page.locator("#table tbody tr").first.wait_for()
    page.locator("#schedule .tape .spoke").first.wait_for()


def tape(page: Page, number: int):
    return page.locator("#schedule .schedule-of").nth(number)


def test_formation_and_hyperbolas_are_a_layer_that_can_be_switched(page: Page, chased: str, keep):
    show(page, chased, "side")
    for name in NAMES:
        page.locator(f".pane[data-algorithm={name}][data-state=shown]").wait_for()
    for other in ("Trails", "Ellipses", "Rays"):
        page.get_by_label(other, exact=True).uncheck()
    layer = page.get_by_label("Formation", exact=True)
    layer.uncheck()

    def drawn(name: str) -> int:
        """Pixels as orange or green as the hyperbolas."""
        image = eyes.pixels(page, name)
        return sum(eyes.count(image, colour) for colour in eyes.vehicle_colours(page)[1:3])

    def steady() -> list[int] | None:
        before, after = ([drawn(name) for name in NAMES] for _ in range(2))
        return after if before == after and all(0 < pixels < 120 for pixels in after) else None

    def more() -> list[int]:
        return [drawn(name) - pixels for name, pixels in zip(NAMES, without)]

    without = until(steady, "the panes without tracks", 120.0)
    layer.check()
    until(lambda: min(more()) > 40, "the hyperbolas in both panes", 120.0)
    keep(page)
    layer.uncheck()
    until(lambda: max(more()) < 30, "the layer to go", 120.0)


def test_the_schedule_runs_with_the_clock_and_says_who_heard_what(page: Page, server: Server, chased: str, keep):
    show(page, chased)
    expect(page.locator("#schedule .schedule-of")).to_have_count(2)
    expect(tape(page, 0)).to_contain_text("28 s cycle")
    expect(tape(page, 1)).to_contain_text("35 s cycle")
    story = server.get(f"/api/jobs/{chased}/graphs/decentralized_pursuit")
    vehicles = story["vehicles"]
    slot = next(
        s for s in story["slots"] if s["cycle"] > 2 and s["sender"] in vehicles and s["spoke"] and len(s["heard"]) == 1
    )
    page.evaluate(
        "time => import('/static/state/clock.js').then(({ clock }) => clock.seek(time))", slot["start_s"] + 1.0
    )
    said = tape(page, 0).locator(".said")
    expect(said).to_contain_text(f"{slot['sender']}'s message: heard by {slot['heard'][0]}, lost by")
    for kind in ("spoke", "heard", "lost", "state.partial", "state.full"):
        expect(tape(page, 0).locator(f".tape .{kind}").first).to_be_attached()
    page.locator("#schedule").scroll_into_view_if_needed()
    keep(page)
    page.get_by_role("button", name="Next slot").click()
    expect(said).not_to_contain_text(f"{slot['sender']}'s message")
    page.get_by_role("button", name="Previous slot").click()
    now = page.locator("#timeline .now").inner_text()
    box = tape(page, 1).locator("svg.tape").bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + 5)
    expect(page.locator("#timeline .now")).not_to_have_text(now)


def test_the_transfer_function_is_drawn_on_logarithmic_axes(page: Page, chased: str, keep):
    show(page, chased)
    response = page.locator("#schedule .response")
    response.locator("summary").click()
    expect(response.locator(".scatterlayer .trace")).to_have_count(4)
    expect(response).to_contain_text(re.compile(r"Break between 0\.\d+ and 0\.\d+ rad/s, of 2 trials"))
    drawing = response.locator(".drawing")
    assert drawing.evaluate("plot => plot.layout.xaxis.type + plot.layout.yaxis.type") == "loglog"
    response.scroll_into_view_if_needed()
    keep(page)


def test_other_missions_have_no_schedule(page: Page, solo: str):
    page.goto(f"/#run={solo}&layout=plan")
    page.locator("#table tbody tr").first.wait_for()
    expect(page.locator("#schedule")).to_be_hidden()
    expect(page.get_by_label("Formation", exact=True)).to_be_hidden()
