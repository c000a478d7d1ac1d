"""What a scenario draws for each episode, as functions of (seed, episode): the robot's limits, the noise of what it senses."""

from __future__ import annotations

import numpy as np

from bug_gym import kernels
from bug_gym.config import Scenario
from bug_gym.schema.ranges import Drawn

CONSTANTS = {
    "robot.radius": "body_reach",
    "robot.max_speed": "max_speed",
    "robot.max_reverse": "max_reverse",
    "robot.max_turn_rate": "max_turn_rate",
    "robot.max_acceleration": "max_acceleration",
    "lidar.range": "reach",
    "lidar.min_range": "min_range",
    "lidar.noise": "range_noise",
    "lidar.dropout": "dropout",
    "odometry.translation_noise": "translation_noise",
    "odometry.rotation_noise": "rotation_noise",
    "odometry.translation_bias": "translation_bias",
    "odometry.rotation_bias": "rotation_bias",
    "robot.wheelbase": "wheelbase",
    "robot.max_steering": "max_steering",
}
"""Keys of a scenario that may be drawn, and the constant of a row's record that each is. Its place here is the number of
its draw, so that none depends on what else is drawn: new ones go to the end."""


def drawn_numbers(scenario: Scenario) -> dict[str, Drawn]:
    """What a scenario draws, by dotted key, in the order of CONSTANTS."""
    values = {key: getattr(getattr(scenario, key.split(".")[0]), key.split(".")[1]) for key in CONSTANTS}
    return {key: value for key, value in values.items() if isinstance(value, Drawn)}


def draw(drawn: dict[str, Drawn], seed: int, episode: int) -> list[float]:
    """The numbers of one episode, in the order of `drawn_numbers`."""
    numbers = list(CONSTANTS)
    key = np.uint64(kernels.hash64(seed, episode, 0, kernels.STREAM_DRAWS))
    return [law.at(kernels.uniform(key, numbers.index(name))) for name, law in drawn.items()]
