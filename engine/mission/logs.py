"""Where a recorded mission's files are, and that nothing outside its folder is read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.pursuit import Recorded
from engine.scenario.recording import CsvRecording, PyfgRecording, SonarRecording

DATA_VARIABLE = "COOPNAV_TEST_DATA"
MAX_BYTES = 200_000_000
#: Recorded logs kept beside a checkout of the project.
BESIDE_THE_CHECKOUT = Path(__file__).resolve().parents[3] / "shared" / "data"


def roots(origin: str, extra: Sequence[Path | str] = ()) -> list[Path]:
    """The folders to look for a log's folder in, in order: the scenario's own, the caller's, the known ones."""
    named = [origin] if origin else []
    named += [str(e) for e in extra]
    if os.environ.get(DATA_VARIABLE):
        named.append(os.environ[DATA_VARIABLE])
    return [Path(n) for n in named] + [BESIDE_THE_CHECKOUT]


def files(mission: CsvRecording | PyfgRecording | SonarRecording | Recorded) -> Iterator[tuple[str, str]]:
    """Every file a recorded mission names, as (key path, file name)."""
    if isinstance(mission, PyfgRecording):
        yield "mission.file", mission.file
        return
    if isinstance(mission, SonarRecording):
        for key in ("records", "pings", "chirp"):
            if getattr(mission, key) is not None:
                yield f"mission.{key}", getattr(mission, key)
        return
    if isinstance(mission, Recorded):
        for key, name in (("arrivals", mission.arrivals), ("receivers", mission.receivers), ("track", mission.track)):
            if name is not None:
                yield f"mission.{key}", name
        return
    for kind in ("odometry", "velocity", "heading", "depth", "fixes", "ranges", "nodes", "truth"):
        for i, source in enumerate(getattr(mission, kind)):
            yield f"mission.{kind}[{i}].file", source.file


def log_folder(scenario, extra: Sequence[Path | str] = ()) -> Path:
    """The folder with all of a recorded mission's files. Raises ScenarioError that says what was sought, and where."""
    mission = scenario.mission
    searched = roots(scenario.origin, extra)
    if mission.log == ".":
        if not scenario.origin or not Path(scenario.origin).is_dir():
            problem = Problem(
                "mission.log",
                "is the scenario file's own folder, and this scenario is in no file",
                "name a folder, or run the scenario file from the command line",
            )
            raise ScenarioError([problem])
        found = Path(scenario.origin).resolve()
    else:
        found = next((f for f in _inside(searched, mission.log) if f.is_dir()), None)
    if found is None:
        problem = Problem(
            "mission.log",
            f"there is no folder {mission.log!r} in {_listed(searched)}",
            f"put the log there, or name the folder that holds {mission.log!r} in {DATA_VARIABLE}",
        )
        raise ScenarioError([problem])
    problems = []
    for key, name in files(mission):
        if not (found / name).is_file():
            problems.append(Problem(key, f"there is no file {name!r} in {found}", "correct the name, or add the file"))
        elif not (found / name).resolve().is_relative_to(found):
            problems.append(Problem(key, f"{name!r} leads out of {found}", "put the file itself there"))
        elif (found / name).stat().st_size > MAX_BYTES:
            problems.append(Problem(key, f"{name!r} is larger than {MAX_BYTES // 10**6} MB", "cut the log"))
    if not problems and sum((found / name).stat().st_size for name in {name for _, name in files(mission)}) > MAX_BYTES:
        many = f"the files of {mission.log!r} have more than {MAX_BYTES // 10**6} MB together"
        problems.append(Problem("mission.log", many, "cut the log"))
    if problems:
        raise ScenarioError(problems)
    return found


def _inside(searched: Iterable[Path], name: str) -> Iterator[Path]:
    for root in searched:
        folder = (root / name).resolve()
        if folder.is_relative_to(root.resolve()):
            yield folder


def _listed(searched: Sequence[Path]) -> str:
    return " or ".join(dict.fromkeys(str(s) for s in searched))
