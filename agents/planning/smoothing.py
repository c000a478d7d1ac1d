"""Ways over cells pulled straight, and whether a straight way is clear among grown obstacles, exactly."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from copy import copy
from itertools import pairwise

import numpy as np

from bug_gym.agents.planning.grid import edges_of
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.compiling import called, inlined, kernel
from bug_gym.geometry import F64, Point
from bug_gym.kernels.layout import Floats


class Solids:
    """Obstacles as discs and straight pieces, for one radius of the robot.

    Args:
        discs: x, y, radius (n, 3) [m].
        edges: x1, y1, x2, y2 (e, 4) [m].
        growth: nearer to anything than this a way must not come [m].
    """

    def __init__(self, discs: F64, edges: F64, growth: float) -> None:
        self.discs = np.array(discs, dtype=np.float64)  # its own: kernels are compiled for what can be written
        self.edges, self.growth = edges, growth

    @classmethod
    def of(cls, plan: PlanningMap, growth: float) -> Solids:
        """The obstacles of a map, and its border."""
        edges, _ = edges_of(((plan.border,), *plan.polygons))
        return cls(plan.discs, edges, growth)

    def with_discs(self, discs: F64) -> Solids:
        """The same with more discs (n, 3) x, y, radius [m]."""
        other = copy(self)
        other.discs = np.concatenate([self.discs, discs])
        return other

    def with_growth(self, growth: float) -> Solids:
        """The same for another distance [m]."""
        other = copy(self)
        other.growth = growth
        return other

    def is_clear(self, a: Point, b: Point) -> bool:
        """Whether the straight way from a to b keeps the growth, to a nanometre; both ends lie outside of obstacles."""
        return bool(is_clear(*a, *b, self.edges, self.discs, self.growth - 1e-9))


IsClear = Callable[[Point, Point], bool]
"""Whether a straight way between two places is clear."""

ROUNDED = 1e-9
"""Differences of costs up to this come of rounding alone [m]."""

PULLS = 3
"""How often a way is pulled straight forth and back."""


CostOf = Callable[[Point, Point], float]
"""What a straight way between two places costs, in metres of open ground."""


def pulled(places: F64, step: float, is_clear: IsClear, cost_of: CostOf | None = None) -> F64:
    """A chain of places (k, 2), pulled straight: what a clear straight way leaves out is left out; the ends stay.

    Forth and back by turns, each time from places a step apart [m], so that bends come closer to the corners that they are
    there for. It never grows longer; where costs are told, it never grows dearer instead.
    """
    chain = places
    for _ in range(PULLS):
        chain = without_detours(chain, is_clear, cost_of)[::-1]
        chain = without_detours(spread(chain, step), is_clear, cost_of)[::-1]
    return chain


def without_detours(places: F64, is_clear: IsClear, cost_of: CostOf | None = None) -> F64:
    """A chain of places (k, 2) that goes on from each to one as far ahead as it is found clear.

    It is looked for in doubled strides, then between the last two by halves; the next place always counts as clear.
    """
    points = [(x, y) for x, y in places.tolist()]
    last = len(points) - 1
    so_far = [0.0] if cost_of is None else [0.0, *itertools.accumulate(itertools.starmap(cost_of, pairwise(points)))]

    def may_skip(begin: int, end: int) -> bool:
        """Whether the straight way from one place to another serves as well as the chain."""
        if not is_clear(points[begin], points[end]):
            return False
        return cost_of is None or cost_of(points[begin], points[end]) <= so_far[end] - so_far[begin] + ROUNDED

    kept, at = [0], 0
    while at < last:
        reached, stride, blocked = at + 1, 2, last + 1
        while reached < last:
            ahead = min(at + stride, last)
            if not may_skip(at, ahead):
                blocked = ahead
                break
            reached, stride = ahead, 2 * stride
        while blocked <= last and blocked - reached > 1:
            middle = (reached + blocked) // 2
            if may_skip(at, middle):
                reached = middle
            else:
                blocked = middle
        kept.append(reached)
        at = reached
    return places[kept]


def spread(places: F64, step: float) -> F64:
    """A chain of places (k, 2) with more on its straight pieces, at most a step [m] apart."""
    pieces = [places[:1]]
    for a, b in pairwise(places):
        count = max(math.ceil(math.dist(a, b) / step), 1)
        pieces.append(b - np.arange(count - 1, -1, -1)[:, None] / count * (b - a))
    return np.concatenate(pieces)


@kernel
def is_clear(ax: float, ay: float, bx: float, by: float, edges: Floats, discs: Floats, growth: float) -> bool:
    """Whether a straight piece is no nearer than the growth to any edge (e, 4) and any disc (n, 3)."""
    low_x, high_x = min(ax, bx) - growth, max(ax, bx) + growth
    low_y, high_y = min(ay, by) - growth, max(ay, by) + growth
    square = growth * growth
    for k in range(len(edges)):
        cx, cy, dx, dy = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        if max(cx, dx) < low_x or min(cx, dx) > high_x or max(cy, dy) < low_y or min(cy, dy) > high_y:
            continue
        if square_gap(ax, ay, bx, by, cx, cy, dx, dy) < square:
            return False
    for k in range(len(discs)):
        x, y, reach = discs[k, 0], discs[k, 1], discs[k, 2] + growth
        if square_to_piece(x, y, ax, ay, bx, by) < reach * reach:
            return False
    return True


@called
def square_gap(ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float) -> float:
    """Square of the distance between two straight pieces."""
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    one = ux * (cy - ay) - uy * (cx - ax)
    other = ux * (dy - ay) - uy * (dx - ax)
    third = vx * (ay - cy) - vy * (ax - cx)
    fourth = vx * (by - cy) - vy * (bx - cx)
    if one * other < 0.0 and third * fourth < 0.0:
        return 0.0
    return min(
        square_to_piece(ax, ay, cx, cy, dx, dy),
        square_to_piece(bx, by, cx, cy, dx, dy),
        square_to_piece(cx, cy, ax, ay, bx, by),
        square_to_piece(dx, dy, ax, ay, bx, by),
    )


@inlined
def square_to_piece(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Square of the distance of a place from a straight piece."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    share = min(max(((x - ax) * dx + (y - ay) * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    gap_x, gap_y = x - ax - share * dx, y - ay - share * dy
    return gap_x * gap_x + gap_y * gap_y
