"""Rooms with doors."""

from __future__ import annotations

from typing import Literal

import numpy as np

from bug_gym.geometry import F64
from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Lines, Positive, Share
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng, check_cells
from bug_gym.worlds.grid import carve
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.places import Walls, draw_within
from bug_gym.worlds.polygons import Rectangle, as_polygons, boxes, lined_walls


class RoomsWorld(DrawnPlaces):
    """Rooms in rows and columns, with doors between neighbours; each can be reached from each."""

    family: Literal["rooms"]
    bounds: Box = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    columns: Lines = 3
    """How many rooms lie along x."""
    rows: Lines = 3
    """How many rooms lie along y."""
    door: Positive = 1.2
    """Width of the doors [m]."""
    wall: Positive = 0.2
    """Thickness of the walls [m]."""
    loops: Share = 0.25
    """Share, 0 to 1, of the walls between neighbours without need of a door that have one; 0: one way between rooms."""
    unevenness: Share = 0.5
    """How far walls stand off their even places, 0 to 1: 1 is half a room's side to either side."""

    @property
    def pitch(self) -> tuple[float, float]:
        """Distance between even walls along x and along y [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        return (xmax - xmin) / self.columns, (ymax - ymin) / self.rows

    def check(self, robot: Robot) -> None:
        """The robot fits through the doors, and they into the smallest room's walls."""
        check_cells(self.columns, self.rows, "columns")
        self.check_width(self.door, robot, "door")
        least = min(self.pitch) * (1.0 - self.unevenness) - self.wall
        if self.door > least:
            raise wrong(f"got {self.door:g}, expected at most the smallest room's side ({least:g})", "door")
        super().check(robot)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Rooms with doors between neighbours: a tree of them, and some more."""

        def build() -> Walls:
            return self.compiled_walls(rng) or Walls(plain_walls(self, rng))

        return draw_within(crew, self, rng, build)

    def compiled_walls(self, rng: Rng) -> Walls | None:
        """What `plain_walls` draws, in compiled code; None, and nothing drawn, where that has to draw it."""
        from bug_gym.worlds.room_walls import Plan, drawn_walls  # loads the compiler

        plan = Plan(self.columns, self.rows, self.bounds, 0.5 * self.wall, self.door, self.loops, self.unevenness)
        return drawn_walls(plan, rng)


def uneven_lines(low: float, high: float, count: int, unevenness: float, rng: Rng) -> F64:
    """Places (count + 1,) of lines that cut a length into `count` parts, the ends among them [m]."""
    pitch = (high - low) / count
    lines: F64 = low + pitch * np.arange(count + 1.0)
    lines[1:-1] += 0.5 * unevenness * pitch * rng.uniform(-1.0, 1.0, count - 1)
    lines[-1] = high
    return lines


def plain_walls(world: RoomsWorld, rng: Rng) -> tuple[Rings, ...]:
    """The walls of one world."""
    open_right, open_up = carve(world.columns, world.rows, world.loops, rng)
    return room_walls(world, open_right, open_up, rng)


def room_walls(world: RoomsWorld, open_right: F64, open_up: F64, rng: Rng) -> tuple[Rings, ...]:
    """The walls between rooms, with a door wherever a room is open to the next (see `grid.carve`)."""
    xmin, ymin, xmax, ymax = world.bounds
    half = 0.5 * world.wall
    x = uneven_lines(xmin, xmax, world.columns, world.unevenness, rng)
    y = uneven_lines(ymin, ymax, world.rows, world.unevenness, rng)

    def door(low: float, high: float) -> tuple[float, float]:
        low, high = low + half, high - half - world.door
        begin = float(rng.uniform(low, max(low, high)))  # a door as wide as its room may be wider by rounding
        return begin, begin + world.door

    doors: list[Rectangle] = []
    for column, row in np.argwhere(open_right).tolist():
        low, high = door(y[row], y[row + 1])
        doors.append((x[column + 1] - world.wall, low, x[column + 1] + world.wall, high))
    for column, row in np.argwhere(open_up).tolist():
        low, high = door(x[column], x[column + 1])
        doors.append((low, y[row + 1] - world.wall, high, y[row + 1] + world.wall))
    return as_polygons(boxes(lined_walls(x, y, half)).difference(boxes(doors)))
