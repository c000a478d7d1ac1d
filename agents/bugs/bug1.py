"""Bug1: walk once round each obstacle, then leave it where its boundary comes nearest to the goal.

Source: Lumelsky and Stepanov (1987). Sensing assumed: contact (here the scan within the clearance), goal, own position.
Memory kept: the nearest point of the boundary, the lengths of the lap and of the way to that point, the trace of the
lap. States: motion_to_goal, boundary_following (the lap), return_to_closest (along the trace), return_along_wall (where
the trace is blocked, or too narrow for a robot that turns slowly). Guarantee: reaches the goal or declares it
unreachable, when the lap is closed and the wall at the nearest point stands between it and the goal. Length: at most
D + 1.5 sum(p_i) over the obstacles met, p_i their perimeters at the clearance; D + 2 sum(p_i) with the rule "same".
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from bug_gym.agents.walls.boundary import FRESH_STARTS, WAIT, LeaveRule
from bug_gym.agents.walls.boundary_bug import BoundaryBug, BoundaryParameters
from bug_gym.agents.walls.contour import CLOSER, TARGET_MOVED, BugMemory, Contour, Gate
from bug_gym.agents.walls.laps import shows_no_way
from bug_gym.checks import shortened
from bug_gym.geometry import Point
from bug_gym.policy import Drawing, Velocity
from bug_gym.steering import Course
from bug_gym.view import Sensors, View

ReturnRule = Literal["shortest", "same"]

RETURN_RULES = ("shortest", "same")


@dataclass(frozen=True)
class ClosestPoint:
    """The nearest point to the goal of the lap so far."""

    place: Point
    """Odometry frame [m]."""
    distance: float
    """To the goal [m]."""
    way: float
    """Length of the lap up to it [m]."""
    index: int
    """Its number in the trace."""
    is_open: bool
    """Whether the way from it to the goal leads away from the wall."""


@dataclass
class Bug1Memory(BugMemory):
    """Memory of Bug1."""

    goal: Point = (0.0, 0.0)
    """Where the target was at the last hit, odometry frame [m]."""
    gate: Gate | None = None
    """Where this lap began."""
    closest: ClosestPoint | None = None
    """The nearest point of this lap; None before the lap has begun."""
    trace: list[Point] = field(default_factory=list)
    """Own places on this lap, odometry frame [m]."""
    way_back: list[Point] = field(default_factory=list)
    """Places still to go to on the way to the nearest point, the next one last."""
    hit_distance: float = math.inf
    """Distance to the goal at the last hit point [m]."""


@dataclass(frozen=True)
class Bug1Parameters(BoundaryParameters):
    """Parameters of Bug1."""

    leave_rule: LeaveRule = field(default="front", init=False)
    """Not to be set: it leaves at the nearest point, whatever else is free."""
    return_rule: ReturnRule = "shortest"
    """How to go to the nearest point after the lap. "shortest": the shorter way, back or ahead (the algorithm as
    published); "same": on in the direction of the lap, as in the table of Oni and Wang."""


class Bug1(BoundaryBug):
    """Bug1.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown return rule; and what BoundaryBug refuses.
    """

    Parameters = Bug1Parameters
    parameters: Bug1Parameters
    fresh_starts = FRESH_STARTS
    turns_on_the_spot = True  # its laps close only where it keeps exactly to contours

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        if self.parameters.return_rule not in RETURN_RULES:
            raise ValueError(
                f"return_rule must be one of {list(RETURN_RULES)}, got {shortened(self.parameters.return_rule)}"
            )

    def start(self) -> Bug1Memory:
        """Memory of a new episode."""
        return Bug1Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Bug1Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        contour = memory.contour
        if memory.is_fresh:
            memory.mode, memory.is_fresh = "motion_to_goal", False
        if contour is not None and math.dist(memory.goal, view.goal_position) > TARGET_MOVED:
            self._leave(view, memory)  # what was measured of this boundary belongs to the target's old place
        elif contour is not None and memory.mode == "boundary_following":
            self._survey(view, memory, contour)
        if contour is not None and memory.mode == "return_to_closest":
            velocity = self._go_back(view, memory, contour)
            if velocity is not None:
                return velocity
        elif contour is not None and memory.mode == "return_along_wall":
            self._come_round(view, memory, contour)
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, self.side, view.goal_bearing)
            if velocity is not None:
                return velocity
            self._begin_lap(view, memory)
        return boundary.follow(view, memory)

    def _begin_lap(self, view: View, memory: Bug1Memory) -> None:
        """Hit what blocks the way to the goal."""
        contour = self.boundary.hit(view, memory, self.side, view.goal_bearing)
        memory.mode = "boundary_following"
        memory.goal = view.goal_position
        memory.hit_distance = contour.hit_distance
        memory.gate, memory.trace, memory.closest = None, [], None

    def _leave(self, view: View, memory: Bug1Memory) -> None:
        """Go to the goal from here."""
        self.boundary.leave(view, memory)
        memory.mode = "motion_to_goal"

    def _survey(self, view: View, memory: Bug1Memory, contour: Contour) -> None:
        """Add the present place to the lap, which begins at the contour's gate; decide when it is closed."""
        if memory.gate is not contour.gate:
            self._begin_anew(memory, contour)
        if contour.gate is None or memory.mode == "return_to_closest":
            return
        if not memory.trace or memory.trace[-1] != contour.position:
            memory.trace.append(contour.position)
        if memory.closest is None or view.goal_distance < memory.closest.distance:
            memory.closest = ClosestPoint(
                place=contour.position,
                distance=view.goal_distance,
                way=contour.odometer - contour.gate.odometer,
                index=len(memory.trace) - 1,
                is_open=self.boundary.is_open(view, contour),
            )
        if contour.is_lap_closed and not self._return(memory, contour) and shows_no_way(contour):
            memory.verdict = "unreachable"

    def _begin_anew(self, memory: Bug1Memory, contour: Contour) -> None:
        """A lap begins, the first one or the next after one in which something moved; that one may do all the same."""
        if not self._return(memory, contour):
            memory.gate, memory.trace, memory.closest = contour.gate, [], None

    def _return(self, memory: Bug1Memory, contour: Contour) -> bool:
        """After a lap: choose the way to the nearest point, if one can leave from there."""
        closest, gate = memory.closest, memory.gate
        if closest is None or gate is None or not closest.is_open:
            return False
        # In an acute corner one of two walls may let the goal pass for open; then the next lap begins at the nearest
        # point and finds none nearer.
        if closest.distance >= memory.hit_distance - CLOSER * self.boundary.step:
            return False
        is_ahead = self.parameters.return_rule == "same" or closest.way <= 0.5 * (contour.odometer - gate.odometer)
        ahead, back = memory.trace[: closest.index + 1], memory.trace[closest.index :]
        memory.way_back = ahead[::-1] if is_ahead else back
        memory.mode = "return_to_closest"
        return True

    def _go_back(self, view: View, memory: Bug1Memory, contour: Contour) -> Velocity | None:
        """Velocity along the trace to the nearest point; None once it has left from there."""
        way, here, step = memory.way_back, view.position, self.boundary.step
        while len(way) > 1 and (math.dist(way[-1], here) < step or math.dist(way[-2], here) < math.dist(way[-1], here)):
            way.pop()
        if len(way) == 1 and math.hypot(*view.to_robot(*way[-1])) <= 0.5 * step:
            self._leave(view, memory)
            return None
        velocity = self.boundary.step_to(view, way[-1])
        if velocity is None:
            return self._wait(view, memory, contour)
        contour.waited = 0.0
        return velocity

    def _wait(self, view: View, memory: Bug1Memory, contour: Contour) -> Velocity:
        """Stand before something in the way back; if it stays, return with the hand on the wall."""
        contour.waited += self.sensors.drive.step
        if contour.waited > WAIT:
            memory.mode = "return_along_wall"
            memory.contour = self.boundary.lay_hand(view, self.side, view.nearest()[1])
        return 0.0, 0.0

    def _come_round(self, view: View, memory: Bug1Memory, contour: Contour) -> None:
        """Leave where the wall leads past the nearest point; one lap without it begins all anew."""
        assert memory.closest is not None
        if math.dist(view.position, memory.closest.place) <= self.boundary.step:
            self._leave(view, memory)
        elif contour.is_lap_closed:
            memory.mode = "boundary_following"
            memory.gate, memory.trace, memory.closest = contour.gate, [], None

    def course(self, view: View, memory: Bug1Memory, velocity: Velocity) -> Course | None:
        """Back to the nearest point it goes as it came."""
        return (
            super().course(view, memory, velocity) if memory.mode in ("boundary_following", "motion_to_goal") else None
        )

    def draw(self, memory: Bug1Memory) -> Drawing:
        """Hit and leave points, and the nearest point of the lap."""
        drawing = super().draw(memory)
        if memory.closest is None or memory.contour is None:
            return drawing
        return Drawing(points=[*drawing.points, (*memory.closest.place, "candidate")])
