"""`VecEnv`s of stable-baselines3 for training: several scenarios, stages of them, a history."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvWrapper

from bug_gym.agents.learning.curriculum import Rows, shared_evenly
from bug_gym.agents.learning.history import TOP_SPEED, History, history_width
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.sb3 import ArrayVecEnv, NavigationVecEnv, RobotsVecEnv, Saved
from bug_gym.checks import checked_seed
from bug_gym.config import Scenario
from bug_gym.geometry import F32
from bug_gym.simulation import Simulation
from bug_gym.spaces import ActionForm

Came = tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]
"""What `step_wait` of a part gives."""


class JoinedVecEnv(ArrayVecEnv):
    """The rows of several flat NavigationVecEnvs, one env's after the other's.

    Where a world of one of them finds no place for its next episodes, the step raises its ValueError as that env does, and
    what came of the others waits with it: a further step hands over what came of the first, whatever its actions.

    Raises:
        ValueError: their observations differ in length, or their actions in kind.
    """

    def __init__(self, parts: Sequence[NavigationVecEnv | RobotsVecEnv]) -> None:
        boxes = [part.observation_space for part in parts]
        shapes = {box.shape for box in boxes} | {repr(part.action_space) for part in parts}
        if len(shapes) != 2:
            raise ValueError(f"scenarios to train in together need the same observations and actions, got {shapes}")
        self.parts = list(parts)
        self._came: dict[int, Came] = {}
        low = np.min([box.low for box in boxes if isinstance(box, gym.spaces.Box)], axis=0)
        high = np.max([box.high for box in boxes if isinstance(box, gym.spaces.Box)], axis=0)
        self.render_mode = None
        self._ends = np.cumsum([part.num_envs for part in parts])
        space = gym.spaces.Box(low, high, dtype=np.float32)
        super().__init__(int(self._ends[-1]), space, parts[0].action_space)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """At the next reset, row k starts episode 0 of seed + k."""
        first = None if seed is None else checked_seed(seed)
        self._seeds = []
        for part, end in zip(self.parts, self._ends, strict=True):
            self._seeds += part.seed(None if first is None else first + int(end) - part.num_envs)
        return self._seeds

    def reset(self) -> F32:
        """Start an episode in each row; `reset_infos` tell what `set_options` asked for."""
        for part, end in zip(self.parts, self._ends.tolist(), strict=True):
            part.set_options(self._options[end - part.num_envs : end])
        self._came.clear()
        observations = [part.reset() for part in self.parts]
        self.reset_infos = [info for part in self.parts for info in part.reset_infos]
        self._reset_seeds()
        self._reset_options()
        return np.concatenate(observations)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next `step_wait`."""
        for part, some in zip(self.parts, np.split(actions, self._ends[:-1]), strict=True):
            part.step_async(some)

    def step_wait(self) -> tuple[F32, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive for one step in each row.

        Raises:
            ValueError: a world that ends finds no place for its next episodes; a further step hands over what came of this one.
        """
        refusal: ValueError | None = None
        for number, part in enumerate(self.parts):
            if number not in self._came:
                try:
                    self._came[number] = part.step_wait()
                except ValueError as error:
                    refusal = refusal or error
        if refusal is not None:
            raise refusal
        came = [self._came.pop(number) for number in range(len(self.parts))]
        observation, reward, done = (np.concatenate([step[number] for step in came]) for number in range(3))
        return observation, reward, done, [info for step in came for info in step[3]]

    def save(self) -> Saved:
        """Copy all that the future depends on, but for the actions."""
        return {"parts": [part.save() for part in self.parts]}

    def restore(self, saved: Saved) -> None:
        """Go back to what `save` gave."""
        self._came.clear()
        for part, state in zip(self.parts, saved["parts"], strict=True):
            part.restore(state)

    def close(self) -> None:
        """Close the parts."""
        for part in self.parts:
            part.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the env that holds each row."""
        values = [value for part in self.parts for value in part.get_attr(attr_name)]
        return [values[row] for row in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of this env and of every part, as the rows share them all.

        Raises:
            ValueError: some rows only are meant.
        """
        super().set_attr(attr_name, value, indices)
        for part in self.parts:
            part.set_attr(attr_name, value)


SameWorlds = NavigationVecEnv | RobotsVecEnv | JoinedVecEnv


class CurriculumVecEnv(ArrayVecEnv):
    """The worlds of the stage that a training is in; the rows stay as many, in `enter` they become others.

    Args:
        stages: rows of each scenario, a stage each.
        action: which actions the robot takes.

    Raises:
        ValueError: stages with another number of robots, other observations or other actions than the first.
    """

    def __init__(self, stages: Sequence[Rows], action: ActionForm) -> None:
        self.stages, self.action = list(stages), action
        boxes: list[gym.spaces.Box] = []
        rows: set[int] = set()
        for stage in self.stages:  # made once before a training begins: what does not fit is found out then
            made = join_rows(stage, action)
            assert isinstance(made.observation_space, gym.spaces.Box)
            boxes.append(made.observation_space)
            rows.add(made.num_envs)
            made.close()
        if len(rows) > 1 or len({box.shape for box in boxes}) > 1:
            came = f"{sorted(rows)} robots, {sorted({box.shape for box in boxes})} numbers observed"
            raise ValueError(f"curriculum: stages need as many robots each, and the same observations, got {came}")
        low, high = (np.min([box.low for box in boxes], axis=0), np.max([box.high for box in boxes], axis=0))
        self.stage = 0
        self.inner: SameWorlds = join_rows(self.stages[0], action)
        self.render_mode = None
        self._first_seed: int | None = None
        super().__init__(rows.pop(), gym.spaces.Box(low, high, dtype=np.float32), self.inner.action_space)

    def enter(self, stage: int) -> None:
        """Go to a stage, whose worlds a reset then begins; each stage has seeds of its own."""
        self.inner.close()
        self.stage, self.inner = stage, join_rows(self.stages[stage], self.action)
        self._seed_rows()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """At the next reset, row k starts episode 0 of seed + k, in stage s of seed + k + s times the number of rows."""
        self._first_seed = None if seed is None else checked_seed(seed)
        return self._seed_rows()

    def _seed_rows(self) -> Sequence[int | None]:
        first = self._first_seed
        self._seeds = list(self.inner.seed(None if first is None else first + self.stage * self.num_envs))
        return self._seeds

    def reset(self) -> F32:
        """Start an episode in each row; `reset_infos` tell what `set_options` asked for."""
        self.inner.set_options(self._options)
        observation: F32 = self.inner.reset()
        self.reset_infos = self.inner.reset_infos
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next `step_wait`."""
        self.inner.step_async(actions)

    def step_wait(self) -> tuple[F32, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive for one step in each row."""
        return self.inner.step_wait()

    def save(self) -> Saved:
        """Copy all that the future depends on, but for the actions."""
        return {"stage": self.stage, "worlds": self.inner.save()}

    def restore(self, saved: Saved) -> None:
        """Go back to what `save` gave, whatever stage that was."""
        if saved["stage"] != self.stage:
            self.enter(saved["stage"])
            self.inner.reset()  # which gives every row an episode to put the saved one into
        self.inner.restore(saved["worlds"])

    def close(self) -> None:
        """Close the worlds."""
        self.inner.close()


FlatEnv = SameWorlds | CurriculumVecEnv


class HistoryVecEnv(VecEnvWrapper):
    """A flat VecEnv of ours whose observations go on with what a History tells of the last steps.

    Args:
        venv: the env, flat.
        robot: its robots.
        lags: of the History.
    """

    def __init__(self, venv: FlatEnv, robot: RobotModel, lags: Sequence[int]) -> None:
        box = venv.observation_space
        assert isinstance(box, gym.spaces.Box)
        top = np.full(history_width(robot, lags), TOP_SPEED, dtype=np.float32)
        space = gym.spaces.Box(np.concatenate([box.low, -top]), np.concatenate([box.high, top]), dtype=np.float32)
        super().__init__(venv, observation_space=space)
        self.inner = venv
        self.history = History(robot, lags, venv.num_envs)

    def reset(self) -> F32:
        """Start an episode in each row."""
        flat = self.inner.reset()
        return self._with_history(flat, np.ones(self.num_envs, dtype=bool))

    def step_wait(self) -> tuple[F32, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive for one step in each row."""
        flat, reward, done, infos = self.inner.step_wait()
        ended = np.flatnonzero(done)
        if len(ended):
            last = np.stack([infos[row]["terminal_observation"] for row in ended])
            whole = np.concatenate([last, self.history.peek(last, ended)], axis=1)
            for row, observation in zip(ended, whole, strict=True):
                infos[row]["terminal_observation"] = observation
        return self._with_history(flat, done), reward, done, infos

    def _with_history(self, flat: F32, starts: NDArray[np.bool_]) -> F32:
        return np.concatenate([flat, self.history.add(flat, starts)], axis=1)

    def save(self) -> Saved:
        """Copy all that the future depends on, but for the actions."""
        return {"env": self.inner.save(), "history": self.history.save()}

    def restore(self, saved: Saved) -> None:
        """Go back to what `save` gave."""
        self.inner.restore(saved["env"])
        self.history.restore(saved["history"])


TrainingEnv = FlatEnv | HistoryVecEnv


def join(scenarios: Sequence[Scenario], rows: int, action: ActionForm) -> SameWorlds:
    """A flat VecEnv of about `rows` robots, shared evenly among the scenarios; each robot of a world is a row.

    Raises:
        ValueError: fewer rows than a world of each scenario has robots.
    """
    return join_rows(shared_evenly(scenarios, rows), action)


def join_rows(shared: Rows, action: ActionForm) -> SameWorlds:
    """A flat VecEnv of scenarios with so many rows each; each robot of a world is a row.

    Raises:
        ValueError: fewer rows than a world of each scenario has robots.
    """
    parts: list[NavigationVecEnv | RobotsVecEnv] = []
    for scenario, some in shared:
        worlds = some // scenario.robots.count
        if worlds < 1:
            rows = sum(count for _, count in shared)
            raise ValueError(f"n_envs: got {rows}, which leaves no world for {scenario.name}")
        simulation = Simulation(scenario, worlds)
        if scenario.robots.count > 1:
            parts.append(RobotsVecEnv(simulation, observation="flat", action=action, restart="world"))
        else:
            parts.append(NavigationVecEnv(simulation, observation="flat", action=action, render_mode=None))
    return parts[0] if len(parts) == 1 else JoinedVecEnv(parts)
