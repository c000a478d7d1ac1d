"""The worlds of the reproduction apf-wall-following: scenes in the paper's manner, random traps, moving things.

Each is a scenario as a dict, for any environment and policy; the guide (docs/guide/scenarios.md) drives one. Scenes have
the names of the paper's figures: of `scenes`, 7a to 7f are the six simple traps and 8a is composed of such, 12a are boxes;
`moving_scenes` has 8b to 8f and 12b.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from bug_gym.config import parse_yaml
from bug_gym.scenarios import polygon_data
from bug_gym.worlds.polygons import as_polygons

SOURCE = Path(__file__).parent.parent / "configs" / "reproductions" / "apf_wall_following.yaml"
THICKNESS = 0.4
"""Of the walls [m]."""
CLEARANCE = 0.4
"""Between the robot's centre and a wall [m]."""
ROBOT: dict[str, Any] = {
    "robot": {"kinematics": "holonomic", "radius": 0.2, "max_speed": 0.5},
    "lidar": {"beams": 360, "range": 10.0, "noise": 0.0},
    "time": {"step": 0.1, "limit": 900.0},
}
"""The paper's speed in simulation; its scanner has 1 degree and 12 m."""
REAL_SPEED = 0.3
"""Of the paper's real robot, a Kobuki, and of what moves beside it; named for Fig. 12b, taken for 12a too [m/s]."""

WALL_X = 6.0
"""Where the straight wall is met [m]."""

CELLS, CELL, FILLED = 11, 1.6, 0.36
"""Cells across a trap, side of one [m], share that is filled."""
SPAN = CELLS * CELL
FAR = 8.0
"""Least distance from start to goal in a trap [m]."""


def scenes() -> dict[str, dict[str, Any]]:
    """The still scenes by name, as scenarios."""
    data = parse_yaml(SOURCE.read_text(encoding="utf-8"))
    found = {name: scene(data["walls"], told) for name, told in data["scenes"].items()}
    return {**found, "12a": with_motion(found["12a"], speed=REAL_SPEED)}


def scene(lines: Mapping[str, Any], told: Mapping[str, Any]) -> dict[str, Any]:
    """One scene: walls put where it says, and the line from start to goal."""
    walls = [
        shapely.LineString(np.asarray(lines[name]) + (x, y)).buffer(
            0.5 * THICKNESS, cap_style="square", join_style="mitre"
        )
        for name, x, y in told["walls"]
    ]
    return written(shapely.union_all(walls), (told.get("start", 0.0), 0.0), (told["goal"], 0.0))


def straight_wall() -> dict[str, Any]:
    """A wall across the way that goes on beyond where a robot comes in the time given, if it turns left: Fig. 6."""
    return {
        **written(shapely.box(WALL_X, -5.0, WALL_X + THICKNESS, 30.0), (0.0, 0.0), (14.0, 0.0)),
        "time": {"step": 0.1, "limit": 60.0},
    }


def written(solid: Any, start: Sequence[float], goal: Sequence[float]) -> dict[str, Any]:
    """A world of walls as a scenario, with room for a robot all round."""
    low = np.minimum(np.minimum(solid.bounds[:2], start), goal) - 5.0
    high = np.maximum(np.maximum(solid.bounds[2:], start), goal) + 5.0
    polygons = [polygon_data(rings) for rings in as_polygons(solid)]
    heading = float(np.arctan2(goal[1] - start[1], goal[0] - start[0]))
    world = {"family": "explicit", "bounds": [*low.tolist(), *high.tolist()], "polygons": polygons}
    return {**ROBOT, "world": {**world, "start": [*map(float, start), heading], "goal": [*map(float, goal)]}}


def trap(seed: int) -> dict[str, Any]:
    """Random cells of a grid in the open, start and goal in two others that are joined."""
    rng = np.random.default_rng(seed)
    while True:
        filled = rng.random((CELLS, CELLS)) < FILLED
        free = np.argwhere(~filled)
        start, goal = free[rng.integers(len(free), size=2)]
        if np.hypot(*(start - goal)) * CELL >= FAR and is_joined(filled, tuple(start), tuple(goal)):
            break
    boxes = [shapely.box(CELL * x, CELL * y, CELL * (x + 1), CELL * (y + 1)) for x, y in np.argwhere(filled)]
    # Cells that meet at a corner are one wall.
    solid = shapely.union_all(boxes).buffer(0.01, join_style="mitre")
    return written(solid, CELL * (start + 0.5), CELL * (goal + 0.5))


def is_joined(filled: Any, start: tuple[int, ...], goal: tuple[int, ...]) -> bool:
    """Whether free cells, or the open round them, lead side by side from one to the other."""
    grid = np.pad(filled, 1, constant_values=False)
    first, last = ((cell[0] + 1, cell[1] + 1) for cell in (start, goal))
    seen, rest = {first}, [first]
    while rest:
        x, y = rest.pop()
        for cell in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            is_inside = 0 <= cell[0] < len(grid) and 0 <= cell[1] < len(grid)
            if is_inside and not grid[cell] and cell not in seen:
                seen.add(cell)
                rest.append(cell)
    return last in seen


def mover(points: Sequence[Sequence[float]], speed: float) -> dict[str, Any]:
    """A disc that goes along way points and stops at the last one."""
    motion = {"law": "waypoints", "points": [list(place) for place in points], "speed": speed, "stop": True}
    return {"shape": {"circle": 0.4}, "at": list(points[0]), "motion": motion}


def target(points: Sequence[Sequence[float]], speed: float, *, stop: bool) -> dict[str, Any]:
    """A target that goes along way points, and stops at the last one or turns round."""
    motion = {"law": "waypoints", "points": [list(place) for place in points], "speed": speed, "stop": stop}
    return {"at": list(points[0]), "motion": motion}


def with_motion(
    base: Mapping[str, Any], *, movers: Sequence[Any] = (), moving_target: Any = None, speed: float = 0.5
) -> dict[str, Any]:
    """A scene with things that move; the robot at another speed [m/s]."""
    world = {**base["world"], "movers": list(movers)}
    if moving_target is not None:
        del world["goal"]
        world["target"] = moving_target
    return {**base, "robot": {**base["robot"], "max_speed": speed}, "world": world}


def moving_scenes() -> dict[str, dict[str, Any]]:
    """Scenes in the manner of Figs. 8b to 8f and 12b: a disc first and a U afterwards, and targets that move."""
    still = scenes()
    up, down = [[2.0, -1.8], [2.0, 3.0]], [[2.5, 2.0], [2.5, -4.0]]
    goes = target([[14.0, 0.0], [14.0, 5.0]], 0.5, stop=True)
    goes_on = target([[14.0, 0.0], [14.0, 4.0], [14.0, -4.0]], 0.3, stop=False)
    return {
        "8b": with_motion(still["7c"], movers=[mover(up, 0.5)]),
        "8c": with_motion(still["7c"], movers=[mover(down, 0.3)], moving_target=goes),
        "8d": with_motion(still["7a"], movers=[mover(up, 0.3), mover(down, 0.3)], moving_target=goes),
        "8e": with_motion(still["7c"], movers=[mover(down, 0.5)], moving_target=goes),
        "8f": with_motion(still["7c"], movers=[mover(up, 0.5)], moving_target=goes),
        "a target that goes on": with_motion(still["7c"], moving_target=goes_on),
        "12b": with_motion(still["7c"], movers=[mover(up, REAL_SPEED)], speed=REAL_SPEED),
    }
