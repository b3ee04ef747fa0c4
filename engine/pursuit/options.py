"""What a scenario may choose for the estimators of a pursuit, under [options.NAME]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from engine.pursuit.sigma_points import Rule, gauss_hermite, unscented

RULES: dict[str, Rule] = {"gauss_hermite": gauss_hermite, "unscented": unscented}


class FilterOptions(BaseModel):
    """Of the sigma-point filter."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    points: Literal["gauss_hermite", "unscented"] = Field("gauss_hermite", description="rule of the sigma points")
    iterations: Annotated[int, Field(ge=1, le=20)] = Field(
        1, description="linearizations of an update; C19 has one, more count where the belief is wide"
    )

    range_sigma_m: Annotated[float, Field(gt=0, le=1e4)] | None = Field(
        None, description="noise of an arrival it assumes, m, where that is not the channel's (C19: R = 0.04 m^2)"
    )
    speed_mps: Annotated[float, Field(ge=0, le=100)] | None = Field(
        None, description="speed of the target it assumes, m/s, where that is not the target's"
    )

    @property
    def rule(self) -> Rule:
        return RULES[self.points]


class PursuitOptions(FilterOptions):
    """Of an estimator in the loop."""

    steer_by: Literal["present", "ping"] = Field(
        "present", description="the estimate the formation goes by: predicted to the present, or as of the last ping"
    )
    assumed_places: Literal["reported", "formation"] = Field(
        "reported",
        description="where arrivals are taken to be heard: as the messages say, or as the formation wants",
    )
