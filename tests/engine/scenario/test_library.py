"""The shipped scenarios."""

from __future__ import annotations

import pytest

from engine import registry
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError

W11 = [f"walls2011-topology-{letter}" for letter in "abcde"]


@pytest.mark.parametrize("name", library.names())
def test_every_shipped_scenario_says_what_to_look_at_and_runs_known_algorithms(name):
    scenario = library.find(name)
    library.check_algorithms(scenario)
    assert scenario.title and scenario.summary and scenario.source and scenario.algorithms
    known = registry.algorithms()
    for claim in scenario.claims:
        assert known[claim.algorithm].family in {known[a].family for a in scenario.algorithms}


def test_the_first_one_is_the_quick_look():
    assert library.names()[0] == "first-look"


@pytest.mark.parametrize("name", W11)
def test_the_w11_scenarios_have_the_papers_sensors_schedule_and_path(name):
    """W12 table 1, W11 section III: 145 s cycles, 4 broadcasts of each AUV, 6 of the ship, 500 m lines 50 m apart."""
    scenario = library.find(name)
    assert scenario.duration_s == 7200
    senders = [slot.vehicle for slot in scenario.network.tdma.slots]
    assert scenario.network.tdma.cycle_s == 145
    assert senders.count("iver28") == senders.count("iver31") == 4
    assert senders.count("topside") == (6 if "topside" in scenario.names else 0)
    for vehicle in scenario.vehicles:
        sensors = vehicle.sensors
        assert sensors.modem.range_sigma_m == 1.0
        if vehicle.kind == "auv":
            assert (sensors.heading.rate_hz, sensors.heading.sigma_deg) == (25, 2)
            assert (sensors.dvl.rate_hz, sensors.dvl.along_sigma_mps, sensors.dvl.cross_sigma_mps) == (3, 0.05, 0.05)
            assert (sensors.depth.rate_hz, sensors.depth.sigma_m) == (2, 0.1)
            assert (vehicle.path.line_length_m, vehicle.path.spacing_m) == (500, 50)
        else:
            assert (sensors.gps.rate_hz, sensors.gps.sigma_m) == (1, 3)


def test_the_w11_topologies_are_those_of_figure_1():
    def links(letter):
        return library.find(f"walls2011-topology-{letter}").network.links

    assert sorted(links("a")) == [["iver28", "iver31"], ["iver31", "iver28"]]
    assert links("b") == [["iver28", "iver31"]]
    assert links("c") == "all"
    assert sorted(links("d")) == [["topside", "iver28"], ["topside", "iver31"]]
    assert sorted(map(sorted, links("e"))) == [["iver28", "iver31"]] * 2 + [["iver28", "topside"]] * 2


@pytest.mark.parametrize("name", ["../pyproject", "no-such-scenario", "walls2011", "A", "first-look.toml/..", ""])
def test_an_unknown_or_unsafe_name_is_refused(name):
    with pytest.raises(ScenarioError):
        library.shipped(name)


def test_a_file_is_found_by_its_path_and_a_folder_by_its_scenario(tmp_path):
    text = toml.dumps(library.find("first-look"))
    (tmp_path / "scenario.toml").write_text(text)
    for path in (tmp_path, tmp_path / "scenario.toml"):
        assert library.find(str(path)).title == library.find("first-look").title
        assert library.find(str(path)).origin == str(tmp_path.resolve())


def test_an_unknown_algorithm_is_named_with_the_known_ones():
    scenario = toml.override(library.find("first-look"), {"algorithms": ["cekf", "kalmann"]})
    with pytest.raises(ScenarioError, match=r"algorithms\[1\].*kalmann.*cekf"):
        library.check_algorithms(scenario)
    scenario = toml.override(library.find("first-look"), {"claims.0.algorithm": "kalmann"})
    with pytest.raises(ScenarioError, match=r"claims\[0\].algorithm"):
        library.check_algorithms(scenario)


def test_a_scenario_without_its_log_says_what_is_missing(tmp_path):
    scenario = library.find("plaza1-two-beacons")
    elsewhere = toml.override(scenario, {"mission.log": "no-such-log"})
    assert "no-such-log" in (library.missing(elsewhere) or "")
    assert library.missing(library.find("first-look")) is None
    for name in ("odometry", "ranges", "beacons", "groundtruth"):
        assert library.missing(elsewhere, tmp_path) is not None
        (tmp_path / "no-such-log").mkdir(exist_ok=True)
        (tmp_path / "no-such-log" / f"{name}.csv").write_text("")
    assert library.missing(elsewhere, tmp_path) is None
