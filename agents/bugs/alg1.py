"""Alg1: Bug2 that remembers all hit and leave points and turns round once where it meets one of them again.

Source: Sankaranarayanan and Vidyasagar (1990). Sensing assumed: contact (here the scan within the clearance), goal, own
position. Memory kept: the M-line, the smallest distance to the goal on it, all hit and leave points, the trace along
the present boundary. States: motion_to_goal, boundary_following, walking_back. Guarantee: reaches the goal or declares
it unreachable. Length: at most D + 2 sum(p_i), p_i the perimeter of obstacle i at the clearance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.contour import Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.agents.walls.m_line import MLine, MLineBug, MLineMemory, go_along_until_hit, nearer_crossing
from bug_gym.agents.walls.turning_round import (
    TurningMemory,
    forget_marks,
    hit_and_trace,
    leave_and_mark,
    trace_contour,
    walk_back,
)
from bug_gym.policy import Velocity
from bug_gym.view import View


@dataclass
class Alg1Memory(MLineMemory, TurningMemory):
    """Memory of Alg1."""

    nearest: float = math.inf
    """Smallest distance to the goal of the places on the M-line visited so far [m]."""


class Alg1(MLineBug):
    """Alg1; its parameters are those of MLineBug."""

    def start(self) -> Alg1Memory:
        """Memory of a new episode."""
        return Alg1Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Alg1Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        line = self.m_line(view, memory)
        if memory.contour is not None and not memory.is_turning:
            self._watch(view, memory, memory.contour, line)
        if memory.is_turning:
            velocity = walk_back(boundary, view, memory)
            if velocity is not None:
                memory.mode = "walking_back"
                return velocity
        if memory.contour is None:
            if memory.landing is None:
                memory.nearest = min(memory.nearest, view.goal_distance)
            velocity = go_along_until_hit(boundary, view, memory, self.next_side(memory), line)
            if velocity is not None:
                memory.mode = "motion_to_goal"
                return velocity
            contour = hit_and_trace(boundary, view, memory, self.next_side(memory), view.goal_bearing)
            memory.nearest = min(memory.nearest, contour.hit_distance)
        memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def _watch(self, view: View, memory: Alg1Memory, contour: Contour, line: MLine) -> None:
        """Leave the boundary, give up, or turn round, where the last step allows it or demands it."""
        if self._may_leave(view, memory, contour, line):
            leave_and_mark(self.boundary, view, memory)
        elif is_proof(contour):
            memory.verdict = "unreachable"
        else:
            trace_contour(self.boundary, view, memory)

    def _may_leave(self, view: View, memory: Alg1Memory, contour: Contour, line: MLine) -> bool:
        """Whether the last step crossed the M-line nearer to the goal than ever before, with a free way on."""
        distance = nearer_crossing(self.boundary, view, contour, line, memory.nearest)
        if distance is None:
            return False
        memory.nearest = distance
        return self.boundary.may_go_on(view, contour)

    def forget_distances(self, view: View, memory: Alg1Memory) -> None:
        """Nothing is nearer than the start of the new line, and marks met on the way to another goal mean nothing."""
        memory.nearest = view.goal_distance
        forget_marks(memory)

    def next_side(self, memory: Alg1Memory) -> int:
        """Side to turn to at the next hit point."""
        return self.side
