"""HD-BUG's tangential circumnavigation: TangentBug, whose lap alone may say that there is no way.

Source: Hasibuzzaman, Jan and Wu name it and leave it open; TangentBug is of Kamon, Rimon and Rivlin (1998). Doors may
lead the robot astray as long as they like within a bound: then it goes round what is in the way, as TangentBug does, and
leaves it only nearer to the goal than it has ever been. So it falls back finitely often, and arrives or is right.
"""

from __future__ import annotations

import math

from bug_gym.agents.bugs.tangent_bug import TangentBug, TangentBugMemory
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.walls.contour import TARGET_MOVED
from bug_gym.policy import Drawing, Velocity
from bug_gym.steering import Course
from bug_gym.view import Sensors, View

EXTRA = 2.0
"""Added to the distance to the goal where patience is measured in it [m]."""

STANDS, STANDS_FOR = 0.25, 60
"""Within this of one place [m] for so many decisions it does not get on."""


class Circumnavigation:
    """The fall-back, and when it begins and ends.

    Args:
        sensors: what a driver knows of the robot.
        clearance: centre to wall that it keeps [m]; None: as other bugs.
        patience: how far it may go without coming nearer to the goal, in distances to it.
        is_driven_alone: whether the robot is driven by velocities alone; else it rounds corners as TangentBug does.
    """

    def __init__(
        self, sensors: Sensors, clearance: float | None, patience: float, *, is_driven_alone: bool = False
    ) -> None:
        self.tangent_bug = TangentBug(sensors, clearance=clearance)
        if is_driven_alone or sensors.drive.latency > 0 or self.tangent_bug.boundary.rounding is None:
            self.tangent_bug.driven_late()
        self.boundary = self.tangent_bug.boundary
        """What it shares with the other bugs: clearances, and how a robot goes straight."""
        self.patience = patience

    def measure(self, view: View, memory: HDBugMemory) -> None:
        """Bring the least distance to the goal up to date; a goal that has moved has no least distance yet."""
        goal = view.goal_position
        if memory.measured_to is None or math.dist(memory.measured_to, goal) > TARGET_MOVED:
            memory.measured_to, memory.best, memory.follow = goal, math.inf, None
        if view.goal_distance < memory.best - self.boundary.progress:
            memory.best, memory.best_at = view.goal_distance, memory.odometer

    def is_due(self, view: View, memory: HDBugMemory) -> bool:
        """Whether candidates have had their time: it is by the goal, or has gone too long a way, or none, to come nearer."""
        if self.is_by_goal(view):
            return True
        if memory.odometer - memory.best_at > self.patience * (memory.best + EXTRA):
            return True
        return self.stands_still(view, memory)

    def is_by_goal(self, view: View) -> bool:
        """Whether the goal is so near that it is gone round what hides it, as by robots that have arrived: doors lead away."""
        return view.goal_distance <= self.boundary.exact_length

    def stands_still(self, view: View, memory: HDBugMemory) -> bool:
        """Whether it has not got on for long; to be asked once a decision."""
        if math.dist(view.position, memory.anchor) > STANDS:
            memory.anchor, memory.anchored = view.position, 0
        memory.anchored += 1
        return memory.anchored > STANDS_FOR

    def begin(self, memory: HDBugMemory) -> None:
        """Go round what is in the way from here on."""
        memory.follow, memory.follow_best = self.tangent_bug.start(), memory.best
        memory.door, memory.way, memory.is_passing = None, [], False

    def velocity(self, view: View, memory: HDBugMemory) -> Velocity:
        """Velocity along the obstacle, robot's frame [m/s]; it notes when the obstacle is left, or there is a verdict."""
        assert isinstance(memory.follow, TangentBugMemory)
        memory.mode = "circumnavigation"
        velocity = self.tangent_bug.act(view, memory.follow)
        memory.verdict = memory.follow.verdict
        is_nearer = view.goal_distance < memory.follow_best - self.boundary.progress
        if is_nearer and memory.follow.mode == "motion_to_goal" and not self.is_by_goal(view):
            memory.follow, memory.must_look = None, True
            memory.anchor, memory.anchored = view.position, 0
        return velocity

    def course(self, view: View, memory: HDBugMemory, velocity: Velocity) -> Course | None:
        """Where a velocity along the obstacle leads on, for a robot that rounds its corners."""
        return None if self.boundary.rounding is None else self.tangent_bug.course(view, memory.follow, velocity)

    def draw(self, memory: HDBugMemory) -> Drawing:
        """Hit and leave points, and the wall that is followed."""
        return self.tangent_bug.draw(memory.follow) if isinstance(memory.follow, TangentBugMemory) else Drawing()
