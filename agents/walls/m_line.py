"""The toolbox of bugs that know the M-line, the straight line from start to goal, and leave walls only on it.

Source: Lumelsky and Stepanov (1987).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

from bug_gym.agents.walls.boundary import FRESH_STARTS, Boundary, LeaveRule
from bug_gym.agents.walls.boundary_bug import BoundaryBug, BoundaryParameters
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour
from bug_gym.geometry import Point
from bug_gym.policy import Drawing, Velocity
from bug_gym.view import View

ON_LINE = 0.1
"""How near to the M-line is on it, and how much nearer to the goal is nearer, in steps: the line is known exactly."""

BESIDE_LINE = 1.0
"""How near to the M-line is beside it, in steps: how far a robot can be off the contour of a wall that it follows."""

IN_VAIN = 10.0
"""After so long at its end, and not at the target, the M-line is drawn anew [s]."""


@dataclass(frozen=True)
class MLine:
    """The straight line from a start to the goal that Bug2 and its relatives follow."""

    start: Point
    """Odometry frame [m]."""
    goal: Point
    """Odometry frame [m]."""

    def offset(self, place: Point) -> float:
        """Signed distance of a place from the line [m], positive to its left."""
        (sx, sy), (gx, gy) = self.start, self.goal
        length = math.dist(self.start, self.goal)
        if length == 0.0:
            return 0.0
        return ((gx - sx) * (place[1] - sy) - (gy - sy) * (place[0] - sx)) / length

    def crossing(self, before: Point, after: Point) -> Point | None:
        """Where a step crosses the line, or None."""
        first, second = self.offset(before), self.offset(after)
        if first * second > 0.0 or first == second:
            return None
        share = first / (first - second)
        return before[0] + share * (after[0] - before[0]), before[1] + share * (after[1] - before[1])

    def ahead(self, place: Point, length: float) -> Point:
        """The point of the line `length` [m] beyond the foot of a place, at most the goal."""
        (sx, sy), (gx, gy) = self.start, self.goal
        whole = math.dist(self.start, self.goal)
        if whole == 0.0:
            return self.goal
        ux, uy = (gx - sx) / whole, (gy - sy) / whole
        along = min((place[0] - sx) * ux + (place[1] - sy) * uy + length, whole)
        return sx + along * ux, sy + along * uy


@dataclass
class MLineMemory(BugMemory):
    """Memory of a bug with an M-line."""

    line: MLine | None = None
    """The M-line."""
    in_vain: float = 0.0
    """How long it has been at the end of that without the target [s]."""


def go_along(boundary: Boundary, view: View, line: MLine) -> Velocity | None:
    """`Boundary.go` on the M-line: a robot beside it steers back onto it. None at a hit point."""
    return boundary.go(view, _bearing_along(boundary, view, line), view.goal_distance)


def go_along_until_hit(boundary: Boundary, view: View, memory: BugMemory, side: int, line: MLine) -> Velocity | None:
    """`Boundary.go_until_hit` on the M-line: a robot beside it steers back onto it. None at a hit point."""
    return boundary.go_until_hit(view, memory, side, _bearing_along(boundary, view, line))


def _bearing_along(boundary: Boundary, view: View, line: MLine) -> float:
    """Where to steer on the M-line, or back onto it [rad]."""
    target = line.ahead(view.position, 5.0 * boundary.step)
    return math.atan2(*reversed(view.to_robot(*target)))


def nearer_crossing(boundary: Boundary, view: View, contour: Contour, line: MLine, limit: float) -> float | None:
    """Distance to the goal [m] where the last step met the M-line, or None where it did not nearer than `limit` [m].

    A wall along the line may be met on it and left beside it, as far off its contour as a robot steers. On a lap after one
    that met the line nowhere, but came by it, being beside it is enough (`laps.is_proof`). Where a goal by walls is within
    reach the line has led far enough.
    """
    if boundary.way_in(view, view.goal_distance) is not None:
        return math.dist(view.position, line.goal)
    crossing = line.crossing(contour.before, contour.position)
    reach = BESIDE_LINE if contour.takes_less else ON_LINE
    if crossing is None and abs(line.offset(view.position)) <= reach * boundary.step:
        crossing = view.position  # it grazes the line without crossing it
    distance = math.dist(view.position if crossing is None else crossing, line.goal)
    if distance > limit - ON_LINE * boundary.step:
        return None
    if crossing is not None:
        return distance
    is_beside = abs(line.offset(view.position)) <= BESIDE_LINE * boundary.step
    if is_beside and distance < contour.way_out and boundary.may_go_on(view, contour):
        contour.way_out = distance
    return None


@dataclass(frozen=True)
class MLineParameters(BoundaryParameters):
    """Parameters of bugs with an M-line."""

    leave_rule: LeaveRule = "any"
    """Where a wall may be left: "any" at a crossing wherever the goal lies (the algorithms as published), "front" only
    with the goal within 90 degrees of the direction of travel: then it may pass by the crossing that counts, and no guarantee
    and no bound holds."""


class MLineBug(BoundaryBug):
    """What bugs with an M-line share; they refuse what BoundaryBug refuses."""

    Parameters = MLineParameters
    parameters: MLineParameters

    fresh_starts = FRESH_STARTS

    def m_line(self, view: View, memory: MLineMemory) -> MLine:
        """The M-line; drawn anew from here when its end is not where the target is, or walls were gone round in vain."""
        goal = view.goal_position
        in_vain = self._is_there_in_vain(view, memory)
        if memory.line is None or memory.is_fresh or in_vain or math.dist(memory.line.goal, goal) > TARGET_MOVED:
            memory.line, memory.is_fresh = MLine(view.position, goal), False
            self.forget_distances(view, memory)
        return memory.line

    def _is_there_in_vain(self, view: View, memory: MLineMemory) -> bool:
        """Whether it has been at the end of the M-line for long, and the target is not there.

        Under drift of odometry the target seems to move, and who keeps to the line would stay beside it for ever.
        """
        within = view.sensors.goal_radius
        is_there = memory.line is not None and math.dist(view.position, memory.line.goal) <= within < view.goal_distance
        memory.in_vain = memory.in_vain + view.sensors.drive.step if is_there and memory.contour is None else 0.0
        return memory.in_vain > IN_VAIN

    @abstractmethod
    def forget_distances(self, view: View, memory: Any) -> None:
        """The M-line is a new one: begin anew with what was measured on the last."""

    def draw(self, memory: MLineMemory) -> Drawing:
        """Hit and leave points and the M-line."""
        drawing = super().draw(memory)
        if memory.line is None:
            return drawing
        return Drawing(points=drawing.points, segments=[(*memory.line.start, *memory.line.goal, "m_line")])
