"""Whether a robot in a potential field is caught in a local minimum.

Source: the paper on potential field and wall following, its switch conditions 1 and 2. A robot overshoots the place where
the forces cancel, so two conditions serve. Ours: they hold at two of three decisions, as a robot may go to and fro at
each; the direction of travel is that of the last 0.3 s, as a robot that turns on the spot has none; a third condition, for
a robot that wanders about.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from bug_gym.agents.potential_field.field import Forces
from bug_gym.geometry import Point, wrap
from bug_gym.view import View

VANISHING = 0.05
"""epsilon of condition 1: share of the attraction below which the sum of the forces is nothing."""

TRAVEL_TIME = 0.3
"""Time over which the direction of travel is taken [s]."""

TRAVEL_WAY = 0.02
"""Way in that time below which the robot stands [m]."""

HELD, OF_LAST = 2, 3
"""At how many decisions conditions 1 or 2 must hold, and of how many."""

SWING_TIME = 3.0
"""Time without progress after which a robot swings [s]."""

SWING_WAY = 0.1
"""By how much nearer to the target is progress [m]."""


@dataclass
class MinimumMemory:
    """What the watch for local minima remembers."""

    places: deque[Point] = field(default_factory=deque)
    """Own places of the last TRAVEL_TIME, odometry frame [m]."""
    caught: deque[bool] = field(default_factory=lambda: deque(maxlen=OF_LAST))
    """Whether condition 1 or 2 held at each of the last decisions."""
    nearest: float = math.inf
    """Smallest distance to the target [m]."""
    waited: float = 0.0
    """Time since that became smaller [s]."""
    why: str = ""
    """What the last minimum was known by: "force", "away" or "swing"."""


def travel_direction(view: View, memory: MinimumMemory) -> float:
    """Direction of travel from the heading [rad]: of the last TRAVEL_TIME, or zero for a robot that stands."""
    memory.places.append(view.position)
    if len(memory.places) > max(round(TRAVEL_TIME / view.sensors.drive.step), 1) + 1:
        memory.places.popleft()
    (x0, y0), (x1, y1) = memory.places[0], memory.places[-1]
    if math.hypot(x1 - x0, y1 - y0) <= TRAVEL_WAY:
        return 0.0
    return wrap(math.atan2(y1 - y0, x1 - x0) - view.heading)


def is_caught(view: View, memory: MinimumMemory, forces: Forces, direction: float) -> bool:
    """Whether this is a local minimum; call once a decision.

    Args:
        view: the observation.
        memory: brought up to this decision.
        forces: of the field here.
        direction: of travel, from the heading [rad].
    """
    if view.goal_distance < memory.nearest - SWING_WAY:
        memory.nearest, memory.waited = view.goal_distance, 0.0
    else:
        memory.waited += view.sensors.drive.step
    if view.goal_distance <= view.sensors.goal_radius:
        return False
    is_blocked = any(not one.is_moving for one in forces.obstacles)
    vanishes = math.hypot(*forces.total) < VANISHING * math.hypot(*forces.attraction)
    goes_away = abs(wrap(view.goal_bearing - direction)) > 0.5 * math.pi
    memory.caught.append(is_blocked and (vanishes or goes_away))
    if is_blocked and memory.waited >= SWING_TIME:  # before the others, who may be told to wait
        memory.why = "swing"
        return True
    if memory.caught[-1] and sum(memory.caught) >= HELD:
        memory.why = "force" if vanishes else "away"
        return True
    return False
