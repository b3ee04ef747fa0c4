"""Scenario files: nothing is lost on the way through TOML, and single keys can be changed."""

from __future__ import annotations

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError


def floats(low: float, high: float):
    return st.floats(low, high, allow_nan=False)


def table(required: dict, optional: dict | None = None):
    return st.fixed_dictionaries(required, optional=optional or {})


positive = floats(1e-3, 1e4)
point = st.lists(floats(-1e5, 1e5), min_size=2, max_size=2)
text = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]), max_size=40)
title = text.filter(lambda t: len(t) > 0)
speed = floats(0.1, 10)

paths = st.one_of(
    table(
        {
            "kind": st.just("lawnmower"),
            "start_m": point,
            "line_length_m": floats(1, 1e4),
            "spacing_m": floats(-1e3, 1e3),
            "lines": st.integers(1, 50),
            "speed_mps": speed,
        },
        {"turn_radius_m": floats(0, 100), "heading_deg": floats(-360, 360)},
    ),
    table(
        {
            "kind": st.just("loiter"),
            "center_m": point,
            "radius_m": floats(1, 1e4),
            "speed_mps": speed,
        },
        {"radius_y_m": floats(1, 1e4), "clockwise": st.booleans()},
    ),
    table(
        {"kind": st.just("drift"), "start_m": point, "wander_m": floats(0, 100)}, {"velocity_mps": st.just([0.5, -1.0])}
    ),
    table({"kind": st.just("station"), "position_m": point}),
)
sensors = table(
    {"heading": table({"sigma_deg": floats(0.01, 90)}), "modem": table({"range_sigma_m": positive})},
    {
        "dvl": table(
            {"along_sigma_mps": floats(1e-6, 1), "cross_sigma_mps": floats(1e-6, 1)}, {"rate_hz": floats(0.1, 5)}
        ),
        "gps": table({"sigma_m": positive}, {"outages": st.just([{"start_s": 1, "end_s": 2.5}])}),
    },
)
losses = st.one_of(
    floats(0, 1),
    table({"kind": st.just("fixed"), "rate": floats(0, 1)}),
    table({"kind": st.just("range"), "half_range_m": positive, "width_m": positive}),
    table({"kind": st.just("snr")}, {"spreading": floats(0, 40)}),
    table({"kind": st.just("bursty"), "mean_good_s": positive, "mean_bad_s": positive}),
    table(
        {
            "kind": st.just("recorded"),
            "links": st.lists(
                table({"sender": st.just("a"), "receiver": st.just("b"), "heard": st.lists(st.booleans(), max_size=5)}),
                max_size=2,
            ),
        }
    ),
)
claims = table(
    {
        "text": text,
        "metric": text,
        "algorithm": text,
        "operator": st.sampled_from(["<", "<=", ">", ">=", "=="]),
        "bound": st.one_of(st.booleans(), st.integers(-(2**53), 2**53), floats(-1e9, 1e9), text),
    },
    {"subject": text},
)


def vehicle(name: str):
    return table(
        {
            "name": st.just(name),
            "kind": st.just("auv"),
            "path": paths,
            "sensors": sensors,
            "initial": table({"position_sigma_m": positive}),
        },
        {"depth_m": floats(0, 1000), "surfacings": st.just([{"start_s": 10, "end_s": 20}])},
    )


scenarios = table(
    {
        "schema": st.just(1),
        "title": title,
        "family": st.just("navigation"),
        "duration_s": floats(10, 10_000),
        "vehicles": st.tuples(vehicle("a"), vehicle("b")).map(list),
        "network": table(
            {"loss": losses},
            {
                "links": st.sampled_from(["all", [], [["a", "b"]], [["a", "b"], ["b", "a"]]]),
                "gate_sigma": floats(0.1, 1000),
                "tdma": st.just(
                    {"cycle_s": 60, "slots": [{"vehicle": "a", "at_s": 0}, {"vehicle": "b", "at_s": 12.5}]}
                ),
            },
        ),
    },
    {
        "summary": text,
        "seed": st.integers(0, 2**63 - 1),
        "trials": st.integers(1, 100_000),
        "algorithms": st.lists(text, max_size=3),
        "options": st.dictionaries(text, st.dictionaries(text, st.one_of(st.integers(-9, 9), text, st.booleans()))),
        "claims": st.lists(claims, max_size=3),
    },
)


@given(scenarios)
def test_writing_and_reading_a_scenario_gives_the_same_scenario(data):
    scenario = toml.validate(data)
    again = toml.loads(toml.dumps(scenario))
    assert again == scenario
    assert again.model_dump() == scenario.model_dump()


@pytest.mark.parametrize("name", library.names())
def test_a_shipped_scenario_survives_the_way_through_toml(name):
    scenario = library.find(name)
    assert toml.loads(toml.dumps(scenario)) == scenario


def test_the_origin_is_remembered_and_never_written():
    scenario = toml.loads(toml.dumps(library.find("first-look")), origin="/some/where")
    assert scenario.origin == "/some/where"
    assert "origin" not in toml.dumps(scenario) and "origin" not in scenario.model_dump(mode="json")


def test_an_origin_in_the_file_is_an_unknown_key():
    with pytest.raises(ScenarioError, match="origin: is not a key"):
        toml.loads('origin = "/etc"\n' + toml.dumps(library.find("first-look")))


def test_overrides_reach_into_lists_by_number_and_by_name():
    scenario = library.find("walls2011-topology-c")
    changed = toml.override(
        scenario,
        {
            "network.loss": "0.4",
            "vehicles.iver31.sensors.modem.range_sigma_m": "2",
            "vehicles[0].depth_m": 5.5,
            "network.tdma.slots.0.at_s": "1.5",
            "title": "bare words",
            "algorithms": '["cekf"]',
        },
    )
    assert changed.network.loss == 0.4
    assert changed.vehicles[1].sensors.modem.range_sigma_m == 2.0
    assert changed.vehicles[0].depth_m == 5.5
    assert changed.network.tdma.slots[0].at_s == 1.5
    assert (changed.title, changed.algorithms) == ("bare words", ["cekf"])
    assert (
        toml.override(
            changed, {"network.loss": "{ kind = 'range', half_range_m = 9, width_m = 1 }"}
        ).network.loss.width_m
        == 1
    )


@pytest.mark.parametrize(
    ("path", "value", "key"),
    [
        ("network.losss", "0.4", "network.losss"),
        ("vehicles.iver99.depth_m", "4", "vehicles.iver99.depth_m"),
        ("vehicles[17].depth_m", "4", "vehicles[17].depth_m"),
        ("network.loss.rate", "0.4", "network.loss.rate"),
        ("", "1", ""),
        ("network.loss", "high", "network.loss"),
        ("duration_s", "inf", "duration_s"),
    ],
)
def test_an_override_that_fits_nowhere_says_so(path, value, key):
    with pytest.raises(ScenarioError) as error:
        toml.override(library.find("walls2011-topology-c"), {path: value})
    assert error.value.problems[0].key == key


@given(st.text(max_size=200))
def test_no_text_is_read_with_anything_but_a_scenario_error(text):
    with pytest.raises(ScenarioError):
        toml.loads(text)


@pytest.mark.parametrize(
    "text",
    [
        'x = {{k = """a"""", {key} = 1, c = "q"}}',
        "x = {{k = '''a''''', {key} = 1, c = 'q'}}",
        'x = """"""""\n{key} = 1',
        'x = "a\\"b"\n{key} = 1',
        "# it's\n{key} = 1 # '",
    ],
)
def test_a_key_of_too_many_parts_hides_behind_no_string(text):
    """The time to read such a key grows with the cube of its parts."""
    with pytest.raises(ScenarioError, match="parts"):
        toml.loads(text.format(key=".".join("k" * (toml.MAX_PARTS + 1))))


@pytest.mark.parametrize("text", ['x = "{key}"', 'x = """\n{key}\n"""', "x = '''{key}'''", "x = 1 # {key}"])
def test_in_a_string_or_a_comment_it_is_no_key(text):
    with pytest.raises(ScenarioError) as error:
        toml.loads(text.format(key=".".join("k" * (toml.MAX_PARTS + 1))))
    assert "parts" not in str(error.value)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
KEYS = ["title", "vehicles", "network", "mission", "claims", "trials", "network.loss", "network.links", "options"]


@given(st.sampled_from([*KEYS, "vehicles.scout", "vehicles.scout.path", "vehicles.scout.sensors"]), json_values)
def test_no_value_anywhere_raises_anything_but_a_scenario_error(key, value):
    scenario = library.find("first-look")
    try:
        changed = toml.override(scenario, {key: value})
    except ScenarioError as error:
        assert str(error)
    else:
        assert toml.loads(toml.dumps(changed)) == changed


def test_numbers_that_are_none_are_refused_wherever_they_stand():
    text = toml.dumps(library.find("first-look"))
    for number in ("nan", "inf", "-inf"):
        for line in ("loss = 0.2", "duration_s = 1200.0", "along_sigma_mps = 0.4"):
            key = line.split()[0]
            with pytest.raises(ScenarioError, match=key):
                toml.loads(text.replace(line, f"{key} = {number}"))
    with pytest.raises(ScenarioError, match="options"):
        toml.loads(text.replace("[network]", "[options.cekf]\nx = [1, nan]\n[network]"))


def test_defaults_are_left_out_and_floats_kept_to_the_last_digit():
    scenario = toml.override(library.find("first-look"), {"network.loss": math.nextafter(0.1, 1)})
    data = tomllib.loads(toml.dumps(scenario))
    assert data["network"]["loss"] == math.nextafter(0.1, 1)
    assert "gate_sigma" not in data["network"]
