"""A run of which only statistics are kept: any number of trials in bounded memory.

Trials go in batches, each of them through all algorithms, and every batch leaves a summary that adds up. Batches are
cut the same way whatever the number of workers, and are added in order, so results do not depend on who computed what.
"""

from __future__ import annotations

import itertools
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

from engine import registry, runner
from engine.evaluation.claims import check
from engine.evaluation.result import SCHEMA, capacity, packet_figures
from engine.evaluation.summary import Summary
from engine.notes import Note, join
from engine.registry import Progress, silent
from engine.scenario.models import ScenarioBase
from engine.tracks import PacketCount, Reference, Tracks

#: Trials of a batch: enough that its answer costs little beside it, few enough to lose little with a worker.
BATCH = 500
#: The first trials are also kept whole, to be looked at.
SHOWN = runner.FIRST
#: Batches at work or waiting to be added, for every process.
AHEAD = 3


@dataclass(frozen=True)
class Batch:
    """All algorithms over consecutive trials."""

    algorithms: tuple[str, ...]
    trials: range

    @property
    def algorithm(self) -> str:
        """Their names."""
        return ", ".join(self.algorithms)


@dataclass(frozen=True)
class Total:
    """What an algorithm left over a number of trials, by subject; what was noted is told once."""

    summaries: dict[str, Summary]
    packets: PacketCount
    notes: tuple[Note, ...]
    cpu_s: float

    def __add__(self, other: Total) -> Total:
        return Total(
            {subject: summary + other.summaries[subject] for subject, summary in self.summaries.items()},
            self.packets + other.packets,
            join(self.notes + other.notes),
            self.cpu_s + other.cpu_s,
        )


#: By algorithm.
Totals = dict[str, Total]


def batches(scenario: ScenarioBase, names: Sequence[str], size: int = BATCH) -> list[Batch]:
    """The trials after those that are kept whole, in batches that end at multiples of size."""
    ends = [min(SHOWN, scenario.trials), *range(size, scenario.trials, size), scenario.trials]
    return [Batch(tuple(names), range(a, b)) for a, b in itertools.pairwise(ends) if b > a]


def shown(scenario: ScenarioBase) -> ScenarioBase:
    """The scenario with the trials alone that are kept whole."""
    return scenario.model_copy(update={"trials": min(SHOWN, scenario.trials)})


def run_batch(scenario: ScenarioBase, batch: Batch, progress: Progress = silent) -> Totals:
    """Run a batch here and now, a block of trials at a time."""
    blocks = [tuple(batch.trials[n : n + runner.BLOCK]) for n in range(0, len(batch.trials), runner.BLOCK)]
    steps = len(blocks) * len(batch.algorithms)
    totals: Totals = {}
    for n, block in enumerate(blocks):
        answers = {}
        for k, name in enumerate(batch.algorithms):
            done = n * len(batch.algorithms) + k
            tell = lambda fraction, _partial=None, done=done: progress((done + fraction) / steps, None)  # noqa: E731
            reference, answers[name] = runner.run_shard(scenario, runner.Shard(name, block), tell)
        totals = merged([totals, of_tracks(reference, answers)]) if totals else of_tracks(reference, answers)
    return totals


def of_tracks(reference: Reference, answers: dict[str, Tracks]) -> Totals:
    """What whole tracks of the same trials leave; the benchmark is the first algorithm that is centralized."""
    known = registry.algorithms()
    best = next((answers[name].beliefs for name in answers if name in known and known[name].centralized), {})
    return {
        name: Total(
            {s: Summary.of(reference.truth.get(s), belief, best.get(s)) for s, belief in tracks.beliefs.items()},
            tracks.packets,
            join(tracks.notes),
            tracks.cpu_s,
        )
        for name, tracks in answers.items()
    }


def merged(parts: Iterable[Totals]) -> Totals:
    """The sum of totals, in the order they come."""
    total: Totals = {}
    for part in parts:
        total = {name: total[name] + new for name, new in part.items()} if total else part
    return total


def told(scenario: ScenarioBase, time_s: Any, totals: Totals, lost: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """The contents of result.json: the figures that follow from totals, and curves over the report times."""
    trials = max((s.trials for total in totals.values() for s in total.summaries.values()), default=scenario.trials)
    algorithms = {
        name: {
            "subjects": {subject: summary.metrics() for subject, summary in total.summaries.items()},
            "packets": packet_figures(total.packets, capacity(scenario)),
            "cpu_s": total.cpu_s,
            "notes": [str(note) for note in total.notes],
        }
        for name, total in totals.items()
    }
    kept = {metric for answer in algorithms.values() for metrics in answer["subjects"].values() for metric in metrics}
    judged = [c for c in scenario.claims if c.metric.partition(".")[0] in kept | {"packets"}]
    result = {
        "schema": SCHEMA,
        "scenario": scenario.model_dump(mode="json", by_alias=True, exclude_none=True),
        "seed": scenario.seed,
        "trials": trials,
        "algorithms": algorithms,
        "claims": check(judged, {"algorithms": algorithms}),
        "statistics": {
            "shown_trials": min(SHOWN, trials),
            "time_s": [float(t) for t in time_s],
            "curves": {
                name: {subject: summary.curves() for subject, summary in total.summaries.items()}
                for name, total in totals.items()
            },
        },
    }
    return result | {"lost": list(lost)} if lost else result


def run(
    scenario: ScenarioBase,
    algorithms: Sequence[str] | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda _fraction: None,
) -> dict[str, Any]:
    """Run a scenario on this machine's processes and keep its statistics: the contents of result.json.

    progress is told the fraction done. The result is the same for any number of workers (None: one per core).
    """
    names = runner.chosen(scenario, algorithms)
    whole = runner.Shard(names[0], tuple(range(min(SHOWN, scenario.trials))))
    answers = {}
    for name in names:
        reference, answers[name] = runner.run_shard(scenario, runner.Shard(name, whole.trials))
    parts = batches(scenario, names)

    def counted() -> Iterator[Totals]:
        yield of_tracks(reference, answers)
        for n, totals in enumerate(_computed(scenario, parts, workers or os.cpu_count() or 1)):
            progress((n + 1) / len(parts))
            yield totals

    return told(scenario, reference.time_s, merged(counted()))


def _computed(scenario: ScenarioBase, parts: Sequence[Batch], workers: int) -> Iterator[Totals]:
    """The batches' totals in order, with few of them at work or waiting at any time."""
    if workers == 1 or len(parts) < 2:
        yield from (run_batch(scenario, batch) for batch in parts)
        return
    with ProcessPoolExecutor(workers) as pool:
        left, running = iter(parts), deque()
        while True:
            for batch in itertools.islice(left, AHEAD * workers - len(running)):
                running.append(pool.submit(run_batch, scenario, batch))
            if not running:
                return
            yield running.popleft().result()
