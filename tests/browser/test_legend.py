"""The legend's chips show and hide estimators and vehicles everywhere at once."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.eyes import count, pixels, see_the_vehicles, settled, vehicle_colours
from tests.browser.serving import until


def chip(page: Page, name: str) -> Locator:
    return page.locator(".chip", has_text=re.compile(f"^{name}$"))


@pytest.fixture(autouse=True)
def everything_shown(opened: Page):
    yield
    opened.keyboard.press("Escape")
    show_all = opened.get_by_role("button", name="Show all")
    if show_all.is_visible():
        show_all.click()


def test_a_chip_has_the_colour_and_dash_of_its_line(opened: Page):
    lines = opened.locator(".plot[data-quantity=sigma_m] .js-line").evaluate_all("all => all.map(l => l.style.stroke)")
    chips = opened.locator(".chip[data-kind=algorithms] line")
    colours = chips.evaluate_all("all => all.map(l => getComputedStyle(l).stroke)")
    assert sorted(colours) == sorted(lines)
    dashes = chips.evaluate_all("all => all.map(l => getComputedStyle(l).strokeDasharray)")
    assert len(set(dashes)) == 3, "and can be told by its dash alone"


def test_an_estimator_is_hidden_and_shown_everywhere(opened: Page, keep):
    chip(opened, "Naive EKF").click()
    expect(chip(opened, "Naive EKF")).to_have_attribute("aria-pressed", "false")
    expect(opened.locator(".pane[data-algorithm=nekf]")).to_be_hidden()
    expect(opened.locator(".pane[data-algorithm=cekf]")).to_be_visible()
    for quantity in ("sigma_m", "error_m"):
        expect(opened.locator(f".plot[data-quantity={quantity}] .js-line")).to_have_count(2)
    expect(opened.locator("#table tbody[data-algorithm=nekf]")).to_have_count(0)
    expect(opened).to_have_url(re.compile("hide=nekf"))
    keep(opened)
    chip(opened, "Naive EKF").click()
    expect(opened.locator(".pane[data-algorithm=nekf]")).to_be_visible()
    expect(opened.locator(".plot[data-quantity=sigma_m] .js-line")).to_have_count(3)
    expect(opened.locator("#table tbody[data-algorithm=nekf] tr")).to_have_count(2)
    expect(opened).not_to_have_url(re.compile("hide="))


def test_a_vehicle_is_hidden_everywhere(opened: Page):
    see_the_vehicles(opened, ["cekf"])
    scout, ship = vehicle_colours(opened)
    expect(opened.locator(".lane-keys")).not_to_contain_text("0 heard")
    chip(opened, "scout").click()
    until(lambda: count(pixels(opened, "cekf"), scout) == 0, "the scout to be gone from the pane")
    assert count(settled(opened, "cekf"), ship) >= 15
    expect(opened.locator("#table tr[data-subject=scout]")).to_have_count(0)
    expect(opened.locator("#table tr[data-subject=ship]")).to_have_count(3)
    expect(opened.locator(".plot .whose").first).to_have_text(" of ship")
    expect(opened.locator(".lane-keys")).to_contain_text("0 heard")
    expect(opened).to_have_url(re.compile("hide-vehicles=scout"))


def test_chips_work_by_keyboard_and_one_can_be_shown_alone(opened: Page):
    chip(opened, "Centralized EKF").focus()
    opened.keyboard.press("Enter")
    expect(opened.locator(".pane[data-algorithm=cekf]")).to_be_hidden()
    opened.keyboard.press("Shift+Enter")
    expect(opened.locator(".pane:visible")).to_have_count(1)
    expect(opened.locator(".pane[data-algorithm=cekf]")).to_be_visible()
    expect(opened.locator("#table tbody")).to_have_count(1)
    opened.get_by_role("button", name="Show all").focus()
    opened.keyboard.press("Enter")
    expect(opened.locator(".pane:visible")).to_have_count(3)


def test_who_is_sent_the_address_sees_the_same(opened: Page):
    chip(opened, "Dead reckoning").click()
    chip(opened, "ship").click()
    expect(opened).to_have_url(re.compile("hide=dead_reckoning&hide-vehicles=ship"))
    opened.reload()
    opened.locator("#table tbody tr").first.wait_for()
    expect(chip(opened, "Dead reckoning")).to_have_attribute("aria-pressed", "false")
    expect(opened.locator(".pane[data-algorithm=dead_reckoning]")).to_be_hidden()
    expect(opened.locator("#table tbody tr")).to_have_count(2)
