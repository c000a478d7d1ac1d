"""Random actions, the same ones each time in a world, others in another: to compare with and to test with.

They are drawn by a key that is made of the parameter `seed` and of the first observation of an episode: so episodes
that begin otherwise are independent of one another, as intervals take them to be, and so are several robots of one world.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.agents.parameters import AtMost
from bug_gym.geometry import velocity_along
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


@dataclass
class RandomMemory(Memory):
    """What the next draw is a function of."""

    draw: int = 0
    """Its number."""
    key: np.uint64 | None = None
    """Key of the episode's draws; None: that of the parameter `seed` alone."""


@dataclass(frozen=True)
class RandomParameters:
    """Parameters of the random policy."""

    seed: Annotated[int, AtMost(2**63 - 1)] = 0
    """Number that the draws are a function of, beside the episode's first observation and the step."""

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
        self._key = self._key_of(0)

    def _key_of(self, episode: int) -> np.uint64:
        return np.uint64(kernels.hash64(self.parameters.seed, episode, 0, kernels.STREAM_POLICY))

    def start(self) -> RandomMemory:
        """Memory of a new episode."""
        return RandomMemory(mode="random")

    def first_memory(self, flat: NDArray[np.float32], number: int) -> RandomMemory:
        """Memory of the episode that begins with an observation of a batch (n, D)."""
        digest = hashlib.blake2b(flat[number].tobytes(), digest_size=8).digest()
        return RandomMemory(mode="random", key=self._key_of(int.from_bytes(digest, "big") >> 1))

    def act(self, view: View, memory: RandomMemory) -> Velocity:
        """One decision."""
        key = self._key if memory.key is None else memory.key
        angle = 2.0 * math.pi * kernels.uniform(key, memory.draw)
        speed = self.sensors.drive.max_speed * math.sqrt(kernels.uniform(key, memory.draw + 1))
        memory.draw += 2
        return velocity_along(angle, speed)
