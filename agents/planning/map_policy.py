"""What the policies share that read the map: each episode's memory holds the world that it is in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.live import LiveMap, Maps
from bug_gym.policy import Memory, ScriptedPolicy
from bug_gym.view import Sensors


@dataclass
class MapMemory(Memory):
    """Memory of a policy that reads the map."""

    live: LiveMap | None = None
    """The world of this episode: what stands, and what moves now."""
    reason: str = ""
    """Why the verdict is what it is, in a sentence."""


class MapPolicy(ScriptedPolicy):
    """A policy that is given the map as an episode begins.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete action table instead of velocities.
        maps: those of the env that it drives in.
        **parameters: the algorithm's own.
    """

    privileged: bool = True  # of one that can do without the map, its parameters tell
    memory_type: ClassVar[type[MapMemory]] = MapMemory
    """What `start` makes."""

    def __init__(
        self, sensors: Sensors, *, discrete: bool = False, maps: Maps | None = None, **parameters: Any
    ) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.maps = maps
        self.privileged = self.reads_map()

    def reads_map(self) -> bool:
        """Whether it reads the map, with the parameters that it has."""
        return True

    def start(self) -> MapMemory:
        """Memory of a new episode, whose world is not known yet."""
        return self.memory_type(mode="planning")

    def begin(self, robot: int) -> MapMemory:
        """Memory of the episode that a robot of the env has begun, the robots numbered row by row.

        One that does without the map asks for none.

        Raises:
            ValueError: the policy was made without an env, there is no such robot, or its row has no episode yet.
        """
        if not self.privileged:
            return self.start()
        if self.maps is None:
            raise ValueError(f"{type(self).__name__} reads the map: make it with make_policy and a live env")
        memory = self.start()
        memory.live = self.maps.of_robot(robot)
        return memory

    def first_memory(self, flat: NDArray[np.float32], number: int) -> MapMemory:
        """Memory of the episode that begins with an observation of a batch (n, D)."""
        is_told = self.privileged and self.maps is not None
        return self.begin(self.maps.robot_behind(flat, number) if is_told and self.maps is not None else number)
