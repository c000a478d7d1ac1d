"""Worlds for teams: rectangles and discs across the way, and random ones of a few rectangles."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
