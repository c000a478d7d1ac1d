"""Random actions, the same ones each time: a policy to compare with and to test with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from bug_gym import kernels
from bug_gym.agents.parameters import AtMost
from bug_gym.geometry import velocity_along
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


@dataclass
class RandomMemory(Memory):
    """Number of the next draw."""

    draw: int = 0


@dataclass(frozen=True)
class RandomParameters:
    """Parameters of the random policy."""

    seed: Annotated[int, AtMost(2**63 - 1)] = 0
    """Number that the draws are a function of, beside that of the step."""

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed!r}")


class Random(ScriptedPolicy):
    """A desired velocity drawn evenly from the disc of the robot's speeds, anew in each step."""

    Parameters = RandomParameters
    parameters: RandomParameters
    room = None

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        # As it leaves compiled code it is an int, which half of the seeds make too large to go back in.
        self._key = np.uint64(kernels.hash64(self.parameters.seed, 0, 0, kernels.STREAM_POLICY))

    def start(self) -> RandomMemory:
        """Memory of a new episode."""
        return RandomMemory(mode="random")

    def act(self, view: View, memory: RandomMemory) -> Velocity:
        """One decision."""
        angle = 2.0 * math.pi * kernels.uniform(self._key, memory.draw)
        speed = self.sensors.drive.max_speed * math.sqrt(kernels.uniform(self._key, memory.draw + 1))
        memory.draw += 2
        return velocity_along(angle, speed)
