"""What moves: obstacles with their shapes, and goals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Self, TypeVar

from pydantic import ValidationError, model_validator

from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Motion, Replay
from bug_gym.schema.polygons import Polygon
from bug_gym.schema.values import Box, NotNegative, Part, Point, Positive

Body = TypeVar("Body", "Mover", "Target")

SAME_PLACE = 1e-6
"""Places nearer to one another than this are one [m]."""


def _begin_with_record(data: object) -> object:
    """Fills in `at` where it is left out and a record tells where a body begins."""
    if not isinstance(data, Mapping) or data.get("at") is not None:
        return data
    motion = data.get("motion")
    if isinstance(motion, Mapping) and motion.get("law") == "replay":
        try:
            motion = Replay.model_validate(motion)
        except ValidationError:
            return {**data, "at": (0.0, 0.0)}  # what is wrong comes out where the motion is checked
    return {**data, "at": motion.place(0.0)} if isinstance(motion, Replay) else data


def _check_begin(body: Body) -> Body:
    """Raises where a body begins elsewhere than its record says."""
    at, motion = body.at, body.motion
    if isinstance(motion, Replay) and at is not None and math.dist(at, motion.place(0.0)) > SAME_PLACE:
        reason = f"got {list(at)}, expected {list(motion.place(0.0))}, where its record has it at 0 s, or nothing"
        raise wrong(reason, "at")
    return body


class Shape(Part):
    """The outline of a mover, relative to its place; exactly one of the two."""

    circle: Positive | None = None
    """Radius of a circle [m]."""
    polygon: Polygon | None = None
    """Corners x, y [m] relative to the mover's place; it has no holes."""

    @model_validator(mode="after")
    def _is_one_of_two(self) -> Self:
        if (self.circle is None) == (self.polygon is None):
            raise wrong("expected either circle: radius or polygon: [[x, y], ...]", "circle")
        if self.polygon is not None and self.polygon.holes:
            raise wrong(f"got {len(self.polygon.holes)}, expected none: a polygon that moves is solid", "polygon.holes")
        return self


class Mover(Part):
    """A circle or a polygon that moves as one body and doesn't turn.

    Robots meet it on the chord of its way in a step, which it leaves by at most half of its speed times the step where it is
    reflected or takes a new direction within one.
    """

    shape: Shape
    """Its outline."""
    at: Point
    """Where it starts x, y [m]; left out for `replay`."""
    motion: Motion
    """How it moves."""

    _begins_with_its_record = model_validator(mode="before")(_begin_with_record)
    _begins_where_its_record_does = model_validator(mode="after")(_check_begin)

    @property
    def is_there(self) -> bool:
        """Whether it is in the world as the episode starts."""
        return not isinstance(self.motion, Replay) or self.motion.is_there(0.0)


class Target(Part):
    """A goal that moves."""

    at: Point | None = None
    """Where it starts x, y [m]; left out for `replay`."""
    region: Box | None = None
    """Rectangle to draw its start from [m], instead of `at`."""
    motion: Motion
    """How it moves."""
    room: NotNegative | None = None
    """Distance that it keeps from still obstacles [m]; none: what the robot needs to reach it."""

    _begins_with_its_record = model_validator(mode="before")(_begin_with_record)
    _begins_where_its_record_does = model_validator(mode="after")(_check_begin)

    @model_validator(mode="after")
    def _starts_somewhere(self) -> Self:
        if (self.at is None) == (self.region is None):
            raise wrong("expected either at: [x, y] or region: [xmin, ymin, xmax, ymax]", "at")
        return self
