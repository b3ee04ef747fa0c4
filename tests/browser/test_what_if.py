"""What if: a slider moves, the mission is flown again, the curves follow; and how an edited mission is kept."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.serving import Server, until


@pytest.fixture
def panel(page: Page) -> Page:
    """The page with the first mission picked and its what-if panel open."""
    page.goto("/#mission=first-look")
    page.get_by_role("tab", name="What if").click()
    expect(knob(page, "loss")).to_be_visible()
    return page


def knob(page: Page, name: str) -> Locator:
    return page.locator(f".knob[data-knob='{name}']")


def value(page: Page, name: str) -> Locator:
    return knob(page, name).get_by_role("textbox")


def enter(page: Page, name: str, text: str) -> None:
    value(page, name).fill(text)
    value(page, name).press("Enter")


def flown(page: Page) -> None:
    expect(page.locator("#panel-whatif[data-state=shown]")).to_be_visible()


def drag(page: Page, name: str, shares: list[float]) -> None:
    box = knob(page, name).get_by_role("slider").bounding_box()
    assert box
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + shares[0] * box["width"], y)
    page.mouse.down()
    for share in shares[1:]:
        page.mouse.move(box["x"] + share * box["width"], y, steps=3)
    page.mouse.up()


def trials_run(server: Server) -> list[dict]:
    return [job for job in server.get("/api/jobs") if job["purpose"] == "what-if"]


def test_dragging_packet_loss_flies_the_mission_again(panel: Page, server: Server, keep):
    page = panel
    drag(page, "loss", [0.2, 0.4, 0.7, 0.95])
    flown(page)
    shown = float(value(page, "loss").input_value())
    assert 0.9 < shown < 1
    expect(page.locator(".plot[data-quantity=error_m] .js-line")).to_have_count(3)
    change = page.locator(".changes li[data-key='network.loss']")
    expect(change.locator(".diff")).to_have_text(f"0.2 → {shown:g}")
    effect = page.locator(".effect tr[data-algorithm=cekf]")
    expect(effect.locator(".worse")).to_have_text(re.compile(r"\+\d+ %"))
    expect(page.locator(".effect tr[data-algorithm=dead_reckoning] td").last).to_have_text("same")
    keep(page)

    first = page.url
    drag(page, "loss", [0.95, 0.5])
    expect(page).not_to_have_url(re.compile(re.escape(first.split("&")[0])))
    flown(page)
    until(lambda: [j["state"] for j in trials_run(server)] == ["done"], "the older what-ifs to be gone")
    assert list(trials_run(server)[0]["changes"]) == ["network.loss"]
    page.locator(".chip[data-name=nekf]").click()
    expect(page).to_have_url(re.compile(r"&hide=nekf"))
    expect(page).not_to_have_url(re.compile(re.escape(first.split("&")[0])))


def test_any_key_can_be_found_typed_and_reverted(panel: Page):
    page = panel
    page.get_by_role("searchbox", name="Search the mission's keys").fill("gps sigma")
    key = "vehicles.ship.sensors.gps.sigma_m"
    enter(page, key, "20")
    flown(page)
    enter(page, "range", "4")
    changes = page.locator(".changes li")
    expect(changes).to_have_count(3)
    flown(page)
    page.get_by_role("button", name=f"Revert {key}").click()
    expect(changes).to_have_count(2)
    expect(value(page, key)).to_have_value("2")
    page.get_by_role("button", name="Revert all").click()
    expect(page.get_by_role("heading", name="As it is saved")).to_be_visible()
    expect(value(page, "range")).to_have_value("1")
    flown(page)


def test_a_value_that_cannot_be_is_refused_at_its_knob(panel: Page, watch):
    watch.refusals.add(422)
    page = panel
    enter(page, "loss", "7")
    status = page.locator("#panel-whatif .status")
    expect(status).to_contain_text("network.loss")
    expect(knob(page, "loss")).to_have_attribute("data-refused", "")
    enter(page, "loss", "0.4")
    flown(page)
    expect(knob(page, "loss")).not_to_have_attribute("data-refused", "")


def test_a_vehicle_joins_with_its_slots_and_leaves_again(panel: Page, keep):
    page = panel
    enter(page, "vehicles", "3")
    flown(page)
    expect(page.locator(".changes li[data-key=vehicles] .diff")).to_have_text("scout, ship → scout, ship, scout2")
    expect(page.locator(".vehicle")).to_have_text(["scout", "ship", "scout2"])
    keep(page)
    page.get_by_role("button", name="Revert vehicles").click()
    expect(page.locator(".changes li")).to_have_count(0)
    flown(page)
    expect(page.locator(".vehicle")).to_have_text(["scout", "ship"])


def test_an_edited_mission_is_saved_exported_and_read_back(panel: Page, server: Server, tmp_path: Path):
    page = panel
    page.get_by_label("Run as I drag").uncheck()
    enter(page, "period", "60")
    with page.expect_download() as download:
        page.get_by_role("button", name="Export TOML").click()
    text = Path(download.value.path()).read_text()
    assert "cycle_s = 60" in text and "at_s = 40" in text

    page.get_by_role("button", name="Save as…").click()
    page.get_by_label("Name to save it under").fill("slow-pings")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.locator("#panel-whatif .word")).to_have_text("Saved as slow-pings.")
    expect(page.locator(".mission[data-name=slow-pings] input")).to_be_checked()
    expect(value(page, "period")).to_have_value("60")
    expect(page.get_by_role("heading", name="As it is saved")).to_be_visible()

    file = tmp_path / "Mine from home.toml"
    file.write_text(text.replace("loss = 0.2", "loss = 0.25"))
    page.get_by_label("TOML file of a mission").set_input_files(file)
    expect(page.locator(".mission[data-name=mine-from-home] input")).to_be_checked()
    expect(value(page, "loss")).to_have_value("0.25")
    assert server.get("/api/scenarios/mine-from-home")["scenario"]["network"]["tdma"]["cycle_s"] == 60


def test_a_file_that_is_no_mission_is_refused_with_its_faults(panel: Page, watch, tmp_path: Path):
    watch.refusals.add(422)
    file = tmp_path / "broken.toml"
    file.write_text('schema = 1\nfamily = "navigation"\ntitle = "x"\nduration = 3\n')
    panel.get_by_label("TOML file of a mission").set_input_files(file)
    word = panel.locator("#panel-whatif .word")
    expect(word).to_contain_text("duration: is not a key of this table; did you mean 'duration_s'?")
    expect(word).to_contain_text("vehicles: is missing")
