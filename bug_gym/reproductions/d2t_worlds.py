"""Worlds of the kinds that Sellers et al. (2026) show: two maps to cross, an urban block, a beach. Their own are not given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from bug_gym.agents.planning.triangulated import Task
from bug_gym.config import load
from bug_gym.geometry import Point

RADIUS = 0.25
"""Of the robot [m]."""
ROOM = 0.7
"""Start and goal lie this far from obstacles at least [m]."""


def rectangle(width: float, height: float) -> list[list[float]]:
    """Corners of a rectangle from the origin on [m]."""
    return [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]]


def convex_shape(generator: np.random.Generator, centre: Point, radius: float) -> shapely.Polygon:
    """A convex polygon of three to seven corners on a circle."""
    angles = np.sort(generator.uniform(0.0, 2.0 * math.pi, int(generator.integers(3, 8))))
    corners = np.asarray(centre) + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return shapely.convex_hull(shapely.MultiPoint(corners))


def field(
    seed: int,
    obstacles: int,
    width: float = 40.0,
    height: float = 24.0,
    *,
    sizes: tuple[float, float] = (0.4, 1.6),
    start: Point | None = None,
    goal: Point | None = None,
) -> Task:
    """A field of convex polygons; the way leads from one end to the other unless said."""
    generator = np.random.default_rng([seed, obstacles])
    begin = (1.0, 0.5 * height) if start is None else start
    end = (width - 1.0, 0.5 * height) if goal is None else goal
    ends = shapely.MultiPoint([begin, end])
    shapes: list[shapely.Polygon] = []
    while len(shapes) < obstacles:
        centre = generator.uniform((0.0, 0.0), (width, height))
        shape = convex_shape(generator, tuple(centre), generator.uniform(*sizes))
        if shape.area > 0.05 and shape.distance(ends) > ROOM:
            shapes.append(shape)
    return Task(shapes, np.array(rectangle(width, height)), begin, end, RADIUS)


def block(x: float, y: float, width: float, height: float) -> shapely.Polygon:
    """An upright rectangle by its lower left corner [m]."""
    return shapely.box(x, y, x + width, y + height)


def scenario_1() -> Task:
    """A map of 45 x 30 m with large blocks of irregular shapes, in the manner of the paper's Scenario 1."""
    return field(1, 22, 45.0, 30.0, sizes=(1.2, 3.2), start=(2.0, 4.0), goal=(42.0, 25.0))


def scenario_2() -> Task:
    """A map of 45 x 30 m with many small obstacles, in the manner of the paper's Scenario 2."""
    return field(2, 55, 45.0, 30.0, sizes=(0.5, 1.7), start=(2.0, 5.0), goal=(42.0, 24.0))


def urban(seed: int = 0) -> Task:
    """Houses of 30 x 30 m town: rows of buildings with alleys too narrow for the robot, streets between the rows."""
    generator = np.random.default_rng([seed, 30])
    shapes: list[shapely.Polygon] = []
    for x0, y0 in ((x, y) for x in (2.5, 11.5, 20.5) for y in (2.5, 11.5, 20.5)):
        x = x0
        for _ in range(int(generator.integers(2, 5))):
            width = float(generator.uniform(1.1, 1.7))
            depth, back = float(generator.uniform(3.0, 6.0)), float(generator.uniform(0.0, 0.8))
            shapes.append(block(x, y0 + back, width, depth))
            x += width + float(generator.uniform(0.15, 0.45))
    return Task(shapes, np.array(rectangle(30.0, 30.0)), (1.0, 1.0), (29.0, 29.0), RADIUS)


BEACH = "d2t_beach"
"""The scenario of the beach: 28 umbrellas and loungers in nine groups, too close within for the robot, and two walkers."""


def beach() -> Task:
    """The 28 obstacles of the beach, from one end to the other."""
    world: Any = load(BEACH).world
    shapes = [shapely.Polygon(polygon.shell) for polygon in world.polygons]
    return Task(shapes, np.array(rectangle(50.0, 100.0)), (25.0, 3.0), (25.0, 96.0), RADIUS)


def is_clear(place: Point, room: float) -> bool:
    """Whether a place is so far from everything on the beach [m]."""
    return bool((shapely.distance(np.array(beach().obstacles, dtype=object), shapely.Point(place)) > room).all())


def as_world(task: Task, movers: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """The same as a world of a scenario."""
    x1, y1, x2, y2 = shapely.bounds(shapely.Polygon(task.border)).tolist()
    heading = math.atan2(task.goal[1] - task.start[1], task.goal[0] - task.start[0])
    return {
        "family": "explicit",
        "bounds": [x1, y1, x2, y2],
        "polygons": [shapely.get_coordinates(shape)[:-1].tolist() for shape in task.obstacles],
        "movers": list(movers),
        "start": [*task.start, heading],
        "goal": list(task.goal),
    }
