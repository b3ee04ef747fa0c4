"""A person may be faster than the page, its server or the network: what was typed and ticked meanwhile stays."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.serving import held


def test_what_is_typed_before_the_library_is_read_stays(page: Page):
    release = held(page, "**/api/scenarios")
    page.goto("/")
    typed = {"trials": "2", "seed": "5", "network.loss": "0.75"}
    for field, text in typed.items():
        page.locator(f"[id='field-{field}']").fill(text)
    expect(page.locator("#run")).to_be_disabled()
    release()
    expect(page.locator("#run")).to_be_enabled()
    for field, text in typed.items():
        expect(page.locator(f"[id='field-{field}']")).to_have_value(text)
    with page.expect_request(lambda r: r.method == "POST" and r.url.endswith("/api/jobs")) as sent:
        page.locator("#run").click()
    body = sent.value.post_data_json
    assert (body["trials"], body["seed"], body["set"]) == (2, 5, {"network.loss": 0.75})


def test_what_is_typed_while_a_run_of_the_address_comes_stays(page: Page, run: str):
    release = held(page, f"**/api/jobs/{run}")
    page.goto(f"/#run={run}&layout=plan")
    expect(page.locator("#run")).to_be_enabled()
    page.locator("#field-seed").fill("5")
    page.locator("[id='field-network.loss']").fill("0.75")
    release()
    page.locator("#table tbody tr").first.wait_for()
    expect(page.locator("#field-trials")).to_have_value("3")
    expect(page.locator("#field-seed")).to_have_value("5")
    expect(page.locator("[id='field-network.loss']")).to_have_value("0.75")


def test_a_mission_picked_while_a_run_of_the_address_comes_stays(page: Page, run: str):
    release = held(page, f"**/api/jobs/{run}")
    page.goto(f"/#run={run}&layout=plan")
    mission = page.locator(".mission[data-name=walls2012-two-node]")
    mission.click()
    release()
    page.locator("#table tbody tr").first.wait_for()
    expect(mission.locator("input")).to_be_checked()


def test_a_field_that_is_emptied_shows_the_missions_own_again(page: Page):
    page.goto("/")
    trials = page.locator("#field-trials")
    expect(page.locator("#run")).to_be_enabled()
    own = trials.input_value()
    trials.fill("")
    expect(trials).to_have_value("")
    trials.press_sequentially("12")
    expect(trials).to_have_value("12")
    trials.fill("")
    trials.press("Tab")
    expect(trials).to_have_value(own)


def test_what_is_typed_for_a_run_outlasts_a_look_at_what_if(page: Page):
    page.goto("/#mission=first-look")
    page.locator("#field-trials").fill("7")
    page.get_by_role("tab", name="What if").click()
    page.get_by_label("Run as I drag").uncheck()
    loss = page.get_by_role("textbox", name="Packet loss, value")
    loss.fill("0.4")
    loss.press("Enter")
    page.get_by_role("tab", name="New run").click()
    expect(page.locator("[id='field-network.loss']")).to_have_value("0.4")
    expect(page.locator("#field-trials")).to_have_value("7")


def test_ticks_made_while_a_run_is_accepted_are_for_the_next(page: Page):
    page.goto("/")
    page.locator("#field-trials").fill("1")
    expect(page.locator("#run")).to_be_enabled()
    release = held(page, "**/api/jobs")
    page.locator("#run").click()
    page.locator("input[value=nekf]").uncheck()
    page.locator("input[value=mdeif]").check()
    release()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    expect(page.locator(".pane")).to_have_count(3)
    expect(page.locator("input[value=nekf]")).not_to_be_checked()
    expect(page.locator("input[value=mdeif]")).to_be_checked()
