"""Whether a robot that has inertia can still stop before what its scan shows.

For policies, as `free_way`: `px`, `py` (k,) are points in the robot's frame. Nothing here sees the world.
"""

from __future__ import annotations

import math

from bug_gym.compiling import kernel
from bug_gym.kernels.chords import chord_square
from bug_gym.kernels.layout import Floats

EASED = 1e-3
"""By how much a body may come nearer [m] to a point that is nearer than the margin already."""


@kernel
def stopping_way(speed: float, acceleration: float, step: float) -> float:
    """Way [m] of a robot that drives a step at `speed` [m/s] and brakes from the next on, that step not counted."""
    if math.isinf(acceleration) or speed == 0.0:
        return 0.0
    loss = acceleration * step
    steps = math.floor(speed / loss)
    return step * (steps * speed - loss * 0.5 * steps * (steps + 1.0))


@kernel
def keeps_clear(
    px: Floats,
    py: Floats,
    circles: Floats,
    x: float,
    y: float,
    turn: float,
    wx: float,
    wy: float,
    margin: float,
    gap: float,
) -> bool:
    """Whether a body stays clear of points on a step to (x, y) with a turn, and on a straight way after it.

    Args:
        px, py: the points (k,), in the frame in which the body stands at the origin and looks along x [m].
        circles: the body as x, y, radius (c, 3) [m].
        x, y: where its origin is after the step [m].
        turn: how far it turns meanwhile [rad].
        wx, wy: the way after it [m].
        margin: what is kept about the body [m].
        gap: half the angle between two beams [rad]: what a point belongs to may reach so far beside it, unseen.

    A point that is nearer already than that may not come nearer.
    """
    cos, sin = math.cos(turn), math.sin(turn)
    reach = math.hypot(x, y) + math.hypot(wx, wy)
    for c in range(circles.shape[0]):
        cx, cy, radius = circles[c, 0], circles[c, 1], circles[c, 2]
        # From where the circle's middle is to where the step brings it, and on.
        mx, my = x + cos * cx - sin * cy, y + sin * cx + cos * cy
        ex, ey = mx - cx, my - cy
        for i in range(px.size):
            dx, dy = cx - px[i], cy - py[i]
            square = dx * dx + dy * dy
            least = radius + margin + gap * math.sqrt(px[i] * px[i] + py[i] * py[i])
            far = reach + least + abs(turn) * math.hypot(cx, cy)
            if square > far * far:
                continue
            if square < least * least:
                least = math.sqrt(square) - EASED
                if least <= 0.0:
                    continue
            if chord_square(dx, dy, ex, ey, 1.0) < least * least:
                return False
            if chord_square(dx + ex, dy + ey, wx, wy, 1.0) < least * least:
                return False
    return True
