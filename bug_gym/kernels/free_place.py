"""Whether a disc fits at a point among the rings of a world, and places drawn where it does.

The compiled counterpart of `worlds.clearance.is_clear` and of `worlds.places.draw_both`.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.generator import Words, drawn_between
from bug_gym.kernels.layout import Floats, Integers

IN_DOUBT = 1e-12  # squares that differ by this share of one another may be of equal lengths
Box = tuple[float, float, float, float]


@inlined
def is_nearer(dx: float, dy: float, room: float) -> bool:
    """Whether a vector is shorter than `room`: by its square, or by the exact length where rounding could decide."""
    squared, limit = dx * dx + dy * dy, room * room
    if abs(squared - limit) > IN_DOUBT * limit:
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


@called
def draw_free(
    g: Words, corners: Floats, firsts: Integers, room: float, box: Box, tries: int, place: Floats, at: int
) -> bool:
    """Draw a point of a box where a disc fits into `place`, from `at` on; whether one was found."""
    for _ in range(tries):
        x, y = drawn_between(g, box[0], box[2]), drawn_between(g, box[1], box[3])
        if fits(corners, firsts, x, y, room):
            place[at], place[at + 1] = x, y
            return True
    return False


@kernel
def draw_start_and_goal(
    g: Words,
    corners: Floats,
    firsts: Integers,
    room: float,
    start: Box,
    heading: float,
    goal: Box,
    separation: float,
    tries: int,
    places: Floats,
) -> bool:
    """Draw a start and a goal where a disc fits, `separation` [m] apart.

    Args:
        g: the generator.
        corners: as `fits` has it.
        firsts: as `fits` has it.
        room: the disc's radius [m].
        start: box to draw the start from: xmin, ymin, xmax, ymax [m].
        heading: of the start [rad]; NaN: drawn.
        goal: box to draw the goal from [m].
        separation: least distance between them [m].
        tries: at each point, and at both.
        places: (5,) to write: x, y [m], heading [rad] of the start, x, y of the goal [m].

    Returns:
        Whether they were found; False too where rounding could decide whether they are far enough apart.
    """
    limit = separation * separation
    for _ in range(tries):
        if not draw_free(g, corners, firsts, room, start, tries, places, 0):
            return False
        places[2] = drawn_between(g, -math.pi, math.pi) if math.isnan(heading) else heading
        if not draw_free(g, corners, firsts, room, goal, tries, places, 3):
            return False
        dx, dy = places[0] - places[3], places[1] - places[4]
        squared = dx * dx + dy * dy
        if abs(squared - limit) <= IN_DOUBT * limit:
            return False
        if squared > limit:
            return True
    return False
