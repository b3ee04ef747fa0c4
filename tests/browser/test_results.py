"""The comparison in figures, the claims, the runs kept."""

from __future__ import annotations

import re

import httpx
from playwright.sync_api import Page, expect

from tests.browser.conftest import SOLO
from tests.browser.serving import Server, until


def test_the_table_has_figures_and_verdicts(opened: Page, server: Server, run: str, keep):
    result = server.get(f"/api/jobs/{run}/result")
    rows = opened.locator("#table tbody tr")
    expect(rows).to_have_count(6)
    row = opened.locator("#table tbody[data-algorithm=cekf] tr[data-subject=scout]")
    rmse = result["algorithms"]["cekf"]["subjects"]["scout"]["rmse_m"]
    shown = float(row.locator("td").first.inner_text())
    assert abs(shown - rmse) <= 0.005 * rmse
    for verdict in opened.locator("#table .verdict").all():
        assert re.search("consistent|overconfident|conservative", verdict.inner_text())
        assert (verdict.get_attribute("data-hint") or "").endswith("."), "the verdict is explained in a sentence"
    sent = opened.locator("#table tbody[data-algorithm=nekf] td[rowspan]").first.inner_text()
    assert int(re.sub(r"\D", "", sent)) == result["algorithms"]["nekf"]["packets"]["sent"]
    opened.locator("#table").scroll_into_view_if_needed()
    keep(opened)


def test_choosing_a_vehicle_changes_curves_and_readings(opened: Page):
    reading = opened.locator(".pane[data-algorithm=dead_reckoning] .reading")
    expect(reading).to_have_text(re.compile(r"error .* m · σ .* m"))
    of_scout = reading.inner_text()
    opened.locator(".vehicle", has_text="ship").click()
    expect(reading).not_to_have_text(of_scout)
    expect(opened.locator(".plot .whose").first).to_have_text(" of ship")
    expect(opened).to_have_url(re.compile("vehicle=ship"))


def test_claims_say_whether_they_hold(opened: Page, server: Server, run: str):
    claims = server.get(f"/api/jobs/{run}/result")["claims"]
    assert claims
    shown = opened.locator("#claims li")
    expect(shown).to_have_count(len(claims))
    for claim, entry in zip(claims, shown.all(), strict=True):
        assert claim["text"] in entry.inner_text()
        word = {True: "holds", False: "does not hold", None: "not tried"}[claim["holds"]]
        expect(entry.locator(".verdict")).to_contain_text(word)


def test_a_reload_restores_the_run_from_its_address(opened: Page, run: str):
    opened.locator("#stage").focus()
    opened.keyboard.press("Home")
    for _ in range(3):
        opened.keyboard.press("Shift+ArrowRight")
    opened.locator(".vehicle", has_text="ship").click()
    time = opened.locator(".now").inner_text()
    expect(opened).to_have_url(re.compile(f"#run={run}&t=.*&vehicle=ship"))
    expect(opened).not_to_have_url(re.compile("t=1200"))
    opened.reload()
    opened.locator("#table tbody tr").first.wait_for()
    expect(opened.locator(".now")).to_have_text(time)
    expect(opened.get_by_role("radio", name="ship", exact=True)).to_be_checked()


def test_runs_are_kept_reopened_and_deleted(page: Page, server: Server, solo: str):
    other = server.finished(SOLO | {"seed": 5})
    page.goto("/")
    page.get_by_role("tab", name="Runs").click()
    entry = page.locator(f"#panel-runs [data-run='{other}']")
    entry.locator(".open").click()
    expect(page).to_have_url(re.compile(f"run={other}"))
    expect(page.locator("#headline")).to_contain_text("seed 5")
    page.locator(f"#panel-runs [data-run='{solo}'] .open").click()
    expect(page).to_have_url(re.compile(f"run={solo}"))
    expect(page.locator("#headline")).to_contain_text("seed 7")
    expect(page.locator("input[value=cekf]")).to_be_checked()
    expect(page.locator("input[value=nekf]")).not_to_be_checked()
    page.go_back()
    expect(page.locator("#headline")).to_contain_text("seed 5")
    page.go_forward()
    expect(page.locator("#headline")).to_contain_text("seed 7")

    entry.locator(".remove").click()
    expect(entry).to_have_count(0)
    until(lambda: httpx.get(f"{server.url}/api/jobs/{other}").status_code == 404, "the run to be deleted for good")
    expect(page.locator("#headline")).to_contain_text("seed 7")
