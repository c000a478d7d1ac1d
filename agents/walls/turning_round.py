"""Turning round once on each boundary, where an earlier hit or leave point is met, and walking back to the hit point.

Source: Sankaranarayanan and Vidyasagar (1990), for Alg1 and Alg2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.contour import BugMemory, Contour
from bug_gym.agents.walls.marks import Mark, passes
from bug_gym.policy import Velocity, brake
from bug_gym.view import View


@dataclass
class TurningMemory(BugMemory):
    """Memory of a bug that turns round, once on each boundary, where it meets an earlier hit or leave point."""

    marks: list[Mark] = field(default_factory=list)
    """Earlier hit and leave points; the present hit point is not among them."""
    trace: list[Mark] = field(default_factory=list)
    """Way along the present boundary, from its hit point, with the wall beside it."""
    start: Mark | None = None
    """The present hit point."""
    is_turning: bool = False
    """Whether it is on its way back to the hit point."""
    has_turned: bool = False
    """Whether it has turned round on this boundary."""


def hit_and_trace(boundary: Boundary, view: View, memory: TurningMemory, side: int, bearing: float) -> Contour:
    """`hit`, and begin a trace; the hit point before becomes an earlier one."""
    if memory.start is not None:
        memory.marks.append(memory.start)
    contour = boundary.hit(view, memory, side, bearing)
    memory.start = Mark(contour.hit, contour.wall)
    memory.trace = [Mark(view.position, contour.wall)]
    memory.is_turning = memory.has_turned = False
    return contour


def leave_and_mark(boundary: Boundary, view: View, memory: TurningMemory) -> None:
    """`leave`, and remember the leave point."""
    assert memory.contour is not None
    memory.marks.append(Mark(view.position, memory.contour.wall))
    boundary.leave(view, memory)


def forget_marks(memory: TurningMemory) -> None:
    """Nothing met before means anything any more, because the target has moved."""
    memory.marks.clear()
    memory.is_turning = memory.has_turned = False


def trace_contour(boundary: Boundary, view: View, memory: TurningMemory) -> None:
    """Add the present place to the trace; turn round where the robot passes an earlier hit or leave point."""
    contour = memory.contour
    assert contour is not None
    memory.trace.append(Mark(view.position, contour.wall))
    if not memory.has_turned and any(passes(boundary, contour, mark) for mark in memory.marks):
        memory.is_turning = memory.has_turned = True


def walk_back(boundary: Boundary, view: View, memory: TurningMemory) -> Velocity | None:
    """Velocity back along the trace; None at its beginning, where the other hand takes the wall.

    It may lead through a gap just too narrow for the contour, and goes through again: from its mouth the other hand might take
    it for none, and go round another wall. Where something has moved into the way, or it cannot go back straight where it came
    on an arc, that hand takes over at once: it leads to the same hit point.
    """
    trace = memory.trace
    while len(trace) > 1 and math.dist(trace[-2].place, view.position) <= 1.01 * boundary.step:
        trace.pop()  # the furthest place that one step reaches
    if trace and math.dist(trace[-1].place, view.position) <= 0.5 * boundary.step:
        trace.pop()
    is_still = memory.contour is not None and not memory.contour.is_disturbed
    radius = boundary.body_radius if is_still else boundary.safe_radius
    velocity = boundary.step_to(view, trace[-1].place, radius=radius) if trace else None
    if velocity is not None and boundary.rounding is not None and brake(view, velocity) != velocity:
        velocity = None  # it came on an arc, nearer to things than where it goes straight
    if velocity is None:
        _change_hands(view, memory)
    return velocity


def _change_hands(view: View, memory: TurningMemory) -> None:
    """Go on along the present boundary the other way, on a lap of its own."""
    last = memory.contour
    assert last is not None and memory.start is not None
    wall, travel = memory.start.wall, last.approach
    if memory.trace:
        wall = memory.trace[-1].wall  # what is nearest may be another one, across a gap
        travel = travel if last.heading is None else last.heading
    memory.trace = []
    memory.is_turning = False
    memory.contour = Contour(-last.side, last.hit, wall, view.position, view.goal_position, travel, view.position)
