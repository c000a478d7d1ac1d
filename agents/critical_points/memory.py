"""Parameters and memory of OperativeCriticalPointBug."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from bug_gym.agents.critical_points.cost import Cost
from bug_gym.agents.critical_points.meeting import VirtualObstacle
from bug_gym.agents.critical_points.moving import OpenPointSets, TrackSets
from bug_gym.agents.parameters import Length
from bug_gym.agents.tracking.tracker import TrackerMemory
from bug_gym.agents.walls.boundary import Turn
from bug_gym.agents.walls.roaming import Roaming
from bug_gym.geometry import Point
from bug_gym.policy import Memory


@dataclass(frozen=True)
class OperativeParameters:
    """Parameters of OperativeCriticalPointBug."""

    safety: Length | None = None
    """Safety constant lambda, what the virtual circle is wider than the body all round [m]; None: the way of one step."""
    clearance: Length | None = None
    """Radius of the virtual circle [m], instead of `safety`."""
    turn: Turn = "left"
    """Which of two equally good sub-goals to take, seen from the line to the goal."""
    sub_goal: Literal["printed", "perpendicular", "validated"] = "validated"
    """"printed": the four cases with their misprint; "perpendicular": one formula for all bearings, the leg not looked
    at; "validated": legs looked at at each step with a swept disc."""
    safe_point: bool = True
    """Whether SAFE_POINT keeps the robot out of gaps up to the width of the virtual circle."""
    gap_rule: Literal["leg", "two_nearest"] | None = None
    """The gap that SAFE_POINT measures: "leg", the least between points on both sides of the leg; "two_nearest" as
    printed, between facing open points, and of a step ahead between the two open points nearest to it. None: as printed
    with sub-goals as printed, else "leg"."""
    classify: Literal["tracks", "open_points"] = "tracks"
    """By what things are told to move: "tracks", fitted discs; "open_points" as printed, which slide over round bodies."""
    timing: Literal["corrected", "printed"] = "corrected"
    """O_TC by the obstacle's distance to the meeting point, or as (10) is printed, by the robot's."""
    jump: Length | None = None
    """Change of the reading that makes an open point [m]; None: 0.5, for small robots less, and six times the noise."""


class LastEnd(NamedTuple):
    """An open point; odometry frame."""

    place: Point
    """[m]."""
    side: int
    """+1: the left end of an obstacle, -1: the right one."""


class CriticalPoint(NamedTuple):
    """A chosen sub-goal; odometry frame."""

    place: Point
    """Where the circle's centre goes [m]."""
    open_point: LastEnd
    """What it lies beside."""
    deadline: float
    """Time of the episode after which it counts as out of reach [s]."""


@dataclass
class OperativeMemory(Memory):
    """Memory of OperativeCriticalPointBug; places in the odometry frame [m]."""

    tracker: TrackerMemory | None = None
    """Tracks of what is seen."""
    sets: TrackSets = field(default_factory=TrackSets)
    """What stands and what moves."""
    printed_sets: OpenPointSets = field(default_factory=OpenPointSets)
    """The same by open points."""
    time: float = 0.0
    """Time of the episode [s]."""
    goal_seen: Point | None = None
    """Where the goal was at the last decision, odometry frame [m]."""
    goal_shift: float = 0.0
    """By how much its bearing has changed since by its own motion, at most [rad]."""
    goal: Point | None = None
    """Where the target was when all this was remembered."""
    critical: CriticalPoint | None = None
    """Where it goes; None on the way to the goal."""
    traversed: list[Point] = field(default_factory=list)
    """T: critical points chosen and reached."""
    refused: list[Point] = field(default_factory=list)
    """Critical points given up on the way."""
    used: list[LastEnd] = field(default_factory=list)
    """Open points whose sub-goals were reached: they give no others."""
    last_ends: list[LastEnd] = field(default_factory=list)
    """Open points at the last look round."""
    looked_at: float = -math.inf
    """When that was [s]."""
    critical_points: list[Point] = field(default_factory=list)
    """All that were chosen, in order; each is an iteration."""
    open_points: list[Point] = field(default_factory=list)
    """Those in sight at the last choice."""
    sub_goals: list[Point] = field(default_factory=list)
    """Those of the last choice."""
    virtual: dict[int, VirtualObstacle] = field(default_factory=dict)
    """Virtual obstacles by the number of the mover."""
    circle: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The virtual circle x, y and radius."""
    movers: set[int] = field(default_factory=set)
    """Numbers of the moving obstacles found so far."""
    avoided: set[int] = field(default_factory=set)
    """Those of them that had a virtual obstacle."""
    roaming: Roaming = field(default_factory=Roaming)
    """How far it has gone, and over what ground."""
    waited: float = 0.0
    """Time without anywhere to go [s]."""
    cost: Cost = field(default_factory=Cost)
    """C_T and its parts."""
