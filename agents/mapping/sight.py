"""What lies on the straight way from one place to another among remembered points: blocked cells, and dear ground.

All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.mapping.cells import BLOCK, Cells, nearest
from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.geometry import length

ESCAPE = 1.5
"""How far from a place nearer to a wall than the clearance the way out of there may lead, in clearances."""


@kernel
def is_blocked(cells: Cells, x: float, y: float) -> bool:
    """Whether a place lies in a blocked cell."""
    rows, columns = cells.blocked.shape
    column, row = int((x - cells.x) / cells.size), int((y - cells.y) / cells.size)
    return bool(0 <= row < rows and 0 <= column < columns and cells.blocked[row, column] != 0)


@kernel
def escape_from(cells: Cells, x: float, y: float) -> float:
    """How far from a place blocked cells don't count: 0 where it isn't in one."""
    if not is_blocked(cells, x, y):
        return 0.0
    # Beyond a wall, open cells begin a clearance behind it: no farther, or the way out could lead through the wall.
    out = nearest(cells, x, y, cells.clearance) + cells.clearance - cells.size
    return min(ESCAPE * cells.clearance, out)


@kernel
def is_in_sight(cells: Cells, ax: float, ay: float, bx: float, by: float, escape: float, tolerance: float) -> bool:
    """Whether the cells between a and b are open, but for the first `escape` and the last `tolerance` metres."""
    blocked, blocked_in_block = cells.blocked, cells.blocked_in_block
    x0, y0, cell = cells.x, cells.y, cells.size
    rows, columns = blocked.shape
    whole = length(bx - ax, by - ay)
    if whole == 0.0:
        return True
    cos, sin = (bx - ax) / whole, (by - ay) / whole
    size = BLOCK * cell
    t = min(escape, whole)
    end = whole - tolerance
    while t <= end:
        u, v = ax + t * cos - x0, ay + t * sin - y0
        if u < 0.0 or v < 0.0:
            return True
        column, row = int(u / cell), int(v / cell)
        if row >= rows or column >= columns:
            return True
        if blocked_in_block[row // BLOCK, column // BLOCK] == 0:
            t += way_to_border(u, v, cos, sin, size) + 1e-6
        else:
            if blocked[row, column]:
                return False
            t += way_to_border(u, v, cos, sin, cell) + 1e-6
    return True


@inlined
def way_to_border(u: float, v: float, cos: float, sin: float, size: float) -> float:
    """How far along a direction the square of a lattice of this size that holds (u, v) ends."""
    return min(way_to_line(u, cos, size), way_to_line(v, sin, size))


@inlined
def way_to_line(u: float, cos: float, size: float) -> float:
    """How far along a direction the next line of a lattice of this size is crossed, the lines across one axis alone."""
    if cos == 0.0:
        return np.inf
    gap = u - math.floor(u / size) * size
    if cos > 0.0:
        gap = size - gap
    # On a line already, up to rounding: without this, a way along a line would be followed by tiny steps.
    if gap < 1e-9:
        gap += size
    return gap / abs(cos)


@kernel
def cost_between(cells: Cells, ax: float, ay: float, bx: float, by: float) -> float:
    """Integral of the weight along the segment from a to b."""
    weight, x0, y0, cell = cells.weight, cells.x, cells.y, cells.size
    rows, columns = weight.shape
    whole = length(bx - ax, by - ay)
    pieces = max(int(math.ceil(whole / (0.5 * cell))), 1)
    total = 0.0
    for i in range(pieces):
        share = (i + 0.5) / pieces
        column, row = int((ax + share * (bx - ax) - x0) / cell), int((ay + share * (by - ay) - y0) / cell)
        total += abs(weight[row, column]) if 0 <= row < rows and 0 <= column < columns else 1.0
    return total * whole / pieces
