"""Plots as a person uses them: chosen, zoomed, pointed at, told apart, saved."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from xml.etree import ElementTree

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect
from scipy.stats import chi2

from tests.browser.serving import Server, until
from tests.browser.test_time import now

MEDIAN, MEAN, FIRST = "band", "mean", "first"

#: The panes are looked at elsewhere; plans are drawn in less time.
LAYOUT = "&layout=plan"


def plot(page: Page, quantity: str) -> Locator:
    return page.locator(f".plot[data-quantity={quantity}]")


def ground(page: Page, quantity: str) -> dict[str, float]:
    """Where a plot's axes are on the screen."""
    found = plot(page, quantity)
    page.evaluate("node => node.scrollIntoView({block: 'center'})", found.element_handle())
    found.locator(".nsewdrag").wait_for()
    box = found.locator(".nsewdrag").bounding_box()
    assert box
    return dict(box)


def span(page: Page) -> tuple[float, float]:
    """The time that the slider can be moved over, s."""
    slider = page.get_by_role("slider", name="Mission time")
    return float(slider.get_attribute("min") or 0), float(slider.get_attribute("max") or 0)


def axis(page: Page, quantity: str, which: str) -> tuple[float, float]:
    """The range of a plot's axis, as plotly has it."""
    low, high = page.evaluate(
        "([q, a]) => document.querySelector(`.plot[data-quantity=${q}] .drawing`)._fullLayout[a].range",
        [quantity, which],
    )
    return low, high


def drawn_as(page: Page, quantity: str, which: str, low: float, high: float) -> None:
    """Wait until a plot's axis has a range; it is drawn a moment after it is asked for."""
    until(lambda: axis(page, quantity, which) == pytest.approx((low, high), rel=1e-9), f"{which} {low} to {high}")


@pytest.fixture(autouse=True)
def as_it_was(opened: Page):
    yield
    opened.mouse.move(5, 5)
    opened.locator("#stage").focus()
    opened.keyboard.press("Escape")


def test_quantities_are_chosen_and_kept_in_the_address(opened: Page, keep):
    expect(opened.locator("#plots .plot")).to_have_count(4)
    chooser = opened.get_by_role("group", name="Plots")
    chooser.get_by_role("button", name="Bandwidth").click()
    chooser.get_by_role("button", name="NEES").click()
    expect(plot(opened, "sent_bytes").locator(".js-line")).to_have_count(2)
    expect(plot(opened, "nees")).to_have_count(0)
    expect(opened).to_have_url(re.compile("plots=[^&]*sent_bytes"))
    ground(opened, "sent_bytes")
    keep(opened)
    chooser.get_by_role("button", name="Bandwidth").click()
    chooser.get_by_role("button", name="NEES").click()
    expect(opened).not_to_have_url(re.compile("plots="))
    expect(plot(opened, "nees").locator(".js-line")).to_have_count(3)


def test_trials_are_a_median_with_a_band_or_a_mean_or_one(opened: Page, server: Server, run: str, keep):
    view = server.get(f"/api/jobs/{run}/view")
    told = view["algorithms"]["nekf"]["subjects"]["scout"]
    error = plot(opened, "error_m")
    ground(opened, "error_m")

    def drawn() -> list[float]:
        return opened.evaluate(
            "() => document.querySelector('.plot[data-quantity=error_m] .drawing').data.find(t => t.meta === 'nekf').y"
        )

    expect(error.locator(".how")).to_have_text("median and 5–95 % of 3 trials")
    expect(error.locator(".shapelayer path")).to_have_count(3)
    assert drawn() == told["band"]["error_m"][1]
    telling = opened.get_by_label("Trials as")
    telling.select_option(MEAN)
    expect(error.locator(".how")).to_have_text("RMS of 3 trials")
    expect(error.locator(".shapelayer path")).to_have_count(0)
    until(lambda: drawn() == told["error_m"], "the curve of the mean")
    expect(opened).to_have_url(re.compile("trials=mean"))
    telling.select_option(FIRST)
    expect(error.locator(".how")).to_have_text("the trial drawn")
    truth = np.array(view["truth"]["scout"], dtype=float)
    away = np.hypot(*(np.array(told["mean"]) - truth).T)
    until(lambda: drawn() == pytest.approx(away), "the curve of the trial drawn")
    telling.select_option(MEDIAN)
    expect(error.locator(".shapelayer path")).to_have_count(3)
    keep(opened)


def test_nees_has_the_bounds_of_the_chi_square(opened: Page):
    ground(opened, "nees")
    expect(plot(opened, "nees").locator(".shapelayer path")).to_have_count(1)
    path = opened.evaluate("() => document.querySelector('.plot[data-quantity=nees] .drawing').layout.shapes[0].path")
    heights = sorted({float(corner.split(",")[1]) for corner in re.findall(r"[\d.e+-]+,[\d.e+-]+", path)})
    np.testing.assert_allclose(heights, chi2.ppf([0.025, 0.975], 6) / 3, rtol=1e-4)
    expect(plot(opened, "nees").locator(".how")).to_have_text("mean of 3 trials")


def lines(page: Page, quantity: str) -> dict[str, dict[str, list[float]]]:
    """What a plot draws, by estimator."""
    found = page.evaluate(
        "q => document.querySelector(`.plot[data-quantity=${q}] .drawing`).data.map(({meta, x, y}) => ({meta, x, y}))",
        quantity,
    )
    return {line["meta"]: line for line in found}


def test_errors_are_told_by_how_many_are_how_large(opened: Page, server: Server, run: str, keep):
    chooser = opened.get_by_role("group", name="Plots")
    chooser.get_by_role("button", name="Distribution of errors").click()
    ground(opened, "distribution")
    distribution = plot(opened, "distribution")
    expect(distribution.locator(".js-line")).to_have_count(3)
    expect(distribution.locator(".how")).to_have_text("all of 3 trials")
    arrays = np.load(io.BytesIO(httpx.get(f"{server.url}/api/jobs/{run}/arrays").content))
    error = np.linalg.norm(arrays["nekf/scout/mean"] - arrays["truth/scout"], axis=-1)
    half, most = np.median(error), error.max()
    for share, place in ((50, half), (100, most)):
        found = np.interp(share, lines(opened, "distribution")["nekf"]["y"], lines(opened, "distribution")["nekf"]["x"])
        assert found == pytest.approx(place, rel=0.02)
    expect(distribution.locator(".entry").nth(2)).to_contain_text(f"most {float(f'{most:.3g}'):g} m")
    keep(opened)
    distribution.get_by_role("button", name="log").click()
    until(lambda: axis(opened, "distribution", "xaxis")[1] == pytest.approx(np.log10(40), abs=2), "a logarithmic axis")
    head, *body = csv.reader(io.StringIO(saved(opened, "distribution", "CSV").read_text()))
    assert head == ["errors below (%)", "Dead reckoning (m)", "Centralized EKF (m)", "Naive EKF (m)"]
    assert [float(row[3]) for row in body] == lines(opened, "distribution")["nekf"]["x"]
    opened.get_by_label("Trials as").select_option(FIRST)
    expect(distribution.locator(".how")).to_have_text("the trial drawn")
    alone = np.percentile(np.linalg.norm(arrays["nekf/scout/mean"][0] - arrays["truth/scout"][0], axis=-1), [50, 95])

    def drawn() -> bool:
        return np.array(lines(opened, "distribution")["nekf"]["x"])[[50, 95]] == pytest.approx(alone, rel=0.02)

    until(drawn, "the errors of the trial drawn")
    opened.get_by_label("Trials as").select_option(MEDIAN)
    for name in ("dead_reckoning", "cekf", "nekf"):
        opened.locator(f".chip[data-name={name}]").click()
    expect(distribution.locator(".js-line")).to_have_count(0)
    expect(distribution).to_contain_text("Nothing of what is shown has this.")
    opened.get_by_role("button", name="Show all").click()
    expect(distribution.locator(".js-line")).to_have_count(3)
    distribution.get_by_role("button", name="log").click()
    chooser.get_by_role("button", name="Distribution of errors").click()
    expect(distribution).to_have_count(0)


def test_an_error_along_an_axis_is_drawn_in_two_of_its_sigmas(opened: Page, server: Server, run: str, keep):
    chooser = opened.get_by_role("group", name="Plots")
    chooser.get_by_role("button", name="North error").click()
    ground(opened, "north_m")
    expect(plot(opened, "north_m").locator(".js-line")).to_have_count(3)
    expect(plot(opened, "north_m").locator(".shapelayer path")).to_have_count(3)
    view = server.get(f"/api/jobs/{run}/view")
    told = view["algorithms"]["cekf"]["subjects"]["scout"]
    north = np.array(told["mean"])[:, 1] - np.array(view["truth"]["scout"])[:, 1]
    assert lines(opened, "north_m")["cekf"]["y"] == pytest.approx(north)
    keep(opened)
    head, *body = csv.reader(io.StringIO(saved(opened, "north_m", "CSV").read_text()))
    place = head.index("Centralized EKF +2 sigma (m)")
    assert float(body[-1][place]) == pytest.approx(2 * np.sqrt(told["cov"][-1][2]))
    chooser.get_by_role("button", name="North error").click()
    expect(plot(opened, "north_m")).to_have_count(0)


def test_an_axis_is_logarithmic_and_linear_again(opened: Page):
    ground(opened, "error_m")
    _, top = axis(opened, "error_m", "yaxis")
    button = plot(opened, "error_m").get_by_role("button", name="log")
    button.click()
    expect(button).to_have_attribute("aria-pressed", "true")
    expect(opened).to_have_url(re.compile("log=error_m"))

    def logarithmic() -> bool:
        low, high = axis(opened, "error_m", "yaxis")
        return 10**low > 0.001 and 10**high == pytest.approx(top, rel=0.5)

    until(logarithmic, "a logarithmic axis")
    button.click()
    expect(button).to_have_attribute("aria-pressed", "false")
    until(lambda: axis(opened, "error_m", "yaxis")[1] == top, "a linear axis again")


def test_pointing_at_one_plot_points_at_all_of_them_and_at_the_slider(opened: Page, keep):
    box = ground(opened, "error_m")
    opened.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 30)
    for quantity in ("error_m", "sigma_m"):
        probe = plot(opened, quantity).locator(".probe")
        expect(probe).to_be_visible()
        expect(probe).to_have_text(re.compile("0:0(4:59|5:0[0-2])"))
    expect(opened.locator("#timeline .probe")).to_be_visible()
    keep(opened)
    opened.mouse.move(5, 5)
    expect(opened.locator(".probe:visible")).to_have_count(0)


def test_brushing_a_plot_zooms_time_everywhere(opened: Page, keep):
    box = ground(opened, "error_m")
    y = box["y"] + 30
    opened.mouse.move(box["x"] + 0.25 * box["width"], y)
    opened.mouse.down()
    opened.mouse.move(box["x"] + 0.5 * box["width"], y, steps=5)
    expect(plot(opened, "error_m").locator(".brush")).to_be_visible()
    opened.mouse.up()
    expect(opened.locator(".whole")).to_have_text(re.compile("0:0(4:5|5:0).* – 0:(09:5|10:0)"))
    np.testing.assert_allclose(span(opened), (300, 600), atol=6)
    assert now(opened) == 1200, "time stays where it was"
    expect(opened).to_have_url(re.compile("zoom="))
    for quantity in ("error_m", "sigma_m"):
        low, high = span(opened)
        drawn_as(opened, quantity, "xaxis", low / 60, high / 60)
    keep(opened)

    box = ground(opened, "sigma_m")
    opened.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 30)
    assert now(opened) == pytest.approx(450, abs=8), "a click goes to the time of the zoomed axis"
    opened.mouse.dblclick(box["x"] + 0.5 * box["width"], box["y"] + 30)
    assert span(opened) == (0, 1200)
    expect(opened.locator(".whole")).to_be_hidden()


def test_zooming_by_keyboard(opened: Page):
    ground(opened, "error_m")
    opened.locator("#stage").focus()
    opened.keyboard.press("+")
    assert span(opened) == (600, 1200), "about the time on the clock"
    opened.keyboard.press("+")
    assert span(opened) == (900, 1200)
    opened.keyboard.press("-")
    assert span(opened) == (600, 1200)
    opened.keyboard.press("Escape")
    assert span(opened) == (0, 1200)


def test_a_span_in_the_address_is_shown(opened: Page, run: str):
    opened.goto(f"/#run={run}{LAYOUT}&t=500&zoom=400-700&log=sigma_m&plots=sigma_m,nis")
    opened.reload()
    opened.locator(".plot .js-line").first.wait_for()
    expect(opened.locator(".whole")).to_be_visible()
    assert span(opened) == (400, 700) and now(opened) == 500
    expect(opened.locator("#plots .plot")).to_have_count(2)
    expect(plot(opened, "sigma_m").get_by_role("button", name="log")).to_have_attribute("aria-pressed", "true")
    opened.goto(f"/#run={run}{LAYOUT}")
    expect(opened.locator("#plots .plot")).to_have_count(4)
    assert span(opened) == (0, 1200)


def saved(page: Page, quantity: str, format: str) -> Path:
    """The file that a plot's menu saves."""
    ground(page, quantity)
    plot(page, quantity).locator("summary").click()
    with page.expect_download() as download:
        plot(page, quantity).get_by_role("button", name=format, exact=True).click()
    assert download.value.suggested_filename == f"first-look-scout-{quantity}.{format.lower()}"
    expect(plot(page, quantity).locator("details")).not_to_have_attribute("open", "")
    expect(plot(page, quantity).locator(".js-line").first).to_be_visible()  # it is still there
    return Path(download.value.path())


def test_a_plot_is_saved_as_a_picture(opened: Page):
    image = Image.open(saved(opened, "error_m", "PNG"))
    assert image.size == (1800, 960)
    assert np.asarray(image.convert("L")).std() > 5, "there is something in it"


def test_a_plot_is_saved_as_a_drawing(opened: Page):
    drawing = ElementTree.parse(saved(opened, "error_m", "SVG"))
    words = "".join(drawing.getroot().itertext())
    for title in ("Dead reckoning", "Centralized EKF", "Naive EKF", "Error of scout", "Error (m)"):
        assert title in words
    lines = [node for node in drawing.iter() if node.get("class") == "js-line"]
    assert len(lines) >= 3, "a line for every estimator"


def test_a_plots_numbers_are_saved_as_shown(opened: Page, server: Server, run: str):
    opened.locator("#stage").focus()
    opened.keyboard.press("+")
    rows = list(csv.reader(io.StringIO(saved(opened, "error_m", "CSV").read_text())))
    opened.keyboard.press("Escape")
    head, *body = rows
    assert head[0] == "time_s" and head[1] == "Dead reckoning (m)" and len(head) == 10
    view = server.get(f"/api/jobs/{run}/view")
    kept = [n for n, t in enumerate(view["time_s"]) if 600 <= t <= 1200]
    assert [float(row[0]) for row in body] == [view["time_s"][n] for n in kept]
    low, middle, high = view["algorithms"]["nekf"]["subjects"]["scout"]["band"]["error_m"]
    place = head.index("Naive EKF (m)")
    for row, n in zip(body, kept, strict=True):
        assert [float(cell) for cell in row[place : place + 3]] == [middle[n], low[n], high[n]]
