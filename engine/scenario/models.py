"""What every scenario file has, whatever its family: pydantic models of TOML tables that know their own keys."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator
from pydantic_core import PydanticCustomError

from engine.scenario.errors import Problem

MAX_TRIALS = 1_000_000
MAX_DURATION_S = 30 * 86_400.0
#: Unknown keys of one table that are told of.
MAX_UNKNOWN = 20

#: What a vehicle, target or beacon may be called: it becomes part of key paths, array names and file columns.
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,39}$")]
#: The name of an algorithm, a subject or a metric.
Word = Annotated[str, Field(max_length=200)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
#: A coordinate or offset: bounded so that no arithmetic on it overflows.
Coordinate = Annotated[float, Field(ge=-1e7, le=1e7)]
#: A point [x, y], east and north, metres.
Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]


class Table(BaseModel):
    """A table of a scenario file: exact types, finite numbers, no keys but its own."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, populate_by_name=False, protected_namespaces=()
    )

    @model_validator(mode="before")
    @classmethod
    def _its_own_keys(cls, data: Any) -> Any:
        """Name every unknown key with the nearest known one, and every missing key with what it means."""
        if not isinstance(data, dict):
            return data
        fields = {f.alias or name: f for name, f in cls.model_fields.items() if f.exclude is not True}
        problems = []
        unknown = [key for key in data if key not in fields and key not in cls.model_fields]
        for key in unknown[:MAX_UNKNOWN]:
            near = difflib.get_close_matches(str(key), fields, n=1)
            remedy = f"did you mean {near[0]!r}?" if near else f"the keys here are: {', '.join(fields)}"
            problems.append(Problem(str(key)[:100], "is not a key of this table", remedy))
        for key, field in fields.items():
            if field.is_required() and key not in data:
                meaning = f": {field.description}" if field.description else ""
                problems.append(Problem(key, "is missing", f"add it{meaning}"))
        if problems:
            raise faults(problems)
        return data


def faults(problems: list[Problem]) -> PydanticCustomError:
    """Problems with keys relative to a table, as the error that table's validator raises."""
    text = "; ".join(map(str, problems)).replace("{", "(").replace("}", ")")
    return PydanticCustomError("problems", text, {"problems": problems})  # type: ignore[arg-type]


class Interval(Table):
    """A stretch of mission time, s."""

    start_s: NotNegative = Field(description="start, s from the start of the mission")
    end_s: Positive = Field(description="end, s from the start of the mission")

    @model_validator(mode="after")
    def _forward(self) -> Interval:
        if self.end_s <= self.start_s:
            raise faults([Problem("end_s", f"is not after start_s ({self.start_s:g})", "give a later time")])
        return self


class Than(Table):
    """Another metric to compare a claim's metric with."""

    metric: Word = Field(description="name of the metric, as in result.json")
    algorithm: Word = Field(description="algorithm it is of")
    subject: Word | None = Field(None, description="vehicle (or other subject) it is of")
    factor: float = Field(1.0, description="multiplies the other metric before comparing")


class Claim(Table):
    """Something the source asserts, checked against the result by `coopnav check`."""

    text: str = Field(max_length=2000, description="the assertion in words")
    metric: Word = Field(description="metric of result.json, dotted where nested (packets.bytes_per_packet)")
    algorithm: Word = Field(description="algorithm it is of")
    subject: Word | None = Field(None, description="vehicle (or other subject) it is of")
    operator: Literal["<", "<=", ">", ">=", "=="] = Field(description="how the metric compares")
    bound: bool | int | float | Word | None = Field(None, description="the value to compare with")
    than: Than | None = Field(None, description="the metric to compare with, instead of a bound")

    @model_validator(mode="after")
    def _one_right_hand_side(self) -> Claim:
        if (self.bound is None) == (self.than is None):
            raise faults([Problem("bound", "a claim compares with one thing", "give either bound or than")])
        return self


class ScenarioBase(Table):
    """What a scenario of any family says. `origin` is the folder or name it was read from, not part of the file."""

    schema_version: Literal[1] = Field(1, alias="schema", description="version of the file format")
    title: str = Field(min_length=1, max_length=200, description="one line")
    summary: str = Field("", max_length=4000, description="what to look at")
    source: str = Field("", max_length=1000, description="paper, figure or log it comes from")
    family: str = Field(description="kind of mission")
    duration_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S)] | None = Field(
        None, description="length of the mission, s; a recorded one may leave it out and is then taken whole"
    )
    seed: int = Field(1, ge=0, lt=2**63, description="of all random draws")
    trials: int = Field(1, ge=1, le=MAX_TRIALS, description="Monte Carlo trials")
    algorithms: list[Word] = Field([], max_length=64, description="estimators to compare")
    options: dict[str, dict[str, Any]] = Field({}, max_length=64, description="settings of single algorithms, by name")
    claims: list[Claim] = Field([], max_length=200, description="assertions to check against the result")
    origin: str = Field("", exclude=True)
