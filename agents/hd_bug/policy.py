"""HD-BUG."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.aim import aim
from bug_gym.agents.hd_bug.circumnavigate import Circumnavigation
from bug_gym.agents.hd_bug.drive import Motion
from bug_gym.agents.hd_bug.explore import Explorer
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.hd_bug.parameters import HDBugParameters
from bug_gym.agents.hd_bug.perceive import Perception, Scene
from bug_gym.geometry import velocity_along
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


class HDBug(ScriptedPolicy):
    """HD-BUG."""

    Parameters = HDBugParameters
    parameters: HDBugParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        self.circumnavigation = Circumnavigation(sensors, own.clearance, own.patience)
        self.boundary = self.circumnavigation.boundary
        self.perception = Perception(sensors, own, self.boundary.inner)
        self.explorer = Explorer(sensors, own, self.perception, self.boundary.inner)
        self.motion = Motion(own, self.boundary)

    def start(self) -> HDBugMemory:
        """Memory of a new episode."""
        return HDBugMemory(mode="direct", tracker=self.perception.tracker.start())

    def act(self, view: View, memory: HDBugMemory) -> Velocity:
        """One decision."""
        memory.is_backing = False
        scene = self.perception.perceive(view, memory)
        aim(view, memory, self.motion.speeds[0], leads=self.parameters.lead)
        self.circumnavigation.measure(view, memory)
        desired = self._desired(scene, memory)
        if memory.verdict:
            return 0.0, 0.0
        direction, speed = desired
        memory.direction = direction
        return velocity_along(direction - view.heading, speed)

    def _desired(self, scene: Scene, memory: HDBugMemory) -> tuple[float, float]:
        view = scene.view
        memory.must_look |= memory.door is None and memory.follow is None
        has_looked = self.explorer.look(scene, memory)
        if self._sees_goal(scene, memory):
            memory.follow = None
            memory.mode = "direct"
            memory.door, memory.way, memory.is_passing = None, [], False
            memory.chosen = memory.goal
            memory.must_look = False
            found = self.motion.toward(scene, memory.goal)
            if found is not None:
                return found
        if memory.follow is None:
            if has_looked or memory.door is None:
                self.explorer.choose(scene, memory)
            for _ in range(3):
                place = self.explorer.next_place(scene, memory)
                found = None if place is None else self.motion.toward(scene, place)
                if place is not None and found is not None:
                    memory.chosen = place
                    if self.circumnavigation.is_due(view, memory):
                        break
                    return found
                if place is not None:
                    self.explorer.give_up(scene, memory)
                self.explorer.look(scene, memory)
                self.explorer.choose(scene, memory)
                if memory.door is None:
                    break
            self.circumnavigation.begin(memory)
        velocity = self.circumnavigation.velocity(view, memory)
        if velocity is None:
            return memory.direction, 1e-6
        bearing = math.atan2(velocity[1], velocity[0])
        return bearing + view.heading, math.hypot(*velocity)

    def _sees_goal(self, scene: Scene, memory: HDBugMemory) -> bool:
        return self.boundary.sees_goal(scene.view)

    def draw(self, memory: HDBugMemory) -> Drawing:
        return Drawing()
