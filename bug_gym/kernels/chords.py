"""Contact on a chord: the straight way of one step, as a fraction from 0 to 1.

Everything is tested in the frame of one of the two bodies, so that one moving thing is left. NEVER means: no contact
on this chord.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.geometry import length

NEVER = 2.0


@called
def disc_contact(dx: float, dy: float, ex: float, ey: float, distance: float) -> float:
    """First fraction at which a point from (dx, dy) along (ex, ey) comes within `distance` of the origin, or NEVER."""
    a = ex * ex + ey * ey
    b = dx * ex + dy * ey
    c = dx * dx + dy * dy - distance * distance
    if b >= 0.0:
        return NEVER  # moving away, or standing
    if c <= 0.0:
        return 0.0
    root = b * b - a * c
    if root < 0.0:
        return NEVER
    fraction = c / (-b + math.sqrt(root))
    return fraction if fraction <= 1.0 else NEVER


@inlined
def chord_square(dx: float, dy: float, ex: float, ey: float, end: float) -> float:
    """Square of `nearest_on_chord`."""
    a = ex * ex + ey * ey
    fraction = 0.0
    if a > 0.0:
        fraction = min(max(-(dx * ex + dy * ey) / a, 0.0), end)
    x, y = dx + fraction * ex, dy + fraction * ey
    return x * x + y * y


@called
def nearest_on_chord(dx: float, dy: float, ex: float, ey: float, end: float) -> float:
    """Smallest distance from the origin of a point going from (dx, dy) along (ex, ey) up to the fraction `end`."""
    return math.sqrt(chord_square(dx, dy, ex, ey, end))


@called
def wall_contact(
    px: float, py: float, ex: float, ey: float, x1: float, y1: float, x2: float, y2: float, distance: float
) -> float:
    """First fraction at which a point from (px, py) along (ex, ey) comes within `distance` of a segment, or NEVER."""
    ux, uy = x2 - x1, y2 - y1
    extent = length(ux, uy)
    if extent > 0.0:
        ux, uy = ux / extent, uy / extent
        height = (px - x1) * -uy + (py - y1) * ux  # signed distance to the line
        rate = ex * -uy + ey * ux
        if height < 0.0:
            height, rate = -height, -rate
        # The line is touched no later than the ends.
        if rate >= 0.0:
            if height >= distance:
                return NEVER
        else:
            fraction = max((height - distance) / -rate, 0.0)
            if fraction > 1.0:
                return NEVER
            along = (px + fraction * ex - x1) * ux + (py + fraction * ey - y1) * uy
            if 0.0 <= along <= extent:
                return fraction
    return min(
        disc_contact(px - x1, py - y1, ex, ey, distance),
        disc_contact(px - x2, py - y2, ex, ey, distance),
    )


@inlined
def point_wall_square(px: float, py: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Square of `point_wall_distance`."""
    ux, uy = x2 - x1, y2 - y1
    square = ux * ux + uy * uy
    along = 0.0
    if square > 0.0:
        along = min(max(((px - x1) * ux + (py - y1) * uy) / square, 0.0), 1.0)
    x, y = px - x1 - along * ux, py - y1 - along * uy
    return x * x + y * y


@kernel
def point_wall_distance(px: float, py: float, x1: float, y1: float, x2: float, y2: float) -> float:
    """Distance of a point to a segment."""
    return math.sqrt(point_wall_square(px, py, x1, y1, x2, y2))


@called
def nearest_to_wall(
    px: float, py: float, ex: float, ey: float, x1: float, y1: float, x2: float, y2: float, end: float
) -> float:
    """Smallest distance to a segment of a point going from (px, py) along (ex, ey) up to the fraction `end`.

    Only called where there is no contact, so the chord and the segment don't cross and an end point is nearest.
    """
    square = min(
        min(
            point_wall_square(px, py, x1, y1, x2, y2),
            point_wall_square(px + end * ex, py + end * ey, x1, y1, x2, y2),
        ),
        min(
            chord_square(px - x1, py - y1, ex, ey, end),
            chord_square(px - x2, py - y2, ex, ey, end),
        ),
    )
    return math.sqrt(square)
