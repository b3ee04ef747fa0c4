"""What the commands of the command line do; each returns the exit code."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from engine import registry, runner, statistics, sweep
from engine.evaluation import comparison
from engine.evaluation.result import Result
from engine.scenario import library, toml
from engine.scenario.models import ScenarioBase
from engine.scenario.navigation import NavigationScenario
from server import table

if TYPE_CHECKING:
    from server.settings import Settings


class Usage(Exception):
    """Input that cannot be used, in words for the person at the keyboard."""


def serve(chosen: Namespace) -> int:
    """Serve the dashboard until told to stop."""
    from server import serving

    try:
        settings = _settings(
            chosen,
            token=serving.given_token(),
            keep_days=chosen.keep_days,
            keep_bytes=int(chosen.keep_gb * 1e9) if chosen.keep_gb else None,
        )
        serving.serve(settings, chosen.log_format, chosen.log_level)
    except serving.CannotServe as error:
        raise Usage(str(error)) from None
    return 0


def doctor(chosen: Namespace) -> int:
    """Check what the dashboard needs, a line each; 1 where something keeps it from working."""
    from server.doctor import findings

    failing = 0
    for finding in findings(_settings(chosen)):
        failing += finding.mark == "FAIL"
        print(f"{finding.mark:4}  {finding.what}: {finding.found}", flush=True)
    print("something is missing" if failing else "all is well", file=sys.stderr)
    return 1 if failing else 0


def _settings(chosen: Namespace, **others: Any) -> Settings:
    from server.settings import Settings, default_data

    tls = {name: getattr(chosen, name) for name in ("cluster_ca", "cluster_cert", "cluster_key")}
    given = [path for path in tls.values() if path is not None]
    if given and (len(given) < len(tls) or chosen.cluster is None):
        raise Usage("--cluster-ca, --cluster-cert and --cluster-key go together, with a --cluster at tls://…")
    for path in given:
        if not path.is_file():
            raise Usage(f"{path} is not there")
    if chosen.workers is not None:
        others["workers"] = chosen.workers
    data = chosen.data or default_data()
    return Settings(data=data, host=chosen.host, port=chosen.port, cluster=chosen.cluster, **tls, **others)


def run(chosen: Namespace) -> int:
    """Run a scenario, print the comparison, write the result directory where one is named."""
    scenario = _wanted(chosen)
    runner.chosen(scenario, chosen.algorithms)
    if chosen.out is not None and chosen.out.exists() and not chosen.out.is_dir():
        raise Usage(f"--out {chosen.out} is a file; name a folder")
    if chosen.sweep is not None:
        return _sweep(scenario, chosen)
    told, write = _outcome(scenario, chosen)
    print(f"{scenario.title} ({told['trials']} trial{'s' * (told['trials'] != 1)}, seed {told['seed']})")
    print("\n".join(table.lines(*table.figures(told))))
    for name, answer in told["algorithms"].items():
        for note in answer["notes"]:
            print(f"note: {name}: {note}")
    for claim in told["claims"]:
        print(_claim(claim))
    if chosen.out is not None:
        write(chosen.out)
        print(f"written to {chosen.out}", file=sys.stderr)
    return 0


def check(chosen: Namespace) -> int:
    """Run scenarios for their claims; 1 where one fails."""
    if chosen.table_1:
        return _table_1(chosen.workers)
    if chosen.all == bool(chosen.scenarios):
        raise Usage("name the scenarios to check, or give --all or --table-1")
    names: Sequence[str] = library.names() if chosen.all else chosen.scenarios
    scenarios = {name: _find(name) for name in names}
    failed = 0
    for name, scenario in scenarios.items():
        missing = library.missing(scenario)
        if missing is not None and chosen.all:
            print(f"{name}: left out, {missing}")
            continue
        if not scenario.claims:
            print(f"{name}: makes no claims")
            continue
        print(f"{name}: {scenario.title}")
        for claim in _run(scenario, runner.claimed(scenario), chosen.workers).claims:
            print(f"  {_claim(claim)}")
            failed += claim["holds"] is False
    print(f"{failed} claim{'s' * (failed != 1)} failed" if failed else "no claim failed")
    return 1 if failed else 0


def _table_1(workers: int | None) -> int:
    """Measure W11's Table I with 100 trials a run and print it; 1 where a cell differs from the paper's."""

    def run(name: str, loss: float) -> dict[str, Any]:
        scenario = toml.override(library.find(name), {"trials": 100, "network.loss": loss})
        print(f"{name}, loss {loss:g}", file=sys.stderr)
        return _run(scenario, comparison.ALGORITHMS, workers).to_json()

    lossless = {name: run(name, 0.0) for name in comparison.TOPOLOGIES}
    rows = comparison.table_1(lossless, run(comparison.LOSSY, comparison.LOSS))
    ticks = {True: "yes", False: "no", None: "-"}
    header = ["algorithm", *(c.replace("_", " ") for c in comparison.COLUMNS), "floats", "bytes"]
    figures = [
        [
            row["algorithm"],
            *(ticks[row[c]["holds"]] for c in comparison.COLUMNS),
            table.number(row["floats_per_packet"]),
            table.number(row["bytes_per_packet"]),
        ]
        for row in rows
    ]
    print("\n".join(table.lines(header, figures, left=1)))
    differing = 0
    for row in rows:
        for column in comparison.COLUMNS:
            cell = row[column]
            differs = cell["paper"] is not None and cell["paper"] != cell["holds"]
            differing += differs
            against = f" (the paper says {ticks[cell['paper']]})" if differs else ""
            print(f"{row['algorithm']}, {column.replace('_', ' ')}: {ticks[cell['holds']]}{against}: {cell['why']}")
    return 1 if differing else 0


def log(chosen: Namespace) -> int:
    """Write the log of a mission's first trial as CSV files with a scenario that reads them."""
    from engine.mission import csv_log, fly

    scenario = _wanted(chosen)
    if not isinstance(scenario, NavigationScenario):
        raise Usage(f"{chosen.scenario} is a {scenario.family} mission; only navigation missions have logs")
    if chosen.out.exists() and not chosen.out.is_dir():
        raise Usage(f"--out {chosen.out} is a file; name a folder")
    csv_log.write(fly(scenario, [0]), scenario, chosen.out)
    print(f"written to {chosen.out}; run it with: coopnav run {chosen.out}")
    return 0


def listing(chosen: Namespace) -> int:
    """List algorithms or scenarios."""
    entries = _algorithms() if chosen.what == "algorithms" else _scenarios()
    if chosen.json:
        print(json.dumps(entries, indent=1, ensure_ascii=False))
        return 0
    columns = ("name", "family", "title")
    print("\n".join(table.lines(columns, [[str(e[c]) for c in columns] for e in entries], left=3)))
    return 0


def report(chosen: Namespace) -> int:
    """Write the report of a result directory, or of a job by its id."""
    from server import artifacts
    from server.report import of_directory
    from server.settings import default_data

    folder = Path(chosen.source)
    if not folder.is_dir() and folder.name == chosen.source:
        folder = (chosen.data or default_data()) / "jobs" / chosen.source
    if not (folder / artifacts.RESULT).is_file():
        raise Usage(f"{chosen.source} is neither a finished job nor a folder with a {artifacts.RESULT}")
    try:
        page = of_directory(folder)
    except (ValueError, KeyError, TypeError) as error:
        raise Usage(f"{folder} does not hold a result as `coopnav run --out` writes it ({error})") from None
    artifacts.write_text(chosen.out, page)
    return 0


def _find(name: str) -> ScenarioBase:
    path = Path(name)
    if path.is_dir():
        path = path / "scenario.toml"
        if not path.is_file():
            raise Usage(f"there is no scenario.toml in {name}")
        return toml.load(path)
    return library.find(name)


def _wanted(chosen: Namespace) -> ScenarioBase:
    changes: dict[str, str] = {}
    for text in chosen.changes:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise Usage(f"--set {text}: write it as key=value, for example network.loss=0.4")
        changes[key.strip()] = value.strip()
    for key in ("trials", "seed"):
        if getattr(chosen, key) is not None:
            changes[key] = getattr(chosen, key)
    scenario = _find(chosen.scenario)
    return toml.override(scenario, changes) if changes else scenario


def _sweep(scenario: ScenarioBase, chosen: Namespace) -> int:
    """Run the scenario at every value of a key, print the curves as a table, write each result where asked."""
    from server import artifacts

    wanted = sweep.parse(chosen.sweep)
    results = []
    with _bar() as bar:
        for value, result in sweep.run(
            scenario,
            wanted,
            chosen.algorithms,
            workers=chosen.workers,
            progress=lambda f: _fill(bar, f),
            how=statistics.run if chosen.statistics else runner.run,
        ):
            told = result.to_json() if isinstance(result, Result) else result
            results.append((value, told))
            if chosen.out is not None:
                folder = chosen.out / f"{wanted.key}={value:g}"
                if isinstance(result, Result):
                    artifacts.write_result(folder, result)
                else:
                    artifacts.write_statistics(folder, result)
        _fill(bar, 1.0)
    print(f"{scenario.title}: {wanted.key} ({scenario.trials} trials each, seed {scenario.seed})")
    print("\n".join(table.lines(*table.curves(wanted.key, results), left=3)))
    if chosen.out is not None:
        curves = sweep.summary(wanted.key, results)
        artifacts.write_text(chosen.out / "sweep.json", json.dumps(curves, indent=1, allow_nan=False))
        print(f"written to {chosen.out}", file=sys.stderr)
    return 0


def _run(scenario: ScenarioBase, algorithms: Sequence[str] | None, workers: int | None) -> Result:
    with _bar() as bar:
        result = runner.run(scenario, algorithms, workers=workers, progress=lambda f: _fill(bar, f))
        _fill(bar, 1.0)
    return result


def _outcome(scenario: ScenarioBase, chosen: Namespace) -> tuple[dict[str, Any], Callable[[Path], None]]:
    """What result.json is to hold, and a function that writes the result directory."""
    from server import artifacts

    if not chosen.statistics:
        result = _run(scenario, chosen.algorithms, chosen.workers)
        return result.to_json(), lambda folder: artifacts.write_result(folder, result)
    with _bar() as bar:
        told = statistics.run(scenario, chosen.algorithms, workers=chosen.workers, progress=lambda f: _fill(bar, f))
        _fill(bar, 1.0)
    return told, lambda folder: artifacts.write_statistics(folder, told)


def _bar() -> tqdm:
    return tqdm(total=100, unit="%", bar_format="{desc}{percentage:3.0f}% |{bar}| {elapsed}", file=sys.stderr)


def _fill(bar: tqdm, fraction: float) -> None:
    bar.update(max(0.0, 100 * fraction - bar.n))


def _claim(claim: dict[str, Any]) -> str:
    verdict = {True: "holds", False: "FAILS", None: "not run"}[claim["holds"]]
    found = f"{_figure(claim['value'])} {claim['operator']} {_figure(claim['bound'])}"
    reason = f" ({claim['reason']})" if claim.get("reason") else ""
    return f"claim {verdict}: {claim['text']} [{found}]{reason}"


def _figure(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "none" if value is None else str(value).lower()


def _algorithms() -> list[dict[str, Any]]:
    return [
        {
            "name": a.name,
            "title": a.title,
            "family": a.family,
            "summary": a.summary,
            "source": a.source,
            "centralized": a.centralized,
            "assumes": list(a.assumes),
        }
        for a in registry.algorithms().values()
    ]


def _scenarios() -> list[dict[str, Any]]:
    entries = []
    for name in library.names():
        scenario = library.find(name)
        entries.append(
            {
                "name": name,
                "title": scenario.title,
                "family": scenario.family,
                "summary": scenario.summary,
                "source": scenario.source,
                "trials": scenario.trials,
                "algorithms": list(scenario.algorithms),
                "missing": library.missing(scenario),
            }
        )
    return entries
