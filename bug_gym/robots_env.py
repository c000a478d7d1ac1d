"""One world with several robots as a PettingZoo `ParallelEnv`, and through PettingZoo's converter as an AEC env."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo.utils.conversions import parallel_to_aec
from pettingzoo.utils.env import AECEnv, ParallelEnv

from bug_gym.checks import checked_options, unknown_options
from bug_gym.config import Scenario, load
from bug_gym.drawing.pictures import Pictures
from bug_gym.log import warn_once
from bug_gym.observation import flat_space
from bug_gym.schema.errors import shortened
from bug_gym.simulation import Simulation
from bug_gym.spaces import (
    OPTIONS,
    ActionForm,
    InfoForm,
    Observation,
    ObservationForm,
    OwnArguments,
    OwnFields,
    OwnTerms,
    RobotSpaces,
    ScenarioSource,
    asked_info,
    is_numeric,
    numeric_info,
    require_one_of,
    with_most_steps,
)


class RobotsEnv(ParallelEnv[str, Any, Any]):
    """Robots "robot_0", "robot_1" ... in one world, each on its way to its goal. `parallel_env` makes one.

    ## Description
    See NavigationEnv for what a robot senses, does and gets. The robots see and touch one another: a collision of two
    ends the episode of both. A robot whose episode has ended stands where it is, an obstacle to the others.

    ## Action Space
    As NavigationEnv's, for each robot that is still in play.

    ## Observation Space
    As NavigationEnv's, and with several robots the field `peers` (R - 1, 4): position [m] and velocity [m/s] of each
    other robot in this one's frame. `state()` is what all of them observe, in one vector.

    ## Episode End
    Each robot ends by itself, as in NavigationEnv, and then leaves `agents`. Where the scenario's `mission` is "first", the
    first arrival ends all: the others are truncated ("ended"). Nothing of a robot's own task has ended there, and it cannot
    foresee it by what it observes, so that who learns from a robot's own rewards goes on from the value of where it stands,
    as at the time limit. Who learns the return of the team takes "ended" for terminated: its mission is over.

    The attribute `simulation` is the core that the env stands on.
    """

    metadata: dict[str, Any] = {
        "name": "bug_gym_robots_v0",
        "render_modes": ["human", "rgb_array"],
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        scenario: Scenario,
        *,
        observation: ObservationForm,
        action: ActionForm,
        render_mode: str | None,
        info: InfoForm = "named",
    ) -> None:
        require_one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        self.simulation = Simulation(scenario)
        robots = self.simulation.robots
        self.possible_agents = [f"robot_{number}" for number in range(robots)]
        self._numbers = {agent: robot for robot, agent in enumerate(self.possible_agents)}
        self.agents: list[str] = []
        # Spaces of its own for each robot: they carry the generator that samples from them.
        self.spaces = {agent: RobotSpaces(self.simulation, observation, action) for agent in self.possible_agents}
        flat = flat_space(self.simulation.fields)
        self.state_space = gym.spaces.Box(np.tile(flat.low, robots), np.tile(flat.high, robots), dtype=np.float32)
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": 1.0 / scenario.time.step}
        self._pictures = Pictures(self.simulation, render_mode)
        self._is_numeric = is_numeric(info)
        self._np_random: np.random.Generator | None = None
        self._np_random_seed: int | None = None

    @property
    def np_random(self) -> np.random.Generator:
        """A generator for wrappers that draw, as Gymnasium's envs have; worlds draw nothing from it.

        It begins anew with each reset that is given a seed; until then it is that of the seed that drew the first world.
        """
        if self._np_random is None:
            self._np_random = seeding.np_random(self._np_random_seed)[0]
        return self._np_random

    @np_random.setter
    def np_random(self, generator: np.random.Generator) -> None:
        self._np_random, self._np_random_seed = generator, -1  # as Gymnasium marks one of no known seed

    def observation_space(self, agent: str) -> gym.spaces.Space[Any]:
        """What the robot may observe; the same object at each call."""
        return self.spaces[agent].observation

    def action_space(self, agent: str) -> gym.spaces.Space[Any]:
        """What the robot may do; the same object at each call."""
        return self.spaces[agent].action

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start episode 0 of the seed, or without one the next episode; seed and options as NavigationEnv's.

        Of an option with another name the log says once that it is passed over: PettingZoo's own tests ask for one.
        """
        wanted = checked_options(options, None)
        if unknown := unknown_options(wanted, OPTIONS):
            warn_once(f"{unknown} is passed over")
        self.simulation.reset(seeds=None if seed is None else [seed])
        if seed is not None or self._np_random_seed is None:
            self._np_random, self._np_random_seed = None, int(self.simulation.world.seed[0])
        self.agents = list(self.possible_agents)
        infos = {
            agent: self.simulation.robot_step(robot=robot).info | asked_info(self.simulation, wanted, robot=robot)
            for robot, agent in enumerate(self.agents)
        }
        self._pictures.record()
        return self._observe(self.agents), self._told(infos)

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive each robot that is still in play for one step.

        Raises:
            ValueError: an action for no robot of this env, or none for a robot in play.
        """
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions are a mapping of robots to actions, got {shortened(actions)}")
        if strange := [agent for agent in actions if agent not in self.spaces]:
            raise ValueError(f"got actions for {shortened(strange[0])}, expected them for {self.agents}")
        if not actions.keys() >= set(self.agents):
            raise ValueError(f"got actions for {sorted(actions)}, expected them for {self.agents}")
        moved = self.agents
        velocities = np.zeros((1, len(self.possible_agents), 2))
        for agent in moved:
            velocities[0, self._numbers[agent]] = self.spaces[agent].velocity(actions[agent])
        self.simulation.advance(velocities)
        reported = self.simulation.robot_steps()
        rewards: dict[str, float] = {}
        terminated: dict[str, bool] = {}
        truncated: dict[str, bool] = {}
        infos: dict[str, dict[str, Any]] = {}
        for agent in moved:
            rewards[agent], terminated[agent], truncated[agent], infos[agent] = reported[self._numbers[agent]]
        self.agents = [agent for agent in moved if not (terminated[agent] or truncated[agent])]
        self._pictures.record()
        return self._observe(moved), rewards, terminated, truncated, self._told(infos)

    def _told(self, infos: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        return {agent: numeric_info(info) for agent, info in infos.items()} if self._is_numeric else infos

    def state(self) -> NDArray[np.float32]:
        """What all robots observe (R * D,), whether they are still in play or not.

        Raises:
            gymnasium.error.ResetNeeded: the world has never been reset, and they observe nothing yet.
        """
        self.simulation.require_episodes()
        return self.simulation.observations().ravel()

    def _observe(self, agents: list[str]) -> dict[str, Observation]:
        flat = self.simulation.observations()[0]  # a copy, of which each robot gets its own part
        return {agent: self.spaces[agent].present(flat[self._numbers[agent]]) for agent in agents}

    def render(self) -> Any:
        """The picture (H, W, 3) RGB uint8 with "rgb_array"; None with "human", whose window each step updates."""
        return next(iter(self._pictures.frames()), None)

    def close(self) -> None:
        """Close the window."""
        self._pictures.close()


def parallel_env(
    scenario: ScenarioSource = "crossing_robots",
    *,
    robots: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    observation: ObservationForm = "dict",
    action: ActionForm = "continuous",
    render_mode: str | None = None,
    max_cycles: int | None = None,
    reward_terms: OwnTerms | None = None,
    observation_fields: OwnFields | None = None,
    trust: bool = False,
    info: InfoForm = "named",
) -> RobotsEnv:
    """Make a PettingZoo `ParallelEnv` of one world with several robots, see RobotsEnv.

    Args:
        scenario: a name, the path of a YAML file, a dict or a Scenario.
        robots: how many, instead of the scenario's number.
        overrides: values by dotted key that replace the scenario's.
        observation: "dict" or "flat".
        action: "continuous" or "discrete".
        render_mode: None, "rgb_array" or "human".
        max_cycles: cuts off episodes after so many steps where the scenario's time limit comes later.
        info: "named", or "numeric": codes of outcomes and no dicts, see NavigationEnv.
        reward_terms: further terms of the reward by name, functions over named arrays: see bug_gym.own_parts.
        observation_fields: further fields of the observation by name, each an ObservationField or a dict that says the same.
        trust: whether code that the scenario only names may be imported, which runs the code of their modules.

    Raises:
        ValueError: a scenario that can't be, or without places for so many robots; another form or mode than these.
    """
    own: OwnArguments = {"reward_terms": reward_terms, "observation_fields": observation_fields, "trust": trust}
    settings = load(scenario, overrides, **own)
    if robots is not None:
        settings = load(settings, {"robots.count": robots})
    settings = with_most_steps(settings, max_cycles)
    return RobotsEnv(settings, observation=observation, action=action, render_mode=render_mode, info=info)


def env(scenario: ScenarioSource = "crossing_robots", **settings: Any) -> AECEnv[str, Any, Any]:
    """Make the same as a PettingZoo `AECEnv`; the arguments are those of `parallel_env`, which checks them."""
    made: AECEnv[str, Any, Any] = parallel_to_aec(parallel_env(scenario, **settings))
    return made
