"""What is taken off the page is let go; tests/soak/soak_page.py does it for long, with panes."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Page


def counter(page: Page) -> Callable[[], int]:
    """A function that counts the nodes that are left in the page when its garbage has been collected."""
    devtools = page.context.new_cdp_session(page)
    devtools.send("Performance.enable")

    def count() -> int:
        for _ in range(3):
            devtools.send("HeapProfiler.collectGarbage")
        told = devtools.send("Performance.getMetrics")["metrics"]
        return next(int(each["value"]) for each in told if each["name"] == "Nodes")

    return count


def test_a_plot_that_is_taken_off_the_page_leaves_nothing(page: Page, run: str):
    page.goto(f"/#run={run}&layout=plan")
    chip = page.locator("#plots .chip[data-key=sigma_m]")
    plot = page.locator(".plot[data-quantity=sigma_m]")
    plot.locator(".js-line").first.wait_for()
    page.mouse.move(5, 5)
    count = counter(page)

    def off_and_on(times: int) -> int:
        for _ in range(times):
            chip.click()
            plot.wait_for(state="detached")
            chip.click()
            plot.locator(".js-line").first.wait_for()
        return count()

    first = off_and_on(2)
    one = plot.evaluate("root => root.querySelectorAll('*').length")
    after = off_and_on(5)
    # The last one may be waiting for a drawing to end, and how far the others are drawn varies; five would be left.
    assert after - first < 2 * one, f"{first} nodes before, {after} after, a plot has {one} elements"
