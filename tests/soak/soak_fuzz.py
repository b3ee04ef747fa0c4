"""Many requests, scenarios, files and packets of every sort, drawn anew each time."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from hypothesis import given, settings

from engine import runner
from engine.mission import csv_log, fly
from engine.scenario import library, toml
from engine.scenario.models import ScenarioBase
from tests.engine import test_robustness as robustness
from tests.mutations import damaged, disturbed, scenarios, templates
from tests.server.test_openapi import ask_all, operations
from tests.soak.rig import rig
from tests.soak.sizes import size


def drawn(share: float, most: int) -> Any:
    """Hypothesis settings for a share of so many examples, others every time."""
    return settings(robustness.QUICK, derandomize=False, max_examples=max(int(share * most), 1))


@pytest.fixture
def clock(told: Callable[..., None]) -> Iterator[None]:
    """Tells how long a proof took."""
    start = time.monotonic()
    yield
    told(seconds=round(time.monotonic() - start))


def test_no_request_makes_the_server_fail_or_grow(tmp_path: Path, told: Callable[..., None], clock: None):
    with rig(tmp_path / "data", "--keep-gb", "0.01", workers=1) as it:
        each = max(size("requests") // len(operations(it.live)) // 5, 1)
        server = psutil.Process(it.server.process.pid)
        answers: Counter[int] = Counter()
        memory_mb = []
        while answers.total() < size("requests"):  # of some operations there are few different requests
            answers += ask_all(it.live, each, derandomize=False)
            memory_mb.append(round(server.memory_info().rss / 1e6, 1))
    told(requests=answers.total(), answers=dict(sorted(answers.items())), memory_mb=memory_mb)
    assert not [status for status in answers if status >= 500]


def test_every_algorithm_bears_a_thousand_scenarios(told: Callable[..., None], clock: None):
    tried = 0

    @drawn(1.0, size("scenarios"))
    @given(scenarios())
    def bears(scenario: ScenarioBase) -> None:
        nonlocal tried
        tried += 1
        robustness.check_every_algorithm(scenario)

    bears()
    told(scenarios=tried)


def test_one_two_and_four_processes_give_the_same_bits(told: Callable[..., None], clock: None):
    """Random scenarios of enough trials for four blocks."""
    compared = 0

    @drawn(0.01, size("scenarios"))
    @given(scenarios())
    def same(scenario: ScenarioBase) -> None:
        nonlocal compared
        scenario = scenario.model_copy(update={"trials": 160})
        names = [a.name for a in robustness.fitting(scenario) if a.family == scenario.family][:4]
        try:
            results = [runner.run(scenario, names, workers=workers).arrays() for workers in (1, 2, 4)]
        except ValueError as error:
            assert "is limited to" in str(error)
            return
        for other in results[1:]:
            assert set(other) == set(results[0])
            for key, value in results[0].items():
                assert np.asarray(value).tobytes() == np.asarray(other[key]).tobytes(), key
        compared += 1

    same()
    told(scenarios=compared)


def test_damaged_scenarios_logs_and_packets_do_no_harm(tmp_path: Path, told: Callable[..., None], clock: None):
    most = size("files")
    done = {"texts": 0, "tables": 0, "logs": 0, "packets": 0}

    @drawn(0.45, most)
    @given(robustness.texts())
    def texts(data: bytes) -> None:
        done["texts"] += 1
        robustness.read(data.decode("utf-8", "replace"))

    @drawn(0.45, most)
    @given(robustness.st.sampled_from(templates()).flatmap(disturbed))
    def tables(changed: dict) -> None:
        done["tables"] += 1
        robustness.check_tables(changed)

    folder = tmp_path / "recorded"
    scenario = toml.override(library.shipped("first-look"), {"duration_s": 120, "trials": 1})
    csv_log.write(fly(scenario, [0]), scenario, folder)
    files = sorted(path.name for path in folder.iterdir())

    @drawn(0.06, most)
    @given(robustness.st.data())
    def logs(data: Any) -> None:
        done["logs"] += 1
        file = data.draw(robustness.st.sampled_from(files))
        changed = data.draw(damaged((folder / file).read_bytes(), robustness.CELLS))
        robustness.check_damaged_log(folder, file, changed)

    for proof in (texts, tables, logs):
        proof()
    seed = 0
    while done["packets"] < 0.04 * most:
        for name in robustness.SENDING:
            for honest in (False, True):
                done["packets"] += robustness.check_damaged_packets(name, seed, 0.3, honest)
        seed += 1
    told(**done)
