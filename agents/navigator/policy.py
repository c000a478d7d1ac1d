"""The navigator: hd_bug_map's planner where nothing moves; among movers a network proposes, and the planner judges.

Source: this package. Its planner is hd_bug_map, its network ppo_mixed of agents/trained, which was trained among movers
and has no map: the one arrives in mazes and rooms, the other passes what moves. Sensing assumed: as hd_bug_map; the
robot and the scanner are those that the network was trained with, another is refused. Memory kept: that of hd_bug_map;
the last scans for the network (learning.history); what was seen to move (switch). States: those of hd_bug_map, and
network. Guarantee: while nothing is taken for a mover it reaches the goal or declares it unreachable, as hd_bug_map
does. Length: there that of hd_bug_map. Found: no worse than the better of its two parts in nine kinds of world, as far as
500 worlds each can tell: docs/results/navigator.md.

1. Each decision begins as hd_bug_map's: to perceive, to aim, to plan. So the way is always one through all that is
   remembered, and where there is none the verdict is the planner's.
2. Until something moves for sure, and again some time after the last mover, hd_bug_map drives, action for action.
3. Else the network proposes. Its goal is the next node of the way, which stands; on the last leg it is the goal itself,
   with the velocity that the network's memory gives it. Its speed, ahead or back, is cut so that this step cannot end in
   something seen.
4. Movers that could be met within the horizon: what is proposed is rolled out in sampled futures beside the planner's own
   velocities, and driven unless it costs more than the best of them by `credit`; then that one is driven. Where no mover could
   be met it is driven unasked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug_map.avoid import HELD, Proposal
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import HDBugMapParameters
from bug_gym.agents.hd_bug_map.perceive import Scene
from bug_gym.agents.hd_bug_map.policy import HDBugMap
from bug_gym.agents.learning.history import History
from bug_gym.agents.learning.play import LearnedPolicy, as_env_actions
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.navigator.switch import Switch
from bug_gym.agents.parameters import Weight, require_numbers
from bug_gym.geometry import F32
from bug_gym.kinematics import differential_action, discrete_actions
from bug_gym.policy import Memory, MisfitError, Velocity, brake, braking_radius
from bug_gym.view import Sensors, View


@dataclass(frozen=True)
class NavigatorParameters(HDBugMapParameters):
    """Parameters of the navigator: the planner's, and the network."""

    model: str | Path = "ppo_mixed"
    """Name of a shipped model, or a folder."""
    credit: Weight | None = 0.3
    """By how much what the network proposes may cost more than the planner's best, to be driven [m]; None: it is not judged."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.credit is not None:
            require_numbers(self, not_negative=("credit",))


@dataclass(kw_only=True)
class NavigatorMemory(HDBugMapMemory):
    """Memory of the navigator."""

    switch: Switch = field(default_factory=Switch)
    """Whether things move."""
    history: tuple[History, ...] | None = None
    """The network's own memory; None before the first decision."""
    seen: F32 = field(default_factory=lambda: np.empty((1, 0), dtype=np.float32))
    """What the network sees now (1, D)."""
    proposed: tuple[float, float] = (0.0, 0.0)
    """What it proposes now: speed [m/s] and turn rate [rad/s]."""
    is_last_leg: bool = False
    """Whether the way leads straight to the goal."""


class Navigator(HDBugMap):
    """The planner with a network for movers.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete table.
        **parameters: see NavigatorParameters.

    Raises:
        MisfitError: the network was made for another robot, or the robot is not differential.
        TypeError: an unknown parameter.
        ValueError: a parameter that cannot be, or no such model.
        ImportError: onnxruntime is not installed.
    """

    Parameters = NavigatorParameters
    parameters: NavigatorParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        if sensors.drive.kinematics != "differential":
            raise MisfitError(f"the navigator drives differential robots, got kinematics={sensors.drive.kinematics!r}")
        self.network = LearnedPolicy(sensors, model=self.parameters.model)
        self._table = discrete_actions(sensors.drive)

    def start(self) -> NavigatorMemory:
        """Memory of a new episode."""
        return NavigatorMemory(mode="direct", tracker=self.tracker.start())

    def look(self, view: View, memory: HDBugMapMemory) -> Scene:
        """What is there, where to, and whether things move."""
        scene = super().look(view, memory)
        assert isinstance(memory, NavigatorMemory)
        memory.switch.update(scene.tracks, self.sensors.drive.step)
        memory.seen, memory.history = self.network.look(view.flat[None], memory.history)
        return scene

    def drive(self, scene: Scene, memory: HDBugMapMemory, way: Way) -> Velocity:
        """Along the way; to stand where the network is to drive, whose action `last_word` takes."""
        assert isinstance(memory, NavigatorMemory)
        if not memory.switch.is_on:
            return super().drive(scene, memory, way)
        x, y = way.places[1].tolist()
        place, memory.is_last_leg = (x, y), len(way.places) == 2
        seen = memory.seen if memory.is_last_leg else self.network.with_goal(memory.seen, scene.view.to_robot(*place))
        memory.proposed = self._proposed(scene.view, seen)
        credit = self.parameters.credit
        if credit is not None and (near := self.avoidance.near_movers(scene, self.predictor)) is not None:
            speed, rate = memory.proposed
            faces = scene.view.heading + 0.5 * HELD * rate  # halfway through holding it
            chosen = self.avoidance.avoid(scene, memory, way, near, Proposal(faces, speed, credit))
            if not chosen.is_proposed:
                return self.go(scene, memory, chosen.direction, chosen.speed)
        memory.mode, memory.chosen, memory.is_backing = "network", place, False
        memory.candidates, memory.costs, memory.forecast = np.empty((0, 2)), np.empty(0), np.empty((0, 0, 2))
        # The planner is to begin anew after it, as it lies then.
        memory.direction = scene.view.heading
        return 0.0, 0.0

    def _proposed(self, view: View, seen: F32) -> tuple[float, float]:
        """Speed [m/s], never into what is seen, and turn rate [rad/s] that the network wants."""
        drive = self.sensors.drive
        ahead, turn = as_env_actions(self.network.answer(seen), self._table, discrete=False)[0].tolist()
        speed = 0.5 * (ahead + 1.0) * (drive.max_speed + drive.max_reverse) - drive.max_reverse
        return braked(view, speed), turn * drive.max_turn_rate

    def last_word(self, view: View, memory: Memory, action: NDArray[Any]) -> NDArray[Any]:
        """The planner's action, or the network's."""
        assert isinstance(memory, NavigatorMemory)
        if memory.mode != "network" or memory.verdict:
            return super().last_word(view, memory, action)
        network = differential_action(self.sensors.drive, *memory.proposed)
        return as_env_actions(network, self._table, discrete=self.discrete)


def braked(view: View, speed: float) -> float:
    """A differential robot's speed [m/s], ahead or back, cut so that this step cannot end in something it sees."""
    if speed >= 0.0:
        return brake(view, (speed, 0.0))[0]
    sensors = view.sensors
    radius = braking_radius(sensors)
    free = max(view.free_distance(math.pi, radius) - (radius - sensors.radius), 0.0)
    return max(speed, -free / sensors.drive.step)
