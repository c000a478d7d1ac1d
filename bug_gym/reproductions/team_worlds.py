"""Worlds for teams: rectangles and discs across the way, and random ones of a few rectangles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Rectangle = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax [m]."""

ROBOT_RADIUS, CLEARANCE, SPACING = 0.25, 1.0, 2.5
GAP = 2.6
"""Least distance between rectangles, and of starts and goal to them: a robot passes at its clearance [m]."""

SENSORS: dict[str, Any] = {"lidar": {"beams": 240, "range": 20.0}}


def random_world(seed: int, robots: int = 2, *, most: int = 5) -> dict[str, Any]:
    """A scenario with one to `most` rectangles between starts on the left and the goal on the right.

    The robots stand in a block, SPACING from one another, turned anyhow; at least one rectangle lies on the straight
    way from its middle to the goal.
    """
    rng = np.random.default_rng([seed, robots])
    while True:
        scenario = _drawn(rng, robots, int(rng.integers(1, most + 1)))
        if scenario is not None:
            return scenario


def _drawn(rng: np.random.Generator, robots: int, count: int) -> dict[str, Any] | None:
    """One draw; None where starts or goal have no room, or the way is free."""
    rectangles: list[Rectangle] = []
    for _ in range(50):
        width, height = rng.uniform(1.0, 8.0, 2)
        x, y = rng.uniform(-10.0, 12.0 - width), rng.uniform(-12.0, 12.0 - height)
        one = (float(x), float(y), float(x + width), float(y + height))
        if all(_gap(one, other) >= GAP for other in rectangles):
            rectangles.append(one)
        if len(rectangles) == count:
            break
    middle, goal = rng.uniform((-17.0, -9.0), (-13.0, 9.0)), rng.uniform((14.0, -9.0), (17.0, 9.0))
    turn = rng.uniform(-math.pi, math.pi)
    columns = math.ceil(math.sqrt(robots))
    block = np.array([divmod(number, columns) for number in range(robots)], dtype=float) * SPACING
    block -= block.mean(axis=0)
    cos, sin = math.cos(turn), math.sin(turn)
    starts = middle + block @ np.array([[cos, sin], [-sin, cos]])
    line = np.linspace(middle, goal, 100)
    is_crossed = any(_distance(one, x, y) == 0.0 for one in rectangles for x, y in line)
    has_room = all(_distance(one, x, y) >= GAP / 2 for one in rectangles for x, y in (*starts, goal))
    if not (is_crossed and has_room):
        return None
    heading = math.atan2(goal[1] - middle[1], goal[0] - middle[0])
    return team_scenario(
        [_corners(one) for one in rectangles], [(float(x), float(y), heading) for x, y in starts], tuple(goal.tolist())
    )


def team_scenario(
    polygons: Sequence[Any],
    starts: list[tuple[float, float, float]],
    goal: tuple[float, float],
    *,
    circles: Sequence[Any] = (),
    radius: float = ROBOT_RADIUS,
    limit: float = 600.0,
) -> dict[str, Any]:
    """A scenario for robots with one goal, whose mission the first arrival ends."""
    return {
        "name": "team",
        "mission": "first",
        "robot": {"radius": radius},
        **SENSORS,
        "time": {"limit": limit},
        "world": {
            "family": "explicit",
            "bounds": [-45, -45, 45, 45],
            "start": list(starts[0]),
            "goal": list(goal),
            "polygons": list(polygons),
            "circles": list(circles),
        },
        "robots": [{"start": list(start)} for start in starts],
    }


def alone(scenario: dict[str, Any], robot: int) -> dict[str, Any]:
    """The same scenario for one of its robots alone."""
    return {**scenario, "robots": [scenario["robots"][robot]]}


def _corners(one: Rectangle) -> list[list[float]]:
    xmin, ymin, xmax, ymax = one
    return [[xmin, ymin], [xmax, ymin], [xmax, ymax], [xmin, ymax]]


def _gap(one: Rectangle, other: Rectangle) -> float:
    """Distance between two rectangles [m]."""
    dx = max(one[0] - other[2], other[0] - one[2], 0.0)
    dy = max(one[1] - other[3], other[1] - one[3], 0.0)
    return math.hypot(dx, dy)


def _distance(one: Rectangle, x: float, y: float) -> float:
    """Distance of a place to a rectangle [m]."""
    return math.hypot(max(one[0] - x, x - one[2], 0.0), max(one[1] - y, y - one[3], 0.0))


# ------------------------------------------------------------------------------------------------ closed forms


@dataclass(frozen=True)
class Across:
    """An obstacle across the way, measured on its contour, as the paper's Fig. 5 has it: a rectangle or a disc."""

    before: float
    """Start to contour, S to A [m]."""
    behind: float
    """Contour to goal, L to G [m]."""
    half: float
    """Half the side that faces the start, A to B, or the disc's radius [m]."""
    depth: float = 0.0
    """Depth of a rectangle, B to C [m]; 0 for a disc."""
    offset: float = 0.0
    """How far the line from start to goal passes beside a rectangle's middle, to the left [m]."""
    clearance: float = CLEARANCE
    """How far the contour lies from the obstacle [m]."""

    @property
    def is_disc(self) -> bool:
        """Whether it is a disc."""
        return self.depth == 0.0

    @property
    def perimeter(self) -> float:
        """Of the rounded contour [m]."""
        if self.is_disc:
            return 2.0 * math.pi * self.half
        c = self.clearance
        return 4.0 * (self.half - c) + 2.0 * (self.depth - 2.0 * c) + 2.0 * math.pi * c

    def leaving(self) -> tuple[float, float]:
        """Way to where a robot leaves the contour on the shorter side, and from there to the goal [m]."""
        if self.is_disc:
            distance = self.half + self.behind
            leg = math.sqrt(distance**2 - self.half**2)
            return self.before + self.half * (math.pi - math.acos(self.half / distance)), leg
        c = self.clearance
        x, y = self.behind + c, self.half - c - abs(self.offset)
        k = math.hypot(x, y)
        arc = math.atan2(y, x) + math.asin(c / k)
        return self.before + y + 0.5 * math.pi * c + self.depth - 2.0 * c + c * arc, math.sqrt(k * k - c * c)

    def com1_rev3(self) -> float:
        """Both ways together: the partner stops when the winner leaves; (6), and K for the offset, rounded [m]."""
        way, leg = self.leaving()
        return 2.0 * way + leg

    def bug1_pair(self) -> float:
        """Both ways together: half the perimeter each, back to the nearest point, and on from there; (5) [m]."""
        return 2.0 * self.before + self.perimeter + 4.0 * abs(self.offset) + self.behind

    def scenario(self) -> dict[str, Any]:
        """The scenario, for one robot."""
        c, x = self.clearance, self.before + self.clearance
        total = self.before + self.behind + (2.0 * self.half if self.is_disc else self.depth)
        circles, polygons = [], []
        if self.is_disc:
            circles.append([self.before + self.half, 0.0, self.half - c])
        else:
            half, depth, middle = self.half - c, self.depth - 2.0 * c, -self.offset
            polygons.append(_corners((x, middle - half, x + depth, middle + half)))
        return team_scenario(polygons, [(0.0, 0.0, 0.0)], (total, 0.0), circles=circles)


def obstacles_across(count: int) -> list[Across]:
    """Rectangles on and off the axis and discs, in turn, of random sizes, always the same."""
    rng = np.random.default_rng(0)
    found = []
    for number in range(count):
        before, behind = rng.uniform(3.0, 8.0), rng.uniform(2.0, 8.0)
        half, depth = rng.uniform(2.5, 7.0), rng.uniform(3.0, 7.0)
        offset = rng.uniform(0.1, 0.8) * (half - CLEARANCE) if number % 3 == 1 else 0.0
        kind = (float(before), float(behind), float(half))
        found.append(Across(*kind) if number % 3 == 2 else Across(*kind, float(depth), float(offset)))
    return found


# ----------------------------------------------------------------------------------- maps in the manner of Fig. 4


def wall(*corners: tuple[float, float]) -> list[list[float]]:
    """A polygon by its corners."""
    return [list(corner) for corner in corners]


ROOM = wall((-1.5, 4.3), (-6, 4.3), (-6, -5), (-1.5, -5), (-1.5, -4.6), (-5.6, -4.6), (-5.6, 3.9), (-1.5, 3.9))
"""A room open to the right."""
HALL = wall((0, -6), (4.8, -6), (4.8, 3), (4.4, 3), (4.4, -5.6), (0, -5.6))
"""Two walls that meet in a corner."""
GAZEBO: dict[str, tuple[list[Any], list[Any], dict[str, tuple[float, float]]]] = {
    "a": ([ROOM, HALL], [[1.5, 1.5, 0.8]], {"A": (9.0, -1.0), "B": (-4.0, -1.0), "C": (-9.0, -1.0)}),
    "b": (
        [
            wall((-6.5, 4), (-1.5, 4), (-1.5, -6), (-8, -6), (-8, -5.6), (-1.9, -5.6), (-1.9, 3.6), (-6.5, 3.6)),
            wall((0, 6), (4.8, 6), (4.8, -4), (4.4, -4), (4.4, 5.6), (0, 5.6)),
            wall((0.3, -2), (3, -2), (3, -1.6), (0.3, -1.6)),
        ],
        [[1.5, 2.5, 0.7]],
        {"A": (9.0, -1.0), "B": (-6.0, -1.0), "C": (-10.0, -1.0)},
    ),
}
"""Polygons, discs and places of two maps of our own with the places of the paper's Table 2."""

FIG_6: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float], str, tuple[float, float]]] = {
    "a": ((9.0, 4.0), (7.0, 0.0), (-8.0, 3.0), "com1", (0.3, -6.7)),
    "b": ((8.0, 4.0), (8.0, 0.0), (-7.0, -2.0), "rev3", (-1.1, 7.0)),
    "c": ((7.0, 0.0), (9.0, 4.0), (-9.0, -1.0), "rev3", (3.8, -1.5)),
    "d": ((7.0, 0.0), (10.0, 4.0), (-9.0, 1.0), "rev3", (-3.9, -5.9)),
    "e": ((6.0, 0.0), (9.0, 4.0), (-3.0, -3.0), "rev3", (-6.4, -7.3)),
    "f": ((7.0, 0.0), (10.0, 4.0), (-9.0, 1.0), "rev3", (-4.7, -2.8)),
    "g": ((-3.0, 3.0), (-4.0, -3.0), (-9.0, -1.0), "com1", (-7.3, -5.3)),
}
"""Starts of Com1 and Rev3, goal, who stopped and where, as printed (e contradicts itself: Rev3 stops and arrives)."""
