"""What the map planner keeps of one episode."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bug_gym.agents.hd_bug.ladder import Ladder
from bug_gym.agents.hd_bug.moving_goal import MovingGoal
from bug_gym.agents.hd_bug_map.light_area import LightArea
from bug_gym.agents.hd_bug_map.poses import Turns
from bug_gym.agents.mapping.goal_watch import GoalWatch
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.tracking.tracker import TrackerMemory
from bug_gym.geometry import F64, Point
from bug_gym.policy import Memory


@dataclass(kw_only=True)
class HDBugMapMemory(Memory):
    """Memory of the map planner."""

    tracker: TrackerMemory
    map: PointMap | None = None
    """Remembered points of still obstacles; None before the first decision."""
    body_map: PointMap | None = None
    """The same points at the clearance of the circles of a long body; None for a round one."""
    way: Way | None = None
    """The planned path: from the robot to the goal, odometry frame [m]."""
    turns: Turns | None = None
    """What leads a long body through where it has to turn; None elsewhere."""
    backs_out: bool = False
    """Whether a long body goes straight back to where it can turn, as no poses lead on."""
    ladder: Ladder = field(default_factory=Ladder)
    steps: int = 0
    """Decisions so far."""
    planned_at: int = 0
    """Decision at which the way was planned."""
    removed_then: int = 0
    """Points taken away from the map until then."""
    revised_then: int = 0
    """Cells of the map whose ground had been revised until then."""
    turned_back: dict[tuple[int, int], int] = field(default_factory=dict)
    """How often it was turned back before a cell of the map that is open there and shut for the body, by its place."""
    held: int = 0
    """Decisions in a row in which it stood though it meant to drive."""
    barred_then: int | None = None
    """Points taken away from the map until a cell was barred for that; None where none is."""
    bars_lifted: int = 0
    """How often such cells have been tried again."""
    closed_off: int = 0
    """Decisions in a row without any way."""
    moved_at: int = -(10**9)
    """Decision at which something was last seen moving or gone."""
    goal_watch: GoalWatch = field(default_factory=GoalWatch)
    """Whether the goal goes elsewhere."""
    moving_goal: MovingGoal = field(default_factory=MovingGoal)
    """How the goal moves."""
    goal: Point = (0.0, 0.0)
    """Where to: the goal or where it can be met, odometry frame [m]."""
    goal_radius: float = 0.0
    """Adaptive goal radius [m]."""
    is_goal_by_wall: bool = False
    """Whether the way is one to a goal by walls that ends before it, and the present scan tells how near the body comes."""
    beside_goal: int = 0
    """Decisions in which it has been near such a goal."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose at this decision."""
    light: LightArea | None = None
    """Light and shadow at this decision."""
    candidates: F64 = field(default_factory=lambda: np.empty((0, 2)))
    """Where the velocities looked at among movers lead (m, 2), odometry frame [m]."""
    costs: F64 = field(default_factory=lambda: np.empty(0))
    """Their costs (m,) [m]."""
    chosen: Point = (0.0, 0.0)
    """Where it heads for, odometry frame [m]."""
    direction: float = 0.0
    """Direction of the last velocity, odometry frame [rad]."""
    is_backing: bool = False
    """Whether it drives straight back."""
    has_stood: bool = False
    """Whether it stood since the decision before."""
    arc: tuple[float, float] | None = None
    """Forward speed [m/s] and turn rate [rad/s] with which it leaves what has come up on it; None: it need not."""
    forecast: F64 = field(default_factory=lambda: np.empty((0, 0, 2)))
    """Predicted places (T, K, 2) of the movers, odometry frame [m]."""
