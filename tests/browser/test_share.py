"""A run passed on: its address, its report, its scenario and numbers as files."""

from __future__ import annotations

import io
import json
import tomllib
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, expect

from tests.browser.serving import Server


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
    for words in ("Figures (JSON)", "Tracks (NPZ)", "Scenario (TOML)", "Report (HTML)"):
        share(page)
        with page.expect_download() as download:
            page.locator("#actions .sheet").get_by_text(words, exact=True).click()
        saved[words] = Path(download.value.path()).read_bytes()
        expect(page.locator("#actions .sheet")).to_be_hidden()
    assert json.loads(saved["Figures (JSON)"])["algorithms"].keys() == {"dead_reckoning", "cekf", "nekf"}
    assert np.load(io.BytesIO(saved["Tracks (NPZ)"]))["cekf/scout/mean"].shape[0] == 3
    assert tomllib.loads(saved["Scenario (TOML)"].decode())["trials"] == 3
    assert b"<!doctype html>" in saved["Report (HTML)"][:100].lower()
