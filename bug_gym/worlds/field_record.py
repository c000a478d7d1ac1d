"""The parameters of a `field` world as the record that compiled code places its obstacles by."""

from __future__ import annotations

import math

import numpy as np

from bug_gym import kernels
from bug_gym.schema.motions import Bounce, Crowd, Evade, Motion, Replay, Waypoints
from bug_gym.schema.values import Region, StartRegion
from bug_gym.worlds.family import Crew
from bug_gym.worlds.field import FieldWorld
from bug_gym.worlds.layout import side_by_side
from bug_gym.worlds.places import check_spacing

TARGET_LAWS = {
    "bounce": kernels.BOUNCE,
    "random_walk": kernels.RANDOM_WALK,
    "crowd": kernels.CROWD,
    "evade": kernels.EVADE,
}
"""Laws under which a field's goal may move."""

HORIZON = float(Crowd.model_fields["horizon"].default)
"""How far ahead the crowd of a field looks [s]."""


def make_record(crew: Crew, world: FieldWorld) -> np.ndarray:
    """The record (1,) that kernels.place_fields reads.

    Raises:
        ValueError: a parameter that the family cannot have.
    """
    check_spacing(crew)
    if crew.robots.places:
        raise ValueError("a field draws the starts of its robots: give robots.count instead of a list of places")
    check_said_start(crew, world)
    check_target(world.target_motion)
    reach = crew.robot.reach
    values = (
        counts_of(world) | ranges_of(world) | room_of(world, reach) | boxes_of(world) | target_of(world.target_motion)
    )
    record = np.zeros(1, dtype=kernels.FIELD)
    for name, value in values.items():
        record[name] = value
    return record


def check_said_start(crew: Crew, world: FieldWorld) -> None:
    """Raises where robots side by side about a start that is said do not all lie within the border."""
    if not isinstance(world.start, tuple):
        return
    for number, (x, y, heading) in enumerate(side_by_side(world.start, crew.robots.count).tolist()):
        if world.obstruction(((x, y, 0.0), *crew.robot.body((x, y, heading)))):
            row = f"{crew.robots.count} robots start side by side, 2 m apart, about world.start"
            raise ValueError(f"robot {number} cannot start at {[x, y, heading]}: the border is in its way ({row})")


def check_target(target: Motion | None) -> None:
    """Raises where a goal would move by places that are written down."""
    if isinstance(target, (Waypoints, Replay)) or (isinstance(target, Crowd) and target.goals is not None):
        fault = "crowd with goals" if isinstance(target, Crowd) else target.law
        raise ValueError(
            f"a field's target_motion can be bounce, random_walk, crowd or evade, not {fault}: its free space is drawn"
        )


def counts_of(world: FieldWorld) -> dict[str, float]:
    """How many obstacles of each kind there are, and under which laws they move."""
    circles = {"circles": world.obstacles, "mixed": (world.obstacles + 1) // 2}.get(world.shapes, 0)
    moving = round(world.moving * world.obstacles)
    moving_circles = round(moving * circles / world.obstacles) if world.obstacles else 0
    bits = {"bounce": kernels.BOUNCE_BIT, "random_walk": kernels.WALK_BIT, "crowd": kernels.CROWD_BIT}
    return {
        "discs": circles + world.pedestrians,
        "moving_discs": moving_circles + world.pedestrians,
        "pedestrians": world.pedestrians,
        "polygons": world.obstacles - circles,
        "moving_polygons": moving - moving_circles,
        "squares": int(world.shapes == "squares"),
        "laws": sum(bits[law] for law in set(world.laws)),
    }


def ranges_of(world: FieldWorld) -> dict[str, float]:
    """From where to where sizes and speeds are drawn, and how far obstacles and places are apart."""
    return {
        "size_min": world.sizes[0],
        "size_max": world.sizes[1],
        "speed_min": world.speeds[0],
        "speed_max": world.speeds[1],
        "pedestrian_radius": world.pedestrian_radius,
        "pedestrian_speed_min": world.pedestrian_speeds[0],
        "pedestrian_speed_max": world.pedestrian_speeds[1],
        "horizon": HORIZON,
        "gap": -1.0 if world.solvable is None else 2.0 * world.solvable,
        "separation": world.separation,
    }


def room_of(world: FieldWorld, reach: float) -> dict[str, float]:
    """What is kept free about start, beyond the robot's reach [m], and goal: of obstacles, and of the border (`edge`).

    Places that are said have only to lie within the border.
    """
    start, goal = world.start_room(reach), world.goal_room
    return {
        "start_clearance": start,
        "goal_clearance": goal,
        "start_edge": -reach if isinstance(world.start, tuple) else start,
        "goal_edge": 0.0 if isinstance(world.goal, tuple) else goal,
    }


def boxes_of(world: FieldWorld) -> dict[str, float]:
    """The bounds, and the boxes that start and goal are drawn from; a fixed place is a box without sides."""
    start, goal = world.start or StartRegion(region=world.bounds), world.goal or Region(region=world.bounds)
    start_box = start.region if isinstance(start, StartRegion) else (start[0], start[1], start[0], start[1])
    heading = start.heading if isinstance(start, StartRegion) else start[2]
    goal_box = goal.region if isinstance(goal, Region) else (*goal, *goal)
    return {
        **corners_of("", world.bounds),
        **corners_of("start_", start_box),
        **corners_of("goal_", goal_box),
        "start_heading": math.nan if heading is None else heading,
    }


def corners_of(prefix: str, box: tuple[float, float, float, float]) -> dict[str, float]:
    """The sides of a box [m] under their names in the record."""
    names = ("xmin", "ymin", "xmax", "ymax")
    return {f"{prefix}{name}": value for name, value in zip(names, box, strict=True)}


def target_of(target: Motion | None) -> dict[str, float]:
    """How the goal moves."""
    velocity = target.velocity if isinstance(target, Bounce) else None
    speed = math.hypot(*velocity) if velocity else getattr(target, "speed", 0.0)
    return {
        "target_law": kernels.STILL if target is None else TARGET_LAWS[target.law],
        "target_speed": speed,
        "target_vx": velocity[0] if velocity else (math.nan if target and target.law == "bounce" else 0.0),
        "target_vy": velocity[1] if velocity else 0.0,
        "leg_min": getattr(target, "min_leg", 1.0),
        "leg_max": getattr(target, "max_leg", 3.0),
        "target_foresight": target.sight if isinstance(target, Evade) else getattr(target, "horizon", HORIZON),
        "target_calm": getattr(target, "wander", 0.0),
    }
