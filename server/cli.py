"""The command line: `coopnav`, also `python -m server`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from engine.scenario.errors import ScenarioError
from server import nursery

BAD_INPUT, INTERRUPTED = 2, 130


def parser() -> argparse.ArgumentParser:
    """All commands and their options."""
    top = argparse.ArgumentParser(
        prog="coopnav", description="Compare cooperative underwater navigation estimators side by side."
    )
    top.add_argument("--version", action="version", version=f"coopnav {version('coopnav')}")
    kinds = top.add_subparsers(dest="command", required=True, metavar="COMMAND")

    serve = kinds.add_parser("serve", help="open the dashboard on this machine")
    _service(serve)
    serve.add_argument(
        "--keep-days", type=_positive, metavar="N", help="delete jobs that ended so long ago, not pinned"
    )
    serve.add_argument(
        "--keep-gb", type=_positive, metavar="N", help="delete the oldest jobs, not pinned, when all take more"
    )
    serve.add_argument("--log-format", choices=("text", "json"), default="text", help="how log lines look (stderr)")
    serve.add_argument(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        default="warning",
        help="what is logged; info has a line for every request",
    )
    serve.set_defaults(run="serve")

    run = kinds.add_parser("run", help="run a scenario and compare its algorithms")
    _scenario(run)
    run.add_argument("--algorithms", type=_names, metavar="A,B", help="algorithms to run instead of the scenario's")
    run.add_argument("--out", type=Path, metavar="DIR", help="write result.json and arrays.npz here")
    run.add_argument(
        "--sweep", metavar="KEY=A:B:STEP", help="run once for each value of a key, as network.loss=0:0.9:0.1"
    )
    run.add_argument(
        "--statistics", action="store_true", help="keep no tracks, only figures over trials: up to a million of them"
    )
    run.add_argument("--workers", type=_count, metavar="N", help="processes to use (default: one per core)")
    run.set_defaults(run="run")

    check = kinds.add_parser("check", help="check what the sources of scenarios claim")
    check.add_argument("scenarios", nargs="*", metavar="SCENARIO", help="shipped name, file or folder")
    check.add_argument("--all", action="store_true", help="all shipped scenarios")
    check.add_argument(
        "--table-1", action="store_true", help="measure W11's Table I: five topologies and one with loss"
    )
    check.add_argument("--workers", type=_count, metavar="N", help="processes to use (default: one per core)")
    check.set_defaults(run="check")

    log = kinds.add_parser("log", help="write what the sensors and modems of a mission saw as CSV files")
    _scenario(log)
    log.add_argument("--out", type=Path, metavar="DIR", required=True, help="folder to write to")
    log.set_defaults(run="log")

    listing = kinds.add_parser("list", help="list the algorithms or the shipped scenarios")
    listing.add_argument("what", choices=("algorithms", "scenarios"))
    listing.add_argument("--json", action="store_true", help="as JSON")
    listing.set_defaults(run="listing")

    doctor = kinds.add_parser("doctor", help="check what the dashboard needs on this machine")
    _service(doctor)
    doctor.set_defaults(run="doctor")

    report = kinds.add_parser("report", help="write a result as one HTML page")
    report.add_argument("source", metavar="JOB|DIR", help="a job of the server, or a folder that `run --out` wrote")
    report.add_argument("--out", type=Path, metavar="FILE.html", required=True, help="file to write")
    report.add_argument("--data", type=Path, metavar="DIR", help="where the server keeps its jobs")
    report.set_defaults(run="report")
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; 0 well, 1 a claim that fails, 2 bad input."""
    chosen = parser().parse_args(arguments)
    if chosen.run == "serve" and chosen.cluster is None:
        nursery.prepare()
    from server import commands  # the engine with it, which --help need not wait for

    try:
        return getattr(commands, chosen.run)(chosen)
    except (commands.Usage, ScenarioError) as error:
        print(f"coopnav: {error}", file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"coopnav: {error.filename or ''}: {error.strerror or error}".replace(": : ", ": "), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("coopnav: interrupted", file=sys.stderr)
        return INTERRUPTED


def _service(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--host", default="127.0.0.1", help="address to listen on; other than loopback asks for a token"
    )
    command.add_argument(
        "--port", type=_port, default=8000, help="port to listen on, 0 for any free one (default 8000)"
    )
    command.add_argument("--data", type=Path, metavar="DIR", help="where jobs and scenarios are kept")
    command.add_argument(
        "--workers", type=_count, metavar="N", help="worker processes (default: one per core, two at least)"
    )
    command.add_argument("--cluster", metavar="tcp://…", help="run jobs on this Dask scheduler's workers instead")
    for what, holds in (("ca", "the authority's certificate"), ("cert", "our certificate"), ("key", "our private key")):
        command.add_argument(f"--cluster-{what}", type=Path, metavar="PEM", help=f"{holds}, for a cluster at tls://…")


def _scenario(command: argparse.ArgumentParser) -> None:
    command.add_argument("scenario", metavar="SCENARIO", help="shipped name, file, or folder with a scenario.toml")
    command.add_argument("--trials", metavar="N", help="Monte Carlo trials instead of the scenario's")
    command.add_argument("--seed", metavar="S", help="seed instead of the scenario's")
    command.add_argument(
        "--set",
        metavar="KEY=VALUE",
        action="append",
        default=[],
        dest="changes",
        help="change a key, as network.loss=0.4",
    )


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _port(text: str) -> int:
    return int(_number(text, int, lambda port: 0 <= port < 65536, "a port is a number from 0 to 65535"))


def _positive(text: str) -> float:
    return _number(text, float, lambda number: 0 < number < float("inf"), "give a number above 0")


def _count(text: str) -> int:
    return int(_number(text, int, lambda count: count >= 1, "give a whole number, at least 1"))


def _number(text: str, read: Callable[[str], float], fits: Callable[[float], bool], remedy: str) -> float:
    try:
        number = read(text)
    except ValueError:
        number = None
    if number is None or not fits(number):
        raise argparse.ArgumentTypeError(f"{text[:40]!r}: {remedy}")
    return number


if __name__ == "__main__":
    sys.exit(main())
