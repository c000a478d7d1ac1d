"""ModifiedCriticalPointBug: CriticalPointBug for a point robot among moving obstacles.

Source: the step between Dutta, Debnath and Das (2016) and Das, Dutta and Debnath (2020), who name it as the algorithm
that theirs grew out of: it avoids moving obstacles, its robot is a point. What it does with them is taken from the
later paper. Sensing assumed: a scan all round; goal, own position. Memory kept: the corners visited, what stands, what
has shifted once and twice. States: motion_to_goal, motion_to_sub_goal, corner_rounding. Where the track of a moving
obstacle meets the robot's straight way to the goal in time, a virtual obstacle is put into the scan there, and is gone
round like one that stands. There is no SAFE_POINT and no virtual circle; a robot that is no point keeps the clearance.
Guarantee: none, it can cycle (then "looping"); with no sub-goal left it stops as "stuck". Length bound: none.

Reported: nothing of its own; the later paper names it as a step. Found: it uses what was repaired there, the obstacle's own
distance in equation (10) and tracks of discs in place of shifting open points; so the times at which tracks meet are those
of that policy. Among still obstacles it goes the way of CriticalPointBug; it comes through all scenes with movers, one of
which CriticalPointBug touches, but goes a long way round before the crossing one: docs/results/operative-critical-points.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bug_gym.agents.bugs.critical_point_bug import CriticalPointBug
from bug_gym.agents.critical_points.meeting import Mover, VirtualObstacle, meeting_times, ring, virtual_obstacle
from bug_gym.agents.critical_points.moving import TrackSets, rules_of_looks
from bug_gym.agents.critical_points.scan_kernels import cast_capsule
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory
from bug_gym.agents.walls.sub_goals import SubGoalMemory
from bug_gym.geometry import velocity_along
from bug_gym.policy import Drawing, Velocity
from bug_gym.view import Sensors, View


@dataclass
class ModifiedMemory(SubGoalMemory):
    """Memory of ModifiedCriticalPointBug."""

    tracker: TrackerMemory | None = None
    """Tracks of what is seen."""
    sets: TrackSets = field(default_factory=TrackSets)
    """What stands and what moves."""
    time: float = 0.0
    """Time of the episode [s]."""
    virtual: dict[int, VirtualObstacle] = field(default_factory=dict)
    """Virtual obstacles by the number of the mover, odometry frame."""


class ModifiedCriticalPointBug(CriticalPointBug):
    """ModifiedCriticalPointBug; its parameters are those of SubGoalBug."""

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.tracker = Tracker(sensors)
        self.rules = rules_of_looks(sensors)

    def start(self) -> ModifiedMemory:
        """Memory of a new episode."""
        return ModifiedMemory(mode="motion_to_goal", tracker=self.tracker.start())

    def act(self, view: View, memory: ModifiedMemory) -> Velocity:
        """One decision, over a scan that holds the virtual obstacles too."""
        assert memory.tracker is not None
        things, _ = self.tracker.things(memory.tracker, view, memory.time)
        movers, _ = memory.sets.update(things, memory.time, self.rules)
        self._note_meetings(view, memory, movers)
        memory.time += self.sensors.drive.step
        return super().act(self._with_virtual(view, memory), memory)

    def _note_meetings(self, view: View, memory: ModifiedMemory, movers: list[Mover]) -> None:
        """Bring the virtual obstacles up to the present: each lasts until it is passed, or the tracks part.

        A robot under way round one meets it no longer on its own track, so what counts is the straight way to the goal.
        """
        boundary, speed = self.sub_goals.boundary, self.sensors.drive.max_speed
        velocity = velocity_along(view.goal_bearing + view.heading, speed)
        found = {}
        for mover in movers:
            times = meeting_times(view.position, velocity, mover, boundary.inner + mover.radius)
            if times is not None and times.first <= view.goal_distance / speed:
                found[mover.number] = virtual_obstacle(mover, times)
        memory.virtual = found

    def _with_virtual(self, view: View, memory: ModifiedMemory) -> View:
        """The observation, as if the virtual obstacles were seen too."""
        if not memory.virtual:
            return view
        ranges, owner = view.ranges.copy(), np.empty(len(view.ranges), dtype=np.int64)
        cos, sin = np.ascontiguousarray(self.sensors.beam_directions)
        inner = self.sub_goals.boundary.inner
        for obstacle in memory.virtual.values():
            begin, end = view.to_robot(*obstacle.begin), view.to_robot(*obstacle.end)
            if math.hypot(*begin) > inner + obstacle.radius and math.hypot(*end) > inner + obstacle.radius:
                cast_capsule(cos, sin, *begin, *end, obstacle.radius, 0, ranges, owner)
        return view.with_ranges(ranges)

    def draw(self, memory: ModifiedMemory) -> Drawing:
        """Sub-goals, the present corner and the virtual obstacles."""
        drawing = super().draw(memory)
        areas = [(ring(one.begin, one.end, one.radius), "virtual") for one in memory.virtual.values()]
        return Drawing(points=drawing.points, areas=areas)
