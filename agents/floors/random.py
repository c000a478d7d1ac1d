"""Random actions, the same ones each time: a policy to compare with and to test with."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym import kernels
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


@dataclass
class RandomMemory(Memory):
    """Number of the next draw."""

    draw: int = 0


class Random(ScriptedPolicy):
    """A desired velocity drawn evenly from the disc of the robot's speeds, anew in each step.

    Args:
        sensors: what a driver knows of the robot.
        seed: the draws are a function of it and of the step.
        discrete: whether actions are numbers of the discrete table.
    """

    def __init__(self, sensors: Sensors, *, seed: int = 0, discrete: bool = False) -> None:
        super().__init__(sensors, discrete=discrete)
        self._key = kernels.hash64(seed, 0, 0, kernels.STREAM_POLICY)

    def start(self) -> RandomMemory:
        """Memory of a new episode."""
        return RandomMemory(mode="random")

    def act(self, view: View, memory: RandomMemory) -> Velocity:
        """One decision."""
        angle = 2.0 * math.pi * kernels.uniform(self._key, memory.draw)
        speed = self.sensors.drive.max_speed * math.sqrt(kernels.uniform(self._key, memory.draw + 1))
        memory.draw += 2
        return speed * math.cos(angle), speed * math.sin(angle)
