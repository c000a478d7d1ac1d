"""A U-shaped trap: the classic dead end."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.schema.polygons import Bounds
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Goal, Number, Positive, Rotation, Start
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import border_of, draw_both, finish
from bug_gym.worlds.polygons import turned


class UTrapWorld(Family):
    """A U that opens toward -x: two arms along x and a base across their ends.

        mouth_x    depth    wall
           +----------------+--+
           +----------------+  |   wall
    start                   |  |   half_width    goal
           +----------------+  |
           +----------------+--+
    """

    family: Literal["u_trap"]
    bounds: Bounds = (-5.0, -10.0, 25.0, 10.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    half_width: Positive = 3.0
    """From the axis y = 0 to the inner side of an arm [m]."""
    depth: Positive = 6.0
    """From the mouth to the inner side of the base [m]."""
    wall: Positive = 1.0
    """Thickness of the arms and of the base [m]."""
    mouth_x: Number = 5.0
    """x of the mouth, before the trap is turned [m]."""
    rotation: Rotation = 0.0
    """Angle by which the trap is turned about the middle of its bounding box [rad], or `random`."""
    start: Start = (0.0, 0.0, 0.0)
    """x [m], y [m], heading [rad], or a region to draw from."""
    goal: Goal = (20.0, 0.0)
    """x, y [m], or a region to draw from."""

    @property
    def centre(self) -> tuple[float, float]:
        """Middle of the trap's bounding box x, y [m], about which it is turned."""
        return self.mouth_x + (self.depth + self.wall) / 2.0, 0.0

    def check(self, robot: Robot) -> None:
        """The trap, start and goal lie within the bounds."""
        x, y = self.centre
        half_length, half_height = (self.depth + self.wall) / 2.0, self.half_width + self.wall
        if self.rotation != 0.0:
            half_length = half_height = math.hypot(half_length, half_height)
        needed = (x - half_length, y - half_height, x + half_length, y + half_height)
        self.check_holds(needed, "trap")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A U that opens toward -x, turned about its middle."""
        x0, x1, x2 = self.mouth_x, self.mouth_x + self.depth, self.mouth_x + self.depth + self.wall
        inner, outer = self.half_width, self.half_width + self.wall
        outside = [(x0, -outer), (x2, -outer), (x2, outer), (x0, outer)]
        ring = np.array([*outside, (x0, inner), (x1, inner), (x1, -inner), (x0, -inner)])
        ring = turned(ring, self.centre, self.rotation, rng)
        free = is_clear(np.zeros((0, 3)), ((ring,),), border_of(self), crew.robot.reach)
        start, goal = draw_both(crew, self, self.start, self.goal, rng, free, free, 0.0)
        return finish(crew, self, start, goal, polygons=((ring,),))
