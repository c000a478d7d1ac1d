"""A beach: obstacles far apart, and pedestrians among them."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from bug_gym.geometry import F64, Point
from bug_gym.schema.motions import Crowd, Motion, RandomWalk
from bug_gym.schema.polygons import Bounds
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import CornerCounts, NotNegative, Obstacles, Positive, Sizes, Speeds
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.places import Pose, finish
from bug_gym.worlds.scattering import Scattering, draw_around, is_apart, scatter, scattered, told_share

PEDESTRIAN_LEGS = (3.0, 10.0)
"""Least and greatest time for which a pedestrian who walks at random keeps a direction [s]."""


class BeachWorld(DrawnPlaces):
    """Irregular obstacles far apart on a long beach, and pedestrians who walk among them.

    After the beach of the D2T-eACO paper (section 7.3: 50 m x 100 m, 28 obstacles).
    """

    family: Literal["beach"]
    bounds: Bounds = (0.0, 0.0, 50.0, 100.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    obstacles: Obstacles = 28
    """How many."""
    sizes: Sizes = (1.0, 4.0)
    """Least and greatest radius of the circle about an obstacle [m]."""
    corners_each: CornerCounts = (5, 10)
    """Least and greatest number of an obstacle's corners."""
    pedestrians: Obstacles = 20
    """How many."""
    radius: Positive = 0.3
    """Radius of a pedestrian [m]."""
    speeds: Speeds = (0.5, 1.3)
    """Least and greatest speed of a pedestrian [m/s]."""
    law: Literal["crowd", "random_walk"] = "crowd"
    """Their motion law: to places that are drawn, making way for one another and for the robot, or at random."""
    solvable: Positive | None = 0.5
    """Clearance [m] at which a path is certain: gaps between obstacles, and to the border, are at least twice as wide.
    None: no such promise, and obstacles may overlap."""
    start_clearance: NotNegative = 2.0
    """Free space around the robot's body at the start [m]."""
    goal_clearance: NotNegative = 1.0
    """Free space around the goal [m]."""
    separation: NotNegative = 60.0
    """Least distance from start to goal [m]."""

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through."""
        self.check_clearance(self.solvable, robot, "solvable")
        super().check(robot)

    @property
    def scattering(self) -> Scattering:
        """What is said of the obstacles."""
        return Scattering(self.obstacles, self.sizes, self.solvable, self.start_clearance, self.goal_clearance)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Irregular obstacles and pedestrians who walk among them."""

        def furnish(start: Pose, goal: Point) -> Layout:
            discs = scattered(crew, self, self.scattering, start, goal, rng)
            polygons = tuple(
                (irregular_polygon(x, y, radius, self.corners_each, rng),) for x, y, radius in discs.tolist()
            )
            walkers = pedestrians(crew, self, discs, start, goal, rng)
            return finish(crew, self, start, goal, polygons=polygons, movers=walkers)

        return draw_around(crew, self, self.scattering, rng, furnish)


def irregular_polygon(x: float, y: float, radius: float, corners: tuple[int, int], rng: Rng) -> F64:
    """A star-shaped polygon (k, 2) within a circle, its first corner on it [m].

    A corner lies in each equal sector, at most 0.4 of a sector off its middle: neighbours are less than half a turn
    apart, so the polygon is simple.
    """
    count = int(rng.integers(corners[0], corners[1] + 1))
    angle = rng.uniform(-math.pi, math.pi) + 2.0 * math.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
    reach = radius * rng.uniform(0.5, 1.0, count)
    reach[0] = radius
    return np.column_stack([x + reach * np.cos(angle), y + reach * np.sin(angle)])


def pedestrians(crew: Crew, world: BeachWorld, obstacles: F64, start: Pose, goal: Point, rng: Rng) -> tuple[Mover, ...]:
    """Walkers who begin clear of the obstacles, of start and of goal.

    Raises:
        ValueError: not all of them found a place.
    """
    apart, radius = is_apart(crew, world, world.scattering, start, goal, edge=0.0), world.radius

    def free(x: float, y: float, size: float) -> bool:
        gaps = np.hypot(obstacles[:, 0] - x, obstacles[:, 1] - y) - obstacles[:, 2]
        return apart(x, y, size) and bool((gaps >= size).all())

    places = scatter(world.pedestrians, (radius, radius), world.box, free, rng, gap=0.0)
    if len(places) < world.pedestrians:
        taken = told_share(world, np.concatenate([obstacles, places]))
        raise ValueError(f"only {len(places)} of {world.pedestrians} pedestrians found a free place{taken}")
    least, most = PEDESTRIAN_LEGS
    speeds = rng.uniform(*world.speeds, len(places)).tolist()
    motions: list[Motion] = [
        Crowd(law="crowd", speed=speed)
        if world.law == "crowd"
        else RandomWalk(law="random_walk", speed=speed, min_leg=least, max_leg=most)
        for speed in speeds
    ]
    return tuple(Mover(radius, (x, y), motion) for (x, y, _), motion in zip(places.tolist(), motions, strict=True))
