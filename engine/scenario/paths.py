"""Where a vehicle goes: the path generators of a scenario file. Metres east (x) and north (y), headings from x."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from engine.scenario.errors import Problem
from engine.scenario.models import Coordinate, NotNegative, Point, Table, faults

Speed = Annotated[float, Field(gt=0, le=100)]
Length = Annotated[float, Field(gt=0, le=1e6)]


class Waypoints(Table):
    """Straight legs between points, corners rounded; at the last point it stops, or returns to the first."""

    kind: Literal["waypoints"]
    points_m: list[Point] = Field(min_length=2, max_length=10_000, description="points [x, y] to visit, m")
    speed_mps: Speed = Field(description="speed over ground, m/s")
    turn_radius_m: NotNegative = Field(10.0, description="radius of turns, m (less where legs are too short for it)")
    repeat: bool = Field(False, description="go back to the first point and round again")

    @model_validator(mode="after")
    def _leads_somewhere(self) -> Waypoints:
        if all(point == self.points_m[0] for point in self.points_m):
            raise faults(
                [Problem("points_m", "is the same point again and again", "give another one, or use a station")]
            )
        return self


class LawnMower(Table):
    """Parallel lines joined at their ends, then straight back to the start, and again."""

    kind: Literal["lawnmower"]
    start_m: Point = Field(description="start of the first line [x, y], m")
    line_length_m: Length = Field(description="length of a line, m")
    spacing_m: Annotated[float, Field(ge=-1e5, le=1e5)] = Field(
        description="distance between lines, m; positive puts the next line to the left of the first"
    )
    lines: int = Field(ge=1, le=1000, description="number of lines")
    heading_deg: Coordinate = Field(0.0, description="direction of the first line, degrees counter-clockwise from x")
    speed_mps: Speed = Field(description="speed over ground, m/s")
    turn_radius_m: NotNegative = Field(25.0, description="radius of turns, m (less where lines are too close for it)")


class Loiter(Table):
    """Round and round a circle, or an ellipse where a second radius is given."""

    kind: Literal["loiter"]
    center_m: Point = Field(description="centre [x, y], m")
    radius_m: Length = Field(description="radius, m; along x before rotation for an ellipse")
    radius_y_m: Length | None = Field(None, description="the other radius of an ellipse, m")
    rotation_deg: Coordinate = Field(0.0, description="turns the ellipse, degrees counter-clockwise")
    start_deg: Coordinate = Field(0.0, description="where on it to start, degrees counter-clockwise from x")
    clockwise: bool = Field(False, description="direction of travel")
    speed_mps: Speed = Field(description="speed over ground, m/s")


class Diamond(Table):
    """Round the four corners of a diamond, starting at its right (+x) corner, counter-clockwise."""

    kind: Literal["diamond"]
    center_m: Point = Field(description="centre [x, y], m")
    radius_m: Length = Field(description="from the centre to the corners on the x axis, m")
    radius_y_m: Length | None = Field(None, description="from the centre to the corners on the y axis, m")
    speed_mps: Speed = Field(description="speed over ground, m/s")
    turn_radius_m: NotNegative = Field(10.0, description="radius of turns, m")


class Drift(Table):
    """A smooth random wander, the same in every trial and different for every seed."""

    kind: Literal["drift"]
    start_m: Point = Field(description="where it is at the start [x, y], m")
    wander_m: Annotated[float, Field(ge=0, le=1e5)] = Field(description="RMS extent of the wander per axis, m")
    period_s: Annotated[float, Field(gt=0, le=1e6)] = Field(
        600.0, description="shortest period of the wander, s; the longest is six times that"
    )
    velocity_mps: Annotated[list[Annotated[float, Field(ge=-100, le=100)]], Field(min_length=2, max_length=2)] = Field(
        [0.0, 0.0], description="mean velocity [x, y], m/s"
    )


class Station(Table):
    """Stays where it is."""

    kind: Literal["station"]
    position_m: Point = Field(description="position [x, y], m")
    heading_deg: Coordinate = Field(0.0, description="heading, degrees counter-clockwise from x")


Path = Annotated[Waypoints | LawnMower | Loiter | Diamond | Drift | Station, Field(discriminator="kind")]
