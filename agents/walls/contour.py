"""What a bug remembers of walls: the boundary that it follows now, and where it hit and left boundaries.

A bug walks on the *contour*: the line at the clearance from the obstacles, where convex corners are arcs. All positions
are kept in the odometry frame. Sides: +1 turns left at a wall and keeps it on the right, -1 is its mirror image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bug_gym.geometry import Point
from bug_gym.policy import Memory
from bug_gym.view import View

TARGET_MOVED = 0.5
"""Way of the target after which distances and laps measured for its old place mean nothing [m]."""

CLOSER = 0.1
"""How much nearer to the goal than a hit point is nearer, in steps."""

HAIR = 1e-6
"""More than rounding moves a place that a robot comes back to [m]."""


@dataclass(frozen=True)
class Gate:
    """A door across the contour: passing it once more in the same direction closes a lap.

    Proximity to a remembered point would fire several times a pass, and on the other side of a thin wall.
    """

    place: Point
    """Middle of the door, odometry frame [m]."""
    heading: float
    """Direction in which it was passed [rad]."""
    odometer: float
    """Length of the contour walked when it was placed [m]."""
    turned: float
    """Total turning when it was placed [rad]."""
    wound: float = 0.0
    """How far the bearing of the goal had gone round when it was placed [rad]."""

    def is_passed(self, before: Point, after: Point, half_width: float, travel: float) -> bool:
        """Whether the step from `before` to `after` goes through the door in its direction.

        It stands a hair beyond its place, where a step began: who goes to and fro in a pocket begins there again and again,
        and never before it. A door that stands right before a corner is passed in the turn: then the direction of travel
        [rad] of the step before counts.
        """
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        x0, y0 = before[0] - self.place[0], before[1] - self.place[1]
        x1, y1 = after[0] - self.place[0], after[1] - self.place[1]
        along0, along1 = cos * x0 + sin * y0, cos * x1 + sin * y1
        if not along0 < HAIR <= along1:
            return False
        share = (HAIR - along0) / (along1 - along0)
        lateral = cos * (y0 + share * (y1 - y0)) - sin * (x0 + share * (x1 - x0))
        return abs(lateral) <= half_width and (
            along1 - along0 > 0.5 * math.dist(before, after) or math.cos(travel - self.heading) > 0.5
        )


@dataclass
class Contour:
    """What a bug keeps while it follows one boundary."""

    side: int
    """+1: the wall is on the right; -1: on the left."""
    hit: Point
    """Where it met the boundary, odometry frame [m]."""
    wall: Point
    """The point of the wall that the hand is on, odometry frame [m]."""
    position: Point
    """Own place at the last decision, odometry frame [m]."""
    goal: Point
    """Where the target was when the lap began, odometry frame [m]."""
    approach: float
    """Direction in which it came to the hit point, odometry frame [rad]."""
    been: Point | None = None
    """Where it has been long before, at its first hit point, odometry frame [m]; None: nothing is known."""
    hit_distance: float = math.inf
    """From the hit point to the goal [m]."""
    before: Point = (0.0, 0.0)
    """Own place at the decision before, odometry frame [m]."""
    heading: float | None = None
    """Direction of the last step, odometry frame [rad]; None before the first."""
    heading_before: float = 0.0
    """Direction of the step before the last, odometry frame [rad]."""
    sweep: float = 0.0
    """Turning that the next step will add, more than half a turn in a narrow wedge [rad]."""
    asked: float | None = None
    """Direction asked for at the last decision, odometry frame [rad]; None where the robot has moved since."""
    asked_for: int = 0
    """Decisions since the robot moved."""
    odometer: float = 0.0
    """Length walked along the boundary [m]."""
    turned: float = 0.0
    """Total turning since the hit [rad]; a closed lap adds or takes 2 pi."""
    wound: float = 0.0
    """How far the bearing of the goal has gone round since the hit [rad]; a lap about the goal adds or takes 2 pi."""
    steps: int = 0
    """Steps with motion since the hit."""
    aligned: int = 0
    """Steps in a row on the contour without turning away from the wall."""
    gate: Gate | None = None
    """Door where the lap began; None until the robot goes along the wall."""
    check: Gate | None = None
    """Another one, set anew where the robot is each time it has come twice as far (Brent 1980): a way that has left the gate
    behind and goes round elsewhere, with a full turn or without, leads through this one again."""
    lost_gates: int = 0
    """Gates that the way no longer led through, so that another was placed."""
    is_lap_closed: bool = False
    """Whether the last step passed the gate, after a lap among still obstacles."""
    is_disturbed: bool = False
    """Whether something near has been seen to move in this lap, which proves nothing then."""
    way_out: float = math.inf
    """Smallest distance to the goal of the places on it where the bug did not leave, but would have with less asked of it:
    a way that is free, if only as far as the next obstacle, or an M-line beside it [m]."""
    takes_less: bool = False
    """Whether less is asked, because a whole lap had no better place to leave than such ones."""
    has_no_other: bool = False
    """Whether it was left for less twice, which led back to the hit point: such places are no way out."""
    vain_laps: int = 0
    """Laps that ended with the goal on the robot's side of them: they prove nothing."""
    crossings: int = 0
    """How often the gate was passed without a full turn: the way crosses itself in a gap that is one from one side only."""
    crossed: float = 0.0
    """Length walked along the boundary when that happened last [m]."""
    waited: float = 0.0
    """Time without an open heading [s]."""
    backed_from: Point | None = None
    """Where it had none for so long that it backed the way it came, the last time."""
    is_exact: bool = False
    """Whether corners are not rounded for now."""
    foot: tuple[float, float, float] | None = None
    """Where the contour is nearest to a robot that rounds its corners, odometry frame [m], and its heading there [rad]."""
    course: NDArray[np.float64] | None = None
    """(k, 2) how the contour leads on from there, the robot's own place first, in its frame now [m]."""


@dataclass
class BugMemory(Memory):
    """Memory of a bug: what it follows now, and where it hit and left boundaries."""

    contour: Contour | None = None
    """The boundary that it follows; None while it goes to the goal."""
    landing: Contour | None = None
    """The boundary onto which it turns from its straight way on an arc, and will follow then; None elsewhere."""
    hits: list[Point] = field(default_factory=list)
    """Hit points, odometry frame [m]."""
    leaves: list[Point] = field(default_factory=list)
    """Leave points, odometry frame [m]."""
    hit_sides: list[int] = field(default_factory=list)
    """Side taken at each hit point."""
    hit_odometers: list[float] = field(default_factory=list)
    """Length of the whole way at each hit point [m]."""
    fresh_starts: int = 0
    """How often it has begun anew where it went round in vain."""
    is_fresh: bool = False
    """Whether it begins anew from where it is: what it measured on the way here means nothing."""
    left_for_less: bool = False
    """Whether the last boundary was left with less asked."""
    vain_leaves: int = 0
    """How often in a row that led back to the same hit point."""
    odometer: float = 0.0
    """Length of the way so far by odometry [m]."""
    position: Point | None = None
    """Own place at the last decision, odometry frame [m]."""
    glances: list[View] = field(default_factory=list)
    """Earlier observations, the oldest first, to see what has moved since."""
    glance_age: float = 0.0
    """How long ago the last one was [s]."""


Kept = TypeVar("Kept", bound=Contour | BugMemory)


def copied(kept: Kept) -> Kept:
    """The same once more, lists in it shared: as copy.copy gives it, in a quarter of the time."""
    other = object.__new__(type(kept))
    vars(other).update(vars(kept))
    return other
