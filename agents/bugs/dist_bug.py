"""DistBug: follow a wall until the free way in sight toward the goal leads nearer to it than the wall has come.

Source: Kamon and Rivlin (1997), who turn to that side of a wall that leads less away from the goal; turning always left
is from Ng and Braeunl (2007), `side_rule="fixed"`. That a wall may be followed back once it leads away is left out. Sensing
assumed: contact (here the scan within the clearance), the free way toward the goal up to r_max, goal, own position. Memory
kept: the least distance to the goal on this boundary (d_min), how far the scan is believed, a gate there. States:
motion_to_goal, boundary_following. Guarantee: reaches the goal or declares it unreachable. Length: a lap for each hit at
most, and not over D / STEP hits; two laps and further hits only where the last resort below is needed.

With F the free way toward the goal, a wall is left where the goal is in sight (d - F <= 0) or d - F <= d_min - STEP.
The published proof asks for a STEP not above the thickness of walls. Where the next obstacle stands nearer than STEP no
such place is seen at all; so a lap without one is followed by Bug1's test at the nearest point, see survey_lap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

from bug_gym import kernels
from bug_gym.agents.parameters import Length
from bug_gym.agents.walls.boundary import FRESH_STARTS, LeaveRule, Turn
from bug_gym.agents.walls.boundary_bug import BoundaryBug, BoundaryParameters
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour
from bug_gym.agents.walls.survey import Survey, survey_lap
from bug_gym.checks import shortened
from bug_gym.geometry import Point, velocity_along, wrap
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View

SideRule = Literal["fixed", "goal"]

SIDE_RULES = ("fixed", "goal")

SQUARE = math.radians(3.0)
"""A wall met at less than this from a right angle has no side nearer to the goal's direction [rad]."""


@dataclass
class DistBugMemory(BugMemory):
    """Memory of DistBug."""

    target: Point | None = None
    """Where the target was when the distances below were measured, odometry frame [m]."""
    closest: float = math.inf
    """d_min: least distance to the goal on this boundary, from the hit point on [m]."""
    hit_distance: float = math.inf
    """Distance to the goal at the last hit point [m]."""
    best: float = math.inf
    """The least of those [m]."""
    promised: float = math.inf
    """Distance to the goal at which the next wall stands, as seen from the last leave point [m]."""
    trust: float = math.inf
    """How far the scan is believed [m]."""
    survey: Survey = field(default_factory=Survey)
    """What is known of this lap."""


@dataclass(frozen=True)
class DistBugParameters(BoundaryParameters):
    """Parameters of DistBug."""

    turn: Turn = "left"
    """Which way to turn at a wall; with side_rule "goal" only where it is met at a right angle."""
    leave_rule: LeaveRule = "any"
    """Where a wall may be left: "any" wherever the goal lies (the algorithm as published), "front" only with the goal
    within 90 degrees of the direction of travel."""
    side_rule: SideRule = "goal"
    """"goal": the way along the wall that turns less from the goal, as Kamon and Rivlin choose it; "fixed": always to the
    side of `turn`, as Ng and Braeunl do."""
    step: Length = 0.5
    """STEP, by how much nearer a leave must lead [m]."""
    r_max: float | None = None
    """How far to look toward the goal [m]; None: as far as the LIDAR sees."""


class DistBug(BoundaryBug):
    """DistBug.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown side rule, a step or r_max not above 0; and what BoundaryBug refuses.
    """

    Parameters = DistBugParameters
    parameters: DistBugParameters
    fresh_starts = FRESH_STARTS

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        side_rule, step, r_max = self.parameters.side_rule, self.parameters.step, self.parameters.r_max
        if side_rule not in SIDE_RULES:
            raise ValueError(f"side_rule must be one of {list(SIDE_RULES)}, got {shortened(side_rule)}")
        if not (step > 0.0 and math.isfinite(step)):
            raise ValueError(f"step must be above 0 m, got {shortened(step)}")
        if r_max is not None and not r_max > 0.0:
            raise ValueError(f"r_max must be above 0 m, got {shortened(r_max)}")
        self.r_max = sensors.range if r_max is None else min(r_max, sensors.range)

    def start(self) -> DistBugMemory:
        """Memory of a new episode."""
        return DistBugMemory(mode="motion_to_goal")

    def act(self, view: View, memory: DistBugMemory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        self._watch_target(view, memory)
        if memory.contour is not None:
            self._look_for_leave(view, memory, memory.contour)
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, partial(self._turn, view), view.goal_bearing)
            if velocity is not None:
                return velocity
            self._hit(view, memory)
        return boundary.follow(view, memory)

    def _watch_target(self, view: View, memory: DistBugMemory) -> None:
        """Forget distances to a place that the target has left."""
        if memory.target is not None and math.dist(memory.target, view.goal_position) <= TARGET_MOVED:
            return
        memory.target = view.goal_position
        memory.closest = memory.hit_distance = memory.best = memory.promised = math.inf
        memory.survey = Survey()

    def _hit(self, view: View, memory: DistBugMemory) -> None:
        """Begin to follow what blocks the way to the goal."""
        contour = self.boundary.hit(view, memory, self._turn(view, 0.0), view.goal_bearing)
        distance = contour.hit_distance
        if distance > memory.promised + 2.0 * self.boundary.step:
            # The scan promised more than there was: believe it half as far until a hit is nearer than all before.
            memory.trust = 0.5 * min(memory.trust, self.r_max)
        elif distance < memory.best:
            memory.trust = math.inf
        memory.best = min(memory.best, distance)
        memory.closest = memory.hit_distance = distance
        memory.survey = Survey()
        memory.mode = "boundary_following"

    def _turn(self, view: View, way: float) -> int:
        """The side to turn to at the wall in front, when the robot has gone a way [m] toward the goal."""
        if self.parameters.side_rule == "fixed":
            return self.side
        bearing = view.goal_bearing
        ahead, left = velocity_along(bearing, way)
        x, y = view.points[0] - ahead, view.points[1] - left
        nearest = kernels.nearest_within(x, y, math.cos(bearing), math.sin(bearing), math.cos(0.5 * math.pi))
        angle = wrap(math.atan2(y[nearest], x[nearest]) - bearing) if nearest >= 0 else 0.0
        if abs(angle) < SQUARE:
            return self.side
        return -1 if angle > 0.0 else 1

    def _look_for_leave(self, view: View, memory: DistBugMemory, contour: Contour) -> None:
        """Leave, or give up after a lap."""
        distance = view.goal_distance
        memory.closest = min(memory.closest, distance)
        next_wall = self._next_wall(view, memory, contour)
        if next_wall > memory.closest - self.parameters.step:
            advice = survey_lap(self.boundary, view, contour, memory.survey, memory.hit_distance)
            if advice != "leave":
                memory.verdict = advice
                return
            next_wall = memory.survey.next_wall
        memory.promised = next_wall
        memory.mode = "motion_to_goal"
        self.boundary.leave(view, memory)

    def _next_wall(self, view: View, memory: DistBugMemory, contour: Contour) -> float:
        """Distance to the goal at the end of the free way toward it, d - F [m].

        Minus infinity with the goal in sight, infinite where the way must not be taken.
        """
        boundary, bearing = self.boundary, view.goal_bearing
        if not boundary.may_head(contour, bearing + view.heading):
            return math.inf
        reach = min(self.r_max, memory.trust)
        if boundary.sees_goal(view, reach):
            return -math.inf
        free = boundary.certain_way(view, bearing) - (boundary.clearance - boundary.inner)
        return view.goal_distance - min(free, reach)
