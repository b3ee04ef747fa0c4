"""What a session's panes show: chosen in the page, checked here."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

Level = Annotated[int, Field(ge=0, le=255)]
Name = Annotated[str, Field(max_length=100)]


class Options(BaseModel):
    """Lines and layers to draw, where to look from, and how.

    sigma: size of the ellipses in standard deviations, or 95 for the 95 % region; follow, graph, pursuit: a vehicle to
    keep in the middle, whose factor graph to draw, and whose view of a pursuit; hidden: vehicles to leave out; colours:
    of each algorithm laid over each other; depth: how much depths are stretched, 0 for as much as suits; linked:
    whether cameras move together; cloud, contours: all trials at the moment, as points with their 90 % envelope, and as
    lines of equal density; sound: beliefs of beacons and the beams that made them.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    trails: bool = True
    rays: bool = True
    ellipses: bool = True
    sigma: Literal[1, 2, 3, 95] = 95
    cloud: bool = False
    contours: bool = False
    follow: Name | None = None
    top: bool = False
    linked: bool = True
    depth: Annotated[float, Field(ge=0, le=50, allow_inf_nan=False)] = 0.0
    dark: bool = False
    hidden: Annotated[list[Name], Field(max_length=500)] = []
    graph: Name | None = None
    pursuit: Name | None = None
    sound: bool = True
    colours: Annotated[dict[Name, Annotated[list[Level], Field(min_length=3, max_length=3)]], Field(max_length=64)] = {}

    def chosen(self, values: dict[str, Any]) -> Options:
        """These options with some of them changed; ValueError says which cannot be."""
        try:
            return Options.model_validate(self.model_dump() | values)
        except ValidationError as error:
            first = error.errors()[0]
            key = str(first["loc"][0])[:40]
            if first["type"] == "extra_forbidden":
                raise ValueError(f"there is no option {key!r}; there are {', '.join(Options.model_fields)}") from None
            raise ValueError(f"option {key}: {first['msg']}") from None
