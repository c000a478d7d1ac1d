"""Bug2: follow the straight line from start to goal (the M-line), and walls from one crossing of it to a nearer one.

Source: Lumelsky and Stepanov (1987). Sensing assumed: contact (here the scan within the clearance), goal, own position.
Memory kept: the M-line, the distance to the goal at the last hit point, a gate there. States: motion_to_goal,
boundary_following. Guarantee: reaches the goal or declares it unreachable. Length: at most D + sum(n_i p_i) / 2, n_i
crossings of the M-line with the boundary of obstacle i, p_i its perimeter at the clearance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import (
    TARGET_MOVED,
    Boundary,
    BugMemory,
    Contour,
    LeaveRule,
    MLine,
    Turn,
    go_along,
    side_of,
)

ON_LINE = 0.1
"""How near to the M-line is on it, and how much nearer to the goal is nearer, in steps: the line is known exactly."""


@dataclass
class Bug2Memory(BugMemory):
    """Memory of Bug2."""

    line: MLine | None = None
    """The M-line."""
    hit_distance: float = math.inf
    """Distance to the goal at the last hit point [m]."""


class Bug2(ScriptedPolicy):
    """Bug2.

    Args:
        sensors: what a driver knows of the robot.
        clearance: centre to wall while following [m]; None: body radius and one step.
        turn: which way to turn at a wall.
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

    def start(self) -> Bug2Memory:
        """Memory of a new episode."""
        return Bug2Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Bug2Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        line = self._line(view, memory)
        contour = memory.contour
        if contour is not None:
            if self._may_leave(view, memory, contour, line):
                boundary.leave(view, memory)
                memory.mode = "motion_to_goal"
            elif contour.is_lap_closed:
                memory.verdict = "unreachable"
        if memory.contour is None:
            velocity = go_along(boundary, view, line)
            if velocity is not None:
                return velocity
            boundary.hit(view, memory, self.side, view.goal_bearing)
            memory.hit_distance = view.goal_distance
            memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def _line(self, view: View, memory: Bug2Memory) -> MLine:
        """The M-line; drawn anew from here when the target has moved away from its end."""
        goal = view.goal_position
        if memory.line is None or math.dist(memory.line.goal, goal) > TARGET_MOVED:
            memory.line = MLine(view.position, goal)
            memory.hit_distance = view.goal_distance if memory.contour is not None else math.inf
        return memory.line

    def _may_leave(self, view: View, memory: Bug2Memory, contour: Contour, line: MLine) -> bool:
        """Whether the last step crossed the M-line nearer to the goal than the hit point, with a free way on."""
        crossing = line.crossing(contour.before, contour.position)
        if crossing is None and abs(line.offset(view.position)) <= ON_LINE * self.boundary.step:
            crossing = view.position  # it grazes the line without crossing it
        if crossing is None or math.dist(crossing, line.goal) > memory.hit_distance - ON_LINE * self.boundary.step:
            return False
        if self.boundary.is_free(view, view.goal_bearing, view.goal_distance, contour):
            return True
        return self.boundary.leave_rule == "any" and self.boundary.points_away(view, view.goal_bearing, contour)

    def draw(self, memory: Bug2Memory) -> Drawing:
        """Hit and leave points and the M-line."""
        drawing = self.boundary.draw(memory)
        if memory.line is None:
            return drawing
        return Drawing(points=drawing.points, segments=[(*memory.line.start, *memory.line.goal, "m_line")])
