"""Where a robot that follows a wall will come, as its present scan shows the wall: the contour ahead.

The rule of boundary following (walls.boundary) step by step on one scan: from the last heading turned toward the wall, away
from it until a step ends at the clearance. Coarser than the rule itself, which is asked again at each decision.
"""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Floats

TRIED = math.radians(8.0)
"""Angle between the headings tried [rad]."""

MOST_INWARD = math.radians(110.0)
"""Turning toward the wall after which the contour ahead is only guessed: the wall there is out of sight [rad]."""


@inlined
def is_clear(px: Floats, py: Floats, x: float, y: float, square: float) -> bool:
    """Whether no point lies nearer to a place than the root of `square`."""
    for i in range(px.size):
        dx, dy = px[i] - x, py[i] - y
        if dx * dx + dy * dy < square:
            return False
    return True


@kernel
def contour_ahead(
    px: Floats, py: Floats, bearing: float, side: int, step: float, clearance: float, places: Floats
) -> int:
    """Places along the contour from the robot on, into `places` (m, 2), the robot's own first; how many there are.

    Args:
        px, py: the scan's points (k,) in the robot's frame [m].
        bearing: of the first step [rad].
        side: +1 with the wall on the right, -1 on the left.
        step: length of a step [m].
        clearance: distance to the wall at which a step ends [m].
        places: (m, 2) result, m at least 2 [m].
    """
    places[0, 0], places[0, 1] = 0.0, 0.0
    x, y, heading, inward = step * math.cos(bearing), step * math.sin(bearing), bearing, 0.0
    places[1, 0], places[1, 1] = x, y
    # Round a point a step turns by so much.
    back = 2.0 * math.asin(min(0.5 * step / clearance, 1.0))
    square = clearance * clearance
    for count in range(2, len(places)):
        low, high, is_open = 0.0, -back, False
        while high < math.pi:
            angle = heading + side * high
            if is_clear(px, py, x + step * math.cos(angle), y + step * math.sin(angle), square):
                is_open = True
                break
            low, high = high, high + TRIED
        if not is_open:
            return count
        if high > -back:
            for _ in range(3):
                middle = 0.5 * (low + high)
                angle = heading + side * middle
                if is_clear(px, py, x + step * math.cos(angle), y + step * math.sin(angle), square):
                    high = middle
                else:
                    low = middle
        heading += side * high
        inward -= high
        if inward > MOST_INWARD:
            return count
        x, y = x + step * math.cos(heading), y + step * math.sin(heading)
        places[count, 0], places[count, 1] = x, y
    return len(places)
