"""Bug0+: Bug0 that remembers its last two hit points and follows the wall to a better place once it meets one again.

Source: Oni and Wang, who give Rev3 this memory and propose it for other bugs. Sensing assumed: contact (here the scan
within the clearance), goal. Memory kept: the last two hit points, their distances to the goal and gates there. States:
motion_to_goal, boundary_following, wall_following_to_better_take_off. Guarantee: none proven; cycles of one or two hit
points are broken, longer ones end as "looping". Length bound: none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from bug_gym.agents.walls.boundary_bug import BoundaryBug, BoundaryParameters
from bug_gym.agents.walls.contour import CLOSER, TARGET_MOVED, BugMemory, Contour, Gate
from bug_gym.agents.walls.laps import is_proof
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View


@dataclass
class SavedHit:
    """A hit point that the robot would know again."""

    place: Point
    """Odometry frame [m]."""
    distance: float
    """To the goal [m]."""
    gate: Gate | None = None
    """Door across the contour there; None if the robot left before it went along the wall."""


@dataclass
class Bug0PlusMemory(BugMemory):
    """Memory of Bug0+."""

    saved: list[SavedHit] = field(default_factory=list)
    """The last hit point, and before it in the list the one before."""
    goal: Point = (0.0, 0.0)
    """Where the target was when their distances were measured, odometry frame [m]."""
    is_free_nearer: bool = False
    """Whether the way was free somewhere on this lap nearer to the goal than its hit point, if not near enough."""


@dataclass(frozen=True)
class Bug0PlusParameters(BoundaryParameters):
    """Parameters of Bug0+."""

    early_stop: bool = False
    """Whether a first lap without a free heading is proof enough; if not, it takes the second that the rules as
    published ask for."""


class Bug0Plus(BoundaryBug):
    """Bug0+; it refuses what BoundaryBug refuses."""

    Parameters = Bug0PlusParameters
    parameters: Bug0PlusParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.closer = CLOSER * self.boundary.step

    def start(self) -> Bug0PlusMemory:
        """Memory of a new episode."""
        return Bug0PlusMemory(mode="motion_to_goal")

    def act(self, view: View, memory: Bug0PlusMemory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        self._watch_target(view, memory)
        contour = memory.contour
        if contour is not None:
            if self._may_leave(view, memory, contour):
                boundary.leave(view, memory)
                memory.mode = "motion_to_goal"
            else:
                self._watch_saved_hits(memory, contour)
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, self.side, view.goal_bearing)
            if velocity is not None:
                return velocity
            self._hit(view, memory)
        return boundary.follow(view, memory)

    def _watch_target(self, view: View, memory: Bug0PlusMemory) -> None:
        """Forget the hit points when the target has moved: their distances belong to its old place."""
        if math.dist(memory.goal, view.goal_position) <= TARGET_MOVED:
            return
        memory.goal = view.goal_position
        memory.saved = []
        memory.is_free_nearer = False
        if memory.contour is not None:
            memory.saved = [SavedHit(view.position, view.goal_distance)]
            memory.mode = "boundary_following"

    def _hit(self, view: View, memory: Bug0PlusMemory) -> None:
        """Follow what blocks the way to the goal, to a better place at once if the hit point is a saved one."""
        reach = self.boundary.gate_half_width
        contour = self.boundary.hit(view, memory, self.side, view.goal_bearing)
        is_known = any(math.dist(hit.place, contour.hit) <= reach for hit in memory.saved)
        memory.mode = "wall_following_to_better_take_off" if is_known else "boundary_following"
        memory.saved = [*memory.saved[-1:], SavedHit(contour.hit, contour.hit_distance)]
        memory.is_free_nearer = False
        if self.boundary.laps.is_looping(memory):
            memory.verdict = "looping"

    def _may_leave(self, view: View, memory: Bug0PlusMemory, contour: Contour) -> bool:
        """Whether the heading to the goal is free and, on the way to a better place, this is one."""
        distance = view.goal_distance
        if not self.boundary.is_free(view, view.goal_bearing, distance, contour):
            return self.boundary.may_leave(view, contour, is_nearer=distance <= memory.saved[-1].distance - self.closer)
        if memory.mode == "boundary_following":
            return True
        memory.is_free_nearer |= distance <= memory.saved[-1].distance - self.closer
        return distance <= min(hit.distance for hit in memory.saved) - self.closer

    def _watch_saved_hits(self, memory: Bug0PlusMemory, contour: Contour) -> None:
        """Change the state, or give up, at a saved hit point."""
        *before, last = memory.saved
        last.gate = contour.gate
        if contour.is_lap_closed:
            is_proven = is_proof(contour)
            if memory.mode == "wall_following_to_better_take_off":
                # A lap without a free heading nearer than its own hit point is proof; without one nearer than a hit
                # point on another obstacle it is not.
                if memory.is_free_nearer:
                    memory.verdict = "looping"
                elif is_proven:
                    memory.verdict = "unreachable"
            elif self.parameters.early_stop and is_proven:
                memory.verdict = "unreachable"
            memory.mode = "wall_following_to_better_take_off"
        elif contour.odometer > self.boundary.arming_length and any(self._passes(contour, hit.gate) for hit in before):
            memory.mode = "wall_following_to_better_take_off"

    def _passes(self, contour: Contour, gate: Gate | None) -> bool:
        """Whether the last step went through a gate of an earlier contour."""
        if gate is None:
            return False
        width = self.boundary.gate_half_width
        return gate.is_passed(contour.before, contour.position, width, contour.heading_before)
