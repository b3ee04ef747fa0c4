"""On a tablet: by touch, upright and across, nothing runs off the screen."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import Watch, window
from tests.browser.serving import Server, until
from tests.browser.test_time import now

ACROSS, UPRIGHT = {"width": 1024, "height": 768}, {"width": 768, "height": 1024}
WIDER = """() => [document.documentElement, document.querySelector('#stage')]
  .map(node => node.scrollWidth - node.clientWidth).filter(over => over > 1)"""


OVERLAPPING = """() => {
  const boxes = [...document.querySelectorAll('.top, #side, #stage')].map(node => node.getBoundingClientRect());
  const common = (a, b) => Math.min(
    Math.min(a.right, b.right) - Math.max(a.left, b.left), Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top));
  return boxes.flatMap((a, n) => boxes.slice(n + 1).filter(b => common(a, b) > 1)).length;
}"""


@pytest.fixture
def tablet(browser: Browser, server: Server) -> Iterator[Page]:
    with window(browser, server, Watch(), viewport=ACROSS, has_touch=True) as context:
        yield context.new_page()


@pytest.mark.parametrize("size", [ACROSS, UPRIGHT], ids=["across", "upright"])
def test_nothing_runs_off_the_screen_or_over_the_rest(tablet: Page, run: str, size, keep):
    tablet.set_viewport_size(size)
    for address, there in (
        ("/", "#studies"),
        (f"/#run={run}", "#table tbody tr"),
        ("/#room=runs", ".history tbody tr"),
        ("/#room=claims", "#claims-room h2"),
    ):
        tablet.goto(address)
        tablet.locator(there).first.wait_for()
        expect(tablet.locator(".top .brand")).to_be_in_viewport()
        assert tablet.evaluate(WIDER) == [], address
        assert tablet.evaluate(OVERLAPPING) == 0, address
        keep(tablet)


def test_a_run_is_made_and_looked_at_by_touch(tablet: Page):
    tablet.goto("/")
    tablet.locator(".mission[data-name=first-look]").tap()
    tablet.locator("#field-trials").tap()
    tablet.locator("#field-trials").fill("2")
    tablet.locator("#run").tap()
    expect(tablet.locator("#headline .state")).to_have_attribute("data-state", "done")
    expect(tablet.locator("#table tbody tr").nth(5)).to_be_attached()
    tablet.locator(".chip[data-name=nekf]").tap()
    expect(tablet.locator(".pane[data-algorithm=nekf]")).to_be_hidden()
    lanes = tablet.locator("#timeline .lanes")
    lanes.scroll_into_view_if_needed()
    box = lanes.bounding_box()
    assert box
    tablet.touchscreen.tap(box["x"] + box["width"] / 2, box["y"] + 3)
    until(lambda: abs(now(tablet) - 600) < 15, "half of the mission")
    tablet.locator("#table .verdict").first.tap()
    expect(tablet.get_by_role("tooltip")).to_be_visible()
    tablet.locator("#table h2").tap()
    expect(tablet.get_by_role("tooltip")).to_be_hidden()
