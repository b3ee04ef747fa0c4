"""Studies of a mission, and the tracking family's own view."""

from __future__ import annotations

import re

from playwright.sync_api import Page, expect


def test_a_loss_study_draws_each_estimator_against_loss(page: Page, keep):
    page.goto("/")
    page.get_by_label("Largest packet loss").fill("0.2")
    study = page.locator(".study", has=page.get_by_role("heading", name="Loss study"))
    study.get_by_role("button", name="Run the loss study").click()
    expect(study.get_by_role("button", name="Stop")).to_be_visible()
    expect(study.locator("p[role=status]")).to_contain_text("3 losses")
    for plot in study.locator("figure").all():
        expect(plot.locator(".scatterlayer .trace")).to_have_count(3)
    expect(page.locator("#runs-count")).to_have_text(re.compile(r"[3-9]|\d\d"))
    keep(page)


def test_a_loss_study_can_be_stopped_and_keeps_what_was_finished(page: Page):
    page.goto("/")
    study = page.locator(".study", has=page.get_by_role("heading", name="Loss study"))
    study.get_by_role("button", name="Run the loss study").click()
    expect(study.locator("figure .scatterlayer .trace").first).to_be_attached()
    study.get_by_role("button", name="Stop").click()
    expect(study.locator("p[role=status]")).to_contain_text("Stopped")
    expect(study.get_by_role("button", name="Run the loss study")).to_be_visible()


def test_table_1_is_offered_for_the_missions_it_is_made_of(page: Page):
    page.goto("/")
    measure = page.get_by_role("button", name="Measure the table")
    expect(measure).to_be_hidden()
    page.locator(".mission", has_text="topology A").click()
    expect(measure).to_be_visible()


def test_the_operating_point_is_dragged_and_answered_at_once(page: Page, keep):
    """From the dangerous point of Fig. 6(b) to a safe one, by mouse, by keyboard and by number."""
    page.goto("/")
    page.locator("label[data-name=rui-chitre-steady-dangerous]").click()
    verdict = page.locator(".verdict-words")
    expect(verdict).to_contain_text("worse than one sensor alone here, after 3 steps")
    expect(page.locator("#explorer .map-canvas .heatmaplayer image")).to_be_attached()
    expect(page.locator("#explorer .beside .scatterlayer .trace").first).to_be_attached()
    keep(page)
    canvas = page.locator(".map-canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.2 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.65 * box["height"], steps=4)
    page.mouse.up()
    expect(verdict).to_contain_text("You may")
    keep(page)
    second = page.get_by_label("Second sensor R₂, m²")
    before = second.input_value()
    page.get_by_role("button", name=re.compile("Operating point")).press("ArrowUp")
    expect(second).not_to_have_value(before)
    second.fill("500")
    second.press("Enter")
    expect(verdict).to_contain_text("Do not")


def test_a_tracking_run_has_its_panes_and_its_view_below(page: Page):
    page.goto("/")
    page.locator("label[data-name=rui-chitre-steady-safe]").click()
    page.locator("#field-trials").fill("50")
    page.get_by_role("button", name="Run", exact=True).click()
    expect(page.locator("#headline .state")).to_have_text("finished")
    expect(page.locator("#table tbody tr").first).to_be_visible()
    expect(page.locator("#explorer")).to_be_visible()
