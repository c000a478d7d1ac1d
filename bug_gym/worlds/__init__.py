"""The families of worlds, one a file: a model of what a scenario may say, and the layout that is drawn from it.

To add a family, write such a file with a `family` of its own, and list its model in `WorldFamily`.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bug_gym.schema.values import tags
from bug_gym.worlds.barn import BarnWorld
from bug_gym.worlds.beach import BeachWorld
from bug_gym.worlds.circle_swap import CircleSwapWorld
from bug_gym.worlds.corridor import CorridorWorld
from bug_gym.worlds.crossing import CrossingWorld
from bug_gym.worlds.dynabarn import DynaBarnWorld
from bug_gym.worlds.empty import EmptyWorld
from bug_gym.worlds.explicit import ExplicitWorld
from bug_gym.worlds.field import FieldWorld
from bug_gym.worlds.forest import ForestWorld
from bug_gym.worlds.hook import HookWorld
from bug_gym.worlds.maze import MazeWorld
from bug_gym.worlds.oni_wang import OniWangWorld
from bug_gym.worlds.replay import ReplayWorld
from bug_gym.worlds.ring import RingWorld
from bug_gym.worlds.rooms import RoomsWorld
from bug_gym.worlds.ros_map import RosMapWorld
from bug_gym.worlds.u_trap import UTrapWorld
from bug_gym.worlds.urban import UrbanWorld
from bug_gym.worlds.warehouse import WarehouseWorld

__all__ = ["FAMILIES", "WorldFamily"]

WorldFamily = Annotated[
    EmptyWorld
    | ExplicitWorld
    | FieldWorld
    | UTrapWorld
    | HookWorld
    | RingWorld
    | MazeWorld
    | CorridorWorld
    | RoomsWorld
    | CrossingWorld
    | CircleSwapWorld
    | WarehouseWorld
    | ForestWorld
    | UrbanWorld
    | BeachWorld
    | OniWangWorld
    | BarnWorld
    | DynaBarnWorld
    | ReplayWorld
    | RosMapWorld,
    Field(discriminator="family"),
]

FAMILIES: tuple[str, ...] = tuple(tags(WorldFamily, "family"))
"""Names of the families, as the key `family` has them."""
