"""Rev2: a bug that takes the other side at each hit point. Two algorithms go by this name.

"s001": leaves a wall wherever the way to the goal is free; keeps nothing but the side. Source: Oni and Wang's
comparison, after McGuire et al. (2019). States: motion_to_goal, boundary_following. Guarantee: none, it can cycle for
ever and then calls itself looping; a full lap without any free heading does prove that the goal is shut in. Length
bound: none.

"noborio": Alg2 with alternating sides. Source: Horiuchi and Noborio (2001). Memory kept: the smallest distance to the
goal on the whole trip, all hit and leave points, the trace along the present boundary. A further state: walking_back.
Guarantee: reaches the goal or declares it unreachable. Length: at most D + 2 sum(p_i), p_i the perimeter of obstacle i
at the clearance.

Sensing assumed by both: contact (here the scan within the clearance), goal; by the second also the own position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import (
    TARGET_MOVED,
    Boundary,
    Contour,
    LeaveRule,
    Point,
    Turn,
    TurningMemory,
    alternating_side,
    side_of,
)

VARIANTS = ("s001", "noborio")


@dataclass
class Rev2Memory(TurningMemory):
    """Memory of Rev2; what is not of BugMemory serves "noborio"."""

    nearest: float = math.inf
    """Smallest distance to the goal on the trip before this decision [m]."""
    goal: Point | None = None
    """The target that this distance belongs to, odometry frame [m]."""


class Rev2(ScriptedPolicy):
    """Rev2.

    Args:
        sensors: what a driver knows of the robot.
        clearance: centre to wall while following [m]; None: body radius and one step.
        turn: which way to turn at the first wall; it alternates.
        leave_rule: "front" or "any", see Boundary.
        variant: "s001" or "noborio", see above.
        discrete: whether actions are numbers of the discrete table.

    Raises:
        ValueError: a clearance not above the radius, an unknown turn, rule or variant.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        turn: Turn = "left",
        leave_rule: LeaveRule = "front",
        variant: Literal["s001", "noborio"] = "s001",
        discrete: bool = False,
    ) -> None:
        super().__init__(sensors, discrete=discrete)
        if variant not in VARIANTS:
            raise ValueError(f"variant must be one of {list(VARIANTS)}, got {variant!r}")
        self.boundary = Boundary(sensors, clearance=clearance, leave_rule=leave_rule)
        self.side = side_of(turn)
        self.remembers = variant == "noborio"

    def start(self) -> Rev2Memory:
        """Memory of a new episode."""
        return Rev2Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Rev2Memory) -> Velocity:
        """One decision."""
        self.boundary.advance(view, memory)
        self._follow_target(view, memory)
        velocity = self._decide(view, memory)
        memory.nearest = min(memory.nearest, view.goal_distance)
        return velocity

    def _follow_target(self, view: View, memory: Rev2Memory) -> None:
        """Distances and marks belong to a target that stands; begin anew when it has moved."""
        if memory.goal is None or math.dist(memory.goal, view.goal_position) > TARGET_MOVED:
            memory.goal = view.goal_position
            memory.nearest = view.goal_distance
            self.boundary.forget_marks(memory)

    def _decide(self, view: View, memory: Rev2Memory) -> Velocity:
        boundary = self.boundary
        if memory.contour is not None and not memory.is_turning:
            self._watch(view, memory, memory.contour)
        if memory.is_turning:
            velocity = boundary.walk_back(view, memory)
            if velocity is not None:
                memory.mode = "walking_back"
                return velocity
        if memory.contour is None:
            velocity = boundary.go(view, view.goal_bearing, view.goal_distance)
            if velocity is not None:
                memory.mode = "motion_to_goal"
                return velocity
            boundary.hit_and_trace(view, memory, alternating_side(memory, self.side), view.goal_bearing)
            if not self.remembers and boundary.is_looping(memory):
                memory.verdict = "looping"
        memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def _watch(self, view: View, memory: Rev2Memory, contour: Contour) -> None:
        """Leave the boundary, give up, or turn round, where the last step allows it or demands it."""
        distance = view.goal_distance
        is_nearer = distance < memory.nearest or not self.remembers
        if is_nearer and self.boundary.is_free(view, view.goal_bearing, distance, contour):
            self.boundary.leave_and_mark(view, memory)
        elif contour.is_lap_closed:
            memory.verdict = "unreachable"
        elif self.remembers:
            self.boundary.trace_contour(view, memory)

    def draw(self, memory: Rev2Memory) -> Drawing:
        """Hit and leave points."""
        return self.boundary.draw(memory)
