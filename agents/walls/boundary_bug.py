"""What bugs that follow walls with a hand share: their parameters, and what they show of their memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

from bug_gym.agents.parameters import Length
from bug_gym.agents.walls.boundary import Boundary, LeaveRule, Turn, side_of
from bug_gym.agents.walls.contour import BugMemory
from bug_gym.agents.walls.course import straight_on
from bug_gym.agents.walls.thinning import ThinningPolicy
from bug_gym.policy import Drawing, Velocity
from bug_gym.steering import Course
from bug_gym.view import Sensors, View


@dataclass(frozen=True)
class BoundaryParameters:
    """Parameters of bugs that follow walls."""

    clearance: Length | None = None
    """Distance from the robot's centre to a wall while following it [m]; None: the body's radius and one step, or what a
    differential robot's brake needs if that is more."""
    turn: Turn = "left"
    """Which way to turn at a wall; of a bug that changes sides, at the first one."""
    leave_rule: LeaveRule = "front"
    """Where a free heading counts: "front" within 90 degrees of the direction of travel, "any" everywhere."""
    round_corners: bool = True
    """Whether a differential robot that has no inertia rounds the corners of walls on arcs, and those between them and its way,
    which is faster. Among thin things that stand close together it keeps to contours exactly. VisBug, and bugs that go to
    sub-goals, have ways of their own: with them it does nothing."""


def alternating_side(memory: BugMemory, first: int) -> int:
    """Side for the next hit point of a bug that changes sides at each: the first one's, the other, and so on."""
    return first if len(memory.hits) % 2 == 0 else -first


FREE_MODES = ("motion_to_goal", "leaving", "leaving_straight")
"""Modes in which a bug that follows no wall goes straight to a place farther away."""


class BoundaryBug(ThinningPolicy):
    """What bugs that follow walls with a hand share.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a clearance not above the radius, an unknown turn or rule; a scanner that does not show what following
            walls needs (MisfitError).
    """

    Parameters: ClassVar[type[BoundaryParameters]] = BoundaryParameters
    parameters: BoundaryParameters
    looks_while_turning = False
    fresh_starts: ClassVar[int] = 0
    """How often it begins anew where it goes round in vain, see `Boundary.fresh_starts`."""

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        self.boundary = Boundary(sensors, clearance=own.clearance, leave_rule=own.leave_rule, foresees=self.foresees)
        self.boundary.require_corners()
        self.boundary.fresh_starts = self.fresh_starts
        self.room = self.boundary.safe_radius - sensors.radius
        self.side = side_of(own.turn)
        rounds = own.round_corners and self._follows_course and sensors.drive.kinematics == "differential"
        if rounds and not sensors.drive.has_inertia:
            self.boundary.round_corners()

    @property
    def kept(self) -> Boundary:
        """How it keeps to walls."""
        return self.boundary

    def without_course(self) -> Self:
        """Itself, for who drives by its velocities alone: it keeps to contours exactly."""
        self.boundary.rounding = None
        return self

    def driven_late(self) -> Self:
        """The same, for who decides by what a robot sees now, also where commands act late."""
        self.boundary.decide_late()
        return self.without_course()

    def course(self, view: View, memory: Any, velocity: Velocity) -> Course | None:
        """Straight on, taken up in an arc; exactly where the velocity leads along walls, back as it came, and with inertia."""
        contour = memory.landing if memory.contour is None else memory.contour
        if contour is not None and contour.course is not None and self.boundary.rounding is not None:
            return Course(contour.course, self.boundary.rounding.aside, contour.side, self.boundary.rounding.toward)
        is_bound = memory.contour is not None or memory.mode not in FREE_MODES or self.sensors.drive.has_inertia
        return None if is_bound else straight_on(self.sensors.drive, velocity, view.goal, self.sensors.goal_radius)

    def draw(self, memory: Any) -> Drawing:
        """Hit and leave points, and the wall that the hand is on."""
        return self.boundary.draw(memory)
