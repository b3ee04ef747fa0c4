"""What a scenario's source asserts, checked against a result: `[[claims]]` are data, never evaluated code."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

OPERATORS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq}


class Other(Protocol):
    """The metric that a claim compares with, times `factor`."""

    @property
    def metric(self) -> str: ...
    @property
    def algorithm(self) -> str: ...
    @property
    def subject(self) -> str | None: ...
    @property
    def factor(self) -> float: ...


class Claim(Protocol):
    """A metric of an algorithm and subject, an operator, and a bound or another metric."""

    @property
    def text(self) -> str: ...
    @property
    def metric(self) -> str: ...
    @property
    def algorithm(self) -> str: ...
    @property
    def subject(self) -> str | None: ...
    @property
    def operator(self) -> str: ...
    @property
    def bound(self) -> Any: ...
    @property
    def than(self) -> Any: ...


class NotRun(Exception):
    """The claim speaks of an algorithm or a subject that is not in the result."""


class Undefined(Exception):
    """The result has no such metric, or no figure for it."""


def check(claims: Iterable[Claim], result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Every claim as {text, value, operator, bound, holds} against a result in the shape of result.json.

    holds is None where an algorithm or subject of the claim was not run, False where it was and the figure
    does not exist; both say why under `reason`.
    """
    return [_check(claim, result) for claim in claims]


def _check(claim: Claim, result: Mapping[str, Any]) -> dict[str, Any]:
    checked: dict[str, Any] = {
        "text": claim.text,
        "value": None,
        "operator": claim.operator,
        "bound": claim.bound,
    }
    try:
        checked["value"] = value = figure(result, claim.metric, claim.algorithm, claim.subject)
        if claim.than is not None:
            checked["bound"] = _scaled(claim.than, result)
        return checked | {"holds": compare(value, claim.operator, checked["bound"])}
    except NotRun as why:
        return checked | {"holds": None, "reason": str(why)}
    except Undefined as why:
        return checked | {"holds": False, "reason": str(why)}


def figure(result: Mapping[str, Any], metric: str, algorithm: str, subject: str | None) -> Any:
    """The value of a metric, dotted where it is nested (`packets.bytes_per_packet`).

    Looked up among the subject's metrics first, then among the algorithm's. Raises NotRun or Undefined.
    """
    if algorithm not in result["algorithms"]:
        raise NotRun(f"{algorithm} was not run")
    whole = result["algorithms"][algorithm]
    places = [whole]
    if subject:
        if subject not in whole["subjects"]:
            raise NotRun(f"{algorithm} did not locate {subject}")
        places.insert(0, whole["subjects"][subject])
    who = f"{algorithm} of {subject}" if subject else algorithm
    for place in places:
        try:
            for key in metric.split("."):
                place = place[int(key)] if isinstance(place, list) else place[key]
        except (KeyError, IndexError, TypeError, ValueError):
            continue
        if place is None:
            raise Undefined(f"{metric} by {who} has no value")
        return place
    raise Undefined(f"there is no metric {metric!r} by {who}")


def _scaled(than: Other, result: Mapping[str, Any]) -> Any:
    value = figure(result, than.metric, than.algorithm, than.subject)
    return value * than.factor if _is_number(value) else value


def compare(value: Any, sign: str, bound: Any) -> bool:
    """Whether `value sign bound` holds: numbers by any operator, flags and words by == alone.

    Raises Undefined for two things that cannot be compared, ValueError for an unknown operator.
    """
    if sign not in OPERATORS:
        raise ValueError(f"no operator {sign!r}; there are: {' '.join(OPERATORS)}")
    alike = _is_number(value) and _is_number(bound)
    if not alike and (sign != "==" or type(value) is not type(bound) or not isinstance(value, bool | str)):
        raise Undefined(f"{value!r} and {bound!r} cannot be compared by {sign}")
    return bool(OPERATORS[sign](value, bound))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
