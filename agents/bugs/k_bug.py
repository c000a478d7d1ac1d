"""K-Bug: round the obstacle in the way by the better one of its two ends in sight.

Source: Langer, Coelho and Oliveira (2007), as reported by Hasibuzzaman, Jan and Wu; neither says enough for a program,
so this is a reconstruction. Sensing assumed: a scan all round; goal, own position. Memory kept: the collision points,
where the straight way to the goal was blocked, and the side taken at each. States: motion_to_goal, motion_to_sub_goal,
corner_rounding. Where the straight way is blocked the robot compares the left and the right end in sight of what blocks
it, by the way over the end to the goal, and over the next corner too where the same obstacle is seen to block the way
on. At a collision point met again it takes the other side. Guarantee: none, it can cycle (then "looping"); without an
end in sight it stops as "stuck". Length bound: none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from bug_gym.agents.walls.open_points import (
    OpenPoint,
    Profile,
    blocking_surface,
    cheapest,
    goal_distance_of,
    rotation_to,
)
from bug_gym.agents.walls.sub_goal_bug import SubGoalBug
from bug_gym.agents.walls.sub_goals import SubGoalMemory
from bug_gym.geometry import F64, Point
from bug_gym.policy import Drawing
from bug_gym.view import View


class Collision(NamedTuple):
    """A collision point."""

    place: Point
    """Where the robot would stand at the end of the straight way to the goal, odometry frame [m]."""
    side: int
    """Side taken there: +1 past the left end, -1 past the right one."""
    odometer: float
    """Length of the whole way then [m]."""


@dataclass
class KBugMemory(SubGoalMemory):
    """Memory of K-Bug."""

    collisions: list[Collision] = field(default_factory=list)
    """Collision points so far."""


class KBug(SubGoalBug):
    """K-Bug; its parameters are those of SubGoalBug."""

    def start(self) -> KBugMemory:
        """Memory of a new episode."""
        return KBugMemory(mode="motion_to_goal")

    def choose(self, view: View, memory: KBugMemory, profile: Profile) -> OpenPoint | None:
        """The end of what blocks the way to the goal that is to be taken; None where neither is in sight."""
        points = self.sub_goals.other_points(view, memory, profile)
        if not points:
            return None
        # The first open point met on each side: the end itself, or that of something nearer which hides it.
        left, right = (min(points, key=lambda point: rotation_to(point, side)) for side in (1, -1))
        surface = blocking_surface(view, profile)
        chosen = cheapest([left, right], lambda end: self._way_over(view, end, surface), self.side)
        way, bearing = min(profile.goal_way, view.goal_distance), view.goal_bearing
        place = view.to_odometry(way * math.cos(bearing), way * math.sin(bearing))
        last = self._met_before(memory, place)
        if last is not None:
            chosen = right if last.side > 0 else left
        memory.collisions.append(Collision(place, 1 if chosen == left else -1, memory.odometer))
        return chosen

    def _met_before(self, memory: KBugMemory, place: Point) -> Collision | None:
        """The last earlier collision at a place, the robot having been elsewhere in between."""
        for collision in reversed(memory.collisions):
            is_same = math.dist(collision.place, place) <= self.sub_goals.same
            if is_same and memory.odometer - collision.odometer > self.sub_goals.boundary.arming_length:
                return collision
        return None

    def _way_over(self, view: View, end: OpenPoint, surface: F64) -> float:
        """Length of the way over an end, and over the next corner if one is seen to be in the way, to the goal [m]."""
        place = end.sub_goal(self.sub_goals.boundary.clearance)
        corner = self._next_corner(view, place, end.side, surface)
        if corner is None:
            return math.hypot(*place) + goal_distance_of(view, place)
        return math.hypot(*place) + math.dist(place, corner) + goal_distance_of(view, corner)

    def _next_corner(self, view: View, place: Point, side: int, surface: F64) -> Point | None:
        """Where a robot that goes on to the goal passes the same obstacle once more; None where it sees a free way."""
        goal = np.array(view.goal)
        distance = math.dist(place, view.goal)
        ahead = (goal - place) / max(distance, 1e-9)
        left = np.array([-ahead[1], ahead[0]])
        offset = surface - place
        along, beside = offset @ ahead, side * (offset @ left)
        between = (along > 0.0) & (along < distance)
        if not (between & (np.abs(beside) < self.sub_goals.boundary.inner)).any():
            return None
        last = surface[np.where(between, beside, -np.inf).argmax()]
        x, y = last + side * self.sub_goals.boundary.clearance * left
        return float(x), float(y)

    def draw(self, memory: KBugMemory) -> Drawing:
        """Sub-goals, the present corner and the collision points."""
        drawing = super().draw(memory)
        return Drawing(points=[*drawing.points, *((*collision.place, "hit") for collision in memory.collisions)])
