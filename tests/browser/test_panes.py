"""The panes: laid over each other, as plans, their options, their cameras; pictures and films of them."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect

from tests.browser.eyes import count, difference, pixels, see_the_vehicles, settled
from tests.browser.serving import Server, until

BLUE, ORANGE = (0, 114, 178), (213, 94, 0)


@pytest.fixture(scope="module")
def many(server: Server) -> str:
    """Id of a finished run of thirty trials."""
    return server.finished({"scenario": "first-look", "trials": 30, "algorithms": ["dead_reckoning", "cekf"]})


def view(page: Page) -> None:
    page.locator("#toolbar .view-menu summary").click()


def plan(page: Page, algorithm: str) -> np.ndarray:
    return pixels(page, algorithm)


def test_estimators_are_laid_over_each_other_and_the_address_keeps_it(page: Page, many: str, keep):
    page.goto(f"/#run={many}")
    page.get_by_label("Panes", exact=True).select_option("Overlay")
    expect(page.locator(".pane")).to_have_count(1)
    page.locator(".pane[data-algorithm=overlay][data-state=shown]").wait_for()
    expect(page.locator(".pane h3")).to_contain_text("Dead reckoning")
    expect(page.locator(".pane h3")).to_contain_text("Centralized EKF")
    # The benchmark's ink is black, dead reckoning's line is orange.
    until(lambda: count(pixels(page, "overlay"), ORANGE) > 100, "dead reckoning's line")
    until(lambda: count(pixels(page, "overlay"), (27, 31, 35)) > 100, "the benchmark's line")
    page.locator(".chip[data-name=dead_reckoning]").click()
    until(lambda: count(pixels(page, "overlay"), ORANGE) < 60, "dead reckoning to go with its chip")
    keep(page)
    page.locator(".chip[data-name=dead_reckoning]").click()
    expect(page).to_have_url(re.compile("layout=overlay"))
    page.reload()
    expect(page.get_by_label("Panes", exact=True)).to_have_value("overlay")
    page.locator(".pane[data-algorithm=overlay][data-state=shown]").wait_for()


def test_a_plan_shows_what_the_scene_shows_and_zooms(page: Page, many: str, keep):
    page.goto(f"/#run={many}&layout=plan")
    page.locator(".pane[data-state=shown]").nth(1).wait_for()
    assert page.locator(".pane iframe").count() == 0
    until(lambda: count(plan(page, "cekf"), BLUE) > 300, "the AUV's track")
    assert count(plan(page, "cekf"), ORANGE) > 300, "the ship's track"
    keep(page)
    before = plan(page, "cekf")
    page.get_by_role("checkbox", name="Trails").uncheck()
    until(lambda: count(plan(page, "cekf"), BLUE) < count(before, BLUE) / 2, "the trails to go")
    page.get_by_role("checkbox", name="Trails").check()
    until(lambda: difference(before, plan(page, "cekf")) == 0, "the trails again")
    page.locator(".pane canvas").first.focus()
    page.keyboard.press("+")
    until(lambda: difference(before, plan(page, "cekf")) > 0.01, "a closer view")
    page.keyboard.press("0")
    until(lambda: difference(before, plan(page, "cekf")) == 0, "everything again")
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    until(lambda: count(plan(page, "cekf"), BLUE) < count(before, BLUE) / 2, "the tracks to be gone at the start")


def test_ellipses_grow_with_their_sigma_and_trials_make_a_cloud(page: Page, many: str, keep):
    page.goto(f"/#run={many}")
    see_the_vehicles(page, ["dead_reckoning"])
    for box in ("Trails", "Ellipses"):
        page.get_by_role("checkbox", name=box, exact=True).uncheck()
    view(page)
    sizes = page.get_by_label("Size of the ellipses")
    inked = {}
    for sigma in ("1 σ", "3 σ"):
        sizes.select_option(sigma)
        inked[sigma] = settled(page, "dead_reckoning")
    until(lambda: difference(inked["1 σ"], pixels(page, "dead_reckoning")) > 0.001, "larger ellipses")
    expect(page.locator("#toolbar .keys")).to_contain_text("3 σ")
    before = pixels(page, "dead_reckoning")
    page.get_by_label("All trials").check()
    page.get_by_label("Densities").check()
    page.keyboard.press("Escape")
    until(lambda: difference(before, pixels(page, "dead_reckoning")) > 0.003, "all trials")
    keep(page)


def test_depths_are_stretched_as_asked(page: Page, many: str):
    page.goto(f"/#run={many}")
    see_the_vehicles(page, ["cekf"])
    before = settled(page, "cekf")
    view(page)
    page.get_by_label("Depths stretched").select_option("× 20")
    page.keyboard.press("Escape")
    until(lambda: difference(before, pixels(page, "cekf")) > 0.01, "deeper water")


def test_a_picture_of_the_panes_is_saved(page: Page, many: str, tmp_path: Path):
    page.goto(f"/#run={many}")
    see_the_vehicles(page, ["dead_reckoning", "cekf"])
    view(page)
    with page.expect_download() as download:
        page.get_by_role("button", name="Picture (PNG)").click()
    assert download.value.suggested_filename == "first-look.png"
    image = np.asarray(Image.open(io.BytesIO(Path(download.value.path()).read_bytes())).convert("RGB")).astype(int)
    boxes = [b for b in (pane.bounding_box() for pane in page.locator(".pane").all()) if b]
    assert abs(image.shape[1] - (boxes[-1]["x"] + boxes[-1]["width"] - boxes[0]["x"])) <= 2
    left, right = image[:, : image.shape[1] // 2], image[:, image.shape[1] // 2 :]
    assert count(left, BLUE) > 50 and count(right, BLUE) > 50, "both scenes are in the picture"


def test_films_of_the_mission_and_round_the_scene_are_saved(page: Page, many: str):
    page.goto(f"/#run={many}")
    see_the_vehicles(page, ["cekf"])
    time = page.locator(".now").inner_text()
    view(page)
    page.get_by_label("Length of a film").select_option("6 s")
    for name in ("Film of the mission", "Film round the scene"):
        with page.expect_download(timeout=120_000) as download:
            page.get_by_role("button", name=name).click()
        film = Path(download.value.path()).read_bytes()
        assert film[:4] == b"\x1a\x45\xdf\xa3" and b"webm" in film[:64], "it is a WebM file"
        assert len(film) > 10_000
        expect(page.get_by_role("button", name="Picture (PNG)")).to_be_enabled()
    assert page.locator(".now").inner_text() == time, "time is where it was"


def test_free_cameras_turn_one_pane_alone(page: Page, many: str):
    page.goto(f"/#run={many}")
    names = ["dead_reckoning", "cekf"]
    see_the_vehicles(page, names)
    view(page)
    page.get_by_label("Cameras linked").uncheck()
    page.keyboard.press("Escape")
    before = {name: settled(page, name) for name in names}
    box = page.locator(".pane[data-algorithm=dead_reckoning] .view").bounding_box()
    assert box

    def dragged() -> bool:
        page.mouse.move(box["x"] + 60, box["y"] + 60)
        page.mouse.down()
        page.mouse.move(box["x"] + 160, box["y"] + 90, steps=4)
        page.mouse.up()
        return difference(before["dead_reckoning"], pixels(page, "dead_reckoning")) > 0.02

    until(dragged, "the pane to turn")
    expect(page).to_have_url(re.compile("camera="))
    assert difference(before["cekf"], pixels(page, "cekf")) < 0.005, "the other stays"


def test_a_vehicle_is_followed(page: Page, many: str):
    page.goto(f"/#run={many}")
    see_the_vehicles(page, ["cekf"])
    for box in ("Trails", "Ellipses", "Rays"):
        page.get_by_role("checkbox", name=box, exact=True).uncheck()
    page.get_by_label("From above").check()
    page.get_by_label("Follow").check()

    def middle() -> bool:
        """The scout's marks are about the middle of the pane."""
        image = settled(page, "cekf")
        height, width, _ = image.shape
        about = image[height // 2 - 40 : height // 2 + 40, width // 2 - 60 : width // 2 + 60]
        return count(about, BLUE) >= 15

    for share in ("Home", "End"):
        page.locator("#stage").focus()
        page.keyboard.press(share)
        until(middle, f"the scout in the middle at {share}")


def test_six_panes_are_the_most_and_a_hidden_one_makes_room(page: Page, server: Server):
    seven = ["dead_reckoning", "cekf", "nekf", "interleaved_update", "deif", "mdeif", "k_last"]
    run = server.finished({"scenario": "first-look", "trials": 1, "algorithms": seven})
    page.goto(f"/#run={run}&layout=plan")
    expect(page.locator(".pane[data-state=shown]")).to_have_count(6)
    expect(page.locator(".pane[data-algorithm=k_last]")).to_have_count(0)
    expect(page.locator("#panes .note")).to_contain_text("1 more estimator")
    page.locator(".chip[data-name=nekf]").click()
    expect(page.locator(".pane[data-algorithm=k_last][data-state=shown]")).to_be_visible()
    expect(page.locator(".pane")).to_have_count(6)
    expect(page.locator("#panes .note")).to_be_hidden()


def test_a_pane_that_went_while_it_waited_for_its_turn_keeps_no_other_waiting(page: Page, solo: str):
    page.goto(f"/#run={solo}")
    see_the_vehicles(page, ["cekf"])
    before = settled(page, "cekf")
    page.evaluate("() => paneTurns.waiting.set((window.gone = {}), { since: 0, asked: Date.now(), begin() {} })")
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    until(lambda: difference(before, pixels(page, "cekf")) > 0.005, "the pane to be drawn again")
    assert not page.evaluate("() => paneTurns.waiting.has(gone)")


#: The canvas of the first pane.
CANVAS = """() => {
  const { contentDocument } = document.querySelector(".pane iframe");
  return [...contentDocument.querySelectorAll("canvas")].find((canvas) => canvas.width > 1);
}"""
#: How opaque a canvas is where it is least so: 0 for one that nothing has been drawn on, 255 for a picture.
OPAQUE = """(canvas) => {
  const small = Object.assign(document.createElement("canvas"), { width: 8, height: 8 });
  const pen = small.getContext("2d");
  pen.drawImage(canvas, 0, 0, 8, 8);
  return Math.min(...pen.getImageData(0, 0, 8, 8).data.filter((_, n) => n % 4 === 3));
}"""
LOSE = "(canvas) => (canvas.lost = canvas.getContext('webgl2').getExtension('WEBGL_lose_context')).loseContext()"


def test_a_pane_is_unveiled_when_there_is_a_picture_and_draws_again_after_its_context_was_lost(page: Page, solo: str):
    page.goto(f"/#run={solo}")
    page.wait_for_function("() => document.querySelector('.pane')?.dataset.state === 'shown'", polling="raf")
    canvas = page.evaluate_handle(CANVAS)
    assert canvas.evaluate(OPAQUE) == 255
    see_the_vehicles(page, ["cekf"])
    canvas.evaluate(LOSE)
    page.wait_for_timeout(500)
    canvas.evaluate("(canvas) => canvas.lost.restoreContext()")
    page.locator("#stage").focus()
    page.keyboard.press("Home")
    see_the_vehicles(page, ["cekf"])
