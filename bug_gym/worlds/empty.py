"""Worlds with nothing in them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Motion
from bug_gym.schema.movers import Target
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Goal, NotNegative, Start
from bug_gym.worlds.clearance import is_clear
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.moving import drawn_goal_room, goal_room, target_motion, target_place
from bug_gym.worlds.places import border_of, draw_both, finish


class EmptyWorld(Family):
    """Nothing but the border, a start and a goal."""

    family: Literal["empty"]
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    target: Target | None = None
    """A moving goal, instead of `goal`."""
    separation: NotNegative = 0.0
    """Least distance from start to goal [m]."""

    def motions(self) -> Iterator[tuple[str, Motion]]:
        """Of the goal."""
        if self.target is not None:
            yield "target.motion", self.target.motion

    def check(self, robot: Robot) -> None:
        """Start and goal lie within the bounds, and far enough apart."""
        if self.goal is not None and self.target is not None:
            raise wrong("expected either goal or target, got both", "target")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        self.check_target(self.target)
        self.check_separation(self.separation, self.start, self.goal if self.target is None else self.target.at)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Nothing but the border."""
        border = border_of(self)
        start_free = is_clear(np.zeros((0, 3)), (), border, crew.robot.reach)
        goal_free = is_clear(np.zeros((0, 3)), (), border, drawn_goal_room(crew, self.target))
        goal = target_place(self, self.goal, self.target)
        start, place = draw_both(crew, self, self.start, goal, rng, start_free, goal_free, self.separation)
        return finish(
            crew, self, start, place, target=target_motion(self.target, rng), goal_room=goal_room(crew, self.target)
        )
