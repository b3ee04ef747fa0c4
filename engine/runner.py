"""Scenario x algorithms x trials -> result: shards that any executor can run, and their assembly.

A shard is one algorithm over one block of trials. Blocks are cut the same way whatever the number of workers,
and every trial has its own random streams, so results do not depend on who computed what.
"""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import queue
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from pydantic import ValidationError

from engine import registry
from engine.evaluation.result import Result, assemble
from engine.registry import Progress, silent
from engine.scenario import toml
from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.models import ScenarioBase
from engine.tracks import Reference, Tracks, stack, stack_references

#: Trials computed together: enough to make array arithmetic pay, few enough to stream and cancel promptly.
BLOCK = 50
#: The first block is small, so that a watcher sees the first estimates soon.
FIRST = 5
#: A run that keeps the tracks of more trials fills the memory; of more, statistics alone are kept.
MOST_WHOLE = 100_000


@dataclass(frozen=True)
class Shard:
    """One algorithm over the trial numbers of one block."""

    algorithm: str
    trials: tuple[int, ...]


def blocks(trials: int, size: int = BLOCK, first: int = FIRST) -> list[tuple[int, ...]]:
    """Trial numbers 0..trials-1 in consecutive blocks that end at multiples of size, the first of them cut in two."""
    ends = sorted({min(first, size, trials), *range(size, trials, size), trials})
    return [tuple(range(a, b)) for a, b in itertools.pairwise([0, *ends])]


def chosen(scenario: ScenarioBase, algorithms: Sequence[str] | None = None) -> list[str]:
    """The algorithms to run, in order and once each: those asked for, else the scenario's own.

    Raises ScenarioError for an unknown one, or one of a family that this mission does not accept.
    """
    names = list(dict.fromkeys(algorithms if algorithms is not None else scenario.algorithms))
    known, family = registry.algorithms(), registry.families()[scenario.family]
    problems = []
    for n, name in enumerate(names):
        if name not in known:
            fitting = sorted(a.name for a in known.values() if a.family in (family.name, *family.accepts))
            problems.append(
                Problem(
                    f"algorithms[{n}]",
                    f"there is no algorithm named {name!r}",
                    f"choose from: {', '.join(fitting)}",
                )
            )
        elif known[name].family not in (family.name, *family.accepts):
            problems.append(
                Problem(
                    f"algorithms[{n}]",
                    f"{name!r} estimates {known[name].family} missions, this one is {family.name}",
                    "leave it out",
                )
            )
    if not names:
        problems.append(Problem("algorithms", "no algorithm to run", "name at least one"))
    problems += _faulty_options(scenario)
    if problems:
        raise ScenarioError(problems)
    return names


def claimed(scenario: ScenarioBase) -> list[str]:
    """The algorithms that checking the scenario's claims takes: its own, and those its claims are about."""
    about = [a for c in scenario.claims for a in (c.algorithm, c.than.algorithm if c.than else None) if a]
    return list(dict.fromkeys([*scenario.algorithms, *about]))


def _faulty_options(scenario: ScenarioBase) -> list[Problem]:
    """What is wrong under [options.NAME]."""
    problems = []
    for name, values in scenario.options.items():
        algorithm = registry.algorithms().get(name)
        if algorithm is None or algorithm.options is None:
            having = ", ".join(a.name for a in registry.algorithms().values() if a.options is not None)
            problems.append(Problem(f"options.{name}", "is no algorithm with options", f"those with options: {having}"))
            continue
        try:
            algorithm.options(**values)
        except ValidationError as error:
            known = ", ".join(algorithm.options.model_fields)
            for fault in error.errors(include_input=False, include_url=False):
                key = ".".join(["options", name, *map(str, fault["loc"])])
                problems.append(Problem(key, fault["msg"], f"the options of {name} are: {known}"))
    return problems


def shards(scenario: ScenarioBase, algorithms: Sequence[str] | None = None) -> list[Shard]:
    """All shards of a run, block by block, so that the first trials of every algorithm come first."""
    names = chosen(scenario, algorithms)
    return [Shard(name, block) for block in blocks(scenario.trials) for name in names]


def prepare(scenario: ScenarioBase, trials: tuple[int, ...]) -> Any:
    """The mission of one block of trials, remembered per process since several algorithms want the same."""
    return _prepare(toml.dumps(scenario), scenario.origin, trials)


@lru_cache(maxsize=2)
def _prepare(text: str, origin: str, trials: tuple[int, ...]) -> Any:
    scenario = toml.loads(text, origin=origin)
    return registry.families()[scenario.family].fly(scenario, trials)


def run_shard(scenario: ScenarioBase, shard: Shard, progress: Progress = silent) -> tuple[Reference, Tracks]:
    """Run one shard here and now: its algorithm's answer, and the truth of its trials."""
    mission = prepare(scenario, shard.trials)
    tracks = registry.algorithm(shard.algorithm).run(mission, progress)
    return Reference(mission.time_s, mission.truth), tracks


def gather(
    scenario: ScenarioBase,
    parts: Sequence[tuple[Shard, Reference, Tracks]],
    names: Sequence[str],
    lost: Sequence[dict[str, Any]] = (),
) -> Result:
    """The result of finished shards in any order; every algorithm must have the same blocks.

    lost tells of shards that were given up; the result is of the trials there are.
    """
    by_algorithm: dict[str, dict[int, Tracks]] = {name: {} for name in names}
    references: dict[int, tuple[Reference, int]] = {}
    for shard, reference, tracks in parts:
        by_algorithm[shard.algorithm][shard.trials[0]] = tracks
        references[shard.trials[0]] = (reference, len(shard.trials))
    whole = {name: stack([done[k] for k in sorted(done)]) for name, done in by_algorithm.items() if done}
    result = assemble(scenario, stack_references([references[k] for k in sorted(references)]), whole)
    return replace(result, trials=sum(n for _, n in references.values()), lost=list(lost)) if lost else result


def run(
    scenario: ScenarioBase,
    algorithms: Sequence[str] | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda _fraction: None,
) -> Result:
    """Run a scenario on this machine's processes and put the result together.

    progress is told the fraction done. The result is the same for any number of workers (None: one per core).
    Raises ScenarioError for more trials than can be kept whole.
    """
    names = chosen(scenario, algorithms)
    if scenario.trials > MOST_WHOLE:
        found = f"the tracks of {scenario.trials} trials are too many to keep"
        raise ScenarioError([Problem("trials", found, f"ask for at most {MOST_WHOLE}, or keep statistics alone")])
    parts = blocks(scenario.trials)
    workers = min(workers or os.cpu_count() or 1, len(parts))
    told = [0.0] * len(parts)

    def tell(block: int, fraction: float) -> None:
        told[block] = fraction
        progress(sum(told) / len(parts))

    done: list[tuple[Shard, Reference, Tracks]] = []
    if workers == 1:
        for n, block in enumerate(parts):
            done += _run_block(scenario, names, block, lambda fraction, n=n: tell(n, fraction))
        return gather(scenario, done, names)

    with multiprocessing.Manager() as manager, ProcessPoolExecutor(workers) as pool:
        news = manager.Queue()
        futures = [pool.submit(_run_block_afar, scenario, names, block, n, news) for n, block in enumerate(parts)]
        for _ in iter(lambda: all(f.done() for f in futures), True):
            with contextlib.suppress(queue.Empty):
                tell(*news.get(timeout=0.05))
        for future in futures:
            done += future.result()
    return gather(scenario, done, names)


def _run_block(
    scenario: ScenarioBase, names: Sequence[str], block: tuple[int, ...], progress: Callable[[float], None]
) -> list[tuple[Shard, Reference, Tracks]]:
    done = []
    for n, name in enumerate(names):
        shard = Shard(name, block)
        done.append((shard, *run_shard(scenario, shard, lambda f, _, n=n: progress((n + f) / len(names)))))
    return done


def _run_block_afar(
    scenario: ScenarioBase, names: Sequence[str], block: tuple[int, ...], n: int, news: Any
) -> list[tuple[Shard, Reference, Tracks]]:
    return _run_block(scenario, names, block, lambda fraction: news.put((n, fraction)))
