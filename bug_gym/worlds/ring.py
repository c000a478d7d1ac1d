"""A closed ring round the goal or the start: there is no way."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Goal, Point, Positive, Start
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import border_of, draw_goal, draw_start, finish
from bug_gym.worlds.polygons import rectangle


class RingWorld(Family):
    """A square ring with no way through, round the goal or round the start."""

    family: Literal["ring"]
    centre: Point = (0.0, 0.0)
    """Middle of the ring x, y [m]."""
    outer: Positive = 4.0
    """Half the outer side [m]."""
    inner: Positive = 3.5
    """Half the inner side [m]."""
    inside: Literal["goal", "start"] = "goal"
    """Which of the two is shut in."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere on its side of the ring."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere on its side of the ring."""

    def check(self, robot: Robot) -> None:
        """The ring lies within the bounds, start and goal on their sides of it."""
        if self.inner >= self.outer:
            raise wrong(f"got {self.inner:g}, expected less than outer ({self.outer:g})", "inner")
        (x, y), side = self.centre, self.outer
        if not self.holds_box((x - side, y - side, x + side, y + side)):
            raise wrong(f"got {self.outer:g}, expected a ring within bounds {list(self.box)}", "outer")
        if self.inside == "start" and self.inner < robot.reach:
            raise wrong(f"got {self.inner:g}, expected at least the robot's reach ({robot.reach:g})", "inner")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        if isinstance(self.start, tuple):
            self._check_side("start", self.start[:2], robot.reach)
        if isinstance(self.goal, tuple):
            self._check_side("goal", self.goal, 0.0)

    def _check_side(self, key: str, point: tuple[float, float], radius: float) -> None:
        """A disc of `radius` about the point lies inside, or outside, of the ring."""
        dx, dy = abs(point[0] - self.centre[0]), abs(point[1] - self.centre[1])
        if self.inside == key and max(dx, dy) + radius > self.inner:
            raise wrong(f"got {list(point)}, expected a place inside the ring, as `inside: {key}` says", key)
        if self.inside != key and math.hypot(max(dx - self.outer, 0.0), max(dy - self.outer, 0.0)) < max(radius, 1e-9):
            raise wrong(f"got {list(point)}, expected a place outside the ring, for {self.inside!r} is inside", key)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A closed square ring round the goal, or round the start."""
        x, y = self.centre
        outer = rectangle(x - self.outer, y - self.outer, x + self.outer, y + self.outer)
        inner = rectangle(x - self.inner, y - self.inner, x + self.inner, y + self.inner)
        clear = is_clear(np.zeros((0, 3)), ((outer, inner),), border_of(self), crew.robot.reach)

        def shut_in(px: float, py: float) -> bool:
            return clear(px, py) and max(abs(px - x), abs(py - y)) < self.inner

        def outside(px: float, py: float) -> bool:
            return clear(px, py) and max(abs(px - x), abs(py - y)) > self.outer

        start_free, goal_free = (outside, shut_in) if self.inside == "goal" else (shut_in, outside)
        start = draw_start(crew, self, self.start, rng, start_free)
        goal = draw_goal(self, self.goal, rng, goal_free)
        return finish(crew, self, start, goal, polygons=((outer, inner),))
