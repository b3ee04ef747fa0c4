"""Scenario files: TOML in, TOML out, and single values changed by key path."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from engine.scenario.errors import Problem, ScenarioError
from engine.scenario.families import MODELS
from engine.scenario.models import ScenarioBase

MAX_BYTES = 4_000_000
#: Parts of a dotted key; the time to read one grows with their cube.
MAX_PARTS = 32

#: What dots in a TOML text mean nothing in: strings and comments. A string without an end goes on to where one would
#: have to be, so that nothing is read twice.
_QUIET = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"{3,5}|\Z)|' + r"'''.*?(?:'{3,5}|\Z)|" + r'"(?:[^"\\\n]|\\.)*+"?|' + r"'[^'\n]*+'?|#[^\n]*+",
    re.DOTALL,
)
_LONG_KEY = re.compile(rf"(?<![\w-])[\w-]++(?:[ \t]*+\.[ \t]*+[\w-]++){{{MAX_PARTS}}}")


def loads(text: str, *, origin: str = "") -> ScenarioBase:
    """The scenario in a TOML text; `origin` is the folder to look for its recording in. Raises ScenarioError."""
    try:
        data = _read(text)
    except RecursionError:
        raise ScenarioError([Problem("", "this is nested too deeply", "write a plain scenario")], origin) from None
    except ValueError as error:
        raise ScenarioError([Problem("", f"this is not TOML: {error}", "correct the file there")], origin) from None
    return validate(data, origin=origin)


def _read(text: str) -> dict[str, Any]:
    """The tables in a TOML text; RecursionError or ValueError where it is none."""
    if _LONG_KEY.search(_QUIET.sub("s", text)):
        raise ValueError(f"a key has more than {MAX_PARTS} parts")
    return tomllib.loads(text)


def load(path: Path | str) -> ScenarioBase:
    """The scenario in a file, or in the scenario.toml of a folder; its origin is that folder. Raises ScenarioError."""
    path = Path(path)
    if path.is_dir():
        path = path / "scenario.toml"
    try:
        state = path.stat()
        if state.st_size > MAX_BYTES:
            raise ScenarioError([Problem("", "the file is too large for a scenario", "keep it below 4 MB")], str(path))
        return _loaded(path.absolute(), (state.st_mtime_ns, state.st_size, state.st_ino))
    except FileNotFoundError:
        raise ScenarioError([Problem("", f"there is no file {path}", "check the path")]) from None
    except UnicodeDecodeError:
        raise ScenarioError([Problem("", "the file is not UTF-8 text", "save it as UTF-8")], str(path)) from None
    except OSError as error:
        raise ScenarioError([Problem("", f"cannot be read: {error.strerror}", "check the path")], str(path)) from None
    except ScenarioError as error:
        raise ScenarioError(error.problems, str(path)) from None


@lru_cache(maxsize=1000)
def _loaded(path: Path, state: tuple[int, ...]) -> ScenarioBase:
    """The scenario in a file, read once for each state (time, size, inode): lists of all are asked for often."""
    return loads(path.read_text(encoding="utf-8"), origin=str(path.parent.resolve()))


def validate(data: Any, *, origin: str = "") -> ScenarioBase:
    """The scenario that nested tables describe. Raises ScenarioError with every problem found."""
    if not isinstance(data, dict):
        raise ScenarioError([Problem("", "a scenario is a table", "give the keys of a scenario file")])
    problems: list[Problem] = []
    if data.get("schema") != 1 or not isinstance(data["schema"], int) or isinstance(data["schema"], bool):
        found = f"is {_shown(data['schema'])}" if "schema" in data else "is missing"
        problems.append(Problem("schema", found, "write schema = 1"))
    family = data.get("family")
    if not isinstance(family, str) or family not in MODELS:
        found = f"is {_shown(data['family'])}" if "family" in data else "is missing"
        problems.append(Problem("family", found, f"use one of: {', '.join(MODELS)}"))
    if "origin" in data:
        problems.append(Problem("origin", "is not a key of this table", "leave it out"))
    try:
        problems += _impossible(data, "")
        if problems:
            raise ScenarioError(problems)
        assert isinstance(family, str), "anything else is a problem"
        return MODELS[family].model_validate(data | {"origin": origin})
    except ValidationError as error:
        raise ScenarioError(_problems(error, data)) from None
    except RecursionError:
        raise ScenarioError([Problem("", "this is nested too deeply", "write a plain scenario")]) from None


def _impossible(place: Any, key: str) -> Iterator[Problem]:
    """Every value that TOML has not: NaN, infinities, integers beyond 64 bits, null in lists and in free tables."""
    if isinstance(place, dict):
        for name, value in place.items():
            yield from _impossible(value, _join(key, str(name)))
    elif isinstance(place, list):
        for i, value in enumerate(place):
            yield from _impossible(value, f"{key}[{i}]")
    elif isinstance(place, float) and not math.isfinite(place):
        yield Problem(key, f"is {place}", "give a finite number")
    elif isinstance(place, int) and not -(2**63) <= place < 2**63:
        yield Problem(key, f"is an integer of {place.bit_length()} bits", "give one of at most 64")
    elif place is None and (key.endswith("]") or key.startswith("options.")):
        yield Problem(key, "is null", "leave it out")


def dumps(scenario: ScenarioBase) -> str:
    """The TOML text of a scenario, without what it leaves at its default; `loads` gives an equal scenario back."""
    return tomli_w.dumps(plain(scenario))


def plain(scenario: ScenarioBase) -> dict[str, Any]:
    """A scenario as nested tables of TOML's own types."""
    tables = scenario.model_dump(by_alias=True, exclude_none=True, exclude_defaults=True)
    return {"schema": scenario.schema_version} | tables


def override(scenario: ScenarioBase, values: Mapping[str, Any]) -> ScenarioBase:
    """The scenario with single values changed by key path. Raises ScenarioError.

    `network.loss`, `vehicles.iver28.sensors.modem.range_sigma_m`, `claims[0].bound`: list items go by number, or by
    name where they have one. Text is read as a TOML value, or taken as it is where it is none.
    """
    data = scenario.model_dump(by_alias=True, exclude_none=True)
    for path, value in values.items():
        _put(data, path, _literal(value) if isinstance(value, str) else value)
    return validate(data, origin=scenario.origin)


def _literal(text: str) -> Any:
    try:
        return _read(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        return text


def _put(data: Any, path: str, value: Any) -> None:
    """Set the value at a key path; tables on the way that are missing are made."""
    keys = [k for k in re.split(r"[.\[\]]+", path) if k]
    if not keys:
        raise ScenarioError([Problem(path, "is no key", "name a key such as network.loss")])
    place = data
    for n, key in enumerate(keys):
        last = n == len(keys) - 1
        if isinstance(place, list):
            names = [item.get("name") if isinstance(item, dict) else None for item in place]
            if key in names:
                at = names.index(key)
            elif key.isdecimal() and len(key) < 10 and int(key) < len(place):
                at = int(key)
            else:
                known = [name for name in names if name] or [f"0 to {len(place) - 1}"]
                raise ScenarioError([Problem(path, f"there is no {key!r} here", f"use one of: {', '.join(known)}")])
            if last:
                place[at] = value
            place = place[at]
        elif isinstance(place, dict):
            if last:
                place[key] = value
            place = place.setdefault(key, {})
        else:
            raise ScenarioError([Problem(path, f"{keys[n - 1]!r} is a value and has no keys", "set it as a whole")])


# --- from pydantic's errors to ours -----------------------------------------------------------------------------


def _problems(error: ValidationError, data: Any) -> list[Problem]:
    found: list[Problem] = []
    for e in error.errors(include_url=False):
        key = _key(e["loc"], data)
        if e["type"] == "problems":
            found += [Problem(_join(key, p.key), p.message, p.remedy) for p in e.get("ctx", {})["problems"]]
        else:
            found.append(Problem(key, *_words(e)))
    return found


def _join(table: str, key: str) -> str:
    return f"{table}.{key}" if table else key


def _key(loc: tuple[int | str, ...], data: Any) -> str:
    """A key path without the tags that pydantic puts in for the members of a union."""
    path, place = "", data
    for part in loc:
        if isinstance(part, int):
            path += f"[{part}]"
            place = place[part] if isinstance(place, list) and part < len(place) else None
        elif isinstance(place, dict) and part in place:
            path, place = _join(path, part), place[part]
    return path


def _words(e: Any) -> tuple[str, str]:
    kind, ctx = e["type"], e.get("ctx", {})
    found = f"is {_shown(e['input'])}"
    if kind == "union_tag_invalid":
        tag, tags = str(ctx["tag"]), [t.strip("'") for t in ctx["expected_tags"].split(", ")]
        near = difflib.get_close_matches(tag, tags, n=1)
        remedy = f"use one of: {', '.join(tags)}" + (f"; did you mean {near[0]!r}?" if near else "")
        return f"there is no kind {tag!r}", remedy
    if kind == "union_tag_not_found":
        return "its kind is missing", f"say which {ctx.get('discriminator', 'kind')!s} it is"
    if kind == "mission":
        return "is no known mission", 'use kind = "simulated", or kind = "recorded" with format = "csv" or "pyfg"'
    if kind == "string_pattern_mismatch":
        return (
            found,
            "use letters, digits, hyphen and underscore, a letter first, and no path (files with their suffix)",
        )
    if kind == "finite_number":
        return found, "give a finite number"
    should = str(e["msg"]).replace("Input should be a valid dictionary or instance of", "give a table:")
    should = re.sub(r"^Input should (be|have) (a valid )?", "give ", should)
    should = re.sub(r"^(List|String|Dictionary) should have", "give", should)
    should = should.replace("give greater", "give a value greater").replace("give less", "give a value less")
    return found, should


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 64:
        return f"an integer of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
