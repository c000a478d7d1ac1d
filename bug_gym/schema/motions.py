"""Motion laws: how movers and goals move.

To add a law, write a model with a `law` of its own and list it in `Motion`.
"""

from __future__ import annotations

import bisect
import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from bug_gym.limits import SMALL
from bug_gym.schema.errors import wrong
from bug_gym.schema.faults import NAMES
from bug_gym.schema.values import Duration, Flag, Part, Point, Positive, Record, Speed, Velocity, tags


class Bounce(Part):
    """Constant velocity, reflected by the border and by still obstacles; a polygon as the disc that holds it.

    What would be reflected more than a million times in a step, in a slit, waits for the next one.
    What begins in a still circle, or over an edge, comes no deeper; inside a still polygon, which it would never leave,
    nothing may begin.
    """

    law: Literal["bounce"]
    velocity: Velocity | None = None
    """Velocity at the start [m/s]."""
    speed: Speed | None = None
    """Speed in a direction that is drawn [m/s], instead of `velocity`."""

    @model_validator(mode="after")
    def _has_one_of_two(self) -> Self:
        if (self.velocity is None) == (self.speed is None):
            raise wrong("expected either velocity: [vx, vy] or speed (the direction is drawn)", "velocity")
        return self


class Waypoints(Part):
    """From point to point in straight lines, through whatever stands there."""

    law: Literal["waypoints"]
    points: Annotated[tuple[Point, ...], Field(min_length=1)]
    """Places x, y [m] in the world, visited in order from where the body starts."""
    speed: Speed
    """Speed along the lines [m/s]."""
    stop: Flag = False
    """Whether it stands still at the last point; otherwise it goes on to the first."""


class RandomWalk(Part):
    """Straight legs in directions that are drawn, reflected as `bounce` is."""

    law: Literal["random_walk"]
    speed: Speed
    """Speed on every leg [m/s]."""
    min_leg: Duration = 1.0
    """Least duration of a leg [s]."""
    max_leg: Duration = 3.0
    """Greatest duration of a leg [s]."""

    @model_validator(mode="after")
    def _legs_are_ordered(self) -> Self:
        if self.min_leg > self.max_leg:
            raise wrong(f"got {self.min_leg}, expected at most max_leg ({self.max_leg})", "min_leg")
        return self


class Crowd(Part):
    """Walks to its goals and gets out of the way: of others under this law, each doing half, and of the robots.

    Optimal reciprocal collision avoidance (van den Berg, Guy, Lin and Manocha 2011). Bodies of a crowd never touch one
    another, nor anything that stands, however little room there is; what moves under other laws they don't see. Where
    one is held up it turns to its right. A goal that takes too long (5 s and twice the straight way) is given up.
    """

    law: Literal["crowd"]
    speed: Speed
    """Greatest speed, at which it walks where nothing is in its way [m/s]."""
    horizon: Duration = 2.0
    """How far ahead it looks for contacts [s]."""
    goals: Annotated[tuple[Point, ...], Field(min_length=1)] | None = None
    """Places x, y [m] to walk to in turn, over and over; it stays at a single one. None: drawn, each as the one before
    is reached, over all that is free within the bounds."""


class Evade(Part):
    """Flees the nearest robot, along walls where they are in its way; in a corner it stands."""

    law: Literal["evade"]
    speed: Speed
    """Speed while it flees [m/s]."""
    sight: Positive = 5.0
    """Distance at which it sees a robot, through walls too [m]."""
    wander: Speed = 0.0
    """Speed while it sees none, in directions drawn for 2 s each [m/s]; 0: it stands."""

    @model_validator(mode="after")
    def _flees_no_slower(self) -> Self:
        if self.wander > self.speed:
            raise wrong(f"got {self.wander:g}, expected at most speed ({self.speed:g})", "wander")
        return self


class Replay(Part):
    """Where it was at recorded times, straight between them; a mover is there from the first to the last of them."""

    law: Literal["replay"]
    points: Annotated[tuple[Record, ...], Field(min_length=1)]
    """Records: time since the start of the episode [s], x, y [m]; times rise, and may begin before 0."""

    @model_validator(mode="after")
    def _times_rise(self) -> Self:
        for index, (before, after) in enumerate(pairwise(self.points), start=1):
            if after[0] <= before[0]:
                raise wrong(f"got time {after[0]:g}, expected more than {before[0]:g}", f"points.{index}")
            if after[0] - before[0] < SMALL:
                reason = f"got {after[0] - before[0]:g} s after the record before, expected at least {SMALL:g} s"
                raise wrong(reason, f"points.{index}")
        return self

    @property
    def speed(self) -> float:
        """Greatest speed between two records [m/s]."""
        return max((math.dist(a[1:], b[1:]) / (b[0] - a[0]) for a, b in pairwise(self.points)), default=0.0)

    def is_there(self, time: float) -> bool:
        """Whether a time [s] lies between the first and the last record."""
        return self.points[0][0] <= time <= self.points[-1][0]

    def place(self, time: float) -> tuple[float, float]:
        """Place x, y [m] at a time [s]; before the first record and after the last one that of these."""
        after = bisect.bisect_right(self.points, time, key=lambda record: record[0])
        if after in (0, len(self.points)):
            return self.points[min(after, len(self.points) - 1)][1:]
        (t0, x0, y0), (t1, x1, y1) = self.points[after - 1 : after + 1]
        share = (time - t0) / (t1 - t0)
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


Motion = Annotated[Bounce | Waypoints | RandomWalk | Crowd | Evade | Replay, Field(discriminator="law")]


LAWS: tuple[str, ...] = tuple(tags(Motion, "law"))
NAMES["law"] = lambda: LAWS
