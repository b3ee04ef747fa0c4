"""What is wrong with a scenario is said with the key path and the remedy."""

from __future__ import annotations

from typing import Any

import pytest

from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError


def data() -> dict[str, Any]:
    return toml.plain(library.find("walls2011-topology-c"))


def put(path: str, value: Any) -> dict[str, Any]:
    """The valid scenario with one key replaced; a path of keys and numbers joined by dots."""
    tables = place = data()
    *way, last = [int(k) if k.isdecimal() else k for k in path.split(".")]
    for key in way:
        place = place[key]
    place[last] = value
    return tables


@pytest.mark.parametrize(
    ("path", "value", "key", "words"),
    [
        ("trails", 4, "trails", "did you mean 'trials'"),
        ("schema", 2, "schema", "schema = 1"),
        ("family", "navigaton", "family", "navigation"),
        ("trials", 0, "trials", "greater than or equal to 1"),
        ("trials", 10_000_000, "trials", "less than or equal to 1000000"),
        ("trials", 2.5, "trials", "integer"),
        ("duration_s", -1, "duration_s", "greater than 0"),
        ("duration_s", 1e12, "duration_s", "less than or equal"),
        ("duration_s", 2_000_000, "duration_s", "too many"),
        ("report_interval_s", 1e-3, "report_interval_s", "reports"),
        ("vehicles.1.name", "iver28", "vehicles[1].name", "2 vehicles named"),
        ("vehicles.1.name", "Iver28", "vehicles[1].name", "2 vehicles named"),
        ("vehicles.1.name", "../secrets", "vehicles[1].name", "letters"),
        ("vehicles.1.name", "", "vehicles[1].name", "letters"),
        ("vehicles.0.kind", "submarine", "vehicles[0].kind", "'auv', 'surface' or 'fixed'"),
        ("vehicles.0.path.kind", "lawnmoer", "vehicles[0].path", "did you mean 'lawnmower'"),
        ("vehicles.0.path.sped_mps", 1, "vehicles[0].path.sped_mps", "did you mean 'speed_mps'"),
        ("vehicles.0.path.speed_mps", float("nan"), "vehicles[0].path.speed_mps", "finite"),
        ("vehicles.0.initial", {}, "vehicles[0].initial.position_sigma_m", "add it"),
        ("vehicles.0.sensors.dvl.along_sigma_mps", -0.1, "vehicles[0].sensors.dvl.along_sigma_mps", "greater than 0"),
        ("vehicles.0.sensors.modem.range_sigma_m", "1", "vehicles[0].sensors.modem.range_sigma_m", "number"),
        ("vehicles.0.sensors.heading", None, "vehicles[0].sensors.heading", ""),
        ("vehicles.0.surfacings", [{"start_s": 9, "end_s": 3}], "vehicles[0].surfacings[0].end_s", "later"),
        ("vehicles.2.surfacings", [{"start_s": 3, "end_s": 9}], "vehicles[2].surfacings", "no AUV"),
        ("vehicles.2.depth_m", 5, "vehicles[2].depth_m", "surface craft"),
        ("network.links", [["iver28", "nobody"]], "network.links[0]", "no vehicle named 'nobody'"),
        ("network.links", [["iver28", "iver28"]], "network.links[0]", "linked to itself"),
        ("network.links", [["iver28"]], "network.links[0]", "2 items"),
        ("network.tdma.slots.3.vehicle", "nobody", "network.tdma.slots[3].vehicle", "no vehicle named 'nobody'"),
        ("network.tdma.slots.3.at_s", 145, "network.tdma.slots[3].at_s", "outside the cycle"),
        ("network.tdma.slots.3.at_s", 0, "network.tdma.slots[3]", "twice at 0 s"),
        ("network.tdma.cycle_s", 1e-9, "network.tdma.cycle_s", "too many"),
        ("network.loss", 1.5, "network.loss", "less than or equal to 1"),
        ("network.loss", {"kind": "burst"}, "network.loss", "did you mean 'bursty'"),
        ("network.loss", {"kind": "bursty", "mean_good_s": 1}, "network.loss.mean_bad_s", "is missing"),
        ("options", {"deif": {"delayed_state": None}}, "options.deif.delayed_state", "null"),
        ("options", {"deif": {"delayed_state": [1, None]}}, "options.deif.delayed_state[1]", "null"),
        ("mission", {"kind": "recorded"}, "mission", 'format = "csv"'),
        ("claims.0.operator", "!=", "claims[0].operator", "'<'"),
        ("claims.0.bound", 3, "claims[0].bound", "one thing"),
    ],
)
def test_a_fault_is_named_by_its_key_with_a_remedy(path, value, key, words):
    with pytest.raises(ScenarioError) as error:
        toml.validate(put(path, value))
    problem = next(p for p in error.value.problems if p.key == key)
    assert words in f"{problem.message}; {problem.remedy}"
    assert problem.remedy


def test_several_faults_are_told_at_once():
    tables = put("network.links", [["iver28", "nobody"], ["somebody", "iver31"]])
    tables["vehicles"][0]["path"]["kind"] = "station"
    with pytest.raises(ScenarioError) as error:
        toml.validate(tables | {"trials": 0})
    assert {p.key for p in error.value.problems} >= {"trials"}
    tables = put("network.links", [["iver28", "nobody"], ["somebody", "iver31"]])
    with pytest.raises(ScenarioError) as error:
        toml.validate(tables)
    assert [p.key for p in error.value.problems] == ["network.links[0]", "network.links[1]"]


def test_a_vehicle_without_modem_has_no_slot_and_no_link():
    tables = data()
    del tables["vehicles"][0]["sensors"]["modem"]
    tables["network"]["links"] = [["iver28", "iver31"]]
    with pytest.raises(ScenarioError) as error:
        toml.validate(tables)
    assert {p.key for p in error.value.problems} >= {"network.links[0]", "network.tdma.slots[1].vehicle"}


def test_a_dvl_needs_a_heading_to_turn_by():
    tables = data()
    del tables["vehicles"][0]["sensors"]["heading"]
    with pytest.raises(ScenarioError, match=r"vehicles\[0\].sensors.heading"):
        toml.validate(tables)


@pytest.mark.parametrize("text", ["title = ", "a = 1\na = 2", "[" * 5000, "\x00", "key = 2020-01-01T00:00:00Z"])
def test_malformed_toml_is_a_scenario_error(text):
    with pytest.raises(ScenarioError):
        toml.loads(text)


def test_a_missing_file_and_a_binary_one_are_scenario_errors(tmp_path):
    with pytest.raises(ScenarioError, match="no file"):
        toml.load(tmp_path / "nothing.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="UTF-8"):
        toml.load(tmp_path / "binary.toml")
    with pytest.raises(ScenarioError, match=r"no file .*scenario.toml"):
        toml.load(tmp_path)
