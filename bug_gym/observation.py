"""What a robot observes: the table of fields, their spaces, and the named view for policies.

The core writes one flat float32 vector a robot (kernels.sensing.observe); a Dict observation is that vector cut by this table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from bug_gym import kernels
from bug_gym.checks import float32_numbers
from bug_gym.config import Scenario, ScenarioError
from bug_gym.geometry import F32

SENSED = tuple(kernels.observation_places(beams=1, regions=0, robots=1))
"""Names of the fields that the core fills, whether a scenario has them or not; others are a scenario's own."""


@dataclass(frozen=True)
class Field:
    """One field of the observation: its place in the flat vector and its bounds."""

    name: str
    shape: tuple[int, ...]
    low: F32
    """Smallest values, of the field's shape."""
    high: F32
    """Largest values, of the field's shape."""
    begin: int
    """Index of its first element in the flat vector."""

    @property
    def end(self) -> int:
        """Index past its last element in the flat vector."""
        return self.begin + math.prod(self.shape)


def world_span(scenario: Scenario) -> float:
    """Length of the diagonal of the bounds [m]: no distance in the world is longer."""
    xmin, ymin, xmax, ymax = scenario.world.box
    return math.hypot(xmax - xmin, ymax - ymin)


def fields(scenario: Scenario) -> tuple[Field, ...]:
    """The fields of a robot's observation in a scenario, in the order of the flat vector.

    | field | shape | meaning |
    |---|---|---|
    | ranges | (B,) | range per beam [m], counter-clockwise from the heading (or over the field of view) |
    | goal | (2,) | the goal in the robot's frame [m] |
    | pose | (3,) | odometry x, y [m], heading [rad] in the frame of the start |
    | velocity | (2,) | forward speed [m/s] and turn rate [rad/s], or velocity ahead and to the left [m/s] |
    | terrain | (32, 16) | only with regions: cost factor at 32 bearings, heading first, every 0.25 m up to 4 m |
    | peers | (R - 1, 4) | only with several robots: position [m] and velocity [m/s] in the robot's frame |

    Then come the scenario's own `observation_fields`.

    Raises:
        ScenarioError: one of them has a name that the observation has already.
    """
    robot, lidar, span = scenario.robot, scenario.lidar, world_span(scenario)
    if robot.kinematics == "holonomic":
        slow, fast = [-robot.max_speed] * 2, [robot.max_speed] * 2
    else:
        slow, fast = [-robot.max_reverse, -robot.greatest_turn_rate], [robot.max_speed, robot.greatest_turn_rate]
    table: list[tuple[str, tuple[int, ...], Any, Any]] = [
        ("ranges", (lidar.beams,), lidar.min_range, lidar.range),
        ("goal", (2,), -span, span),
        ("pose", (3,), [-2.0 * span, -2.0 * span, -np.pi], [2.0 * span, 2.0 * span, np.pi]),
        ("velocity", (2,), slow, fast),
    ]
    regions = scenario.world.regions
    if regions:
        samples = (kernels.TERRAIN_HEADINGS, kernels.TERRAIN_RINGS)
        table.append(("terrain", samples, 1.0, max(region.factor for region in regions)))
    peers = scenario.robots.count - 1
    if peers > 0:
        top = max(robot.max_speed, robot.max_reverse)
        table.append(("peers", (peers, 4), [-span, -span, -top, -top], [span, span, top, top]))
    places = kernels.observation_places(lidar.beams, len(regions), scenario.robots.count)
    result = []
    for name, shape, low, high in table:
        low32 = np.broadcast_to(np.asarray(low, dtype=np.float32), shape).copy()
        high32 = np.broadcast_to(np.asarray(high, dtype=np.float32), shape).copy()
        result.append(Field(name, shape, low32, high32, places[name][0]))
    for name, own in scenario.observation_fields.items():
        if name in SENSED:
            raise ScenarioError(
                f"observation_fields.{name}: this name is taken: the observation has such a field already"
            )
        result.append(Field(name, own.shape, *own.bounds, result[-1].end))
    return tuple(result)


def width(table: tuple[Field, ...]) -> int:
    """Length of the flat observation."""
    return table[-1].end


def dict_space(table: tuple[Field, ...]) -> gym.spaces.Dict:
    """The Dict space of the fields."""
    return gym.spaces.Dict({field.name: gym.spaces.Box(field.low, field.high, dtype=np.float32) for field in table})


def flat_space(table: tuple[Field, ...]) -> gym.spaces.Box:
    """The Box space of the flat observation."""
    low = np.concatenate([field.low.ravel() for field in table])
    high = np.concatenate([field.high.ravel() for field in table])
    return gym.spaces.Box(low, high, dtype=np.float32)


def as_dict(flat: F32, table: tuple[Field, ...]) -> dict[str, F32]:
    """Cut flat observations (..., D) into fields (..., *shape); each is a copy of its own."""
    batch = flat.shape[:-1]
    return {field.name: flat[..., field.begin : field.end].reshape(batch + field.shape).copy() for field in table}


def as_flat(observation: Mapping[str, F32], table: tuple[Field, ...]) -> F32:
    """Join fields (..., *shape) into flat observations (..., D).

    Raises:
        ValueError: a field is missing, has another shape than the table says, or holds no real numbers.
    """
    parts = []
    for field in table:
        if field.name not in observation:
            raise ValueError(f"the observation lacks the field {field.name!r}; it has {sorted(observation)}")
        value = float32_numbers(f"field {field.name!r}", observation[field.name])
        batch = value.shape[: value.ndim - len(field.shape)]
        if value.shape[len(batch) :] != field.shape:
            raise ValueError(f"field {field.name!r} has shape {value.shape}, expected (..., {field.shape})")
        parts.append(value.reshape((*batch, -1)))
    return np.concatenate(parts, axis=-1)
