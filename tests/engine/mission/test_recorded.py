"""Recorded missions from CSV: columns, units and conventions, what a vehicle believes at the start, and bad files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.mission import fly, logs
from engine.mission.log import Log
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError

FILES = {
    "odometry.csv": "t,ds,dth\n1,2.0,0.1\n2,2.0,0.1\n3,0.0,-0.2\n",
    "dvl.csv": "t,u,v\n0.5,1.0,0.25\n1.5,1.5,-0.25\n",
    "compass.csv": "t,psi\n0.25,0.5\n1.25,0.75\n2.25,-3.0\n",
    "depth.csv": "t,z\n1,10\n2,11.5\n",
    "gps.csv": "t,x,y\n1,100,200\n3,101,202\n",
    "ranges.csv": "t,who,r\n1.5,17,150\n2.5,18,300\n2.5,17,151\n",
    "beacons.csv": "id,x,y\n17,0,150\n18,300,0\n",
    "truth.csv": "t,x,y,th\n0,1,2,0.5\n1,3,4,0.5\n3,5,8,0.6\n",
}
SCENARIO: dict[str, Any] = {
    "schema": 1,
    "title": "recorded",
    "family": "navigation",
    "report_interval_s": 0.5,
    "mission": {
        "kind": "recorded",
        "format": "csv",
        "log": "harbour",
        "odometry": [{"vehicle": "rover", "file": "odometry.csv", "time": "t", "forward": "ds", "turn": "dth"}],
        "velocity": [{"vehicle": "auv", "file": "dvl.csv", "time": "t", "forward": "u", "left": "v"}],
        "heading": [{"vehicle": "auv", "file": "compass.csv", "time": "t", "heading": "psi"}],
        "depth": [{"vehicle": "auv", "file": "depth.csv", "time": "t", "depth": "z"}],
        "fixes": [{"vehicle": "auv", "file": "gps.csv", "time": "t", "x": "x", "y": "y"}],
        "ranges": [
            {
                "file": "ranges.csv",
                "time": "t",
                "receiver": "rover",
                "sender_column": "who",
                "range": "r",
                "names": {"17": "north", "18": "east"},
            }
        ],
        "nodes": [{"file": "beacons.csv", "name": "id", "x": "x", "y": "y", "names": {"17": "north", "18": "east"}}],
        "truth": [{"vehicle": "rover", "file": "truth.csv", "time": "t", "x": "x", "y": "y", "heading": "th"}],
    },
    "vehicles": [
        {
            "name": "rover",
            "kind": "surface",
            "initial": {"position_sigma_m": 0.5},
            "sensors": {
                "modem": {"range_sigma_m": 1.0},
                "odometry": {
                    "per_reading": {"forward_sigma_m": 0.1, "turn_sigma_deg": 1.0},
                    "per_sqrt_m": {"forward_sigma_m": 0.2, "left_sigma_m": 0.3},
                    "per_sqrt_s": {"turn_sigma_deg": 2.0},
                },
            },
        },
        {
            "name": "auv",
            "kind": "auv",
            "initial": {"position_sigma_m": 2.0},
            "sensors": {
                "dvl": {"along_sigma_mps": 0.1, "cross_sigma_mps": 0.2},
                "heading": {"sigma_deg": 3.0},
                "depth": {"sigma_m": 0.1},
                "gps": {"sigma_m": 3.0},
            },
        },
        {
            "name": "north",
            "kind": "fixed",
            "initial": {"position_sigma_m": 0.1},
            "sensors": {"modem": {"range_sigma_m": 1}},
        },
        {
            "name": "east",
            "kind": "fixed",
            "initial": {"position_sigma_m": 0.1},
            "sensors": {"modem": {"range_sigma_m": 1}},
        },
    ],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A data folder with the log in it."""
    (tmp_path / "harbour").mkdir()
    for name, text in FILES.items():
        (tmp_path / "harbour" / name).write_text(text)
    return tmp_path


def read(folder: Path, changes: dict[str, Any] | None = None, trials=(0,)) -> Log:
    scenario = toml.override(toml.validate(SCENARIO), changes or {})
    return fly(scenario, trials, logs=[folder])  # type: ignore[arg-type]


def test_columns_become_sensors_on_the_missions_clock(folder):
    log = read(folder)
    rover, auv, north, east = log.vehicles
    np.testing.assert_array_equal(rover.odometry.time_s, [1, 2, 3])
    np.testing.assert_array_equal(rover.odometry.value, [[[2, 0, 0.1], [2, 0, 0.1], [0, 0, -0.2]]])
    np.testing.assert_array_equal(auv.velocity.value, [[[1, 0.25], [1.5, -0.25]]])
    np.testing.assert_array_equal(auv.heading.value, [[0.5, 0.75, -3.0]])
    assert auv.heading.sigma_rad == pytest.approx(np.radians(3))
    np.testing.assert_array_equal(auv.depth.value, [[10, 11.5]])
    np.testing.assert_array_equal(auv.fixes.value, [[[100, 200], [101, 202]]])
    np.testing.assert_array_equal(auv.fixes.cov, [np.eye(2) * 9] * 2)
    np.testing.assert_array_equal(north.initial.position_m, [[0, 150]])
    np.testing.assert_array_equal(east.initial.position_m, [[300, 0]])
    assert log.duration_s == 3 and log.trials == 1


def test_odometry_noise_adds_up_per_reading_per_metre_and_per_second(folder):
    cov = read(folder).vehicles[0].odometry.cov
    turn = np.radians(1.0) ** 2 + np.radians(2.0) ** 2
    np.testing.assert_allclose(cov[0], np.diag([0.01 + 0.04 * 2, 0.09 * 2, turn]), rtol=1e-12)
    np.testing.assert_allclose(cov[2], np.diag([0.01, 0, turn]), rtol=1e-12)


def test_every_range_is_a_broadcast_launched_a_travel_time_before(folder):
    a = read(folder).acoustics
    np.testing.assert_array_equal(a.sender, [2, 3, 2])
    np.testing.assert_allclose(a.tol_s, [1.4, 2.3, 2.5 - 151 / 1500])
    assert sorted(zip(a.toa_s, a.sender[a.broadcast])) == [(1.5, 2), (2.5, 2), (2.5, 3)]
    np.testing.assert_allclose(a.tol_s[a.broadcast], a.toa_s - a.travel_time_s[0])
    np.testing.assert_allclose(sorted(a.travel_time_s[0]), [0.1, 151 / 1500, 0.2])
    assert set(a.receiver) == {0}


def test_the_start_is_the_references_and_nothing_later_is(folder):
    rover = read(folder).vehicles[0].initial
    np.testing.assert_array_equal(rover.position_m, [[1, 2]])
    np.testing.assert_array_equal(rover.heading_rad, [0.5])
    np.testing.assert_array_equal(rover.velocity_mps, [[2, 2]])
    later = FILES["truth.csv"].replace("1,3,4,0.5", "1,3,4,0.9").replace("3,5,8,0.6", "3,50,-80,2.6")
    (folder / "harbour" / "truth.csv").write_text(later)
    moved = read(folder)
    np.testing.assert_array_equal(moved.vehicles[0].initial.position_m, rover.position_m)
    np.testing.assert_array_equal(moved.vehicles[0].initial.heading_rad, rover.heading_rad)


def test_a_stated_start_goes_before_the_references_and_a_fix_serves_where_there_is_none(folder):
    log = read(folder, {"vehicles.rover.initial.position_m": [9, 9], "vehicles.rover.initial.heading_deg": 90})
    np.testing.assert_array_equal(log.vehicles[0].initial.position_m, [[9, 9]])
    np.testing.assert_allclose(log.vehicles[0].initial.heading_rad, np.pi / 2)
    np.testing.assert_array_equal(log.vehicles[1].initial.position_m, [[100, 200]])


def test_without_a_heading_column_the_first_metre_of_the_reference_gives_it(folder):
    mission = SCENARIO["mission"]
    truth = [{k: v for k, v in mission["truth"][0].items() if k != "heading"}]
    log = read(folder, {"mission": mission | {"truth": truth}})
    np.testing.assert_allclose(log.vehicles[0].initial.heading_rad, np.pi / 4)


def test_the_reference_is_interpolated_but_not_over_gaps_nor_beyond_its_ends(folder):
    log = read(folder)
    np.testing.assert_allclose(log.truth["rover"][0, :4], [[1, 2], [2, 3], [3, 4], [3.5, 5]])
    assert set(log.truth) == {"rover"}
    gappy = read(folder, {"mission.truth.0.max_gap_s": 1.5}).truth["rover"][0]
    assert np.isfinite(gappy[:3]).all() and np.isnan(gappy[3:6]).all() and np.isfinite(gappy[6]).all()
    (folder / "harbour" / "truth.csv").write_text("t,x,y,th\n0,1,2,0.5\n1,3,4,0.5\n")
    assert np.isnan(read(folder).truth["rover"][0, 3:]).all()


def same(a: Log, b: Log) -> None:
    np.testing.assert_allclose(a.time_s, b.time_s, atol=1e-9)
    for v, w in zip(a.vehicles, b.vehicles):
        for name in ("velocity", "heading", "odometry", "depth", "fixes"):
            x, y = getattr(v, name), getattr(w, name)
            assert (x is None) == (y is None)
            if x is not None:
                np.testing.assert_allclose(x.time_s, y.time_s, atol=1e-6)
                value, other = (x.value, y.value) if name != "heading" else (np.exp(1j * x.value), np.exp(1j * y.value))
                np.testing.assert_allclose(value, other, atol=1e-9)
        np.testing.assert_allclose(v.initial.heading_rad, w.initial.heading_rad, atol=1e-9)
    np.testing.assert_allclose(a.acoustics.toa_s, b.acoustics.toa_s, atol=1e-6)
    np.testing.assert_allclose(a.acoustics.travel_time_s, b.acoustics.travel_time_s, atol=1e-9)
    for name in a.truth:
        np.testing.assert_allclose(a.truth[name], b.truth[name], atol=1e-6)


def test_other_units_conventions_and_clocks_give_the_same_log(folder):
    """The same mission as somebody else might have kept it: epoch milliseconds, degrees, compass, starboard, up."""
    plain = read(folder)
    epoch = 1_700_000_000_000

    def ms(t: float) -> str:
        return str(int(epoch + 1000 * t))

    def compass(radians: float) -> str:
        return repr(float(90 - np.degrees(radians)) % 360)

    other = {
        "odometry.csv": "ms;ds;right\n"
        + "".join(f"{ms(t)};{d};{-np.degrees(w)!r}\n" for t, d, w in rows("odometry.csv")),
        "dvl.csv": "ms\tu\tstarboard\n" + "".join(f"{ms(t)}\t{u}\t{-v}\n" for t, u, v in rows("dvl.csv")),
        "compass.csv": "ms,hdg\n" + "".join(f"{ms(t)},{compass(h)}\n" for t, h in rows("compass.csv")),
        "depth.csv": "ms,z\n" + "".join(f"{ms(t)},{-z}\n" for t, z in rows("depth.csv")),
        "gps.csv": "ms,x,y\n" + "".join(f"{ms(t)},{x},{y}\n" for t, x, y in rows("gps.csv")),
        "ranges.csv": "ms,who,owtt_us\n"
        + "".join(f"{ms(t)},{int(w)},{r / 1500 * 1e6!r}\n" for t, w, r in rows("ranges.csv")),
        "truth.csv": "ms,x,y,hdg\n" + "".join(f"{ms(t)},{x},{y},{compass(h)}\n" for t, x, y, h in rows("truth.csv")),
    }
    for name, text in other.items():
        (folder / "harbour" / name).write_text("\ufeff" + text.replace("np.float64(", "").replace(")", ""))
    clock = {"time": "ms", "time_unit": "ms"}
    mission = SCENARIO["mission"]

    def with_(kind: str, drop: tuple[str, ...] = (), **changes: Any) -> list[dict]:
        entry = {k: v for k, v in mission[kind][0].items() if k not in drop}
        return [entry | clock | changes]

    log = read(
        folder,
        {
            "mission": mission
            | {
                "odometry": with_("odometry", turn="right", turn_unit="deg", turn_positive="right"),
                "velocity": with_("velocity", ("left",), right="starboard"),
                "heading": with_("heading", heading="hdg", unit="deg", convention="compass"),
                "depth": with_("depth", positive="up"),
                "fixes": with_("fixes"),
                "ranges": with_("ranges", ("range",), travel_time="owtt_us", travel_time_unit="us"),
                "truth": with_("truth", heading="hdg", heading_unit="deg", convention="compass"),
            }
        },
    )
    wrapped = (log.vehicles[0].initial.heading_rad + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(wrapped, plain.vehicles[0].initial.heading_rad, atol=1e-9)
    object.__setattr__(log.vehicles[0].initial, "heading_rad", wrapped)
    same(plain, log)


def rows(name: str) -> list[list[float]]:
    return [[float(c) for c in line.split(",")] for line in FILES[name].splitlines()[1:]]


def test_world_velocities_need_no_heading(folder):
    (folder / "harbour" / "dvl.csv").write_text("t,ve,vn\n0.5,1.0,0.25\n1.5,1.5,-0.25\n")
    velocity = [{"vehicle": "auv", "file": "dvl.csv", "time": "t", "east": "ve", "north": "vn"}]
    log = read(folder, {"mission": SCENARIO["mission"] | {"velocity": velocity, "heading": []}})
    auv = log.vehicles[1]
    np.testing.assert_array_equal(auv.velocity.value, [[[1, 0.25], [1.5, -0.25]]])
    np.testing.assert_array_equal(auv.heading.value, [[0.0]])
    assert auv.heading.sigma_rad == 0


def test_time_zero_can_be_stated_and_the_mission_cut(folder):
    """From 1.25 s to 2.75 s: three quarters of the second increment are left, and the third reaches over the end."""
    log = read(folder, {"mission.start_s": 1.25, "duration_s": 1.5, "vehicles.auv.initial.position_m": [0, 0]})
    rover, auv = log.vehicles[:2]
    np.testing.assert_allclose(rover.odometry.time_s, [0.75, 1.75])
    np.testing.assert_allclose(rover.odometry.value[0], [[1.5, 0, 0.075], [0, 0, -0.2]])
    np.testing.assert_allclose(auv.velocity.time_s, [0.25])
    np.testing.assert_allclose(auv.heading.time_s, [0.0, 1.0])
    np.testing.assert_allclose(log.acoustics.toa_s, [0.25, 1.25, 1.25])
    assert auv.fixes is None and auv.depth.value.tolist() == [[11.5]]


def test_links_losses_and_silences_of_the_scenario_come_on_top(folder):
    log = read(folder, {"network.links": [["north", "rover"]]})
    assert set(log.acoustics.sender[log.acoustics.broadcast]) == {2}
    lost = read(folder, {"network.loss": 0.5}, range(400)).acoustics.travel_time_s
    assert 0.4 < np.isnan(lost).mean() < 0.6
    assert np.isnan(read(folder, {"network.loss": 1.0}).acoustics.travel_time_s).all()
    silent = read(folder, {"network.silences": [{"start_s": 2, "end_s": 3}]}).acoustics
    np.testing.assert_array_equal(np.isnan(silent.travel_time_s[0]), silent.toa_s > 2)


def test_a_range_from_somebody_ignored_is_passed_over(folder):
    ranges = [{k: v for k, v in SCENARIO["mission"]["ranges"][0].items() if k != "names"}]
    ranges[0] |= {"names": {"17": "north"}, "ignore": ["18"]}
    log = read(folder, {"mission": SCENARIO["mission"] | {"ranges": ranges}})
    assert set(log.acoustics.sender) == {2} and len(log.acoustics.toa_s) == 2


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("odometry.csv", "t,ds,dth\n1,2,0.1\n0.5,2,0.1\n", "odometry.csv line 3, column 't'.*earlier"),
        ("odometry.csv", "t,ds,dth\n1,2,0.1\n1,2,0.1\n", "odometry.csv line 3, column 't'.*repeats"),
        ("odometry.csv", "t,ds,dth\nnan,2,0.1\n", "odometry.csv line 2, column 't'.*not finite"),
        ("odometry.csv", "t,ds,dth\n1,inf,0.1\n", "odometry.csv line 2, column 'ds'.*not finite"),
        ("odometry.csv", "t,ds,dth\n1,two,0.1\n", "odometry.csv line 2, column 'ds'.*'two' is no number"),
        ("odometry.csv", "t,ds,dth\n1,,0.1\n", "odometry.csv line 2, column 'ds'.*empty"),
        ("odometry.csv", "t,ds\n1,2\n", "no column 'dth'.*its columns are: t, ds"),
        ("odometry.csv", "t,ds,dth\n1,2\n", "odometry.csv line 2 has 2 cells, the header 3"),
        ("odometry.csv", "t,ds,dth\n", "odometry.csv has no rows"),
        ("odometry.csv", "", "odometry.csv has no rows"),
        ("ranges.csv", "t,who,r\n2,17,9\n1,17,9\n", "ranges.csv line 3, column 't'.*earlier"),
        (
            "ranges.csv",
            "t,who,r\n1,99,9\n",
            "ranges.csv line 2, column 'who'.*'99' is no vehicle.*names, or under ignore",
        ),
        ("ranges.csv", "t,who,r\n1,17,-9\n", "ranges.csv line 2, column 'r'.*no range"),
        ("ranges.csv", "t,who,r\n1,,9\n", "ranges.csv line 2, column 'who'.*empty"),
        ("truth.csv", "t,x,y,th\n0,1,2,0\n0,1,2,0\n", "truth.csv line 3"),
    ],
)
def test_a_bad_cell_is_named_by_file_line_and_column(folder, file, text, words):
    (folder / "harbour" / file).write_text(text)
    with pytest.raises(ScenarioError, match=words):
        read(folder)


def test_a_file_that_is_not_text_is_refused(folder):
    (folder / "harbour" / "depth.csv").write_bytes(b"t,z\n\xff\xfe,1\n")
    with pytest.raises(ScenarioError, match=r"depth\.csv is not UTF-8"):
        read(folder)


def test_unsorted_ranges_are_taken_where_the_scenario_says_sort(folder):
    (folder / "harbour" / "ranges.csv").write_text("t,who,r\n2,17,9\n1,17,9\n")
    assert read(folder, {"mission.ranges.0.sort": True}).acoustics.toa_s.tolist() == [1, 2]


def test_without_a_start_the_error_says_what_to_state(folder):
    mission = {k: v for k, v in SCENARIO["mission"].items() if k not in ("truth", "nodes")}
    with pytest.raises(ScenarioError, match=r"vehicles\[0\].initial.position_m"):
        read(folder, {"mission": mission})
    with pytest.raises(ScenarioError, match=r"vehicles\[0\].initial.heading_deg"):
        read(folder, {"mission": mission, "vehicles.rover.initial.position_m": [0, 0]})


def test_noise_that_nobody_states_is_an_error():
    without = {**SCENARIO, "vehicles": [{**SCENARIO["vehicles"][0], "sensors": {}}, *SCENARIO["vehicles"][1:]]}
    with pytest.raises(ScenarioError, match=r"vehicles\[0\].sensors.odometry"):
        toml.validate(without)


# --- where logs are looked for -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["../harbour", "/etc", "a/b", "..", ".hidden", "", "harbour/.."])
def test_a_log_is_named_by_a_plain_name(name):
    with pytest.raises(ScenarioError, match=r"mission.log"):
        toml.override(toml.validate(SCENARIO), {"mission.log": name})


@pytest.mark.parametrize("name", ["../odometry.csv", "/etc/passwd", "passwd", "sub/odometry.csv", "jobs.sqlite"])
def test_a_file_is_named_by_a_plain_name_with_a_tables_suffix(name):
    with pytest.raises(ScenarioError, match=r"mission.odometry\[0\].file"):
        toml.override(toml.validate(SCENARIO), {"mission.odometry.0.file": name})


def test_a_link_that_leads_out_of_the_folder_is_not_followed(folder, tmp_path_factory):
    outside = tmp_path_factory.mktemp("outside")
    (outside / "secret.csv").write_text(FILES["odometry.csv"])
    (folder / "harbour" / "odometry.csv").unlink()
    (folder / "harbour" / "odometry.csv").symlink_to(outside / "secret.csv")
    with pytest.raises(ScenarioError, match="leads out of"):
        read(folder)
    (folder / "elsewhere").symlink_to(outside)
    with pytest.raises(ScenarioError, match="there is no folder 'elsewhere'"):
        read(folder, {"mission.log": "elsewhere"})


def test_files_too_large_are_refused_before_they_are_read(folder, monkeypatch):
    sizes = [len(text.encode()) for text in FILES.values()]
    monkeypatch.setattr(logs, "MAX_BYTES", max(sizes))
    with pytest.raises(ScenarioError, match=r"mission\.log: .*together"):
        read(folder)
    monkeypatch.setattr(logs, "MAX_BYTES", min(sizes) - 1)
    with pytest.raises(ScenarioError, match="is larger than"):
        read(folder)


def test_a_missing_log_says_where_it_was_looked_for(tmp_path):
    with pytest.raises(ScenarioError) as error:
        read(tmp_path)
    assert "harbour" in str(error.value) and str(tmp_path) in str(error.value)
    assert "COOPNAV_TEST_DATA" in str(error.value)


def test_a_missing_file_is_named(folder):
    (folder / "harbour" / "depth.csv").unlink()
    with pytest.raises(ScenarioError, match=r"mission.depth\[0\].file: there is no file 'depth.csv'"):
        read(folder)


def test_a_log_is_found_beside_its_scenario_and_by_the_variable(folder, monkeypatch, tmp_path_factory):
    (folder / "trial.toml").write_text(toml.dumps(toml.validate(SCENARIO)))
    assert fly(library.find(str(folder / "trial.toml")), [0]).duration_s == 3  # type: ignore[arg-type]
    monkeypatch.setenv("COOPNAV_TEST_DATA", str(folder))
    assert fly(toml.validate(SCENARIO), [0]).duration_s == 3  # type: ignore[arg-type]


def test_the_scenarios_own_folder_is_none_for_a_scenario_in_no_file():
    with pytest.raises(ScenarioError, match="in no file"):
        fly(toml.override(toml.validate(SCENARIO), {"mission.log": "."}), [0])  # type: ignore[arg-type]


# --- the public log ------------------------------------------------------------------------------------------------


@pytest.mark.recorded
def test_plaza_1_is_read_as_its_files_have_it(recorded_data):
    folder = recorded_data("plaza1")
    log = fly(library.find("plaza1-four-beacons"), [0])  # type: ignore[arg-type]
    odometry = np.loadtxt(folder / "odometry.csv", delimiter=",", skiprows=1)
    truth = np.loadtxt(folder / "groundtruth.csv", delimiter=",", skiprows=1)
    ranges = np.loadtxt(folder / "ranges.csv", delimiter=",", skiprows=1)
    start = truth[0, 0]
    robot = log.vehicles[0]
    inside = odometry[:, 0] - start <= log.duration_s
    inside[np.argmin(inside)] = True  # the increment over the end
    np.testing.assert_allclose(robot.odometry.time_s, odometry[inside, 0] - start, atol=1e-9)
    np.testing.assert_array_equal(robot.odometry.value[0, :, [0, 2]], odometry[inside, 1:].T)
    np.testing.assert_array_equal(robot.initial.position_m, truth[:1, 1:3])
    assert robot.initial.heading_rad[0] == truth[0, 3]
    assert len(log.acoustics.toa_s) == np.count_nonzero(ranges[:, 0] - start <= log.duration_s)
    measured = np.sort(log.acoustics.travel_time_s[0] * 1500)
    np.testing.assert_allclose(measured, np.sort(ranges[: len(measured), 3]), rtol=1e-9)


@pytest.mark.recorded
def test_plaza_1s_odometry_turns_to_the_true_heading(recorded_data):
    """So the start heading of the reference and the turns are all the heading there is."""
    folder = recorded_data("plaza1")
    robot = fly(library.find("plaza1-four-beacons"), [0]).vehicles[0]  # type: ignore[arg-type]
    truth = np.loadtxt(folder / "groundtruth.csv", delimiter=",", skiprows=1)
    heading = robot.initial.heading_rad[0] + np.cumsum(robot.odometry.value[0, :, 2])
    true = np.interp(robot.odometry.time_s + truth[0, 0], truth[:, 0], np.unwrap(truth[:, 3]))
    assert np.abs(np.angle(np.exp(1j * (heading - true)))).max() < 0.05


def test_the_clock_starts_where_the_first_increment_began(folder):
    """At the reference before the first reading; without one, as long before it as the second comes after."""
    only = {
        k: v for k, v in SCENARIO["mission"].items() if k not in ("velocity", "heading", "depth", "fixes", "ranges")
    }
    rover = SCENARIO["vehicles"][0]
    base = {**SCENARIO, "mission": only, "vehicles": [rover, *SCENARIO["vehicles"][2:]]}
    (folder / "harbour" / "odometry.csv").write_text("t,ds,dth\n1,2,0.1\n1.25,2,0.1\n")
    log = fly(toml.validate(base), [0], logs=[folder])  # type: ignore[arg-type]
    np.testing.assert_allclose(log.vehicles[0].odometry.time_s, [1, 1.25])
    start = {"position_m": [0, 0], "heading_deg": 0}
    alone = {**only, "truth": []}
    changed = toml.override(toml.validate(base), {"mission": alone, "vehicles.rover.initial": rover["initial"] | start})
    log = fly(changed, [0], logs=[folder])  # type: ignore[arg-type]
    np.testing.assert_allclose(log.vehicles[0].odometry.time_s, [0.25, 0.5])
