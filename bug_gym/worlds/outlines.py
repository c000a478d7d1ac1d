"""Where there is room among walls, and places drawn there, in compiled code: the same as `clearance` and `places` have it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.geometry import F64, Point
from bug_gym.kernels.free_place import draw_start_and_goal, fits
from bug_gym.kernels.generator import give_back, taken
from bug_gym.kernels.layout import Integers
from bug_gym.worlds.clearance import Free
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng


class Outlines(NamedTuple):
    """A border and polygons without holes, as compiled code reads them."""

    corners: F64
    """Corners (n, 2) of the border, then of the polygons [m]."""
    firsts: Integers
    """Where each of them begins (rings + 1,)."""

    def clear(self, room: float) -> Free:
        """A test whether a disc of radius `room` [m] fits at a point, 20 times as fast as that of `is_clear`."""
        return lambda x, y: fits(self.corners, self.firsts, x, y, room)

    def draw_both(
        self, crew: Crew, world: DrawnPlaces, rng: Rng, tries: int
    ) -> tuple[tuple[float, float, float], Point] | None:
        """The start and the goal that `places.draw_both` draws.

        None, and nothing drawn, where that has to draw them: where the scenario says a place, for robots in a row, where
        there is no such pair, and where rounding could decide.
        """
        start, goal, box = world.start, world.goal, world.box
        words = taken(rng)
        is_row = crew.robots.count > 1 and not crew.robots.places
        if words is None or is_row or isinstance(start, tuple) or isinstance(goal, tuple):
            return None
        found = np.empty(5)
        is_found = draw_start_and_goal(
            words,
            self.corners,
            self.firsts,
            crew.robot.reach,
            box if start is None else start.region,
            math.nan if start is None or start.heading is None else start.heading,
            box if goal is None else goal.region,
            world.separation,
            tries,
            found,
        )
        if not is_found:
            return None
        give_back(rng, words)
        x, y, heading, goal_x, goal_y = found.tolist()
        return (x, y, heading), (goal_x, goal_y)
