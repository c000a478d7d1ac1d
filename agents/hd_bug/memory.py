"""What HD-BUG keeps of one episode."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.ladder import Ladder
from bug_gym.agents.hd_bug.light import HEADINGS
from bug_gym.agents.hd_bug.moving_goal import MovingGoal
from bug_gym.agents.hd_bug.path_list import Door, PathList
from bug_gym.agents.tracking.tracker import TrackerMemory
from bug_gym.agents.walls.contour import BugMemory
from bug_gym.geometry import F64, Point
from bug_gym.policy import Memory


class Walls(NamedTuple):
    """What a scan shows of walls: its points, and points of the lines that join those of one wall."""

    x: F64
    """(m,) odometry frame [m]."""
    y: F64
    """The same."""
    still: NDArray[np.bool_]
    """(m,) whether it is of something still."""


@dataclass
class Closing:
    """A door that led nowhere."""

    place: Point
    """Its q, odometry frame [m]."""
    until: float
    """Decision until which it counts; infinite where nothing moved near it."""


@dataclass(kw_only=True)
class HDBugMemory(Memory):
    """Memory of HD-BUG."""

    tracker: TrackerMemory
    path: PathList = field(default_factory=PathList)
    """Where it has been, and what of the ground was light from there."""
    ladder: Ladder = field(default_factory=Ladder)
    steps: int = 0
    """Decisions so far."""
    odometer: float = 0.0
    """Way travelled [m]."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose at this decision."""
    moving_goal: MovingGoal = field(default_factory=MovingGoal)
    """How the goal moves."""
    goal: Point = (0.0, 0.0)
    """Where to: the goal or where it can be met, odometry frame [m]."""
    measured_to: Point | None = None
    """Where the goal was when `best` was measured [m]."""
    best: float = math.inf
    """Least distance to the goal so far [m]."""
    best_at: float = 0.0
    """Odometer when it was reached [m]."""
    looked_at: float = -math.inf
    """Odometer when it last looked for doors [m]."""
    must_look: bool = True
    """Whether it looks for doors in any case."""
    door: Door | None = None
    """The candidate that it heads for."""
    heading_to: Point = (math.inf, math.inf)
    """q of the last one [m]."""
    is_passing: bool = False
    """Whether it goes through that door already."""
    way: list[int] = field(default_factory=list)
    """Numbers of the nodes that it goes back over, to that door's owner."""
    closed: list[Closing] = field(default_factory=list)
    """Doors that led nowhere."""
    anchor: Point = (0.0, 0.0)
    """Where it was when it last got on, odometry frame [m]."""
    anchored: int = 0
    """Decisions since then."""
    follow: BugMemory | None = None
    """Memory of the tangential circumnavigation, while it lasts."""
    follow_best: float = math.inf
    """Least distance to the goal when that began [m]."""
    light: F64 = field(default_factory=lambda: np.zeros(HEADINGS))
    """Light area (K,) when it last looked [m]."""
    walls: Walls | None = None
    """The walls in sight when it last looked."""
    reach: float = 0.0
    """Detection radius r' at this decision [m]."""
    candidates: F64 = field(default_factory=lambda: np.empty((0, 2)))
    """Candidates (m, 2) of the last choice, odometry frame [m]."""
    costs: F64 = field(default_factory=lambda: np.empty(0))
    """Their costs (m,) [m]."""
    chosen: Point = (0.0, 0.0)
    """Where it heads for, odometry frame [m]."""
    direction: float = 0.0
    """Direction of the last velocity, odometry frame [rad]."""
    rounds_corners: bool = False
    """Whether it goes along an obstacle as TangentBug does, on arcs round its corners."""
    is_backing: bool = False
    """Whether it drives straight back."""
    forecast: F64 = field(default_factory=lambda: np.empty((0, 0, 2)))
    """Predicted places (T, K, 2) of the movers, odometry frame [m]."""
