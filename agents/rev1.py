"""Rev1: Alg1 that takes the other side at each new hit point.

Source: Horiuchi and Noborio (2001). Sensing assumed: contact (here the scan within the clearance), goal, own position.
Memory kept: the M-line, the smallest distance to the goal on it, all hit and leave points, the side taken last, the
trace along the present boundary. States: motion_to_goal, boundary_following, walking_back. Guarantee: reaches the goal
or declares it unreachable. Length: at most D + 2 sum(p_i), p_i the perimeter of obstacle i at the clearance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import (
    TARGET_MOVED,
    Boundary,
    Contour,
    LeaveRule,
    MLine,
    Turn,
    TurningMemory,
    alternating_side,
    go_along,
    side_of,
)

ON_LINE = 0.1
"""How near to the M-line is on it, and how much nearer to the goal is nearer, in steps: the line is known exactly."""


@dataclass
class Rev1Memory(TurningMemory):
    """Memory of Rev1."""

    line: MLine | None = None
    """The M-line."""
    nearest: float = math.inf
    """Smallest distance to the goal of the places on the M-line visited so far [m]."""


class Rev1(ScriptedPolicy):
    """Rev1.

    Args:
        sensors: what a driver knows of the robot.
        clearance: centre to wall while following [m]; None: body radius and one step.
        turn: which way to turn at the first wall; it alternates.
        leave_rule: "any": leave at a crossing wherever the goal lies (the algorithm as published); "front": only with
            the goal within 90 degrees of the direction of travel.
        discrete: whether actions are numbers of the discrete table.

    Raises:
        ValueError: a clearance not above the radius, an unknown turn or rule.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        turn: Turn = "left",
        leave_rule: LeaveRule = "any",
        discrete: bool = False,
    ) -> None:
        super().__init__(sensors, discrete=discrete)
        self.boundary = Boundary(sensors, clearance=clearance, leave_rule=leave_rule)
        self.side = side_of(turn)

    def start(self) -> Rev1Memory:
        """Memory of a new episode."""
        return Rev1Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Rev1Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        line = self._line(view, memory)
        if memory.contour is not None and not memory.is_turning:
            self._watch(view, memory, memory.contour, line)
        if memory.is_turning:
            velocity = boundary.walk_back(view, memory)
            if velocity is not None:
                memory.mode = "walking_back"
                return velocity
        if memory.contour is None:
            memory.nearest = min(memory.nearest, view.goal_distance)
            velocity = go_along(boundary, view, line)
            if velocity is not None:
                memory.mode = "motion_to_goal"
                return velocity
            boundary.hit_and_trace(view, memory, alternating_side(memory, self.side), view.goal_bearing)
        memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def _line(self, view: View, memory: Rev1Memory) -> MLine:
        """The M-line; drawn anew from here when the target has moved away from its end."""
        goal = view.goal_position
        if memory.line is None or math.dist(memory.line.goal, goal) > TARGET_MOVED:
            memory.line = MLine(view.position, goal)
            memory.nearest = view.goal_distance
            self.boundary.forget_marks(memory)
        return memory.line

    def _watch(self, view: View, memory: Rev1Memory, contour: Contour, line: MLine) -> None:
        """Leave the boundary, give up, or turn round, where the last step allows it or demands it."""
        if self._may_leave(view, memory, contour, line):
            self.boundary.leave_and_mark(view, memory)
        elif contour.is_lap_closed:
            memory.verdict = "unreachable"
        else:
            self.boundary.trace_contour(view, memory)

    def _may_leave(self, view: View, memory: Rev1Memory, contour: Contour, line: MLine) -> bool:
        """Whether the last step crossed the M-line nearer to the goal than ever before, with a free way on."""
        crossing = line.crossing(contour.before, contour.position)
        if crossing is None and abs(line.offset(view.position)) <= ON_LINE * self.boundary.step:
            crossing = view.position  # it grazes the line without crossing it
        if crossing is None or math.dist(crossing, line.goal) > memory.nearest - ON_LINE * self.boundary.step:
            return False
        memory.nearest = math.dist(crossing, line.goal)
        if self.boundary.is_free(view, view.goal_bearing, view.goal_distance, contour):
            return True
        return self.boundary.leave_rule == "any" and self.boundary.points_away(view, view.goal_bearing, contour)

    def draw(self, memory: Rev1Memory) -> Drawing:
        """Hit and leave points and the M-line."""
        drawing = self.boundary.draw(memory)
        if memory.line is None:
            return drawing
        return Drawing(points=drawing.points, segments=[(*memory.line.start, *memory.line.goal, "m_line")])
