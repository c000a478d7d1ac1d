"""The families of worlds, one a file: a model of what a scenario may say, and the layout that is drawn from it.

To add a family, write such a file with a `family` of its own, and list its model in `WorldFamily`. Families from outside need
neither: see bug_gym.worlds.own.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from bug_gym.checks import shortened
from bug_gym.references import from_anywhere, is_reference
from bug_gym.schema.faults import NAMES
from bug_gym.schema.values import tags
from bug_gym.worlds.barn import BarnWorld
from bug_gym.worlds.beach import BeachWorld
from bug_gym.worlds.cellular_automaton import CellularAutomatonWorld
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
from bug_gym.worlds.own import REGISTERED, SHIPPED, checked_name, class_of, installed, own_families
from bug_gym.worlds.replay import ReplayWorld
from bug_gym.worlds.ring import RingWorld
from bug_gym.worlds.rooms import RoomsWorld
from bug_gym.worlds.ros_map import RosMapWorld
from bug_gym.worlds.u_trap import UTrapWorld
from bug_gym.worlds.urban import UrbanWorld
from bug_gym.worlds.warehouse import WarehouseWorld

__all__ = ["FAMILIES", "WorldFamily", "register"]

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
    | CellularAutomatonWorld
    | DynaBarnWorld
    | ReplayWorld
    | RosMapWorld,
    Field(discriminator="family"),
]

FAMILIES: tuple[str, ...] = tuple(tags(WorldFamily, "family"))
"""Names of the families, as the key `family` has them."""
SHIPPED.extend(FAMILIES)
NAMES["family"] = lambda: (*FAMILIES, *own_families())


def register(name: str, reference: str) -> None:
    """Give a family of worlds from outside a name that scenarios may say.

    It holds for this process, and for the workers of its evaluations. A package that is installed offers its families to
    all by entry points of the group `bug_gym.worlds`. Registering the same again changes nothing,
    and what is refused leaves the name free.

    Args:
        name: letters, digits, `_` and `-`.
        reference: "module:Class", or "file.py:Class", which is imported now.

    Raises:
        ValueError: the name cannot be one or is taken, or the reference is none, or leads to no family's class.
        ImportError: its module imports another one that is missing.
    """
    if not isinstance(reference, str) or not is_reference(reference):
        raise ValueError(
            f"family {shortened(name)}: got {shortened(reference)}, expected text such as 'my_module:MyWorld'"
        )
    place = from_anywhere(reference)
    if name not in REGISTERED or REGISTERED[name] != place:
        shipped = {family: f"the family {family!r} of this package" for family in FAMILIES}
        free = checked_name(name, {**shipped, **installed(), **REGISTERED})
        class_of(place)
        REGISTERED[free] = place
