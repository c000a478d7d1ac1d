"""Learned policies in play: an ONNX graph run by onnxruntime, without torch.

Shipped ones lie in agents/trained/NAME; `bug-gym train` writes folders of the same kind. A model is made for one robot
and one scanner, and is refused for any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.learning.folder import GRAPH, model_folder, open_graph, read_config, require_answers
from bug_gym.agents.learning.history import History, history_width, with_history
from bug_gym.agents.learning.robot_model import RobotModel, require_spaces
from bug_gym.checks import needed_from, shortened
from bug_gym.geometry import F32, Point
from bug_gym.kinematics import discrete_actions
from bug_gym.observation import as_dict
from bug_gym.policy import MisfitError, Observation, flat_observation
from bug_gym.view import Sensors, require_sensors


@dataclass(frozen=True)
class LearnedParameters:
    """Parameters of a learned policy."""

    model: str | Path
    """Name of a shipped model, a folder, or `hf://user/name`."""


class LearnedPolicy:
    """A trained model.

    Decides without chance: `deterministic` is ignored. Where the model has a memory, `state` is a 1-tuple of the
    History of all rows together, changed in place.

    Args:
        sensors: the robot that it is to drive.
        discrete: whether the env takes numbers of discrete actions.
        **parameters: see LearnedParameters.

    Raises:
        MisfitError: the model was made for another robot.
        ValueError: no such model, or its files are damaged.
        ImportError: onnxruntime is not installed.
    """

    Parameters = LearnedParameters
    one_by_one: ClassVar[bool] = True
    """Asked for each robot alone by an evaluation, so that its times of decisions compare with those of others."""

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        require_sensors(sensors, self)
        self.parameters = LearnedParameters(**parameters)
        folder = model_folder(self.parameters.model)
        self.config = read_config(folder)
        self.robot = RobotModel.from_dict(self.config["robot"])
        require_fit(self.config["name"], self.robot, sensors)
        self.sensors, self.discrete = sensors, discrete
        self._lags = tuple(self.config["history"])
        self._session = open_graph(folder / GRAPH, self.config["sha256"][GRAPH])
        width = self.robot.width + history_width(self.robot, self._lags)
        require_answers(self._session, folder / GRAPH, width, [(2,), ()])
        self._table = discrete_actions(sensors.drive)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without its graph, which is opened again."""
        return partial(type(self), discrete=self.discrete, model=self.parameters.model), (self.sensors,)

    def predict(
        self,
        observation: Observation,
        state: tuple[History, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[History, ...] | None]:
        """Actions for one observation or a batch.

        Args:
            observation: Dict or flat, one or a batch (n, ...).
            state: as the last call returned it.
            episode_start: (n,) True where the observation is the first of an episode.
            deterministic: ignored.

        Returns:
            Actions (2,) or (n, 2) float32, or numbers of discrete actions; and the state.

        Raises:
            ValueError: an observation of another size, or with a number that is not finite.
        """
        flat = flat_observation(observation, self.sensors)
        rows = np.atleast_2d(flat)
        if not np.isfinite(rows).all():
            raise ValueError("the observation holds a number that is not finite")
        seen, state = self.look(rows, state, episode_start)
        actions = as_env_actions(self.answer(seen), self._table, discrete=self.discrete)
        return (actions[0] if flat.ndim == 1 else actions), state

    def look(
        self, rows: F32, state: tuple[History, ...] | None, episode_start: NDArray[np.bool_] | None = None
    ) -> tuple[F32, tuple[History, ...] | None]:
        """What the network sees of flat observations (n, D), and the state; call it once a step.

        Args:
            rows: the observations.
            state: as the last call returned it.
            episode_start: (n,) True where the observation is the first of an episode.

        Returns:
            What it sees (n, W), the observations first; and the state, changed in place.

        Raises:
            ValueError: the state is of another policy or number of robots.
        """
        return with_history(rows, state, episode_start, robot=self.robot, lags=self._lags)

    def with_goal(self, seen: F32, goal: Point) -> F32:
        """What the network would see (n, W) if its goal stood at a place of the robot's frame [m]."""
        beams, width = self.robot.beams, self.robot.width
        seen = seen.copy()
        seen[:, beams : beams + 2] = goal
        # After the observation comes a block a lag, which ends with the goal's velocity: see History.add.
        for block in range(width, seen.shape[1], beams + 2):
            seen[:, block + beams : block + beams + 2] = 0.0
        return seen

    def answer(self, seen: F32) -> NDArray[Any]:
        """The network's own actions for what it sees (n, W): (n, 2) in [-1, 1], or numbers (n,)."""
        (actions,) = self._session.run(None, {"observation": seen})
        return np.asarray(actions)


@dataclass(frozen=True)
class ZipParameters:
    """Parameters of a model that SB3 has saved."""

    path: Path
    """The zip."""
    trust: bool = False
    """Whether to read it at all: a zip is a pickle and can run any code."""


class ZipPolicy:
    """A model that SB3 has saved, as a policy; it was trained on our observations, Dict or flat.

    Args:
        sensors: the robot that it is to drive.
        discrete: whether the env takes numbers of discrete actions.
        **parameters: see ZipParameters.

    Raises:
        MisfitError: the model was made for other observations or actions, or for a robot that sees or drives otherwise.
        ValueError: the zip is not trusted, or no model of SB3.
    """

    Parameters = ZipParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        require_sensors(sensors, self)
        self.parameters = ZipParameters(**parameters)
        path = self.parameters.path
        if not path.is_file():
            raise ValueError(f"no file {path}")
        if self.parameters.trust is not True:
            raise ValueError(
                f"{path} is a pickle, which can run any code when it is read: "
                f"pass trust=True (on the command line {path}:trust=true) if you know where it comes from"
            )
        with needed_from("train", "a zip of stable-baselines3"):
            from bug_gym.agents.learning.models import load_zip  # torch, of the extra `train`

        self.model: Any = load_zip(path)
        self.sensors, self.discrete = sensors, discrete
        self._table = discrete_actions(sensors.drive)
        self._is_dict = isinstance(self.model.observation_space, gym.spaces.Dict)
        require_spaces(path, self.model.observation_space, self.model.action_space, sensors)

    def predict(
        self,
        observation: Observation,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Any, ...] | None]:
        """As SB3's `predict`, for Dict or flat observations, one or a batch."""
        flat = flat_observation(observation, self.sensors)
        fit: Any = as_dict(flat, self.sensors.fields) if self._is_dict else flat
        actions, state = self.model.predict(fit, state, episode_start, deterministic)
        return as_env_actions(actions, self._table, discrete=self.discrete), state


def as_env_actions(actions: NDArray[Any], table: NDArray[np.float32], *, discrete: bool) -> NDArray[Any]:
    """Actions of a model as the env takes them.

    Args:
        actions: (..., 2) in [-1, 1], or numbers (...) of discrete actions.
        table: the discrete actions (m, 2).
        discrete: whether the env takes numbers.
    """
    is_number = actions.dtype.kind in "iu"
    if is_number == discrete:
        return actions
    if is_number:
        return np.asarray(table[actions])
    gaps = np.square(actions[..., None, :] - table).sum(axis=-1)
    return np.asarray(gaps.argmin(axis=-1), dtype=np.int64)


def require_fit(name: str, robot: RobotModel, sensors: Sensors) -> None:
    """Raise a MisfitError where a model was made for another robot."""
    try:
        other = RobotModel.of(sensors)
    except ValueError as error:
        raise MisfitError(f"policy {shortened(name)} does not fit this robot: {error}") from None
    if differences := list(robot.differences(other)):
        raise MisfitError(f"policy {shortened(name)} was made for another robot: {'; '.join(differences)}")
