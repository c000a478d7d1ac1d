"""Rev3: change sides at each hit point; where one of the last two is met again, leave only nearer to the goal than both.

Source: Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments", figure 2. Sensing assumed:
contact (here the scan within the clearance), goal, own position. Memory kept: the last hit point, the one before, and
which of them is nearer to the goal. States: motion_to_goal, boundary_following, follow_wall_to_better_take_off.
Guarantee: none proven; it can cycle over more than two hit points, and then calls itself looping. Length bound: none.

The paper calls the goal unreachable where the last hit point is met while looking for a better take-off. A hit point on
another obstacle may be nearer to a goal that can be reached than anything on this one, so here a lap on which the way
was free somewhere only lowers the demand to the nearest such place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import Boundary, BugMemory, Contour, LeaveRule, Mark, Turn, alternating_side, side_of

SAVED = ("two", "all")
BETTER = "follow_wall_to_better_take_off"


@dataclass
class Rev3Memory(BugMemory):
    """Memory of Rev3."""

    last_hit: Mark | None = None
    """Last hit point (the paper's LHP)."""
    hit_before: Mark | None = None
    """Hit point before the last (HPBL)."""
    marks: list[Mark] = field(default_factory=list)
    """All hit points, for the guard."""
    is_searching: bool = False
    """Whether it follows the wall to a better take-off."""
    is_repeating: bool = False
    """Whether the guard found the last hit point and its side among earlier ones."""
    nearest_free: float = math.inf
    """Smallest distance to the goal of the places of this search where the way was free [m]."""
    lowered: float = 0.0
    """Distance to the goal that a search without success has lowered its demand to [m]; 0: none."""
