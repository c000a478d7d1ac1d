"""Whether a disc fits at a point among the rings of a world; the compiled counterpart of `worlds.clearance.is_clear`."""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Floats, Integers


@inlined
def is_nearer(dx: float, dy: float, room: float) -> bool:
    """Whether a vector is shorter than `room`: by its square, or by the exact length where rounding could decide."""
    squared, limit = dx * dx + dy * dy, room * room
    if abs(squared - limit) > 1e-12 * limit:
        return squared < limit
    return math.hypot(dx, dy) < room


@kernel
def fits(corners: Floats, firsts: Integers, x: float, y: float, room: float) -> bool:
    """Whether a disc of radius `room` lies in the first ring, in no other one, and over no side.

    Args:
        corners: (n, 2) of the border, then of the shells of polygons, which have no holes [m].
        firsts: (rings + 1,), where each ring begins.
        x: of the disc's centre [m].
        y: of the disc's centre [m].
        room: its radius [m].
    """
    for ring in range(firsts.size - 1):
        is_inside = False
        begin, end = firsts[ring], firsts[ring + 1]
        ax, ay = corners[end - 1, 0], corners[end - 1, 1]
        for corner in range(begin, end):
            bx, by = corners[corner, 0], corners[corner, 1]
            along_x, along_y = bx - ax, by - ay
            if (ay > y) != (by > y) and x < ax + (y - ay) * along_x / along_y:
                is_inside = not is_inside
            squared = max(along_x * along_x + along_y * along_y, 1e-300)
            share = min(max(((x - ax) * along_x + (y - ay) * along_y) / squared, 0.0), 1.0)
            if is_nearer(ax + share * along_x - x, ay + share * along_y - y, room):
                return False
            ax, ay = bx, by
        if is_inside != (ring == 0):
            return False
    return True
