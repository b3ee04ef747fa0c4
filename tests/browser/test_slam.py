"""Localization by sound: beliefs as a layer in the panes, and what each measurement sounded like and did."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Page, expect

from tests.browser import eyes
from tests.browser.serving import Server, until

NAMES = ["sas_static", "sas_all_priors"]
TWO_MODES = {"scenario": "sas-two-modes", "trials": 1, "algorithms": NAMES}


@pytest.fixture(scope="module")
def heard(server: Server) -> str:
    """Id of a finished run of three arrays, the first of which leaves two places."""
    return server.finished(TWO_MODES)


def show(page: Page, run: str, layout: str = "plan") -> None:
    page.goto(f"/#run={run}&layout={layout}")
    page.locator("#table tbody tr").first.wait_for()
    page.locator("#listening figure").first.wait_for()


def test_beliefs_are_a_layer_that_can_be_switched(page: Page, heard: str, keep):
    show(page, heard, "side")
    page.get_by_role("button", name="Previous measurement").click()
    page.get_by_role("button", name="Previous measurement").click()
    for other in ("Trails", "Ellipses", "Rays"):
        page.get_by_label(other, exact=True).uncheck()
    page.get_by_label("From above").check()
    for name in NAMES:
        page.locator(f".pane[data-algorithm={name}][data-state=shown]").wait_for()

    beacon = eyes.vehicle_colours(page)[1]

    def drawn() -> int:
        """Pixels about as orange as the beacon's ellipse, or its lines of equal density; those are few."""
        return eyes.count(eyes.pixels(page, NAMES[0]), beacon)

    until(lambda: 15 < drawn() < 300, "the lines of equal density")
    keep(page)
    beliefs = page.get_by_label("Beliefs", exact=True)
    beliefs.uncheck()
    until(lambda: drawn() > 600, "the ellipse that spans both places")
    beliefs.check()
    until(lambda: 15 < drawn() < 300, "the lines once more")


def test_each_measurement_is_looked_into(page: Page, heard: str, keep):
    show(page, heard)
    room = page.locator("#listening")
    words = room.get_by_role("status")
    expect(words).to_contain_text("Measurement 3 of 3")
    for label in ("Matched filter output of 8 records", "Beam pattern", "Factor graph: ", "Bayes tree of "):
        expect(room.get_by_role("img", name=label)).to_be_visible()
    now = float(page.locator("#time").input_value())
    page.get_by_role("button", name="Previous measurement").click()
    expect(words).to_contain_text("Measurement 2 of 3")
    page.get_by_role("button", name="Previous measurement").click()
    expect(words).to_contain_text("Measurement 1 of 3")
    assert float(page.locator("#time").input_value()) < now
    expect(words).to_contain_text("0 of them reused")
    far = float(words.inner_text().split("beacon ")[1].split(" nats")[0])
    assert far > 1.0, "two places are not a Gaussian"
    keep(page)
    room.get_by_label("Estimator").select_option("sas_all_priors")
    expect(words).to_contain_text("Measurement 1 of 3")
    expect(page).to_have_url(re.compile("heard=sas_all_priors"))
    other = page.context.new_page()
    other.goto(page.url)
    expect(other.locator("#listening").get_by_label("Estimator")).to_have_value("sas_all_priors")
    other.close()
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    expect(words).to_contain_text("Nothing was measured yet")
    expect(room.locator("figure")).to_have_count(0)


def test_estimators_that_hear_nothing_have_no_such_room(page: Page, solo: str):
    page.goto(f"/#run={solo}&layout=plan")
    page.locator("#table tbody tr").first.wait_for()
    expect(page.locator("#listening")).to_be_hidden()
    expect(page.get_by_label("Beliefs", exact=True)).to_be_hidden()
