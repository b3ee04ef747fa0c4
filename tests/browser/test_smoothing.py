"""The smoothers' own views: the factor graph in the panes, the packet inspector, the reconstruction study."""

from __future__ import annotations

import re
from collections.abc import Iterator

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.browser import eyes
from tests.browser.serving import Server, until

SURFACING = {
    "scenario": "walls2015-trial-2",
    "trials": 1,
    "algorithms": ["k_best", "centralized_smoother"],
    "set": {"duration_s": 1800},
}


@pytest.fixture(scope="module")
def smoothed(server: Server) -> str:
    """Id of a finished run of two smoothers."""
    return server.finished(SURFACING)


def show(page: Page, run: str, layout: str = "plan") -> None:
    page.goto(f"/#run={run}&layout={layout}")
    page.locator("#table tbody tr").first.wait_for()
    page.locator("#broadcasts li").first.wait_for()


def test_the_factor_graph_is_a_layer_that_can_be_switched(page: Page, smoothed: str, keep):
    show(page, smoothed, "side")
    eyes.see_the_vehicles(page, ["k_best", "centralized_smoother"])
    page.get_by_label("From above").check()
    for other in ("Trails", "Ellipses", "Rays"):
        page.get_by_label(other, exact=True).uncheck()
    names, colours = ("k_best", "centralized_smoother"), eyes.vehicle_colours(page)

    def drawn(name: str) -> int:
        image = eyes.pixels(page, name)
        return min(eyes.count(image, colour) for colour in colours)

    until(lambda: all(drawn(name) < 100 for name in names), "the tracks to go")
    graph = page.get_by_label("Graph", exact=True)
    graph.check()
    until(lambda: all(drawn(name) > 150 for name in names), "the graphs of both vehicles")
    keep(page)
    graph.uncheck()
    until(lambda: all(drawn(name) < 100 for name in names), "the graphs to go")


def test_estimators_without_a_graph_offer_no_layer_and_no_broadcasts(page: Page, solo: str):
    page.goto(f"/#run={solo}&layout=plan")
    page.locator("#table tbody tr").first.wait_for()
    expect(page.get_by_label("Graph", exact=True)).to_be_hidden()
    expect(page.locator("#broadcasts")).to_be_hidden()


def test_a_broadcast_is_inspected_by_mouse_keyboard_and_timeline(page: Page, server: Server, smoothed: str, keep):
    show(page, smoothed)
    told = server.get(f"/api/jobs/{smoothed}/graphs/k_best")["broadcasts"]
    options = page.locator("#broadcasts [role=option]")
    expect(options).to_have_count(len(told))
    detail = page.locator("#broadcasts .detail")
    first = next(
        n for n, b in enumerate(told) if any(link["prior"] for link in b["links"]) and b["receivers"][0]["heard"]
    )
    options.nth(first).click()
    expect(options.nth(first)).to_have_attribute("aria-selected", "true")
    expect(detail.locator("h3")).to_contain_text(f"launch {told[first]['number']}")
    expect(detail.locator("h3")).to_contain_text("64 bytes")
    expect(detail.locator("tbody tr")).to_have_count(len(told[first]["links"]))
    expect(detail).to_contain_text("received it at")
    expect(detail.locator("svg.chain .solid").first).to_be_visible()
    keep(page)
    page.locator("#broadcasts [role=listbox]").press("ArrowDown")
    expect(options.nth(first + 1)).to_have_attribute("aria-selected", "true")
    lost = next(n for n, b in enumerate(told) if not b["receivers"][0]["heard"])
    options.nth(lost).click()
    expect(detail).to_contain_text("did not receive it")
    page.locator("#broadcasts [role=listbox]").press("End")
    expect(options.last).to_have_attribute("aria-selected", "true")
    lanes = page.locator("#timeline .lanes")
    lanes.scroll_into_view_if_needed()
    box = lanes.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 3)
    middle = page.locator("#broadcasts [aria-selected=true] .when")
    expect(middle).to_have_text(re.compile(r"^0:1[45]:"))


@pytest.fixture
def brief(server: Server) -> Iterator[str]:
    """Name of a saved mission: the reconstruction study's own, a third as long."""
    name, scenarios = "reconstruction-in-brief", f"{server.url}/api/scenarios"
    body = {"set": {"duration_s": 1500}}
    edited = httpx.post(f"{scenarios}/walls2015-reconstruction/edited", json=body, timeout=60).json()
    assert httpx.put(f"{scenarios}/{name}", json=edited["scenario"], timeout=60).status_code == 201
    yield name
    httpx.delete(f"{scenarios}/{name}", timeout=60)


def test_the_reconstruction_study_draws_divergence_on_a_logarithmic_axis(page: Page, brief: str, keep):
    page.goto("/")
    page.locator(f"label[data-name={brief}]").click()
    study = page.locator(".study", has=page.get_by_role("heading", name="Reconstruction against reception"))
    study.get_by_label("Draws at each rate").select_option("3")
    study.get_by_role("button", name="Run the reconstruction study").click()
    expect(study.locator("p[role=status]")).to_contain_text("10 reception rates", timeout=240_000)
    for figure in ("kld", "mean_difference"):
        plot = study.locator(f"figure[data-figure={figure}] .drawing")
        expect(plot.locator(".scatterlayer .trace")).to_have_count(3)
        expect(plot.locator(".errorbars").first).to_be_attached()
        assert plot.evaluate("plot => plot.layout.yaxis.type") == "log"
        assert plot.evaluate("plot => plot.data.every(trace => trace.y.length === 10 && trace.y.every(v => v > 0))")
    study.get_by_label("Chain").select_option("auv-3")
    expect(study.locator("figure[data-figure=kld] .scatterlayer .trace")).to_have_count(3)
    study.scroll_into_view_if_needed()
    keep(page)
