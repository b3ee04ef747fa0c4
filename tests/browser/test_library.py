"""The mission picker: families, papers, pictures, search, and an address for each mission."""

from __future__ import annotations

import re

from playwright.sync_api import Page, expect

from tests.browser.serving import Server, until


def test_every_mission_has_a_picture_under_its_paper(page: Page, server: Server, keep):
    page.goto("/")
    available = [m["name"] for m in server.get("/api/scenarios") if m["available"]]
    for name in available:
        picture = page.locator(f".mission[data-name={name}] .picture svg > *")
        expect(picture.first).to_be_attached()
    tracking = page.get_by_role("group", name="Target tracking")
    paper = tracking.get_by_role("group", name="Rui and Chitre", exact=True)
    expect(paper.get_by_role("radio").first).to_be_attached()
    walls = page.get_by_role("group", name="Walls and Eustice 2011", exact=True)
    expect(walls.get_by_role("radio")).to_have_count(sum(name.startswith("walls2011") for name in available))
    keep(page)


def test_missions_are_found_by_words_of_their_paper(page: Page, server: Server):
    page.goto("/")
    search = page.get_by_role("searchbox", name="Search missions")
    search.fill("walls 2012 lossy")
    expect(page.locator(".mission:visible")).to_have_count(1)
    search.press("Enter")
    expect(page.locator("#empty h1")).to_have_text(re.compile(r"\(W12\)"))
    expect(page).to_have_url(re.compile("mission=walls2012-two-node-lossy"))
    search.fill("no such thing anywhere")
    expect(page.get_by_text("No mission matches.")).to_be_visible()
    search.press("Escape")
    total = len(server.get("/api/scenarios"))
    until(lambda: page.locator(".mission:not([hidden])").count() == total, "all missions again")


def test_the_address_of_a_mission_opens_it(page: Page):
    page.goto("/#mission=walls2011-topology-c")
    expect(page.locator(".mission[data-name=walls2011-topology-c] input")).to_be_checked()
    expect(page.locator("#empty h1")).to_contain_text("topology C")
