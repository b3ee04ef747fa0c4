"""Anything is pressed, typed and dragged in any order: nothing fails in the page, its address brings it back."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import ElementHandle, Error, Page, Route, sync_playwright

from tests.browser.conftest import FIRST_LOOK, FLAGS, Watch, chromium, window
from tests.server.living import Live
from tests.soak.rig import rig
from tests.soak.sizes import size

RUNS = [
    FIRST_LOOK,
    {"scenario": "cheung2019-pursuit-line", "trials": 2},
    {"scenario": "rui-chitre-steady-dangerous", "trials": 2},
    {"scenario": "sas-two-modes", "trials": 1},
    {"scenario": "walls2015-trial-1", "trials": 1, "set": {"duration_s": 600}},
]
KEYS = ["Space", "ArrowLeft", "Shift+ArrowRight", "Home", "End", "Escape", "Enter", "Tab", *"?[]/ft12npl."]
#: Actions between two openings of another run, and between two looks at what the address says.
ANEW, LOOK = 40, 25
#: An element that is covered or has gone is given up after this, ms.
PATIENCE_MS = 1500

#: What can be worked with now: kept in the page; its kind and name.
FOUND = """() => {
  const any = "button, a[href^='#'], input:not([type=file]), select, summary, textarea, [tabindex='0'], .nsewdrag";
  const within = document.querySelector("dialog:modal") ?? document;
  window.found = [...within.querySelectorAll(any)].filter((node) => {
    const { width, height } = node.getBoundingClientRect();
    return !node.disabled && width > 1 && height > 1 && node.checkVisibility({ visibilityProperty: true });
  });
  return found.map((node) => [
    node.tagName === "INPUT" ? node.type : node.tagName.toLowerCase(),
    node.getAttribute("aria-label") || node.title || node.textContent.trim().slice(0, 40) || node.id,
  ]);
}"""

#: What the address of a run promises to bring back.
SHOWN = """() => {
  const elsewhere = "#explorer, [aria-label='Playback speed'], [aria-label='Length of a film']";
  return {
    run: new URLSearchParams(location.hash.slice(1)).get("run"),
    chips: [...document.querySelectorAll(".chip")].map((c) => [c.textContent, c.getAttribute("aria-pressed")]),
    panes: [...document.querySelectorAll(".pane")].map((p) => p.dataset.algorithm),
    chosen: [...document.querySelectorAll("#workbench select")]
      .filter((s) => s.offsetParent && !s.closest(elsewhere))
      .map((s) => [s.getAttribute("aria-label"), s.value]),
    drawn: [...document.querySelectorAll("[name^=pane-]")].map((b) => [b.name, b.checked]),
    time: document.querySelector(".now").textContent,
  };
}"""
#: Whoever opens a run sees something of it: an address that hides every estimator is not taken at its word.
SOME_SHOWN = """() => document.querySelector(".chip[data-kind=algorithms][aria-pressed=true]") !== null"""
PAUSE = """() => document.querySelector("[title^='Pause']")?.click()"""


def briefly(route: Route) -> None:
    """Runs are asked for as the page asks for them, but of two trials at most."""
    body = route.request.post_data_json if route.request.method == "POST" else None
    if isinstance(body, dict) and isinstance(body.get("trials", 2), int):
        body["trials"] = min(body.get("trials", 2), 2)
    route.continue_(post_data=None if body is None else json.dumps(body))


def work(page: Page, kind: str, node: ElementHandle, chance: random.Random) -> None:
    """Do with an element what a person might."""
    match kind:
        case "select":
            values = node.evaluate("node => [...node.options].map((option) => option.value)")
            node.select_option(chance.choice(values), timeout=PATIENCE_MS)
        case "range":
            node.focus()
            page.keyboard.press(chance.choice(["ArrowLeft", "ArrowRight", "PageUp", "Home", "End"]))
        case "number" | "text" | "search" | "textarea":
            some = ["0", "1", "-1", "0.5", "1e9", ""] if kind == "number" else ["", "auv", "é<b>", "first"]
            node.fill(chance.choice(some), timeout=PATIENCE_MS)
            if chance.random() < 0.4:
                page.keyboard.press("Enter")
        case "rect":
            box = node.bounding_box()
            if box is not None:
                page.mouse.move(box["x"] + chance.random() * box["width"], box["y"] + chance.random() * box["height"])
                page.mouse.down()
                page.mouse.move(box["x"] + chance.random() * box["width"], box["y"], steps=3)
                page.mouse.up()
        case "radio" | "checkbox":
            node.evaluate("node => { node.scrollIntoView({ block: 'nearest' }); node.click(); }")
        case _:
            node.click(timeout=PATIENCE_MS)


def act(page: Page, chance: random.Random) -> str:
    """Do something; returns what it was."""
    if chance.random() < 0.2:
        key = chance.choice(KEYS)
        page.keyboard.press(key)
        return key
    found = page.evaluate(FOUND)
    n = chance.randrange(len(found))
    kind, name = found[n]
    try:
        node = page.evaluate_handle("n => found[n]", n).as_element()
        if node is not None:
            work(page, kind, node, chance)
    except Error as error:  # it was covered, or has gone meanwhile
        return f"{kind} {name} ({str(error).splitlines()[0]})"
    return f"{kind} {name}"


def lost(page: Page) -> str:
    """What the address of an open run does not bring back in another page, if anything."""
    page.evaluate(PAUSE)
    page.wait_for_timeout(1000)  # for the address to follow
    if "run=" not in page.url or not page.evaluate(SOME_SHOWN):
        return ""
    other = page.context.new_page()
    address = ""
    for _ in range(30):
        if page.url != address:  # it says more once a run that was being read is there
            address = page.url
            other.goto(address)
        other.wait_for_timeout(1000)
        here, there = page.evaluate(SHOWN), other.evaluate(SHOWN)
        if here == there:
            break
    other.close()
    return "\n".join(f"{key}: {here[key]} became {there[key]}" for key in here if here[key] != there[key])


def anew(page: Page, live: Live, runs: list[str], chance: random.Random) -> None:
    """Open one of the runs, made again where it was deleted."""
    n = chance.randrange(len(runs))
    if live.http.get(f"/api/jobs/{runs[n]}").status_code == 404:
        runs[n] = live.done(RUNS[n])["id"]
    page.goto(f"/#run={runs[n]}")
    page.locator("#table tbody").first.wait_for()


@pytest.mark.parametrize("seed", range(5))
def test_nothing_fails_whatever_is_pressed(tmp_path: Path, told: Callable[..., None], seed: int):
    chance = random.Random(seed)
    trail: list[str] = []
    watch = Watch()
    watch.refusals = {422}  # of what is typed into fields
    with rig(tmp_path / "data") as it, sync_playwright() as playwright:
        runs = [it.live.done(run)["id"] for run in RUNS]
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        with window(browser, it, watch) as context:  # type: ignore[arg-type]
            context.route("**/api/jobs", briefly)
            page = context.new_page()
            page.on("dialog", lambda dialog: dialog.accept())
            for n in range(size("clicks") // 5):
                if n % ANEW == 0:
                    trail.append("another run")
                    anew(page, it.live, runs, chance)
                trail.append(act(page, chance))
                assert not watch.faults, "\n".join([*watch.faults, *trail[-LOOK:]])
                if n % LOOK == LOOK - 1:
                    missing = lost(page)
                    assert not missing, "\n".join([page.url, missing, *trail[-LOOK:]])
        browser.close()
    told(actions=len(trail), missed=sum(" (" in done for done in trail))
