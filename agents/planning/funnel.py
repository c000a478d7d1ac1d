"""The shortest way within a sleeve, exactly: the funnel of two taut strings from the start to the next edge.

Source: Lee and Preparata 1984, "Euclidean shortest paths in the presence of rectilinear barriers", in the form of one
pass with restarts. The length is a convex function of where the edges are crossed, so it has no other minimum: this is
what every search over the crossings can reach at best.
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.planning.sleeve import Sleeve, path_length
from bug_gym.compiling import called, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats

SAME = 1e-12
"""Points nearer together than this are one [m]."""


def funnel(sleeve: Sleeve) -> F64:
    """The way-points (k, 2) of the shortest way within a sleeve, start and goal among them [m]."""
    left = np.concatenate([sleeve.left, sleeve.goal[None]])
    right = np.concatenate([sleeve.right, sleeve.goal[None]])
    way = np.empty((2 * len(left) + 2, 2))
    count = pull_taut(left, right, float(sleeve.start[0]), float(sleeve.start[1]), way)
    return way[:count].copy()


def funnel_length(sleeve: Sleeve) -> float:
    """Its length [m]."""
    return path_length(funnel(sleeve))


@called
def left_of(ax: float, ay: float, bx: float, by: float, cx: float, cy: float) -> float:
    """Above 0 where c lies left of the way from a to b: twice the area that the three span [m^2]."""
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@called
def is_same(ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether two points are one."""
    return abs(ax - bx) < SAME and abs(ay - by) < SAME


@kernel
def pull_taut(left: Floats, right: Floats, sx: float, sy: float, way: Floats) -> int:
    """Narrow the funnel edge by edge; where one side crosses the other, the way bends there and a new funnel begins.

    Args:
        left: left ends of the edges (n + 1, 2), the last the goal [m].
        right: right ends (n + 1, 2), the last the goal [m].
        sx: x of the start [m].
        sy: y of the start [m].
        way: the way-points, written here [m].

    Returns:
        How many there are.
    """
    last = left.shape[0] - 1
    way[0, 0], way[0, 1] = sx, sy
    count = 1
    ax, ay = sx, sy
    left_at, right_at = -1, -1
    lx, ly, rx, ry = sx, sy, sx, sy
    i = 0
    while i <= last:
        nx, ny = right[i, 0], right[i, 1]
        if left_of(ax, ay, rx, ry, nx, ny) >= 0.0:
            if is_same(ax, ay, rx, ry) or left_of(ax, ay, lx, ly, nx, ny) < 0.0:
                rx, ry, right_at = nx, ny, i
            else:
                ax, ay, i = lx, ly, left_at + 1
                way[count, 0], way[count, 1] = ax, ay
                count += 1
                lx, ly, rx, ry, right_at = ax, ay, ax, ay, left_at
                continue
        nx, ny = left[i, 0], left[i, 1]
        if left_of(ax, ay, lx, ly, nx, ny) <= 0.0:
            if is_same(ax, ay, lx, ly) or left_of(ax, ay, rx, ry, nx, ny) > 0.0:
                lx, ly, left_at = nx, ny, i
            else:
                ax, ay, i = rx, ry, right_at + 1
                way[count, 0], way[count, 1] = ax, ay
                count += 1
                lx, ly, rx, ry, left_at = ax, ay, ax, ay, right_at
                continue
        i += 1
    if not is_same(way[count - 1, 0], way[count - 1, 1], left[last, 0], left[last, 1]):
        way[count, 0], way[count, 1] = left[last, 0], left[last, 1]
        count += 1
    return count
