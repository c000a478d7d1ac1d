"""The first heading along a wall that leaves a step's room (wall following)."""

from __future__ import annotations

import math

from bug_gym.compiling import kernel
from bug_gym.kernels.free_way import free_distance
from bug_gym.kernels.layout import Floats


@kernel
def gap_after_step(px: Floats, py: Floats, angle: float, step: float) -> float:
    """Distance from the end of a straight step to the nearest scan point [m]."""
    ex, ey = step * math.cos(angle), step * math.sin(angle)
    nearest = math.inf
    for i in range(px.size):
        dx, dy = px[i] - ex, py[i] - ey
        square = dx * dx + dy * dy
        nearest = square if square < nearest else nearest
    return math.sqrt(nearest)


@kernel
def first_open_heading(
    px: Floats, py: Floats, wall_angle: float, side: int, step: float, clearance: float, radius: float, increment: float
) -> float:
    """First heading, turning away from the wall, along which a step ends at `clearance` or more from every point.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        wall_angle: bearing of the wall where the search begins [rad].
        side: +1 turns counter-clockwise (wall on the right), -1 clockwise.
        step: length of the step [m].
        clearance: distance to keep at its end [m].
        radius: the whole step must be free for a disc of this radius [m].
        increment: angle between headings tried [rad]; the first open one is refined by bisection.

    Returns:
        The angle turned from `wall_angle` [rad], or -1 where no heading is open.
    """
    last = 0.0
    for j in range(int(2.0 * math.pi / increment) + 1):
        turned = j * increment
        angle = wall_angle + side * turned
        if gap_after_step(px, py, angle, step) >= clearance and free_distance(px, py, angle, radius, step) >= step:
            if j == 0:
                return 0.0
            for _ in range(12):
                middle = 0.5 * (last + turned)
                angle = wall_angle + side * middle
                if (
                    gap_after_step(px, py, angle, step) >= clearance
                    and free_distance(px, py, angle, radius, step) >= step
                ):
                    turned = middle
                else:
                    last = middle
            return turned
        last = turned
    return -1.0
