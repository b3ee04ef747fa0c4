"""Inputs nobody would write: scenarios of every sort, and files and packets with something wrong in them."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

from engine import runner
from engine.scenario import library, toml
from engine.scenario.errors import ScenarioError
from engine.scenario.models import ScenarioBase

#: What may stand where something else should.
STRANGE: list[Any] = [
    *(0, -1, 1, 2, 7, 10**6, 2**31, 2**63 - 1, -(2**63), 10**30),
    *(-0.0, 0.5, 1e-300, 5e-324, 1e308, -1e308, float("nan"), float("inf")),
    *("", "x", "../../etc/passwd", "é" * 50, "a" * 5000, "\x00", "1e999", "{}", "vehicles"),
    *(True, False, [], {}, [[]], [{}], {"kind": "?"}, [1e308] * 3, {"a": {"a": {"a": 1}}}),
]

Path = tuple[str | int, ...]


def places(value: Any, at: Path = ()) -> Iterator[Path]:
    """The path of every value in nested tables and lists."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inside in items:
        yield (*at, key)
        yield from places(inside, (*at, key))


def holder(tables: Any, at: Path) -> Any:
    """The table or list that the value at a path stands in."""
    for key in at[:-1]:
        tables = tables[key]
    return tables


@st.composite
def disturbed(draw: st.DrawFn, tables: dict[str, Any]) -> dict[str, Any]:
    """The tables with some values changed for strange ones, left out, repeated, moved or renamed."""
    tables = copy.deepcopy(tables)
    for _ in range(draw(st.integers(1, 4))):
        everywhere = list(places(tables))
        if not everywhere:
            break
        at = draw(st.sampled_from(everywhere))
        inside, key = holder(tables, at), at[-1]
        match draw(st.integers(0, 5)):
            case 0 | 1:
                inside[key] = copy.deepcopy(draw(st.sampled_from(STRANGE)))
            case 2:
                del inside[key]
            case 3:
                other = draw(st.sampled_from(everywhere))
                inside[key] = copy.deepcopy(holder(tables, other)[other[-1]])
            case 4 if isinstance(inside, list):
                inside.extend(copy.deepcopy(inside[key]) for _ in range(draw(st.integers(1, 3))))
            case 5 if isinstance(inside, dict):
                inside[draw(st.text(max_size=8))] = inside.pop(key)
            case _ if isinstance(inside[key], int | float) and not isinstance(inside[key], bool):
                inside[key] = inside[key] * draw(st.sampled_from([-1, 0, 0.001, 1000, 1e12]))
    return tables


@st.composite
def damaged(draw: st.DrawFn, data: bytes, words: tuple[bytes, ...] = ()) -> bytes:
    """The bytes with some changed, cut out, repeated, or words put between them."""
    changed = bytearray(data)
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(changed)))
        match draw(st.integers(0, 4)):
            case 0 if at < len(changed):
                changed[at] = draw(st.integers(0, 255))
            case 1:
                del changed[at : at + draw(st.integers(1, 40))]
            case 2:
                changed[at:at] = changed[at : at + draw(st.integers(1, 40))]
            case 3 if words:
                changed[at:at] = draw(st.sampled_from(words))
            case _:
                changed[at:at] = draw(st.binary(min_size=1, max_size=8))
    return bytes(changed)


@cache
def templates() -> list[dict[str, Any]]:
    """The shipped scenarios that are simulated, each short, of two trials, without claims."""
    found = []
    for name in library.names():
        scenario = library.shipped(name)
        if getattr(getattr(scenario, "mission", None), "kind", "simulated") == "simulated":
            tables = toml.plain(scenario) | {"trials": 2}
            tables.pop("claims", None)
            found.append(tables)
    return found


#: Keys that decide how long a mission takes to compute; they change little.
COSTLY = ("_hz", "_s", "steps", "lines", "samples", "trials")


def shortened(tables: dict[str, Any]) -> dict[str, Any]:
    """The tables of as short a mission as they allow: in a shorter one a vehicle may never have its turn to send."""
    for duration_s in (600, 300, 100, 30):
        share = duration_s / tables.get("duration_s", duration_s)
        if share >= 1 or (duration_s < 100 and tables["family"] != "slam"):
            continue
        short: dict[str, Any] = copy.deepcopy(tables) | {"duration_s": duration_s}
        if tables["family"] == "slam":  # as densely measured
            for used in ("ranging", "arrays"):
                many = getattr(toml.validate(tables), used).count
                short[used] = short.get(used, {}) | {"count": math.ceil(share * many)}
        try:
            toml.validate(short)
        except ScenarioError:
            continue
        tables = short
    return tables


@st.composite
def scenarios(draw: st.DrawFn) -> ScenarioBase:
    """Scenarios anywhere in the schema that can be run: shipped ones with many values changed far and wide."""
    tables = shortened(copy.deepcopy(draw(st.sampled_from(templates()))))
    tables["seed"] = draw(st.integers(0, 2**63 - 1))
    scenario = toml.validate(tables)
    for _ in range(draw(st.integers(1, 12))):
        wanted = copy.deepcopy(tables)
        at = draw(st.sampled_from([p for p in places(wanted) if p[-1] not in ("duration_s", "schema", "trials")]))
        inside, key = holder(wanted, at), at[-1]
        value = inside[key]
        if isinstance(value, bool):
            inside[key] = not value
        elif isinstance(value, int | float):
            names = [part for part in at if isinstance(part, str)]
            few = bool(names) and names[-1].endswith(COSTLY)
            factor = draw(st.floats(-0.5, 0.5) if few else st.floats(-4, 4))
            changed = value * 10.0**factor * draw(st.sampled_from([1, 1, 1, -1, 0]))
            inside[key] = round(changed) if isinstance(value, int) and draw(st.booleans()) else changed
        elif isinstance(inside, dict):
            del inside[key]
        elif len(inside) > 1:
            inside.pop(int(key))
        try:
            other = toml.validate(wanted)
            runner.chosen(other, None)
        except ScenarioError:
            continue
        scenario, tables = other, wanted
    return scenario


def check_tracks(name: str, tracks: Any) -> None:
    """What every estimator owes whatever it is given: finite means, covariances that are symmetric and definite."""
    for subject, belief in tracks.beliefs.items():
        where = f"{name}, {subject}"
        assert np.isfinite(belief.mean).all(), f"{where}: a mean is not finite"
        assert np.isfinite(belief.cov).all(), f"{where}: a covariance is not finite"
        cov, scale = belief.cov, np.abs(belief.cov).max(axis=(-2, -1), keepdims=True) + 1e-300
        assert np.abs(cov - np.swapaxes(cov, -1, -2)).max(initial=0.0) <= 1e-9 * scale.max(initial=0.0), (
            f"{where}: a covariance is not symmetric"
        )
        smallest = np.linalg.eigvalsh(cov / scale)[..., 0]
        assert smallest.min(initial=0.0) >= -1e-9, f"{where}: a covariance has the eigenvalue {smallest.min():.3g}"
    for subject, samples in tracks.samples.items():
        assert np.isfinite(samples.points).all(), f"{name}, {subject}: a sample is not finite"
