"""Recorded logs over REST: uploaded, described, tried, saved as a mission, run; and what is refused."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from server import logbook
from tests.server.living import Live

DRIVE = "t_s;forward;turn\n" + "".join(f"{t};1.0;0.0\n" for t in range(1, 61))
RANGES = "t;who;range_m\n" + "".join(f"{t + 0.5};7;{40 + 0.9 * t}\n" for t in range(5, 60, 5))
TRUTH = "t_s,x,y,hdg\n" + "".join(f"{t},{t},0,0\n" for t in range(0, 61))

MAPPED: dict[str, Any] = {
    "schema": 1,
    "title": "Harbour",
    "family": "navigation",
    "algorithms": ["dead_reckoning", "cekf"],
    "mission": {
        "kind": "recorded",
        "format": "csv",
        "log": "harbour",
        "odometry": [{"vehicle": "robot", "file": "drive.csv", "time": "t_s", "forward": "forward", "turn": "turn"}],
        "ranges": [
            {
                "file": "ranges.csv",
                "time": "t",
                "receiver": "robot",
                "sender_column": "who",
                "names": {"7": "buoy"},
                "range": "range_m",
            }
        ],
        "truth": [{"vehicle": "robot", "file": "truth.csv", "time": "t_s", "x": "x", "y": "y", "heading": "hdg"}],
    },
    "vehicles": [
        {
            "name": "robot",
            "kind": "surface",
            "initial": {"position_sigma_m": 0.5},
            "sensors": {"modem": {"range_sigma_m": 1.0}, "odometry": {"per_sqrt_m": {"forward_sigma_m": 0.1}}},
        },
        {
            "name": "buoy",
            "kind": "fixed",
            "initial": {"position_sigma_m": 0.5, "position_m": [-40.0, 0.0]},
            "sensors": {"modem": {"range_sigma_m": 1.0}},
        },
    ],
}


@pytest.fixture(scope="module")
def harbour(live: Live) -> str:
    for file, text in (("drive.csv", DRIVE), ("ranges.csv", RANGES), ("truth.csv", TRUTH)):
        assert live.http.put(f"/api/logs/harbour/{file}", content=text).status_code == 201
    return "harbour"


def test_files_are_described_by_their_columns(live: Live, harbour: str):
    files = {f["name"]: f for f in live.http.get("/api/logs/harbour").json()["files"]}
    drive = files["drive.csv"]
    assert drive["rows"] == 60 and [c["name"] for c in drive["columns"]] == ["t_s", "forward", "turn"]
    assert drive["columns"][0] | {} == {
        "name": "t_s",
        "empty": 0,
        "kind": "number",
        "min": 1,
        "max": 60,
        "ascending": True,
    }
    assert files["ranges.csv"]["columns"][1]["values"] == ["7"]
    assert live.http.put("/api/logs/harbour/drive.csv", content=DRIVE).status_code == 204


def test_of_a_long_file_the_first_rows_are_described_and_all_are_counted(live: Live):
    rows = 2 * logbook.ROWS
    body = "t,a\n" + "".join(f"{n},x\n" for n in range(rows))
    assert live.http.put("/api/logs/long/a.csv", content=body).status_code == 201
    (file,) = live.http.get("/api/logs/long").json()["files"]
    assert file["rows"] == rows and file["columns"][0]["max"] == logbook.ROWS - 1
    live.http.put("/api/logs/long/a.csv", content=body + "1,2,3\n")
    (file,) = live.http.get("/api/logs/long").json()["files"]
    assert f"line {rows + 2} has 3 cells" in file["problem"]["message"]


def test_whole_files_are_read_one_request_at_a_time(live: Live, harbour: str, monkeypatch):
    """Eight of the largest files in memory at once would be more than a small machine has."""
    inside, most = [], []
    describe = logbook.Logbook.describe

    def watched(self: logbook.Logbook, log: str) -> dict[str, Any]:
        inside.append(log)
        most.append(len(inside))
        try:
            return describe(self, log)
        finally:
            inside.pop()

    monkeypatch.setattr(logbook.Logbook, "describe", watched)
    with ThreadPoolExecutor(6) as pool:
        answers = list(pool.map(lambda _: live.http.get(f"/api/logs/{harbour}").status_code, range(24)))
    assert set(answers) == {200} and set(most) == {1}


def test_a_mapping_is_tried_before_it_is_saved(live: Live, harbour: str):
    found = live.http.post("/api/logs/harbour/preview", json={"scenario": MAPPED}).json()
    assert found["duration_s"] == pytest.approx(60.0)
    robot = found["vehicles"][0]
    assert robot["sensors"] == [{"kind": "odometry", "readings": 60, "from_s": 1.0, "to_s": 60.0}]
    assert robot["reckoned"][-1] == pytest.approx([60.0, 0.0])
    assert found["pairs"] == [{"from": "buoy", "to": "robot", "heard": 11, "of": 11, "range_m": [44.5, 89.5]}]


def test_a_wrong_column_is_named_with_those_there_are(live: Live, harbour: str):
    wrong = MAPPED | {"mission": MAPPED["mission"] | {"odometry": [MAPPED["mission"]["odometry"][0] | {"turn": "yaw"}]}}
    answer = live.http.post("/api/logs/harbour/preview", json={"scenario": wrong})
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["key"] == "mission.odometry[0]" and "'yaw'" in error["message"]
    assert error["remedy"] == "its columns are: t_s, forward, turn"


def test_a_saved_mapping_runs_and_its_log_stays(live: Live, harbour: str):
    assert live.http.put("/api/scenarios/harbour-run", json=MAPPED).status_code == 201
    entry = next(e for e in live.http.get("/api/scenarios").json() if e["name"] == "harbour-run")
    assert entry["available"], entry["missing"]
    assert live.done({"scenario": "harbour-run"})["state"] == "done"
    refused = live.http.delete("/api/logs/harbour")
    assert refused.status_code == 409 and "harbour-run" in refused.json()["detail"]
    assert live.http.delete("/api/scenarios/harbour-run").status_code == 204
    assert live.http.put("/api/logs/passing/a.csv", content="a\n1\n").status_code == 201
    assert live.http.delete("/api/logs/passing").status_code == 204
    assert live.http.get("/api/logs/passing").status_code == 404


def test_a_graph_is_described_by_its_robots_and_points(live: Live):
    graph = "VERTEX_SE2 0 A0 0 0 0\nVERTEX_SE2 1 A1 1 0 0\nVERTEX_XY L0 5 5\nEDGE_SE2 1 A0 A1 1 0 0 1 0 0 1 0 1\n"
    graph += "EDGE_RANGE 1 A1 L0 6.4 0.1\n"
    assert live.http.put("/api/logs/graph/one.pyfg", content=graph).status_code == 201
    (file,) = live.http.get("/api/logs/graph").json()["files"]
    assert file["robots"] == {"A": 2} and file["points"] == ["L0"] and file["ranges"] == 1


@pytest.mark.parametrize(
    ("path", "content", "status"),
    [
        ("/api/logs/..%2f..%2fetc/a.csv", b"a\n1\n", 404),
        ("/api/logs/Upper/a.csv", b"a\n1\n", 422),
        ("/api/logs/mine/..%2fescape.csv", b"a\n1\n", 404),
        ("/api/logs/mine/.hidden.csv", b"a\n1\n", 422),
        ("/api/logs/mine/program.py", b"print()\n", 422),
        ("/api/logs/mine/a.csv", b"\xff\xfe\x00\x01", 422),
        ("/api/logs/mine/a.csv", b"a\x00b\n", 422),
        ("/api/logs/mine/a.csv", b"  \n", 422),
    ],
)
def test_what_is_no_log_file_is_refused(live: Live, path: str, content: bytes, status: int):
    answer = live.http.put(path, content=content)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert not (live.settings.data / "scenarios" / "mine").exists()


def test_a_file_may_be_larger_than_other_requests_but_not_without_bounds(live: Live):
    line = "1.0,2.0,3.0\n"
    body = "a,b,c\n" + line * (live.settings.largest_body // len(line) + 1)
    assert live.http.put("/api/logs/large/a.csv", content=body).status_code == 201
    assert live.http.put("/api/scenarios/large", content=body).status_code == 413
    answer = live.http.put("/api/logs/large/b.csv", content=b"1" * (live.settings.largest_log_file + 1))
    assert answer.status_code == 413


def test_links_in_the_folder_are_not_followed(live: Live, tmp_path_factory: pytest.TempPathFactory):
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.csv").write_text("a\n1\n")
    folder = live.settings.data / "scenarios"
    folder.mkdir(exist_ok=True)
    os.symlink(outside, folder / "linked")
    assert live.http.get("/api/logs/linked").status_code == 404
    assert live.http.put("/api/logs/linked/new.csv", content="a\n1\n").status_code == 403
    assert not (outside / "new.csv").exists()
    assert live.http.delete("/api/logs/linked").status_code == 404
    (folder / "linked").unlink()
