"""Blocks of buildings between streets."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Lines, NotNegative, Positive, Share
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng, check_cells
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.places import Walls, draw_within
from bug_gym.worlds.polygons import Rectangle, boxes, rings_of

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


class UrbanWorld(DrawnPlaces):
    """Blocks of buildings between streets, some round a courtyard; a courtyard is closed or has a gateway.

    A map of this kind and size is Fig. 7 of the D2T-eACO paper. Start and goal lie in streets, on squares, or in
    courtyards with a gateway.
    """

    family: Literal["urban"]
    bounds: Box = (-15.0, -15.0, 15.0, 15.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    columns: Lines = 4
    """How many blocks lie along x."""
    rows: Lines = 4
    """How many blocks lie along y."""
    street: Positive = 1.5
    """Least width of the streets, that along the border too [m]."""
    unevenness: Share = 0.3
    """How much of a block's side may be left free beside its building, 0 to 1."""
    squares: Share = 0.1
    """Share of the blocks without a building, 0 to 1."""
    courtyards: Share = 0.5
    """Share of the buildings that have a courtyard, 0 to 1."""
    gateways: Share = 0.6
    """Share of the courtyards that have a gateway, 0 to 1."""
    gateway: Positive = 1.2
    """Width of a gateway [m]."""
    depth: Positive = 1.0
    """Thickness of a building around its courtyard [m]."""
    separation: NotNegative = 15.0
    """Least distance from start to goal [m]; unless it is said, points that are said may lie nearer."""

    @property
    def block(self) -> tuple[float, float]:
        """Sides of a block along x and along y [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        width, height = xmax - xmin, ymax - ymin
        return (
            (width - (self.columns + 1) * self.street) / self.columns,
            (height - (self.rows + 1) * self.street) / self.rows,
        )

    def check(self, robot: Robot) -> None:
        """The robot fits through streets and gateways, and the smallest building holds a courtyard with a gateway."""
        check_cells(self.columns, self.rows, "columns")
        self.check_width(self.street, robot, "street")
        self.check_width(self.gateway, robot, "gateway")
        least = min(self.block) * (1.0 - self.unevenness) - 2.0 * self.depth
        if least < self.gateway:
            reason = f"got {self.depth:g}, expected less: the smallest courtyard has a side of {least:g} m"
            raise wrong(f"{reason}, its gateway {self.gateway:g} m", "depth")
        super().check(robot)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Blocks between streets; nobody starts or arrives in a closed courtyard."""
        return draw_within(crew, self, rng, lambda: Walls(city_buildings(self, rng)))


def city_buildings(world: UrbanWorld, rng: Rng) -> tuple[Rings, ...]:
    """A building in each block that is no square: a rectangle, or one with a courtyard, with or without a gateway."""
    xmin, ymin, _, _ = world.bounds
    width, height = world.block
    buildings = []
    for column in range(world.columns):
        for row in range(world.rows):
            is_square, has_courtyard, has_gateway = rng.random(3) < (world.squares, world.courtyards, world.gateways)
            left = xmin + world.street + column * (width + world.street)
            low = ymin + world.street + row * (height + world.street)
            rectangle = _set_back((left, low, left + width, low + height), world.unevenness, rng)
            side = int(rng.integers(4))
            if is_square:
                continue
            courtyard = _courtyard(rectangle, world, side, rng, has_gateway=bool(has_gateway))
            solid = boxes([rectangle])
            buildings.append(solid.difference(courtyard) if has_courtyard else solid)
    return tuple(rings_of(building) for building in buildings)


def _set_back(block: Rectangle, unevenness: float, rng: Rng) -> Rectangle:
    """The rectangle of a building in its block, up to `unevenness` of each side left free."""
    left, low, right, high = block
    free = rng.uniform(0.0, unevenness, 2) * (right - left, high - low)
    x, y = (left, low) + rng.random(2) * free
    return float(x), float(y), float(x + right - left - free[0]), float(y + high - low - free[1])


def _courtyard(rectangle: Rectangle, world: UrbanWorld, side: int, rng: Rng, *, has_gateway: bool) -> BaseGeometry:
    """The courtyard of a building and the gateway that leads into it from one of its sides, if it has one."""
    left, low, right, high = rectangle
    depth = world.depth
    inner = (left + depth, low + depth, right - depth, high - depth)
    if not has_gateway:
        return boxes([inner])
    begin = float(rng.uniform(inner[side % 2], inner[side % 2 + 2] - world.gateway))
    end = begin + world.gateway
    # A little longer than the building is deep, so that nothing is left standing at either end.
    gateways = (
        (begin, low - depth, end, low + 1.5 * depth),
        (left - depth, begin, left + 1.5 * depth, end),
        (begin, high - 1.5 * depth, end, high + depth),
        (right - 1.5 * depth, begin, right + depth, end),
    )
    return boxes([inner, gateways[side]])
