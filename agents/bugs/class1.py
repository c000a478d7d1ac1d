"""Class1: Bug0 that leaves a wall only where it is nearer to the goal than ever before.

Source: Noborio (1992); rules as compared by McGuire et al. (2019). Sensing assumed: contact (here the scan within the
clearance), goal. Memory kept: the smallest distance to the goal on the whole way, a gate at the last hit point. States:
motion_to_goal, boundary_following. Guarantee: reaches the goal or declares it unreachable, when a lap brings no nearer
point with a free way. Length: at most D and one perimeter a hit.

A step that brings it nearer than ever leads toward the goal: `leave_rule` says the same either way, but for places where
less is asked (walls/laps.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.boundary import FRESH_STARTS
from bug_gym.agents.walls.boundary_bug import BoundaryBug
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory
from bug_gym.agents.walls.laps import is_proof
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.view import View


@dataclass
class Class1Memory(BugMemory):
    """Memory of Class1."""

    least_distance: float = math.inf
    """Smallest distance to the goal at any decision before this one [m]."""
    goal: Point | None = None
    """Where the target was when that was first measured, odometry frame [m]."""


class Class1(BoundaryBug):
    """Class1; its parameters are those of BoundaryBug."""

    fresh_starts = FRESH_STARTS

    def start(self) -> Class1Memory:
        """Memory of a new episode."""
        return Class1Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Class1Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        is_nearer = self._is_nearer(view, memory)
        contour = memory.contour
        if contour is not None:
            if boundary.may_leave(view, contour, is_nearer=is_nearer):
                boundary.leave(view, memory)
                memory.mode = "motion_to_goal"
            elif is_proof(contour):
                memory.verdict = "unreachable"
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, self.side, view.goal_bearing)
            if velocity is not None:
                return velocity
            contour = boundary.hit(view, memory, self.side, view.goal_bearing)
            memory.least_distance = min(memory.least_distance, contour.hit_distance)
            memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def _is_nearer(self, view: View, memory: Class1Memory) -> bool:
        """Whether it is nearer to the goal than ever before; a target that moved away begins a new record."""
        if memory.goal is None or memory.is_fresh or math.dist(memory.goal, view.goal_position) > TARGET_MOVED:
            memory.goal, memory.is_fresh = view.goal_position, False
            memory.least_distance = math.inf
        is_nearer = view.goal_distance < memory.least_distance
        memory.least_distance = min(memory.least_distance, view.goal_distance)
        return is_nearer
