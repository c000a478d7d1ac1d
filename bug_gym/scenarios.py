"""The worlds of a scenario: drawn for an episode, and written out as a scenario again."""

from __future__ import annotations

from typing import Any

import numpy as np

from bug_gym import kernels
from bug_gym.config import Scenario, dump, load
from bug_gym.world import World
from bug_gym.worlds.clearance import share_of_box
from bug_gym.worlds.field import FieldWorld
from bug_gym.worlds.field_record import make_record
from bug_gym.worlds.layout import Layout, Mover, Rings
from bug_gym.worlds.own import OwnFamily
from bug_gym.worlds.polygons import rectangle


def draw_layout(scenario: Scenario, seed: int, episode: int) -> Layout:
    """The world of one episode, for a family made in Python.

    Raises:
        ValueError: start, goal or obstacles found no place.
    """
    # The salt keeps these numbers apart from any other use of the same seed.
    rng = np.random.default_rng([kernels.STREAM_WORLD, seed, episode])
    try:
        return scenario.world.layout(scenario.crew, rng)
    except Exception as error:  # of a caller's code: any
        if isinstance(scenario.world, OwnFamily):
            error.add_note(f"world of {scenario.world.family}, seed {seed}, episode {episode}")
        raise


def field_record(scenario: Scenario, world: FieldWorld) -> np.ndarray:
    """The parameters of a `field` world as the record (1,) that kernels.place_fields reads.

    Raises:
        ValueError: a parameter that the family cannot have.
    """
    return make_record(scenario.crew, world)


def covered_share(world: World, row: int) -> float:
    """Share of the bounds that the obstacles placed so far would cover, 0 to 1 (overlaps count twice)."""
    first_polygon = int(world.spec["discs"][0])
    radius = world.array("body_radius")[row]
    last_polygon = first_polygon + int(world.array("polygon_count")[row, 0])
    radii = np.concatenate([radius[: int(world.disc_count[row])], radius[first_polygon:last_polygon]])
    return share_of_box(radii, world.scenario.world.box)


def as_explicit(scenario: Scenario, layout: Layout) -> Scenario:
    """The scenario with one layout written out: every obstacle, mover, start and goal of it, and nothing drawn.

    Loaded again it gives the same layout bit for bit. Random walks keep their law and speed; which ways they take is
    drawn from the seed, as ever.

    Raises:
        ScenarioError: a layout that no scenario can have, such as one with a robot in an obstacle.
    """
    xmin, ymin = layout.border.min(axis=0).tolist()
    xmax, ymax = layout.border.max(axis=0).tolist()
    is_box = np.array_equal(layout.border, rectangle(xmin, ymin, xmax, ymax))
    goals = layout.goals.tolist()
    world: dict[str, Any] = {
        "family": "explicit",
        "bounds": [xmin, ymin, xmax, ymax] if is_box else layout.border.tolist(),
        "regions": scenario.world.regions,
        "circles": layout.circles.tolist(),
        "polygons": [polygon_data(rings) for rings in layout.polygons],
        "movers": [mover_data(mover) for mover in layout.movers],
        "start": layout.starts[0].tolist(),
    }
    if layout.target is None:
        world["goal"] = goals[0]
    else:
        world["target"] = {"at": goals[0], "motion": layout.target, "room": layout.goal_room}
    data = {**dump(scenario), "world": world}
    if scenario.robots.count > 1:
        places: list[dict[str, Any]] = [{"start": pose} for pose in layout.starts.tolist()]
        if len(goals) > 1:
            places = [{**place, "goal": goal} for place, goal in zip(places, goals, strict=True)]
        data["robots"] = places
    return load(data)


def polygon_data(rings: Rings) -> Any:
    """A polygon as a scenario has it."""
    shell, *holes = (ring.tolist() for ring in rings)
    return {"shell": shell, "holes": holes} if holes else shell


def mover_data(mover: Mover) -> dict[str, Any]:
    """A mover as a scenario has it."""
    outline = np.asarray(mover.outline).tolist()
    return {"shape": {"circle" if mover.is_circle else "polygon": outline}, "at": mover.at, "motion": mover.motion}
