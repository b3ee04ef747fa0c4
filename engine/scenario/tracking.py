"""Scenarios of multi-sensor tracking: several nodes, one target, estimates exchanged over a link that may lose them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import Fraction, Name, NotNegative, Positive, ScenarioBase, Table, faults

#: Bounds on what one trial may produce, and on nodes whose joint covariance is tracked.
MAX_STEPS, MAX_SENSORS = 5000, 8

Variance = Annotated[float, Field(gt=0, le=1e12)]


class Ellipse(Table):
    """Noise of a position measurement by its ellipse: variances along two axes, the first turned from x."""

    along_m2: Variance = Field(description="variance along the first axis, m^2")
    across_m2: Variance = Field(description="variance across it, m^2")
    angle_deg: Annotated[float, Field(ge=-360, le=360)] = Field(0.0, description="of the first axis from x, degrees")


class Sensor(Table):
    """A node that sees the target's position with Gaussian noise and exchanges its estimate with the others."""

    name: Name = Field(description="name of the node")
    variance_m2: Variance | None = Field(None, description="noise variance of x and of y, m^2")
    ellipse: Ellipse | None = Field(None, description="noise of different size along turned axes, instead")

    @model_validator(mode="after")
    def _one_noise(self) -> Sensor:
        if (self.variance_m2 is None) == (self.ellipse is None):
            raise faults([Problem("variance_m2", "a sensor has one noise", "give either variance_m2 or ellipse")])
        return self


class Target(Table):
    """A target that does a random walk (RC eq. 1)."""

    process_variance_m2: NotNegative = Field(description="variance of each step in x and in y, m^2")
    prior_variance_m2: NotNegative = Field(description="of everybody's common first estimate in x and in y, m^2")


class Link(Table):
    """How the nodes' estimates reach each other after every step."""

    loss: Fraction = Field(0.0, description="fraction of packets lost, each direction by itself")


class TrackingScenario(ScenarioBase):
    """Nodes that track one target and fuse each other's estimates."""

    family: Literal["tracking"] = Field(description="kind of mission")
    step_s: Positive = Field(1.0, description="time between measurements, s")
    target: Target = Field(description="how it moves")
    sensors: list[Sensor] = Field(min_length=2, max_length=MAX_SENSORS, description="the nodes")
    network: Link = Field(Link.model_validate({}), description="the link between them")

    @property
    def steps(self) -> int:
        """Number of measurements."""
        return max(1, int((self.duration_s or 0.0) / self.step_s + 1e-9))

    @model_validator(mode="after")
    def _whole(self) -> TrackingScenario:
        problems = list(_problems(self))
        if problems:
            raise faults(problems)
        return self


def _problems(scenario: TrackingScenario) -> Iterator[Problem]:
    if scenario.duration_s is None:
        yield Problem("duration_s", "is missing", "say how long to track, s")
    elif scenario.steps > MAX_STEPS:
        yield Problem("duration_s", f"makes {scenario.steps} steps", f"keep duration_s / step_s below {MAX_STEPS}")
    for name, count in Counter(s.name for s in scenario.sensors).items():
        if count > 1:
            yield Problem("sensors", f"{count} of them are named {name!r}", "give every node its own name")
