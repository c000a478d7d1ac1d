"""Maps of ROS's map_server as worlds."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ModelWrapValidatorHandler, model_validator

from bug_gym.schema.errors import wrong
from bug_gym.schema.polygons import Bounds
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import ExistingPath, Flag, Positive, Region, StartRegion, existing_path, unsaid
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.places import TRIES, border_of, draw_both, finish
from bug_gym.worlds.ros_files import RosMap, load_ros_map
from bug_gym.worlds.ros_outlines import outlines_of


class RosMapWorld(DrawnPlaces):
    """An occupancy map as ROS's map_server reads it: a YAML file that names a picture, its scale and its place.

    Its keys are `image`, `resolution`, `origin`, `negate`, `occupied_thresh`, `free_thresh` and `mode: trinary`. The
    picture is a .pgm, or what pillow reads (extra `maps`), of at most 16,000,000 pixels. Occupied cells become polygons,
    drawn straighter than the cells by at most half a cell. Start and goal are drawn from free cells.
    """

    family: Literal["ros_map"]
    bounds: Bounds
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall. Left out: the
    outline of the picture. Less than that: a piece of the map."""
    path: ExistingPath
    """The map's .yaml; relative to the scenario's file."""
    unknown_is_wall: Flag = False
    """Whether cells that are neither occupied nor free are walls too."""
    solvable: Positive | None = 0.3
    """Clearance [m] at which there is a path from start to goal. None: no such promise."""

    @model_validator(mode="wrap")
    @classmethod
    def _bounds_are_the_picture(cls, data: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if not isinstance(data, Mapping) or data.get("bounds") is not None:
            return handler(data)
        # Without a map there is no outline; its own fault is told where `path` is checked.
        path = data.get("path")
        bounds = _ros_map(str(path)).bounds if existing_path(path) else (0.0, 0.0, 1.0, 1.0)
        return unsaid(handler({**data, "bounds": bounds}), "bounds")

    def data_files(self) -> tuple[Path, ...]:
        """The map's YAML file and its picture."""
        return load_ros_map.files(self.path)

    def check(self, robot: Robot) -> None:
        """The map can be read; start and goal lie within the bounds."""
        _ros_map(self.path)
        self.check_clearance(self.solvable, robot, "solvable")
        super().check(robot)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """A map of ROS's map_server; start and goal in its free cells.

        Raises:
            ValueError: no start and goal were found, or none with a path between them.
        """
        plan = load_ros_map(self.path)
        # 1.02: free space may come as near to a wall as 0.99 of the radius it is made for.
        radius = max(self.solvable or 0.0, 1.02 * crew.robot.reach)
        polygons, rooms = map_walls(self, plan), map_rooms(self, plan, radius)

        def free(x: float, y: float) -> bool:
            return plan.is_free(x, y) and room_at(rooms, x, y) >= 0

        box = plan.free_box
        start, goal = self.start or StartRegion(region=box), self.goal or Region(region=box)
        for _ in range(TRIES):
            pose, place = draw_both(crew, self, start, goal, rng, free, free, self.separation)
            if self.solvable is None or room_at(rooms, *pose[:2]) == room_at(rooms, *place) >= 0:
                return finish(crew, self, pose, place, polygons=polygons)
        raise ValueError(f"no start and goal with a path at a clearance of {radius:g} m after {TRIES} tries")


def _ros_map(path: str) -> RosMap:
    """A map, its faults told as those of the key `path`."""
    try:
        return load_ros_map(str(Path(path).expanduser().absolute()))
    except ValueError as error:
        raise wrong(str(error), "path") from None


@lru_cache(maxsize=8)
def map_walls(world: RosMapWorld, plan: RosMap) -> tuple[Rings, ...]:
    """The polygons of a map that reach into the bounds."""
    xmin, ymin, xmax, ymax = world.box
    polygons = outlines_of(plan, unknown_is_wall=world.unknown_is_wall)
    shells = [(rings, rings[0].min(axis=0), rings[0].max(axis=0)) for rings in polygons]
    return tuple(
        rings for rings, low, high in shells if low[0] < xmax and low[1] < ymax and high[0] > xmin and high[1] > ymin
    )


@lru_cache(maxsize=8)
def map_rooms(world: RosMapWorld, plan: RosMap, radius: float) -> NDArray[np.object_]:
    """The connected parts, as shapely's polygons, of where a disc of some radius [m] may be on a map."""
    import shapely  # slow to load, and most scenarios need none

    from bug_gym.shortest_path import free_space  # SciPy and shapely, slow to load

    free = free_space(np.zeros((0, 3)), map_walls(world, plan), border_of(world), radius=radius)
    rooms: NDArray[np.object_] = shapely.get_parts(free)
    shapely.prepare(rooms)
    return rooms


def room_at(rooms: NDArray[np.object_], x: float, y: float) -> int:
    """Number of the room that a point lies in, -1 where it lies in none."""
    import shapely  # slow to load, and most scenarios need none

    holding = np.flatnonzero(shapely.contains_xy(rooms, x, y))
    return int(holding[0]) if len(holding) else -1
