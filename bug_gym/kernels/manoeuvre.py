"""Which arc a robot that steers takes to a place, ahead or back.

For policies, as `free_way`: `px`, `py` (k,) are the scan's points in the robot's frame. Nothing here sees the world.
"""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.arcs import turn_to_point
from bug_gym.kernels.free_way import way_to_point
from bug_gym.kernels.layout import Floats

STRAIGHT = 1e-6
"""A curvature below this is none [1/m]."""

TURNING = 1.5
"""What a radian of heading error costs, in lengths of the sharpest arc's radius: more than driving it off does, ahead and
back, so that it is driven off."""

BACKWARD = 1.2
"""What a metre backwards costs more than one ahead."""

CHANGE = 0.5
"""What a change between ahead and back costs, in lengths of that radius."""

LEAST = 0.02
"""Less of an arc than this is not driven, in lengths of that radius."""


@kernel
def free_arc(
    px: Floats, py: Floats, circles: Floats, margin: float, direction: int, curvature: float, reach: float
) -> float:
    """How far the robot's origin goes on an arc before a circle of its body touches a point [m], at most `reach`.

    Args:
        px: the points (k,) [m].
        py: the same.
        circles: of the body (c, 3): x, y, radius [m].
        margin: by which each is larger [m].
        direction: 1 ahead, -1 back.
        curvature: of the arc [1/m], above 0 where its centre lies to the left.
        reach: [m].
    """
    free = reach
    side = 1.0 if curvature >= 0.0 else -1.0
    for c in range(circles.shape[0]):
        # Mirrored so that it goes ahead and to the left.
        cx, cy, radius = direction * circles[c, 0], side * circles[c, 1], circles[c, 2] + margin
        if abs(curvature) < STRAIGHT:
            for i in range(px.size):
                free = min(free, way_to_point(direction * px[i] - cx, side * py[i] - cy, radius))
            continue
        bend = 1.0 / abs(curvature)
        # The circle's centre goes on an arc of its own about the same place, (0, bend), in a direction of its own.
        own = math.hypot(cx, bend - cy)
        if own == 0.0:
            continue
        sin, cos = cx / own, (bend - cy) / own
        inner, outer = max(own - radius, 0.0), own + radius
        for i in range(px.size):
            x, y = direction * px[i], side * py[i]
            square = x * x + (y - bend) * (y - bend)
            if square <= inner * inner or square >= outer * outer:
                continue
            dx, dy = x - cx, y - cy
            free = min(free, bend * turn_to_point(cos * dx + sin * dy, cos * dy - sin * dx, own, radius))
    return free


@inlined
def place_on_arc(curvature: float, way: float) -> tuple[float, float, float]:
    """Where a way [m], below 0 back, on an arc [1/m] ends: x, y [m], heading [rad]."""
    turn = curvature * way
    half = 0.5 * turn
    chord = way * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return chord * math.cos(half), chord * math.sin(half), turn


@inlined
def cost_to_go(x: float, y: float, heading: float, tx: float, ty: float, least_bend: float) -> float:
    """What is left from a place and heading to a target, in metres: the way there, and the turn toward it.

    The nearer the target is, the less the turn counts.
    """
    dx, dy = tx - x, ty - y
    cos, sin = math.cos(heading), math.sin(heading)
    error = math.atan2(cos * dy - sin * dx, cos * dx + sin * dy)
    away = math.hypot(dx, dy)
    return away + TURNING * min(least_bend, away) * abs(error)


@kernel
def best_arc(
    px: Floats,
    py: Floats,
    circles: Floats,
    margin: float,
    tx: float,
    ty: float,
    least_bend: float,
    reach: float,
    moving: int,
    may_back: bool,
    arcs: int,
    parts: int,
) -> tuple[int, float, float, float]:
    """The arc after which least is left to a place: direction, curvature [1/m], free way and way to go on it [m].

    Direction 0: none is free.

    Each arc is tried up to each of some parts of the way to look ahead that are free, and as far as the place is away, or as
    far as it is free if that is less; what is left is the way to the place and the turn toward it (`cost_to_go`), beside
    what the arc itself costs. Backwards costs more, and so does a change between ahead and back.

    Args:
        px: the scan's points (k,) [m].
        py: the same.
        circles: of the body (c, 3): x, y, radius [m].
        margin: kept about each [m].
        tx: the place, robot's frame [m].
        ty: the same.
        least_bend: radius of the sharpest arc [m].
        reach: how far it looks ahead [m].
        moving: which way it goes now: 1 ahead, -1 back, 0 neither.
        may_back: whether it may drive backwards.
        arcs: how many are tried to each side.
        parts: of the way to look ahead.
    """
    least, best, best_curvature, best_free, best_way = math.inf, 0, 0.0, 0.0, 0.0
    away = math.hypot(tx, ty)
    for direction in (1, -1):
        if direction < 0 and not may_back:
            continue
        price = 1.0 if direction > 0 else BACKWARD
        change = CHANGE * least_bend if moving == -direction else 0.0
        for j in range(-arcs, arcs + 1):
            curvature = j / (arcs * least_bend)
            free = free_arc(px, py, circles, margin, direction, curvature, reach)
            for part in range(parts + 1):
                way = reach * part / parts if part > 0 else min(free, away)
                if way > free or way < LEAST * least_bend:
                    break
                x, y, heading = place_on_arc(curvature, direction * way)
                cost = cost_to_go(x, y, heading, tx, ty, least_bend) + price * way + change
                if cost < least:
                    least, best, best_curvature, best_free, best_way = cost, direction, curvature, free, way
    return best, best_curvature, best_free, best_way
