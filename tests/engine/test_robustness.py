"""Estimators and readers on input of every sort: scenarios drawn over the schema, damaged files and packets."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, note, settings
from hypothesis import strategies as st

from engine import registry, runner
from engine.mission import csv_log, fly
from engine.navigation import packets
from engine.navigation.network import Packet
from engine.notes import Least, Note
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError
from engine.scenario.models import ScenarioBase
from server.wire import dumps
from tests.mutations import check_tracks, damaged, disturbed, scenarios, templates

#: The same examples every time, and without shrinking, which would take minutes: a failure shows the whole scenario.
#: `make soak` draws others, and many more.
QUICK = settings(
    deadline=None,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.explicit, Phase.generate],
    database=None,
    derandomize=True,
)
TRIALS = (0, 1)


def fitting(scenario: ScenarioBase) -> list[registry.Algorithm]:
    """The algorithms that run on a scenario's missions."""
    family = registry.families()[scenario.family]
    return [a for a in registry.algorithms().values() if a.family in (family.name, *family.accepts)]


def check_every_algorithm(scenario: ScenarioBase) -> None:
    """All algorithms end with finite, definite answers, the same ones when asked again, and a result that is JSON."""
    parts = []
    for algorithm in fitting(scenario):
        shard = runner.Shard(algorithm.name, TRIALS)
        try:
            reference, tracks = runner.run_shard(scenario, shard)
        except ValueError as error:
            assert "is limited to" in str(error), f"{algorithm.name}: {error}"
            continue
        check_tracks(algorithm.name, tracks)
        _, again = runner.run_shard(scenario, shard)
        for subject, belief in tracks.beliefs.items():
            np.testing.assert_array_equal(belief.mean, again.beliefs[subject].mean)
            np.testing.assert_array_equal(belief.cov, again.beliefs[subject].cov)
        parts.append((shard, reference, tracks))
    result = runner.gather(scenario, parts, [shard.algorithm for shard, _, _ in parts])
    json.loads(dumps(result.to_json()), parse_constant=lambda word: pytest.fail(f"{word} in JSON"))


@settings(QUICK, max_examples=10)  # each takes ten seconds and more
@given(scenarios())
def test_every_algorithm_bears_every_scenario(scenario: ScenarioBase):
    note(toml.dumps(scenario))
    check_every_algorithm(scenario)


def read(text: str) -> None:
    """A scenario's text is read, or refused in words; what is read can be written and read again."""
    try:
        scenario = toml.loads(text)
    except ScenarioError as error:
        assert str(error)
        return
    assert toml.loads(toml.dumps(scenario)) == scenario


WORDS = (
    b"\n[[vehicles]]\n",
    b"[network]\n",
    b"nan",
    b"inf",
    b"-1",
    b"1e999",
    b'"""',
    b"'",
    b"{",
    b"[",
    b"=",
    b".",
    b"\xff",
)


def texts() -> st.SearchStrategy[bytes]:
    """Shipped scenario files, damaged."""
    return st.sampled_from(library.names()).flatmap(lambda name: damaged(source(name), WORDS))


@settings(QUICK, max_examples=150)
@given(texts())
def test_a_damaged_scenario_file_is_read_or_refused_in_words(data: bytes):
    read(data.decode("utf-8", "replace"))


def source(name: str) -> bytes:
    """A shipped scenario's file."""
    return (library.folder() / f"{name}.toml").read_bytes()


@settings(QUICK, max_examples=150)
@given(st.sampled_from(templates()).flatmap(disturbed))
def test_disturbed_tables_are_a_scenario_or_refused_in_words(tables: dict):
    check_tables(tables)


def check_tables(tables: dict) -> None:
    """Tables are a scenario that can be written and read again, or refused in words."""
    try:
        scenario = toml.validate(tables)
    except ScenarioError as error:
        assert str(error)
        return
    assert toml.loads(toml.dumps(scenario)) == scenario


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a short mission's log as CSV files, and the scenario that reads them."""
    folder = tmp_path_factory.mktemp("recorded")
    scenario = toml.override(library.shipped("first-look"), {"duration_s": 120, "trials": 1})
    csv_log.write(fly(scenario, [0]), scenario, folder)
    yield folder


CELLS = (b",", b"\n", b'"', b"nan", b"inf", b"-1", b"1e308", b"1e999", b"abc", b"\xff", b"\x00", b",,,,")


def check_damaged_log(folder: Path, file: str, data: bytes) -> None:
    """A log with one file changed: the mission is refused in words, or every algorithm ends well on it."""
    with tempfile.TemporaryDirectory() as place:
        copy = Path(place) / "log"
        shutil.copytree(folder, copy)
        (copy / file).write_bytes(data)
        try:
            scenario = toml.load(copy)
            for name in ("dead_reckoning", "cekf", "mdeif", "k_last"):
                check_tracks(name, runner.run_shard(scenario, runner.Shard(name, (0,)))[1])
        except ScenarioError as error:
            assert str(error)


@settings(QUICK, max_examples=40)
@given(st.data())
def test_a_damaged_log_is_refused_in_words_or_borne(recorded: Path, data: st.DataObject):
    file = data.draw(st.sampled_from(sorted(p.name for p in recorded.iterdir())))
    check_damaged_log(recorded, file, data.draw(damaged((recorded / file).read_bytes(), CELLS)))


def check_damaged_packets(name: str, seed: int, rate: float, honest_checksum: bool) -> int:
    """Run an algorithm while some of its packets are changed on their way; how many were."""
    rng, launch, changed = np.random.default_rng(seed), Packet.__init__, 0

    def tampered(packet: Packet, data: np.ndarray, floats: int) -> None:
        nonlocal changed
        data = data.copy()
        for trial in np.flatnonzero(rng.random(len(data)) < rate):
            changed += 1
            data[trial, rng.integers(data.shape[1], size=rng.integers(1, 5))] = rng.integers(256)
            if honest_checksum:
                data[trial, -2:] = packets.crc16(data[trial : trial + 1, :-2]).view(np.uint8)
        launch(packet, data, floats)

    scenario = toml.override(library.shipped("first-look"), {"duration_s": 300, "trials": 2, "network.loss": 0.0})
    with mock.patch.object(Packet, "__init__", tampered):
        tracks = runner.run_shard(scenario, runner.Shard(name, TRIALS))[1]
    check_tracks(name, tracks)
    firsts = [f for note in tracks.notes if isinstance(note, Note) for f in note.figures if isinstance(f, Least)]
    assert all(first_s > 0 for first_s in firsts), "a packet takes time"
    return changed


SENDING = ["nekf", "interleaved_update", "deif", "mdeif", "k_last", "k_best", "paull"]


@pytest.mark.parametrize("honest_checksum", [False, True], ids=["noise", "with its checksum made right"])
@pytest.mark.parametrize("name", SENDING)
def test_packets_changed_on_their_way_leave_beliefs_finite_and_definite(name: str, honest_checksum: bool):
    assert sum(check_damaged_packets(name, seed, 0.3, honest_checksum) for seed in range(4)) > 10
