"""A box with a slit: the way out leads away from the goal."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.schema.errors import wrong
from bug_gym.schema.polygons import Bounds
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Goal, Number, Point, Positive, Rotation, Start
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import border_of, draw_both, finish
from bug_gym.worlds.polygons import turned


class HookWorld(Family):
    """A square box with a slit in its upper wall, turned about its middle: the way out leads away from the goal.

    +------+    +--------+
    | +----+slit+------+ |   wall
    | |                | |
    | | start          | |          goal
    | |                | |
    | +----------------+ |
    +--------------------+
    """

    family: Literal["hook"]
    bounds: Bounds = (-5.0, -12.0, 35.0, 12.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    centre: Point = (10.0, 0.0)
    """Middle of the box x, y [m]."""
    half_side: Positive = 6.0
    """Half the outer side [m]."""
    wall: Positive = 1.0
    """Thickness of the walls [m]."""
    slit: Positive = 2.0
    """Width of the slit [m]."""
    slit_at: Number = -1.0
    """From the middle of the box to that of the slit, along x [m]."""
    rotation: Rotation = 0.0
    """Angle by which the box is turned about its middle [rad], or `random`."""
    start: Start = (7.0, 0.0, 0.0)
    """x [m], y [m], heading [rad], or a region to draw from."""
    goal: Goal = (30.0, 0.0)
    """x, y [m], or a region to draw from."""

    def check(self, robot: Robot) -> None:
        """The robot fits through the slit, the slit into the wall, and the box, start and goal into the bounds."""
        self.check_width(self.slit, robot, "slit")
        inner = self.half_side - self.wall
        if abs(self.slit_at) + 0.5 * self.slit > inner:
            raise wrong(f"got {self.slit:g}, expected a slit between the inner corners, +-{inner:g}", "slit")
        (x, y), half = self.centre, self.half_side
        if self.rotation != 0.0:
            half *= math.sqrt(2.0)
        needed = (x - half, y - half, x + half, y + half)
        self.check_holds(needed, "box")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A square box with a slit in its upper wall, turned about its middle."""
        (x, y), outer, inner = self.centre, self.half_side, self.half_side - self.wall
        left, right = x + self.slit_at - 0.5 * self.slit, x + self.slit_at + 0.5 * self.slit
        outside = [(right, y + outer), (x + outer, y + outer), (x + outer, y - outer), (x - outer, y - outer)]
        inside = [(left, y + inner), (x - inner, y + inner), (x - inner, y - inner), (x + inner, y - inner)]
        upper_left = [(x - outer, y + outer), (left, y + outer)]
        ring = np.array([*outside, *upper_left, *inside, (x + inner, y + inner), (right, y + inner)])
        ring = turned(ring, self.centre, self.rotation, rng)
        free = is_clear(np.zeros((0, 3)), ((ring,),), border_of(self), crew.robot.reach)
        start, goal = draw_both(crew, self, self.start, self.goal, rng, free, free, 0.0)
        return finish(crew, self, start, goal, polygons=((ring,),))
