"""May one fuse naively? One operating point, or a map of them (Rui and Chitre)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field, model_validator

from engine.tracking import analysis, regions

router = APIRouter(prefix="/api/tracking", tags=["tracking"])

#: A map of turned ellipses is iterated cell by cell, in two dimensions.
MOST_TURNED = 48

#: A millimetre and a kilometre of standard deviation, squared: beyond that ratio a double has no digits left.
SMALLEST, LARGEST = 1e-6, 1e6
Variance = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]


class Point(BaseModel):
    """An operating point in one dimension; variances in m^2."""

    model_config = ConfigDict(extra="forbid")

    process: Annotated[float, Field(ge=0, le=LARGEST)] = Field(description="variance of the target's step")
    sensors: list[Variance] = Field(min_length=2, max_length=analysis.MOST_SENSORS, description="noise variances")
    prior: Annotated[float, Field(ge=0, le=LARGEST)] = Field(description="variance of the common first estimate")
    steps: int = Field(30, ge=1, le=analysis.MOST_STEPS)
    trials: int = Field(2000, ge=1, le=analysis.MOST_TRIALS)
    seed: int = Field(1, ge=0, lt=2**63)

    @model_validator(mode="after")
    def _bounded(self) -> Point:
        if self.steps * len(self.sensors) > analysis.MOST_UPDATES:
            raise ValueError(f"steps: steps x sensors is at most {analysis.MOST_UPDATES}")
        if self.steps * self.trials * len(self.sensors) > analysis.MOST_DRAWS:
            raise ValueError(f"trials: steps x trials x sensors is at most {analysis.MOST_DRAWS}")
        return self


class Map(BaseModel):
    """A map over the two sensors' normalized noise, logarithmic in both."""

    model_config = ConfigDict(extra="forbid")

    kind: Literal["one_step", "asymptotic"] = "asymptotic"
    size: int = Field(100, ge=2, le=400, description=f"cells along each axis; at most {MOST_TURNED} for long ellipses")
    smallest: float = Field(0.05, ge=1e-6, le=1e6)
    largest: float = Field(50.0, ge=1e-6, le=1e6)
    elongation: float = Field(1.0, ge=1, le=100, description="of the sensors' ellipses: long axis to short one")
    angle_deg: float = Field(0.0, ge=-360, le=360, description="between the two ellipses, degrees")

    @model_validator(mode="after")
    def _bounded(self) -> Map:
        if self.elongation > 1 and self.size > MOST_TURNED:
            raise ValueError(f"size: {self.size} cells; at most {MOST_TURNED} where elongation is above 1")
        return self


@router.post("/analysis")
def analyse(point: Point) -> dict[str, Any]:
    """Fig. 3's curve, Fig. 6's histories with Monte Carlo, steady states and a verdict in words, for one point."""
    return analysis.analyse(
        point.process, point.sensors, point.prior, steps=point.steps, trials=point.trials, seed=point.seed
    )


@router.post("/regions")
def dangerous(wanted: Map) -> dict[str, Any]:
    """Where naive fusion is worse than the better sensor alone, its boundary, and ratio maps.

    axis: r of both sensors (R / (P + Q) for one step, R / Q in the steady state; along the long axis of an ellipse);
    maps by rows of r2 over r1, of variances, or of square roots of determinants for ellipses; boundary: r2 over the
    axis for r1 <= r2, null where there is none.
    """
    low, high = sorted((wanted.smallest, max(wanted.largest, wanted.smallest * 1.01)))
    axis = np.geomspace(low, high, wanted.size)
    chart = regions.chart(
        wanted.kind, axis, elongation=wanted.elongation, angle_rad=float(np.radians(wanted.angle_deg))
    )
    return chart | {"figure_6": [{"name": "a", "r1": 1.0, "r2": 1.5}, {"name": "b", "r1": 10.0, "r2": 20.0}]}
