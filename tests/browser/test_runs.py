"""The history of runs: found, sorted, tagged, pinned, compared, run again, deleted and had back."""

from __future__ import annotations

import re

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import SOLO
from tests.browser.serving import Server, until


@pytest.fixture(scope="module")
def lossy(server: Server) -> str:
    """A run like `solo` that loses most packets, with a seed of its own."""
    return server.finished(SOLO | {"trials": 2, "seed": 21, "set": {"network.loss": 0.9, "report_interval_s": 4.0}})


def row(page: Page, id: str):
    return page.locator(f".history tr[data-run='{id}']")


def test_runs_are_searched_sorted_and_tagged(page: Page, server: Server, solo: str, lossy: str, keep):
    page.goto("/")
    page.get_by_role("link", name="Runs", exact=True).click()
    expect(row(page, lossy)).to_contain_text("network.loss 0.9")
    page.get_by_role("searchbox", name="Search runs").fill("seed 21")
    expect(row(page, lossy)).to_be_visible()
    expect(row(page, solo)).to_have_count(0)
    page.get_by_role("searchbox", name="Search runs").fill("")

    head = page.get_by_role("columnheader", name="Seed")
    for direction in ("ascending", "descending"):
        head.get_by_role("button").click()
        expect(head).to_have_attribute("aria-sort", direction)
        seeds = [int(text) for text in page.locator(".history tbody td.figure:nth-of-type(5)").all_inner_texts()]
        assert seeds == sorted(seeds, reverse=direction == "descending")

    errors = {
        job["id"]: job["rmse_m"]["cekf"]
        for job in server.get("/api/jobs")
        if "cekf" in job["rmse_m"] and job["id"] in (solo, lossy)
    }
    page.get_by_label("Estimator of the errors").select_option(label="Error of Centralized EKF")
    page.get_by_role("columnheader", name="RMSE").get_by_role("button").click()
    for id, of in errors.items():
        error = sum(e**2 for e in of.values()) / len(of)
        expect(row(page, id).locator(".error")).to_have_text(re.compile(rf"{error**0.5:.3g}0* m$"))
    shown = page.locator(".history tbody td.figure:nth-of-type(6)").all_inner_texts()
    told = [float(text.split()[0]) for text in shown if text != "–"]
    assert told == sorted(told) and shown[len(told) :] == ["–"] * (len(shown) - len(told))

    add = row(page, lossy).get_by_role("combobox", name=re.compile("Add a tag"))
    add.fill("bad weather")
    add.press("Enter")
    expect(row(page, lossy).locator(".tag")).to_contain_text("bad weather")
    until(lambda: server.get(f"/api/jobs/{lossy}")["tags"] == ["bad weather"], "the tag to be kept")
    page.reload()
    page.get_by_role("combobox", name="Tag", exact=True).select_option("bad weather")
    expect(page.locator(".history tbody tr")).to_have_count(1)
    keep(page)
    row(page, lossy).get_by_role("button", name="Take the tag bad weather off").click()
    until(lambda: server.get(f"/api/jobs/{lossy}")["tags"] == [], "the tag to be gone")


def test_two_runs_are_compared_against_the_pinned_one(page: Page, server: Server, solo: str, lossy: str, keep):
    page.goto("/#room=runs")
    row(page, solo).get_by_role("button", name=re.compile("^Pin")).click()
    until(lambda: server.get(f"/api/jobs/{solo}")["pinned"], "the pin to be kept")
    expect(page.get_by_role("button", name="Compare")).to_be_disabled()
    for id in (solo, lossy):
        row(page, id).get_by_role("checkbox").check()
    page.get_by_role("button", name="Compare 2 runs").click()
    expect(page.locator(f".compared li[data-run='{solo}']")).to_contain_text("baseline")
    for quantity in ("error_m", "sigma_m"):
        expect(page.locator(f".overlay[data-quantity={quantity}] .js-line")).to_have_count(2)

    results = [server.get(f"/api/jobs/{id}/result") for id in (solo, lossy)]
    one, other = (result["algorithms"]["cekf"]["subjects"]["scout"] for result in results)
    page.get_by_label("Figure to compare").select_option("sigma_m")
    cells = page.locator(".differences tr[data-algorithm=cekf][data-subject=scout] td").all_inner_texts()
    change = other["sigma_m"] / one["sigma_m"] - 1
    assert any(f"{100 * abs(change):.0f} %" in cell for cell in cells), (cells, change)
    assert any(f"{one['sigma_m']:.2f}" in cell for cell in cells)
    scenarios = page.get_by_role("region", name="Differences in scenarios")
    expect(scenarios.get_by_role("row", name=re.compile("network.loss"))).to_contain_text("0.9")
    expect(scenarios.get_by_role("row", name=re.compile("^seed"))).to_contain_text("21")
    keep(page)

    expect(page).to_have_title("Comparison · coopnav")
    address = page.url
    again = page.context.new_page()
    again.goto(address)
    expect(again.locator(".overlay[data-quantity=error_m] .js-line")).to_have_count(2)
    again.get_by_role("link", name="All runs").click()
    expect(row(again, solo)).to_be_visible()
    expect(again).to_have_title("Runs · coopnav")
    httpx.patch(f"{server.url}/api/jobs/{solo}", json={"pinned": False})


def test_a_run_that_is_opened_brings_back_what_it_was_made_of(page: Page, lossy: str):
    page.goto(f"/#run={lossy}&layout=plan")
    expect(page.locator("#field-trials")).to_have_value("2")
    expect(page.locator("#field-seed")).to_have_value("21")
    expect(page.locator("[id='field-network.loss']")).to_have_value("0.9")
    expect(page.get_by_role("list", name="Also changed in the mission")).to_contain_text("report_interval_s 4")
    expect(page.locator("input[value=cekf]")).to_be_checked()
    expect(page.locator("input[value=nekf]")).not_to_be_checked()


def test_a_run_is_run_again_as_it_was(page: Page, server: Server, lossy: str):
    page.goto("/#room=runs")
    row(page, lossy).get_by_role("button", name=re.compile("^Run .* again$")).click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    expect(page).to_have_url(re.compile("run=[0-9a-f]+"))
    id = re.search("run=([0-9a-f]+)", page.url)
    assert id and id[1] != lossy
    first, second = (server.get(f"/api/jobs/{i}/result")["algorithms"]["cekf"]["subjects"] for i in (lossy, id[1]))
    assert first == second


def test_deleted_runs_can_be_had_back(page: Page, server: Server):
    ids = [server.finished(SOLO | {"seed": seed}) for seed in (31, 32)]
    page.goto("/#room=runs")
    for id in ids:
        row(page, id).get_by_role("checkbox").check()
    page.get_by_role("button", name="Delete 2").click()
    for id in ids:
        expect(row(page, id)).to_have_count(0)
    page.get_by_role("button", name="Undo").click()
    for id in ids:
        expect(row(page, id)).to_be_visible()
        assert server.get(f"/api/jobs/{id}")["state"] == "done"

    row(page, ids[0]).get_by_role("button", name=re.compile("^Delete")).click()
    row(page, ids[1]).get_by_role("button", name=re.compile("^Delete")).click()
    until(lambda: httpx.get(f"{server.url}/api/jobs/{ids[0]}").status_code == 404, "the first to be gone for good")
    page.get_by_role("button", name="Undo").click()
    expect(row(page, ids[1])).to_be_visible()
    expect(row(page, ids[0])).to_have_count(0)

    row(page, ids[1]).get_by_role("button", name=re.compile("^Delete")).click()
    expect(row(page, ids[1])).to_have_count(0)
    page.close()
    until(lambda: httpx.get(f"{server.url}/api/jobs/{ids[1]}").status_code == 404, "deletion as the page goes")
