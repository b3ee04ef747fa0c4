"""The same scenario over a range of one of its keys: accuracy, consistency and bandwidth against, say, packet loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from engine import runner
from engine.scenario import toml
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.models import ScenarioBase

T = TypeVar("T")

MOST_POINTS = 200


@dataclass(frozen=True)
class Sweep:
    """A key path of the scenario and the values it takes in turn."""

    key: str
    values: tuple[float, ...]


def parse(text: str) -> Sweep:
    """KEY=START:STOP:STEP (both ends included) or KEY=A,B,C; ScenarioError where it is neither."""
    key, equals, spec = (part.strip() for part in text.partition("="))
    try:
        if ":" in spec:
            start, stop, step = (float(part) for part in spec.split(":"))
            if not (step > 0 and stop >= start and np.isfinite([start, stop, step]).all()):
                raise ValueError
            count = int(np.floor((stop - start) / step + 1e-9)) + 1
            values = tuple(round(start + k * step, 12) for k in range(min(count, MOST_POINTS + 1)))
        else:
            values = tuple(float(part) for part in spec.split(","))
    except ValueError:
        values = ()
    if not equals or not key or not values or len(values) > MOST_POINTS or not np.isfinite(values).all():
        remedy = f"write KEY=START:STOP:STEP or KEY=A,B,C with at most {MOST_POINTS} values, as network.loss=0:0.9:0.1"
        raise ScenarioError([Problem("sweep", f"cannot read {text!r}", remedy)])
    return Sweep(key, values)


def points(scenario: ScenarioBase, sweep: Sweep) -> list[ScenarioBase]:
    """The scenario at every value; ScenarioError, before anything runs, where one of them is not allowed."""
    return [toml.override(scenario, {sweep.key: value}) for value in sweep.values]


def run(
    scenario: ScenarioBase,
    sweep: Sweep,
    algorithms: Sequence[str] | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda _fraction: None,
    how: Callable[..., T] = runner.run,
) -> Iterator[tuple[float, T]]:
    """Each value with its result, in order, as it is finished; `how` is what runs one, or keeps its statistics."""
    at = points(scenario, sweep)
    for n, (value, point) in enumerate(zip(sweep.values, at)):
        told = lambda fraction, n=n: progress((n + fraction) / len(at))  # noqa: E731
        yield value, how(point, algorithms, workers=workers, progress=told)


def summary(key: str, results: Sequence[tuple[float, dict[str, Any]]]) -> dict[str, Any]:
    """Curves against the swept key from result.json contents: {algorithm: {subject: {metric: [..]}, "packets": ..}}."""
    figures = ("rmse_m", "sigma_m", "final_sigma_m", "anees", "anees_interval", "verdict")
    algorithms: dict[str, Any] = {}
    for name in results[0][1]["algorithms"] if results else ():
        answers = [result["algorithms"][name] for _, result in results]
        algorithms[name] = {
            "subjects": {
                s: {figure: [a["subjects"][s][figure] for a in answers] for figure in figures}
                for s in answers[0]["subjects"]
            },
            "packets": {k: [a["packets"][k] for a in answers] for k in ("bytes_per_packet", "bits_per_second")},
        }
    return {"schema": 1, "key": key, "values": [value for value, _ in results], "algorithms": algorithms}
