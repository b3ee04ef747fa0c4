"""The comparison table: differences to a baseline, winners, verdicts in words, copies."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.serving import Server, until

#: The panes are looked at elsewhere; plans are drawn in less time.
LAYOUT = "&layout=plan"


@pytest.fixture(scope="module")
def view(server: Server, run: str) -> dict[str, Any]:
    return server.get(f"/api/jobs/{run}/view")


def cell(page: Page, algorithm: str, subject: str, kind: str = ".versus") -> Locator:
    return page.locator(f"#table tbody[data-algorithm={algorithm}] tr[data-subject={subject}] {kind}")


def figures(text: str) -> tuple[float, float]:
    """Mean and half width of "−1.2 ± 0.3 ▼"."""
    found = re.match(r"([+−]?[\d.]+) ± ([\d.]+)", text)
    assert found, text
    return float(found[1].replace("−", "-")), float(found[2])


#: What the page was scrolled by is told to it with the next frame.
TWO_FRAMES = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


def point_at(target: Locator) -> None:
    """Point at something that explains itself, again where the page scrolled to it only after the pointer had come."""
    page = target.page

    def told() -> bool:
        page.mouse.move(5, 5)
        target.hover()
        page.evaluate(TWO_FRAMES)
        return page.get_by_role("tooltip").is_visible()

    until(told, "the sentence of what is pointed at")


def test_differences_are_told_with_their_interval_and_what_it_means(opened: Page, view: dict[str, Any], keep):
    for subject in ("scout", "ship"):
        expect(cell(opened, "dead_reckoning", subject)).to_have_text("–")
        for name in ("cekf", "nekf"):
            mean, half = view["differences"]["rmse_m"][subject][name]["dead_reckoning"]
            shown = cell(opened, name, subject)
            assert figures(shown.inner_text()) == pytest.approx((mean, half), rel=0.06, abs=1e-4)
            kind = "chance" if abs(mean) <= half else "better" if mean < 0 else "worse"
            expect(shown).to_have_attribute("data-kind", kind)
            expect(shown.locator(".kind")).to_have_text({"chance": "n.s.", "better": "▼", "worse": "▲"}[kind])
    opened.locator("#table").scroll_into_view_if_needed()
    point_at(cell(opened, "nekf", "scout"))
    expect(opened.get_by_role("tooltip")).to_contain_text("Over 3 trials")
    keep(opened)


def test_another_baseline_turns_the_sign(opened: Page, view: dict[str, Any]):
    opened.get_by_label("Baseline").focus()
    opened.get_by_label("Baseline").select_option(label="Naive EKF")
    expect(cell(opened, "nekf", "scout")).to_have_text("–")
    mean, _ = view["differences"]["rmse_m"]["scout"]["nekf"]["dead_reckoning"]
    assert figures(cell(opened, "dead_reckoning", "scout").inner_text())[0] == pytest.approx(-mean, rel=0.06)
    expect(opened).to_have_url(re.compile("base=nekf"))
    expect(opened.get_by_label("Baseline")).to_be_focused()
    opened.get_by_label("Figure compared").select_option(label="σ")
    mean, half = view["differences"]["sigma_m"]["scout"]["dead_reckoning"]["nekf"]
    shown = cell(opened, "dead_reckoning", "scout")
    assert figures(shown.inner_text()) == pytest.approx((mean, half), rel=0.06, abs=1e-4)
    expect(shown).to_have_attribute("data-kind", "more")
    expect(opened.locator("#table .rank")).to_have_count(0)
    opened.get_by_label("Figure compared").select_option(label="RMSE")
    opened.get_by_label("Baseline").select_option(label="Dead reckoning")


def test_the_winner_is_marked_and_who_is_not_behind_by_more_than_chance(opened: Page, server: Server, run: str, view):
    result = server.get(f"/api/jobs/{run}/result")["algorithms"]
    for subject in ("scout", "ship"):
        least = min(("dead_reckoning", "nekf"), key=lambda name: result[name]["subjects"][subject]["rmse_m"])
        other = "nekf" if least == "dead_reckoning" else "dead_reckoning"
        expect(cell(opened, least, subject, ".best")).to_contain_text("★")
        expect(cell(opened, "cekf", subject, ".best")).to_have_count(0)
        mean, half = view["differences"]["rmse_m"][subject][other][least]
        expect(cell(opened, other, subject, ".level")).to_have_count(1 if abs(mean) <= half else 0)


def test_a_verdict_is_explained_in_a_sentence_on_focus(opened: Page, server: Server, run: str):
    told = server.get(f"/api/jobs/{run}/result")["algorithms"]["cekf"]["subjects"]["scout"]["explanation"]
    verdict = cell(opened, "cekf", "scout", ".verdict")
    verdict.focus()
    expect(opened.get_by_role("tooltip")).to_have_text(told)
    expect(verdict).to_have_attribute("aria-describedby", "hint")
    opened.keyboard.press("Escape")
    expect(opened.get_by_role("tooltip")).to_be_hidden()
    opened.mouse.move(5, 5)
    point_at(verdict)
    expect(opened.get_by_role("tooltip")).to_have_text(told)
    opened.mouse.move(5, 5)
    expect(opened.get_by_role("tooltip")).to_be_hidden()


#: Scrolls, and waits for the event that the browser makes of what comes to lie under a pointer that rests.
SCROLL_UNDER_THE_POINTER = """dy => new Promise(done => {
  const soon = () => requestAnimationFrame(() => requestAnimationFrame(done));
  document.addEventListener("pointerover", soon, {once: true});
  document.querySelector("#stage").scrollBy(0, dy);
})"""


def test_a_sentence_shown_by_focus_stays_until_the_focus_goes(opened: Page):
    """What moves under a pointer that rests is not pointed at; a table drawn anew keeps focus and sentence."""
    opened.locator("#table").scroll_into_view_if_needed()
    opened.locator("#table h2").hover()
    verdict = cell(opened, "cekf", "scout", ".verdict")
    verdict.focus()
    told = verdict.get_attribute("data-hint") or ""
    tooltip = opened.get_by_role("tooltip")
    expect(tooltip).to_have_text(told)
    for dy in (-120, 120):
        opened.evaluate(SCROLL_UNDER_THE_POINTER, dy)
        assert tooltip.is_visible() and tooltip.inner_text() == told
    opened.emulate_media(color_scheme="dark")
    opened.emulate_media(color_scheme="light")
    expect(verdict).to_be_focused()
    expect(tooltip).to_have_text(told)
    other = cell(opened, "nekf", "scout")
    other.hover()
    expect(tooltip).not_to_have_text(told)
    opened.mouse.move(5, 5)
    expect(tooltip).to_have_text(told)
    opened.locator("#stage").focus()
    expect(tooltip).to_be_hidden()


def test_a_sentence_can_be_pointed_at_and_put_away(opened: Page):
    verdict = cell(opened, "cekf", "scout", ".verdict")
    point_at(verdict)
    tooltip = opened.get_by_role("tooltip")
    box = tooltip.bounding_box()
    assert box
    opened.mouse.move(box["x"] + 40, box["y"] + box["height"] / 2, steps=10)
    expect(tooltip).to_be_visible()
    opened.keyboard.press("Escape")
    expect(tooltip).to_be_hidden()


def copied(page: Page, label: str) -> str:
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    button = page.get_by_role("button", name=f"Copy as {label}")
    button.click()
    expect(button).to_have_text("copied ✓")
    return page.evaluate("navigator.clipboard.readText()")


def test_the_table_is_copied_as_csv(opened: Page, server: Server, run: str, view: dict[str, Any]):
    rows = list(csv.DictReader(io.StringIO(copied(opened, "CSV"))))
    assert len(rows) == 6
    row = next(r for r in rows if r["estimator"] == "Naive EKF" and r["vehicle"] == "scout")
    metrics = server.get(f"/api/jobs/{run}/result")["algorithms"]["nekf"]["subjects"]["scout"]
    assert float(row["rmse_m"]) == metrics["rmse_m"] and row["verdict"] == metrics["verdict"]
    mean, half = view["differences"]["rmse_m"]["scout"]["nekf"]["dead_reckoning"]
    assert float(row["rmse_m_minus_dead_reckoning"]) == mean
    assert float(row["low"]) == pytest.approx(mean - half) and float(row["high"]) == pytest.approx(mean + half)


def test_a_spreadsheet_computes_no_text_of_ours(opened: Page):
    """A title or a tag that begins like a formula stays text; a number below zero stays a number."""
    rows = [["=1+1", "@a", "-2", "a,b", "x\ry"], [-2, None, "+3"]]
    script = 'async (rows) => (await import("/static/runs/differences.js")).csv(rows)'
    read = list(csv.reader(io.StringIO(opened.evaluate(script, rows), newline="")))
    assert read == [["'=1+1", "'@a", "'-2", "a,b", "x\ry"], ["-2", "", "'+3"]]


def test_the_table_is_copied_as_latex(opened: Page):
    opened.locator(".chip", has_text=re.compile("^ship$")).click()
    text = copied(opened, "LaTeX")
    opened.get_by_role("button", name="Show all").click()
    body = text.split("\\midrule")[1].split("\\bottomrule")[0].strip().splitlines()
    assert len(body) == 3, "what is hidden is not copied"
    assert body[0].startswith("Dead reckoning & scout & ") and all(line.count("&") == 7 for line in body)
    assert re.search(r"\$[+-][\d.]+ \\pm [\d.]+\$", body[1])
    assert sum("\\textbf" in line for line in body) == 1


def test_one_trial_tells_no_interval(page: Page, server: Server):
    alone = server.finished({"scenario": "first-look", "trials": 1, "algorithms": ["dead_reckoning", "nekf"]})
    page.goto(f"/#run={alone}&layout=plan")
    shown = cell(page, "nekf", "scout")
    expect(shown).to_have_attribute("data-kind", "one")
    expect(shown).to_have_text(re.compile(r"^−[\d.]+$"))
    expect(shown).to_have_attribute("data-hint", re.compile("One trial cannot tell"))
