"""First steps, the sheet of keys, and what axe-core finds for people who do not use a mouse or a screen."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import SIZE, Watch
from tests.browser.serving import Server


def test_the_first_visit_is_shown_round_once_in_three_steps(browser: Browser, server: Server, keep):
    context = browser.new_context(viewport=SIZE, base_url=server.url)  # type: ignore[arg-type]
    page = context.new_page()
    page.goto("/")
    page.locator(".mission").first.wait_for()
    tour = page.locator(".tour")
    for number, (title, marked) in enumerate(
        [("Pick a mission", "missions"), ("Tick estimators", "algorithms"), ("Run, then look", "launch")], start=1
    ):
        expect(tour).to_contain_text(title)
        expect(tour).to_contain_text(f"{number} of 3")
        expect(page.locator(".toured")).to_have_id(marked)
        if number == 1:
            keep(page)
        tour.get_by_role("button", name="Done" if number == 3 else "Next").click()
    expect(tour).to_have_count(0)
    page.reload()
    page.locator(".mission").first.wait_for()
    expect(tour).to_have_count(0)
    context.close()


def test_a_question_mark_opens_the_keys_and_leads_to_the_first_steps(page: Page, keep):
    page.goto("/")
    page.locator(".mission").first.wait_for()
    page.keyboard.press("?")
    sheet = page.get_by_role("dialog", name="Keys")
    expect(sheet).to_contain_text("play or pause")
    keep(page)
    page.keyboard.press("Escape")
    expect(sheet).to_have_count(0)
    page.get_by_role("button", name="Help").click()
    sheet.get_by_role("button", name="First steps").click()
    tour, search = page.locator(".tour"), page.locator("#find-mission")
    expect(tour).to_contain_text("1 of 3")
    tour.get_by_role("button", name="Skip").click()
    expect(tour).to_have_count(0)
    page.get_by_role("button", name="Help").click()
    sheet.get_by_role("button", name="First steps").click()
    search.fill("range")
    search.press("Escape")
    expect(search).to_have_value("")
    expect(tour).to_contain_text("1 of 3")  # the search had that Escape
    search.press("Escape")
    expect(tour).to_have_count(0)


def library(page: Page, run: str) -> None:
    page.goto("/")
    page.locator(".mission").first.wait_for()


def workbench(page: Page, run: str) -> None:
    page.goto(f"/#run={run}&layout=plan")
    page.locator("#table tbody tr").nth(5).wait_for()
    page.locator(".plot .js-line").nth(5).wait_for()


def what_if(page: Page, run: str) -> None:
    workbench(page, run)
    page.get_by_role("tab", name="What if").click()
    page.locator("#panel-whatif input").first.wait_for()


def runs(page: Page, run: str) -> None:
    page.goto("/#room=runs")
    page.locator("#runs-room tbody tr").first.wait_for()


def claims(page: Page, run: str) -> None:
    page.goto("/#room=claims")
    page.locator("#claims-room h2").first.wait_for()


def compared(page: Page, run: str) -> None:
    others = [job["id"] for job in page.request.get("/api/jobs").json() if job["state"] == "done"]
    page.goto(f"/#room=runs&compare={run},{next(id for id in others if id != run)}")
    page.locator(".compared li").nth(1).wait_for()


def keys(page: Page, run: str) -> None:
    library(page, run)
    page.keyboard.press("?")
    page.get_by_role("dialog", name="Keys").wait_for()


def tour(page: Page, run: str) -> None:
    keys(page, run)
    page.get_by_role("dialog").get_by_role("button", name="First steps").click()
    page.locator(".tour").wait_for()


def upload(page: Page, run: str) -> None:
    library(page, run)
    page.get_by_role("button", name="Bring a recorded log…").click()
    log = "time_s,forward_m,turn_rad\n" + "".join(f"{t},1.0,0.0\n" for t in range(60))
    file = {"name": "drive.csv", "mimeType": "text/csv", "buffer": log.encode()}
    page.get_by_label("Files of the log").set_input_files([file])  # type: ignore[list-item]
    expect(page.get_by_label("What was understood")).to_contain_text("nothing says where")


ROOMS = [library, workbench, what_if, runs, claims, compared, keys, tour, upload]


@pytest.mark.parametrize("room", ROOMS)
def test_no_serious_fault_for_those_who_see_or_hear_or_point_otherwise(
    page: Page, run: str, solo: str, room: Callable[[Page, str], None], watch: Watch
):
    """The panes' own frames are pictures, described by their labels; what draws in them is not ours."""
    watch.refusals = {422}
    room(page, run)
    serious = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        found = Axe().run(page, options={"iframes": False, "resultTypes": ["violations"]}).response["violations"]
        serious += [
            f"{scheme}: {fault['id']} ({fault['impact']}): {node['target']} {node.get('failureSummary', '')}"
            for fault in found
            if fault["impact"] in ("serious", "critical")
            for node in fault["nodes"][:3]
        ]
    assert not serious, "\n".join(serious)
