"""Racks with aisles between them, and a way of its own for each robot."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from bug_gym.geometry import Point
from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Lines, NotNegative, Positive
from bug_gym.worlds.clearance import Free, is_clear
from bug_gym.worlds.family import Crew, Family, Rng, check_cells
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.places import ATTEMPTS, TRIES, border_of, draw_point, finish_crew, written_or_drawn
from bug_gym.worlds.polygons import rectangle


class WarehouseWorld(Family):
    """The floor plan of a store: racks in columns and rows, an aisle around each; starts and goals are drawn in the aisles.

    +--------------------------+
    |  ########      ########  |
    |                        2 |
    |  ########  1   ########  |
    +--------------------------+

    Each robot has a start and a goal of its own. No two robots start, and no two stand at their goals, within
    `spacing` of one another.
    """

    has_own_goals: ClassVar[bool] = True

    family: Literal["warehouse"]
    bounds: Box = (-12.0, -9.0, 12.0, 9.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    columns: Lines = 3
    """How many racks lie along x."""
    rows: Lines = 4
    """How many racks lie along y."""
    aisle: Positive = 2.4
    """Width of the aisles [m]."""
    spacing: Positive = 1.5
    """Least distance from start to start and from goal to goal [m]."""
    separation: NotNegative = 8.0
    """Least distance from a robot's start to its goal [m]."""

    @property
    def pitch(self) -> tuple[float, float]:
        """Distance from rack to rack along x and along y [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        return (xmax - xmin - self.aisle) / self.columns, (ymax - ymin - self.aisle) / self.rows

    def check(self, robot: Robot) -> None:
        """The robot fits into the aisles, which leave room for racks, and starts and goals are far enough apart."""
        check_cells(self.columns, self.rows, "columns")
        self.check_width(self.aisle, robot, "aisle")
        self.check_width(self.spacing, robot, "spacing")
        least = min(self.pitch)
        if self.aisle >= least:
            raise wrong(f"got {self.aisle:g}, expected less than from rack to rack ({least:g})", "aisle")
        self.check_separation(self.separation, None, None)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Racks; starts and goals in the aisles.

        Raises:
            ValueError: the aisles have no room for so many robots.
        """
        racks = self._racks()
        free = is_clear(np.zeros((0, 3)), racks, border_of(self), crew.goal_room)
        fault = ValueError()
        for _ in range(ATTEMPTS):
            try:
                ways = draw_ways(self, crew.robots.count, rng, free)
            except ValueError as error:
                fault = error
                continue
            starts = np.array([(*start, float(rng.uniform(-math.pi, math.pi))) for start, _ in ways])
            goals = np.array([goal for _, goal in ways])
            return finish_crew(crew, self, *written_or_drawn(crew, starts, goals), polygons=racks)
        raise ValueError(f"{fault}; none of {ATTEMPTS} draws had room for {crew.robots.count} robots")

    def _racks(self) -> tuple[Rings, ...]:
        xmin, ymin, _, _ = self.bounds
        along, up = self.pitch
        corners = [
            (xmin + self.aisle + column * along, ymin + self.aisle + row * up)
            for row in range(self.rows)
            for column in range(self.columns)
        ]
        return tuple((rectangle(x, y, x + along - self.aisle, y + up - self.aisle),) for x, y in corners)


def draw_ways(world: WarehouseWorld, robots: int, rng: Rng, free: Free) -> list[tuple[Point, Point]]:
    """Start and goal of each robot.

    Raises:
        ValueError: no place was found for one of them.
    """
    ways: list[tuple[Point, Point]] = []
    for robot in range(robots):
        for _ in range(TRIES):
            way = draw_point(world.box, rng, free, "start"), draw_point(world.box, rng, free, "goal")
            is_alone = all(
                math.dist(a, b) >= world.spacing for others in ways for a, b in zip(way, others, strict=True)
            )
            if is_alone and math.dist(*way) >= world.separation:
                ways.append(way)
                break
        else:
            raise ValueError(f"no start and goal for robot {robot} after {TRIES} tries")
    return ways
