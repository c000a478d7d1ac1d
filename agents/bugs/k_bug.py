"""K-Bug: round the obstacle in the way by the shorter chain of its vertices in sight.

Source: Langer, Coelho and Oliveira (2007), whose paper is not at hand, as Hasibuzzaman, Jan and Wu report it: it
analyses the boundary of an obstacle for the shortest way round it, and keeps track of the points where the bug collides
with obstacles to tell how to go round them. Assumed here: which vertices are looked at, those of the blocking obstacle
in sight, and how ways over them are measured, as taut strings at the clearance (walls/vertex_chain.py) with all that is
out of sight as free; that a collision point met again means the other side; a disc in place of a point. Sensing assumed: a
scan all round; goal, own position. Memory kept: the collision points, where the straight way to the goal was blocked, and the
side taken at each. States: motion_to_goal, motion_to_sub_goal, corner_rounding. Where the straight way is blocked the
robot takes the shorter one of two chains of vertices to the goal, one past the left end in sight of what blocks it, one
past the right end; at the chain's first vertex it looks again. At a collision point met again it takes the other side.
Guarantee: none, it can cycle (then "looping"); without an end in sight it stops as "stuck". Length bound: none.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import NamedTuple

from bug_gym.agents.walls.open_points import (
    OpenPoint,
    Profile,
    blocking_surface,
    cheapest,
    rotation_to,
)
from bug_gym.agents.walls.sub_goal_bug import SubGoalBug
from bug_gym.agents.walls.sub_goals import SubGoalMemory
from bug_gym.agents.walls.vertex_chain import VertexChain, chain_past
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
    chain: list[Point] = field(default_factory=list)
    """Vertices of the way chosen last, odometry frame [m]."""


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
        chains = {end: self._chain_over(view, end, surface) for end in (left, right)}
        chosen = cheapest([left, right], lambda end: chains[end].length, self.side)
        way, bearing = min(profile.goal_way, view.goal_distance), view.goal_bearing
        place = view.to_odometry(way * math.cos(bearing), way * math.sin(bearing))
        last = self._met_before(memory, place)
        if last is not None:
            chosen = right if last.side > 0 else left
        memory.collisions.append(Collision(place, 1 if chosen == left else -1, memory.odometer))
        memory.chain = [] if chosen is None else [view.to_odometry(*vertex) for vertex in chains[chosen].vertices]
        return chosen

    def _met_before(self, memory: KBugMemory, place: Point) -> Collision | None:
        """The last earlier collision at a place, the robot having been elsewhere in between."""
        for collision in reversed(memory.collisions):
            is_same = math.dist(collision.place, place) <= self.sub_goals.same
            if is_same and memory.odometer - collision.odometer > self.sub_goals.boundary.arming_length:
                return collision
        return None

    def _chain_over(self, view: View, end: OpenPoint, surface: F64) -> VertexChain:
        """The chain of vertices in sight that begins at an end and goes past what blocks the way to the goal."""
        boundary = self.sub_goals.boundary
        return chain_past(surface, end.corner, view.goal, end.side, boundary.clearance, boundary.inner)

    def draw(self, memory: KBugMemory) -> Drawing:
        """Sub-goals, the present corner, the collision points and the chain of vertices chosen last."""
        drawing = super().draw(memory)
        chain = [(*begin, *until, "chain") for begin, until in itertools.pairwise(memory.chain)]
        hits = [(*collision.place, "hit") for collision in memory.collisions]
        return Drawing(points=[*drawing.points, *hits], segments=chain)
