"""Com1: Bug0 that leaves a wall only nearer to the goal than where it hit it.

Source: Sankaranarayanan and Vidyasagar (1990); rules as compared by McGuire et al. (2019) and Oni and Wang. Sensing
assumed: contact (here the scan within the clearance), goal. Memory kept: the distance to the goal at the last hit
point, a gate there. States: motion_to_goal, boundary_following. Guarantee: reaches the goal or declares it
unreachable, when a lap brings no nearer point with a free way. Length: at most D and one perimeter a hit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.boundary import FRESH_STARTS
from bug_gym.agents.walls.boundary_bug import BoundaryBug
from bug_gym.agents.walls.contour import CLOSER, TARGET_MOVED, BugMemory, Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.view import View


@dataclass
class Com1Memory(BugMemory):
    """Memory of Com1."""

    hit_distance: float = math.inf
    """Distance to the goal at the last hit point [m]."""
    goal: Point = (0.0, 0.0)
    """Where the target was when that was measured, odometry frame [m]."""


class Com1(BoundaryBug):
    """Com1; its parameters are those of BoundaryBug."""

    fresh_starts = FRESH_STARTS

    def start(self) -> Com1Memory:
        """Memory of a new episode."""
        return Com1Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Com1Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        contour = memory.contour
        if contour is not None:
            if math.dist(memory.goal, view.goal_position) > TARGET_MOVED:
                self._measure(view, memory, view.goal_distance)
            if self._may_leave(view, memory, contour):
                boundary.leave(view, memory)
                memory.mode = "motion_to_goal"
            elif is_proof(contour):
                memory.verdict = "unreachable"
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, self.side, view.goal_bearing)
            if velocity is not None:
                return velocity
            contour = boundary.hit(view, memory, self.side, view.goal_bearing)
            self._measure(view, memory, contour.hit_distance)
            memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def _measure(self, view: View, memory: Com1Memory, distance: float) -> None:
        """Take a distance [m] for that of the hit point."""
        memory.hit_distance = distance
        memory.goal = view.goal_position

    def _may_leave(self, view: View, memory: Com1Memory, contour: Contour) -> bool:
        """Whether it is nearer to the goal than at the hit point, with a free way on."""
        is_nearer = view.goal_distance <= memory.hit_distance - CLOSER * self.boundary.step
        return self.boundary.may_leave(view, contour, is_nearer=is_nearer)
