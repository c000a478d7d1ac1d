"""Alg2: leave a wall nearer to the goal than ever before; turn round once where an earlier hit or leave point is met.

Source: Sankaranarayanan and Vidyasagar (1990). Sensing assumed: contact (here the scan within the clearance), goal, own
position. Memory kept: the smallest distance to the goal on the whole trip, all hit and leave points, the trace along
the present boundary. States: motion_to_goal, boundary_following, walking_back. Guarantee: reaches the goal or declares
it unreachable. Length: at most D + 2 sum(p_i), p_i the perimeter of obstacle i at the clearance. `leave_rule` says the
same either way, as in class1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.boundary import FRESH_STARTS
from bug_gym.agents.walls.boundary_bug import BoundaryBug
from bug_gym.agents.walls.contour import TARGET_MOVED, Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.agents.walls.turning_round import (
    TurningMemory,
    forget_marks,
    hit_and_trace,
    leave_and_mark,
    trace_contour,
    walk_back,
)
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.view import View


@dataclass
class Alg2Memory(TurningMemory):
    """Memory of Alg2."""

    nearest: float = math.inf
    """Smallest distance to the goal on the trip before this decision [m]."""
    goal: Point | None = None
    """The target that this distance belongs to, odometry frame [m]."""


class Alg2(BoundaryBug):
    """Alg2; its parameters are those of BoundaryBug."""

    fresh_starts = FRESH_STARTS

    def start(self) -> Alg2Memory:
        """Memory of a new episode."""
        return Alg2Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Alg2Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        self._follow_target(view, memory)
        velocity = self._decide(view, memory)
        memory.nearest = min(memory.nearest, view.goal_distance)
        return velocity

    def _follow_target(self, view: View, memory: Alg2Memory) -> None:
        """Distances and marks belong to a target that stands; begin anew when it has moved, or after vain laps."""
        if memory.goal is None or memory.is_fresh or math.dist(memory.goal, view.goal_position) > TARGET_MOVED:
            memory.goal, memory.is_fresh = view.goal_position, False
            memory.nearest = view.goal_distance
            forget_marks(memory)

    def _decide(self, view: View, memory: Alg2Memory) -> Velocity:
        boundary = self.boundary
        if memory.contour is not None and not memory.is_turning:
            self.watch(view, memory, memory.contour)
        if memory.is_turning:
            velocity = walk_back(boundary, view, memory)
            if velocity is not None:
                memory.mode = "walking_back"
                return velocity
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, self.next_side(memory), view.goal_bearing)
            if velocity is not None:
                memory.mode = "motion_to_goal"
                return velocity
            self.hit(view, memory)
        memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def hit(self, view: View, memory: Alg2Memory) -> None:
        """Begin to follow what blocks the way to the goal."""
        contour = hit_and_trace(self.boundary, view, memory, self.next_side(memory), view.goal_bearing)
        memory.nearest = min(memory.nearest, contour.hit_distance)

    def next_side(self, memory: Alg2Memory) -> int:
        """Side to turn to at the next hit point."""
        return self.side

    def watch(self, view: View, memory: Alg2Memory, contour: Contour) -> None:
        """Leave the boundary, give up, or turn round, where the last step allows it or demands it."""
        if self.boundary.may_leave(view, contour, is_nearer=view.goal_distance < memory.nearest):
            leave_and_mark(self.boundary, view, memory)
        elif is_proof(contour):
            memory.verdict = "unreachable"
        else:
            trace_contour(self.boundary, view, memory)
