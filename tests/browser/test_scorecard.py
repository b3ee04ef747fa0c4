"""The papers' claims: measured from the page, and shown where they can be seen."""

from __future__ import annotations

import re

from playwright.sync_api import Page, expect

from tests.browser.serving import Server

PAPER = "An example of our own"


def test_a_papers_claims_are_measured_and_lead_to_their_moment(page: Page, server: Server, keep):
    claims = server.get("/api/scenarios/first-look")["scenario"]["claims"]
    page.goto("/")
    page.get_by_role("link", name="Claims", exact=True).click()
    paper = page.get_by_role("region", name=PAPER)
    paper.get_by_role("button", name=f"Measure the claims of {PAPER}").click()
    expect(paper.locator("h2 + .score")).to_have_text(re.compile(rf"\d of {len(claims)} hold$"))
    mission = paper.locator("details[data-mission=first-look]")
    mission.locator("summary").click()
    expect(mission.locator("li")).to_have_count(len(claims))
    for claim, entry in zip(claims, mission.locator("li").all(), strict=True):
        expect(entry.locator(".text")).to_have_text(claim["text"])
        expect(entry.locator(".verdict")).to_have_text(re.compile("holds|does not hold"))
        expect(entry.locator(".figures")).to_have_text(re.compile(r"\S+ [<≤>≥=] \S+"))
    keep(page)

    mission.get_by_role("link", name=re.compile("^Show: ")).first.click()
    expect(page.locator("#headline")).to_contain_text("First look")
    expect(page).to_have_url(re.compile(r"#run=[0-9a-f]+&t=[\d.]+&vehicle=" + (claims[0]["subject"] or "")))
    expect(page.locator("#claims li")).to_have_count(len(claims))
    shown = page.locator(".now").inner_text()
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    page.locator("#claims").get_by_role("button", name=re.compile("^Show: ")).first.click()
    expect(page.locator(".now")).to_have_text(shown)


def test_a_measured_paper_needs_no_new_run(page: Page, server: Server):
    """A run of the mission as it is, made elsewhere, is evidence."""
    run = server.finished({"scenario": "first-look"})
    page.goto("/#room=claims")
    mission = page.locator("details[data-mission=first-look]")
    expect(mission.locator("summary .score")).to_have_text(re.compile(r"\d of \d hold"))
    mission.locator("summary").click()
    expect(mission.locator(".show").first).to_have_attribute("href", re.compile(f"run={run}"))


def test_a_room_is_entered_at_its_top(page: Page, run: str):
    page.goto(f"/#run={run}&layout=plan")
    stage = page.locator("#stage")
    page.locator("#table tbody tr").first.scroll_into_view_if_needed()
    assert stage.evaluate("stage => stage.scrollTop") > 0
    page.get_by_role("link", name="Claims", exact=True).click()
    expect(page.get_by_role("region", name=PAPER)).to_be_in_viewport()
    assert stage.evaluate("stage => stage.scrollTop") == 0
