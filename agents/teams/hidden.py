"""What a partner's body hides from a scan, compiled: its beams are taken out, and what the partner sees there put in."""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Flags, Floats


@inlined
def is_body_point(x: float, y: float, bodies: Floats, reach: float) -> bool:
    """Whether a point lies within `reach` [m] of one of some places (k, 2) [m]."""
    for b in range(bodies.shape[0]):
        dx, dy = x - bodies[b, 0], y - bodies[b, 1]
        if dx * dx + dy * dy <= reach * reach:
            return True
    return False


@called
def put_wall(ranges: Floats, hidden: Flags, ux: Floats, uy: Floats, x: float, y: float, nx: float, ny: float) -> None:
    """Shorten the hidden beams that meet a piece of wall from (x, y) to (nx, ny) [m]."""
    for i in range(ranges.size):
        if not hidden[i]:
            continue
        aside, aside_end = ux[i] * y - uy[i] * x, ux[i] * ny - uy[i] * nx
        if aside * aside_end > 0.0 or aside == aside_end:
            continue
        share = aside / (aside - aside_end)
        along = (1.0 - share) * (ux[i] * x + uy[i] * y) + share * (ux[i] * nx + uy[i] * ny)
        if 0.0 < along < ranges[i]:
            ranges[i] = along


@kernel
def take_out_bodies(
    ranges: Floats, ux: Floats, uy: Floats, far: float, bodies: Floats, reach: float, hidden: Flags
) -> int:
    """Take the beams off bodies; returns how many, and marks them in `hidden` (B,).

    Args:
        ranges: (B,), changed in place [m].
        ux: directions' x (B,) in the robot's frame.
        uy: directions' y (B,).
        far: range that means "nothing seen" [m].
        bodies: places (k, 2) in the robot's frame [m].
        reach: how near to a place a point is of the body there [m].
        hidden: filled.
    """
    count = 0
    for i in range(ranges.size):
        hidden[i] = ranges[i] < far and is_body_point(ux[i] * ranges[i], uy[i] * ranges[i], bodies, reach)
        count += hidden[i]
    for i in range(ranges.size):
        if hidden[i]:
            ranges[i] = far
    return count


@kernel
def take_out_discs(ranges: Floats, ux: Floats, uy: Floats, far: float, bodies: Floats, reaches: Floats) -> None:
    """Take the beams off bodies of several sizes; what `take_out_bodies` does, where nobody asks which they were.

    Args:
        ranges: (B,), changed in place [m].
        ux: directions' x (B,) in the robot's frame.
        uy: directions' y (B,).
        far: range that means "nothing seen" [m].
        bodies: places (k, 2) in the robot's frame [m]; further columns are left alone.
        reaches: how near to each place a point is of the body there (k,) [m]; below 0: none is.
    """
    for i in range(ranges.size):
        if ranges[i] >= far:
            continue
        x, y = ux[i] * ranges[i], uy[i] * ranges[i]
        for b in range(reaches.size):
            dx, dy, reach = x - bodies[b, 0], y - bodies[b, 1], reaches[b]
            if reach >= 0.0 and dx * dx + dy * dy <= reach * reach:
                ranges[i] = far
                break


@called
def put_in_walls_of(
    ranges: Floats,
    hidden: Flags,
    ux: Floats,
    uy: Floats,
    far: float,
    bodies: Floats,
    reach: float,
    theirs: Floats,
    x: float,
    y: float,
    turn: float,
    widest: float,
) -> None:
    """The same for one partner at a place [m], with its ranges (B,) [m] and its heading [rad]."""
    cos, sin = math.cos(turn), math.sin(turn)
    beams = theirs.size
    for i in range(beams):
        j = (i + 1) % beams
        if theirs[i] >= far or theirs[j] >= far:
            continue
        x1 = x + theirs[i] * (cos * ux[i] - sin * uy[i])
        y1 = y + theirs[i] * (sin * ux[i] + cos * uy[i])
        x2 = x + theirs[j] * (cos * ux[j] - sin * uy[j])
        y2 = y + theirs[j] * (sin * ux[j] + cos * uy[j])
        length = widest * min(theirs[i], theirs[j])
        if (x2 - x1) * (x2 - x1) + (y2 - y1) * (y2 - y1) > length * length:
            continue
        if is_body_point(x1, y1, bodies, reach) or is_body_point(x2, y2, bodies, reach):
            continue
        put_wall(ranges, hidden, ux, uy, x1, y1, x2, y2)


@kernel
def put_in_walls(
    ranges: Floats,
    hidden: Flags,
    ux: Floats,
    uy: Floats,
    far: float,
    bodies: Floats,
    reach: float,
    theirs: Floats,
    places: Floats,
    widest: float,
) -> None:
    """Put into hidden beams the walls that partners see: pieces between neighbouring points of their scans.

    Args:
        ranges: (B,), changed in place [m].
        hidden: which beams to fill (B,).
        ux: directions' x (B,), in any robot's own frame.
        uy: directions' y (B,).
        far: range that means "nothing seen" [m].
        bodies: places (k, 2) of robots in the looking robot's frame, itself too: what is seen of them is no wall [m].
        reach: how near to a place a point is of the body there [m].
        theirs: the partners' ranges (p, B) [m].
        places: the partners' places [m] and headings [rad] in the looking robot's frame (p, 3).
        widest: two neighbouring points are of one wall where they are nearer than so many ranges.
    """
    for p in range(theirs.shape[0]):
        x, y, turn = places[p, 0], places[p, 1], places[p, 2]
        put_in_walls_of(ranges, hidden, ux, uy, far, bodies, reach, theirs[p], x, y, turn, widest)
