"""A person's first minutes: open, look, tick, run, watch."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.eyes import see_the_vehicles

THREE = ["dead_reckoning", "cekf", "nekf"]

#: Notes every state of the headline and every time on the clock from now on.
NOTE = """() => {
  window.noted = {progress: [], times: [], states: []};
  const look = () => {
    const bar = document.querySelector("#progress");
    if (!bar.hidden) noted.progress.push(bar.value);
    noted.states.push(document.querySelector("#headline .state").dataset.state);
    noted.times.push(document.querySelector(".now").textContent);
  };
  const options = {subtree: true, childList: true, characterData: true, attributes: true};
  new MutationObserver(look).observe(document.querySelector("#headline"), options);
  new MutationObserver(look).observe(document.querySelector(".now"), options);
}"""


def test_the_first_mission_is_picked_and_described(page: Page, keep):
    page.goto("/")
    expect(page.get_by_role("radio", name="First look")).to_be_checked()
    expect(page.get_by_role("heading", name="First look")).to_be_visible()
    for name in THREE:
        expect(page.locator(f"input[value={name}]")).to_be_checked()
    expect(page.get_by_role("button", name="Run", exact=True)).to_be_enabled()
    expect(page.locator("#empty .sketch circle").first).to_be_visible()
    keep(page)


def test_missions_can_be_chosen_by_keyboard(page: Page):
    page.goto("/")
    first = page.get_by_role("radio", name="First look")
    expect(first).to_be_checked()
    first.focus()
    page.keyboard.press("ArrowDown")
    expect(first).not_to_be_checked()
    chosen = page.locator("label.mission:has(input:checked) .title").inner_text()
    expect(page.locator("#empty h1")).to_have_text(chosen)


def test_estimators_that_can_be_compared_can_be_told_apart(page: Page):
    """Also those of another family that fly the same missions: by colour and dash together, and by the dash alone."""
    page.goto("/")
    expect(page.get_by_role("radio", name="First look")).to_be_checked()
    lines = page.locator("#algorithms .line-sample line")
    styles = lines.evaluate_all("all => all.map(l => [l.getAttribute('stroke'), l.getAttribute('stroke-dasharray')])")
    assert len(styles) > 8
    assert len({tuple(style) for style in styles}) == len(styles)
    assert len({dash for _, dash in styles}) == len(styles)


def test_nothing_ticked_cannot_be_run(page: Page):
    page.goto("/")
    for name in THREE:
        page.locator(f"input[value={name}]").uncheck()
    expect(page.locator("#run")).to_be_disabled()
    page.locator("input[value=cekf]").check()
    expect(page.locator("#run")).to_be_enabled()


def test_three_estimators_run_side_by_side(page: Page, keep):
    page.goto("/")
    page.locator(".mission", has_text="topology C").click()
    page.locator("#field-trials").fill("50")
    page.evaluate(NOTE)
    page.get_by_role("button", name="Run", exact=True).click()

    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    noted = page.evaluate("noted")
    assert "running" in noted["states"]
    assert any(0 < fraction < 1 for fraction in noted["progress"]), "progress was shown while it ran"

    assert page.locator(".pane").evaluate_all("all => all.map(p => p.dataset.algorithm)") == THREE
    expect(page.locator(".pane .verdict")).to_have_count(3)
    see_the_vehicles(page, THREE)
    for quantity in ("sigma_m", "error_m"):
        expect(page.locator(f".plot[data-quantity={quantity}] .js-line")).to_have_count(3)
    assert "camera=" not in page.url, "nobody has moved a camera"
    keep(page)


def test_the_clock_follows_the_estimates_of_a_run_at_work(page: Page):
    """Of one estimator that takes its time, so that a busy page sees more than the end."""
    page.goto("/")
    page.locator(".mission", has_text="topology C").click()
    for name in page.locator("input[name=algorithm]").evaluate_all("all => all.map(x => x.value)"):
        page.locator(f"input[name=algorithm][value={name}]").set_checked(name == "interleaved_update")
    page.evaluate(NOTE)
    page.get_by_role("button", name="Run", exact=True).click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    assert set(page.evaluate("noted")["times"]) - {"0:00:00.0", "2:00:00.0"}
