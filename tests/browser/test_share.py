"""A run passed on: its address, its report, its scenario and numbers as files."""

from __future__ import annotations

import io
import json
import re
import tomllib
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from playwright.sync_api import Page, expect

from tests.browser.eyes import difference, pixels, see_the_vehicles, settled
from tests.browser.serving import Server, until


def share(page: Page) -> None:
    page.locator("#actions summary").click()


def test_the_report_of_the_open_run_is_one_page_that_needs_nothing_else(page: Page, server: Server, run: str, keep):
    result = server.get(f"/api/jobs/{run}/result")
    page.goto(f"/#run={run}&layout=plan")
    asked: list[str] = []
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Report", exact=True).click()
    report = opened.value
    expect(report.get_by_role("heading", level=1)).to_contain_text("First look")
    report.wait_for_load_state()
    report.on("request", lambda request: asked.append(request.url))
    report.reload()
    expect(report.get_by_role("heading", level=1)).to_contain_text("First look")
    assert report.locator("svg, img").count() >= 2, "figures"
    error = result["algorithms"]["cekf"]["subjects"]["scout"]["rmse_m"]
    said = report.locator("body").inner_text()
    assert f"{error:.2f}" in said or f"{error:.3g}" in said, "the table of figures"
    for words in ("seed", str(result["seed"]), "numpy", "duration_s"):
        assert words in said, "scenario, versions, seed"
    assert [url for url in asked if not url.startswith(("data:", "blob:"))] == [report.url], "nothing else is fetched"
    keep(report)


def test_numbers_and_scenario_of_the_open_run_are_saved_as_files(page: Page, server: Server, run: str):
    page.goto(f"/#run={run}&layout=plan")
    saved = {}
    for words in ("Figures (JSON)", "Tracks (NPZ)", "Tracks (TUM)", "Scenario (TOML)", "Report (HTML)"):
        share(page)
        with page.expect_download() as download:
            page.locator("#actions .sheet").get_by_text(words, exact=True).click()
        saved[words] = Path(download.value.path()).read_bytes()
        expect(page.locator("#actions .sheet")).to_be_hidden()
    assert json.loads(saved["Figures (JSON)"])["algorithms"].keys() == {"dead_reckoning", "cekf", "nekf"}
    assert np.load(io.BytesIO(saved["Tracks (NPZ)"]))["cekf/scout/mean"].shape[0] == 3
    assert "nekf-ship.txt" in ZipFile(io.BytesIO(saved["Tracks (TUM)"])).namelist()
    assert tomllib.loads(saved["Scenario (TOML)"].decode())["trials"] == 3
    assert b"<!doctype html>" in saved["Report (HTML)"][:100].lower()


def test_whoever_opens_a_copied_address_sees_the_same(page: Page, run: str):
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.goto(f"/#run={run}")
    page.get_by_label("Panes", exact=True).select_option("Overlay")
    see_the_vehicles(page, ["overlay"])
    page.locator(".vehicle", has_text="ship").click()
    page.locator(".chip[data-name=nekf]").click()
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    for _ in range(9):
        page.keyboard.press("Shift+ArrowRight")
    box = page.locator(".pane[data-algorithm=overlay] .view").bounding_box()
    assert box
    before = settled(page, "overlay")

    def turned() -> bool:
        page.mouse.move(box["x"] + 60, box["y"] + 60)
        page.mouse.down()
        page.mouse.move(box["x"] + 200, box["y"] + 90, steps=4)
        page.mouse.up()
        return difference(before, pixels(page, "overlay")) > 0.025

    until(turned, "the pane to turn")
    expect(page).to_have_url(re.compile("camera="))
    page.wait_for_timeout(2000)  # the camera is told when it has come to rest
    seen = settled(page, "overlay")
    share(page)
    page.get_by_role("button", name="Copy the address").click()
    expect(page.locator("#actions .word")).to_have_text("The address is copied.")
    address = page.evaluate("navigator.clipboard.readText()")

    other = page.context.new_page()
    other.goto(address)
    expect(other.locator(".now")).to_have_text(page.locator(".now").inner_text())
    expect(other.get_by_role("radio", name="ship", exact=True)).to_be_checked()
    expect(other.get_by_label("Panes", exact=True)).to_have_value("overlay")
    expect(other.locator(".chip[data-name=nekf]")).to_have_attribute("aria-pressed", "false")
    # Two pages smooth their lines differently: a likeness, not a copy.
    until(lambda: difference(seen, pixels(other, "overlay")) < 0.02, "the same picture")


def test_what_the_panes_draw_is_sent_with_the_address(page: Page, solo: str):
    page.goto(f"/#run={solo}&draw=top,sigma9,-constructor")
    see_the_vehicles(page, ["cekf"])
    above = settled(page, "cekf")
    expect(page.get_by_label("From above", exact=True)).to_be_checked()
    page.get_by_label("From above", exact=True).uncheck()
    until(lambda: difference(above, pixels(page, "cekf")) > 0.02, "the camera to turn")
    page.get_by_label("From above", exact=True).check()
    page.get_by_label("Rays", exact=True).uncheck()
    page.locator("#toolbar .view-menu summary").click()
    page.get_by_label("Size of the ellipses").select_option("3 σ")
    page.keyboard.press("Escape")
    expect(page).to_have_url(re.compile("draw=sigma3%2C-rays%2Ctop"))
    page.wait_for_timeout(2000)
    seen = settled(page, "cekf")
    other = page.context.new_page()
    other.goto(page.url)
    for label, on in {"From above": True, "Rays": False, "Trails": True}.items():
        expect(other.get_by_label(label, exact=True)).to_be_checked(checked=on)
    expect(other.get_by_label("Size of the ellipses")).to_have_value("3")
    until(lambda: difference(seen, pixels(other, "cekf")) < 0.02, "the same picture")
