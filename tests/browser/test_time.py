"""One time for panes, plots and readings: by slider, plot, play button and keyboard."""

from __future__ import annotations

import re

import httpx
from playwright.sync_api import Page, expect

from tests.browser.eyes import difference, pixels, see_the_vehicles, settled
from tests.browser.serving import Server, until

#: A run that is at work for longer than the test.
LONG = {"scenario": "walls2011-topology-c", "trials": 2000, "algorithms": ["dead_reckoning", "cekf"]}

TWO_FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


def now(page: Page) -> float:
    """Mission time on the clock, s."""
    h, m, s = page.locator(".now").inner_text().split(":")
    return 3600 * int(h) + 60 * int(m) + float(s)


def test_the_slider_moves_the_scene(opened: Page, keep):
    see_the_vehicles(opened, ["cekf"])
    before = settled(opened, "cekf")
    slider = opened.get_by_role("slider", name="Mission time")
    slider.focus()
    opened.keyboard.press("Home")
    assert now(opened) == 0
    until(lambda: difference(before, pixels(opened, "cekf")) > 0.005, "the tracks to be gone at the start")
    box = slider.bounding_box()
    assert box
    opened.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert abs(now(opened) - 600) < 30
    keep(opened)


def test_space_plays_and_pauses(opened: Page):
    opened.locator("#stage").focus()
    opened.keyboard.press("Home")
    opened.keyboard.press(" ")
    expect(opened.get_by_role("button", name="Pause")).to_be_visible()
    until(lambda: now(opened) > 5, "time to run")
    opened.keyboard.press(" ")
    expect(opened.get_by_role("button", name="Play")).to_be_visible()
    stopped = now(opened)
    opened.evaluate(TWO_FRAMES)
    assert now(opened) == stopped


def test_brackets_change_the_speed(opened: Page):
    opened.locator("#stage").focus()
    speed = opened.get_by_label("Playback speed")
    first = float(speed.input_value())
    opened.keyboard.press("]")
    assert float(speed.input_value()) > first
    opened.keyboard.press("[")
    assert float(speed.input_value()) == first


def test_arrows_step_by_report_and_by_event(opened: Page):
    opened.locator("#stage").focus()
    opened.keyboard.press("Home")
    opened.keyboard.press("ArrowRight")
    assert now(opened) == 2, "the mission reports every two seconds"
    opened.keyboard.press("ArrowLeft")
    assert now(opened) == 0
    opened.get_by_role("button", name="Next event").click()
    first = now(opened)
    expect(opened.locator(".event")).to_have_text(re.compile("(ship|scout) → (ship|scout) (heard|lost)"))
    opened.locator("#stage").focus()
    opened.keyboard.press("Shift+ArrowRight")
    assert now(opened) > first
    opened.keyboard.press("Shift+ArrowLeft")
    assert now(opened) == first


def test_a_plot_has_a_line_per_algorithm_and_its_cursor_follows(opened: Page, keep):
    for quantity in ("sigma_m", "error_m"):
        plot = opened.locator(f".plot[data-quantity={quantity}]")
        lines = plot.locator(".scatterlayer .js-line")
        expect(lines).to_have_count(3)
        styles = lines.evaluate_all("all => all.map(l => l.style.stroke + l.style.strokeDasharray)")
        assert len(set(styles)) == 3, "each algorithm has a line of its own"
        dashes = lines.evaluate_all("all => all.map(l => l.style.strokeDasharray)")
        assert len(set(dashes)) == 3, "and can be told by its dash alone"

    plot = opened.locator(".plot[data-quantity=error_m]")
    plot.scroll_into_view_if_needed()
    ground = plot.locator(".nsewdrag").bounding_box()
    assert ground

    def cursor() -> float:
        box = plot.locator(".cursor:not(.probe)").bounding_box()
        assert box
        return (box["x"] - ground["x"]) / ground["width"]

    opened.locator("#stage").focus()
    opened.keyboard.press("Home")
    assert abs(cursor()) < 0.02
    opened.keyboard.press("End")
    assert abs(cursor() - 1) < 0.02

    opened.mouse.click(ground["x"] + ground["width"] / 4, ground["y"] + ground["height"] / 2)
    assert abs(now(opened) - 300) < 10, "a click in a plot goes to that time"
    assert abs(cursor() - 0.25) < 0.02
    keep(opened)


def test_dragging_in_a_plot_with_shift_moves_time(opened: Page):
    ground = opened.locator(".plot[data-quantity=sigma_m] .nsewdrag").bounding_box()
    assert ground
    x, y = ground["x"], ground["y"] + 20
    opened.keyboard.down("Shift")
    opened.mouse.move(x + 0.8 * ground["width"], y)
    opened.mouse.down()
    opened.mouse.move(x + 0.5 * ground["width"], y, steps=4)
    opened.mouse.up()
    opened.keyboard.up("Shift")
    assert abs(now(opened) - 600) < 15


def test_pointing_at_a_plot_reads_all_curves_there(opened: Page):
    values = opened.locator(".plot[data-quantity=sigma_m] .legend .value")
    at_the_end = values.all_inner_texts()
    ground = opened.locator(".plot[data-quantity=error_m] .nsewdrag").bounding_box()
    assert ground
    opened.mouse.move(ground["x"] + 5, ground["y"] + 20)
    expect(values.first).not_to_have_text(at_the_end[0])
    assert now(opened) == 1200, "pointing does not move time"
    opened.mouse.move(5, 5)
    expect(values.first).to_have_text(at_the_end[0])


def test_marks_tell_what_happened_under_the_pointer(opened: Page):
    lanes = opened.locator("#timeline .lanes").bounding_box()
    assert lanes
    opened.get_by_role("button", name="Previous event").click()
    said = opened.locator(".event").inner_text()
    share = now(opened) / 1200
    opened.locator("#stage").focus()
    opened.keyboard.press("Home")
    opened.mouse.move(lanes["x"] + 8 + share * (lanes["width"] - 16), lanes["y"] + 3)
    expect(opened.locator(".event")).to_have_text(said)
    assert now(opened) == 0, "pointing does not move time"


def test_a_live_run_follows_its_head_until_the_person_scrubs(page: Page, server: Server):
    job = httpx.post(f"{server.url}/api/jobs", json=LONG, timeout=20).json()["id"]
    page.goto(f"/#run={job}")
    expect(page.locator(".now")).not_to_have_text("0:00:00.0")
    live = page.get_by_role("button", name="Live")
    expect(live).to_be_hidden()
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    expect(live).to_be_visible()
    page.evaluate(TWO_FRAMES)
    assert now(page) == 0, "time stays where it was put"
    live.click()
    expect(live).to_be_hidden()
    until(lambda: now(page) > 0, "time to be at the head again")
    page.locator("#headline").get_by_role("button", name="Cancel").click()
    expect(page.locator("#headline .state")).to_have_text("cancelled")
