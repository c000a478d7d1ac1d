"""Polygons: borders, obstacles, and ground that slows robots down."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import (
    AfterValidator,
    Discriminator,
    SerializerFunctionWrapHandler,
    Tag,
    model_serializer,
    model_validator,
)

from bug_gym.limits import SMALL
from bug_gym.schema.errors import shortened, wrong
from bug_gym.schema.values import Box, Disc, Factor, Part, Point, box_or_corners

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


def _ring(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Drops the repeated last point of a closed ring; at least three must be left."""
    if len(points) > 1 and points[0] == points[-1]:
        points = points[:-1]
    if len(points) < 3:
        reason = f"got {len(points)} corners, expected at least 3 points [x, y]"
        raise wrong(reason)
    return points


Ring = Annotated[tuple[Point, ...], AfterValidator(_ring)]


def _simple(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Raises where a ring crosses or touches itself."""
    import shapely  # slow to load, and most scenarios need none

    check_simple(shapely.Polygon(points))
    return points


def check_simple(outline: BaseGeometry) -> None:
    """Raises where an outline is not that of a polygon, with the place of the fault."""
    import shapely  # slow to load, and most scenarios need none

    if not shapely.is_valid(outline):
        fault = re.fullmatch(r"(.*)\[(\S+) (\S+)\]", shapely.is_valid_reason(outline))
        what, x, y = fault.groups() if fault else ("not valid", "?", "?")
        what = "crosses itself" if what.endswith("Self-intersection") else f"is not simple ({what})"
        raise wrong(f"the polygon {what} at ({x}, {y})")
    if outline.area < SMALL**2:
        raise wrong(f"the polygon has an area of {outline.area:g}, expected at least {SMALL**2:g}")


Bounds = Annotated[
    Annotated[Box, Tag("<box>")] | Annotated[Ring, AfterValidator(_simple), Tag("<corners>")],
    Discriminator(box_or_corners),
]


class Polygon(Part):
    """A simple polygon, corners in either order. Without holes its list of corners is enough."""

    shell: Ring
    """Corners x, y [m], not closed."""
    holes: tuple[Ring, ...] = ()
    """Corners x, y [m] of each hole."""

    @model_validator(mode="before")
    @classmethod
    def _corners_are_enough(cls, data: object) -> object:
        if isinstance(data, (list, tuple)):
            return {"shell": data}
        if not isinstance(data, (Mapping, Polygon)):
            raise wrong(
                f"got {shortened(data)}, expected its corners [[x, y], ...], or {{shell: corners, holes: [corners]}}"
            )
        return data

    @model_validator(mode="after")
    def _is_simple(self) -> Self:
        check_simple(self.geometry())
        return self

    @model_serializer(mode="wrap")
    def _shortest(self, handler: SerializerFunctionWrapHandler) -> Any:
        data = handler(self)
        return data if self.holes else data["shell"]

    def geometry(self, at: tuple[float, float] = (0.0, 0.0)) -> BaseGeometry:
        """The polygon as shapely's, moved by `at` [m]."""
        import shapely  # slow to load, and most scenarios need none

        def moved(ring: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
            return [(x + at[0], y + at[1]) for x, y in ring]

        return shapely.Polygon(moved(self.shell), [moved(hole) for hole in self.holes])


class WeightedRegion(Part):
    """Ground that is hard to cross: a robot whose centre is in it has its greatest speeds divided by the factor.

    Nothing else minds it: no beam, no contact, no mover. Where regions overlap the largest factor counts.
    """

    polygon: Polygon | None = None
    """Corners x, y [m], or `{shell, holes}`."""
    circle: Disc | None = None
    """x, y, radius [m], instead of `polygon`."""
    factor: Factor
    """What a metre in it costs, in metres of open ground [1]."""

    @model_validator(mode="after")
    def _has_one_outline(self) -> Self:
        if (self.polygon is None) == (self.circle is None):
            raise wrong("expected either polygon: [[x, y], ...] or circle: [x, y, radius]", "polygon")
        return self

    def geometry(self) -> BaseGeometry:
        """The region as shapely's; a circle as a polygon of 256 corners."""
        import shapely  # slow to load, and most scenarios need none

        if self.polygon is not None:
            return self.polygon.geometry()
        assert self.circle is not None
        x, y, radius = self.circle
        return shapely.Point(x, y).buffer(radius, quad_segs=64)
