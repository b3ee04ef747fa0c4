"""A person's own recorded log: files chosen, columns mapped, what was understood looked at, saved and run."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.serving import Server

EAST, NORTH = (30.0, -20.0), (60.0, 40.0)


def rows(header: str, lines: list[str]) -> str:
    return "\n".join([header, *lines]) + "\n"


@pytest.fixture
def log(tmp_path: Path) -> dict[str, Path]:
    """A vehicle that runs 120 m east at 1 m/s and ranges two beacons, in the files its owner kept."""
    times = range(1, 121)
    ranges = [
        f"{t * 1000},{beacon},{math.dist((t, 0.0), place) / 1500 * 1000:.4f}"
        for t in range(4, 120, 4)
        for beacon, place in ((17, EAST), (18, NORTH))
        if t % 8 == (0 if beacon == 17 else 4)
    ]
    texts = {
        "drive.csv": rows("time_ms,forward_m,turn_rad", [f"{t * 1000},1.0,0.0" for t in times]),
        "modem.csv": rows("time_ms,beacon,owtt_ms", ranges),
        "anchors.csv": rows("id,x,y", [f"17,{EAST[0]},{EAST[1]}", f"18,{NORTH[0]},{NORTH[1]}"]),
        "truth.csv": rows("time_ms,x,y,yaw_rad", [f"{t * 1000},{t},0,0" for t in range(0, 121)]),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return {name: tmp_path / name for name in texts}


@pytest.fixture
def dialog(page: Page):
    page.goto("/")
    page.get_by_role("button", name="Bring a recorded log…").click()
    return page.get_by_role("dialog", name="A recorded log as a mission")


def test_a_log_is_understood_saved_and_run(page: Page, dialog, log: dict[str, Path], server: Server, keep):
    dialog.get_by_label("Files of the log").set_input_files(list(log.values()))
    seen = dialog.get_by_label("What was understood")
    expect(seen).to_contain_text("2 min of mission, 3 vehicles")
    expect(seen).to_contain_text("120 odometry readings")
    expect(seen).to_contain_text("node17 → vehicle: 14 of 14 ranges")
    expect(seen.get_by_role("img", name="Plan of the log")).to_be_visible()
    keep(page)

    dialog.get_by_label("Title").fill("Harbour trial, 3 May")
    dialog.get_by_role("button", name="Save the mission").click()
    expect(dialog).to_be_hidden()
    expect(page.locator(".mission[data-name=harbour-trial-3-may] input")).to_be_checked()
    page.get_by_role("button", name="Run", exact=True).click()
    expect(page.locator("#headline .state")).to_have_attribute("data-state", "done")
    expect(page.locator("#table tbody[data-algorithm=cekf] tr[data-subject=vehicle]")).to_be_visible()
    assert server.get("/api/logs")[-1]["used_by"] == ["harbour-trial-3-may"]


def test_a_column_that_fits_not_is_named_with_the_remedy_and_put_right(dialog, log: dict[str, Path], watch, keep):
    watch.refusals.add(422)
    dialog.get_by_label("Files of the log").set_input_files([log["drive.csv"], log["truth.csv"]])
    seen = dialog.get_by_label("What was understood")
    expect(seen).to_contain_text("120 odometry readings")
    use = dialog.get_by_label("truth.csv", exact=True).locator(".use")
    use.locator("select[data-key=time]").select_option("x")
    use.locator("select[data-key=x]").select_option("yaw_rad")
    use.locator("select[data-key=time]").select_option("y")
    expect(use.locator(".faults")).to_contain_text("truth.csv line 3, column 'y'")
    expect(use.locator(".remedy")).to_have_text("sort the file by time, each time once")
    expect(dialog.get_by_role("button", name="Save the mission")).to_be_disabled()
    use.locator("select[data-key=time]").select_option("time_ms")
    use.locator("select[data-key=x]").select_option("x")
    expect(seen).to_contain_text("120 odometry readings")
    expect(dialog.get_by_role("button", name="Save the mission")).to_be_enabled()


def test_a_file_with_a_fault_says_where_and_closing_leaves_nothing_behind(dialog, server: Server, tmp_path: Path):
    file = tmp_path / "compass.csv"
    file.write_text("time;heading_deg\n1;10\n2;20;30\n")
    before = server.get("/api/logs")
    dialog.get_by_label("Files of the log").set_input_files(file)
    section = dialog.get_by_label("compass.csv", exact=True)
    expect(section.locator(".faults")).to_have_text(
        "compass.csv line 3 has 3 cells, the header 2; give every column a cell"
    )
    with dialog.page.expect_response(lambda r: r.request.method == "DELETE"):
        dialog.get_by_role("button", name="Close").click()
    expect(dialog).to_have_count(0)
    assert server.get("/api/logs") == before


def test_a_graph_of_poses_and_ranges_is_a_mission_too(page: Page, dialog, server: Server, tmp_path: Path):
    poses = [f"VERTEX_SE2 {t} A{t} {t} 0 0" for t in range(60)]
    steps = [f"EDGE_SE2 {t + 1} A{t} A{t + 1} 1 0 0 .01 0 0 .01 0 .0001" for t in range(59)]
    ranges = [f"EDGE_RANGE {t} A{t} L1 {math.dist((t, 0), NORTH):.3f} 0.5" for t in range(2, 60, 4)]
    file = tmp_path / "boat.pyfg"
    file.write_text("\n".join([*poses, f"VERTEX_XY L1 {NORTH[0]} {NORTH[1]}", *steps, *ranges]) + "\n")
    dialog.get_by_label("Files of the log").set_input_files(file)
    seen = dialog.get_by_label("What was understood")
    expect(seen).to_contain_text("L1 → robotA: 15 of 15 ranges")
    dialog.get_by_role("textbox", name="A is").fill("boat")
    dialog.get_by_role("textbox", name="A is").press("Tab")
    expect(seen).to_contain_text("L1 → boat: 15 of 15 ranges")
    dialog.get_by_role("button", name="Save the mission").click()
    expect(page.locator(".mission[data-name=my-recorded-mission] input")).to_be_checked()
    assert server.finished({"scenario": "my-recorded-mission"})
