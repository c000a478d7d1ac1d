"""N worlds with one robot each as a native `gymnasium.vector.VectorEnv`: one call of the core steps them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from bug_gym.checks import checked_options, checked_seed, shortened
from bug_gym.config import load
from bug_gym.drawing.pictures import Pictures
from bug_gym.simulation import RobotStatus, Simulation, Transition
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
    is_numeric,
    require_one_of,
    require_one_robot,
    told_draws,
    with_codes,
    with_most_steps,
)

Bools = NDArray[np.bool_]
Infos = dict[str, Any]

RESET_MASK = "reset_mask"
"""The option of a reset that says which rows begin."""


class Waiting(NamedTuple):
    """What a step gave that cannot be handed over yet: a row that ended in it found no place for its next world."""

    reward: NDArray[np.float64]
    terminated: Bools
    truncated: Bools
    infos: Infos
    """Last observations and infos of the rows that ended."""


class NavigationVectorEnv(gym.vector.VectorEnv[Any, Any, Any]):
    """`num_envs` worlds of NavigationEnv, see there for what a robot sees, does and gets.

    Row k is NavigationEnv with seed + k, bit for bit, whatever the number of rows and threads. Infos are arrays with
    their masks, `key` and `_key`, as `gymnasium.vector.SyncVectorEnv` gives them.

    Args:
        num_envs: how many worlds, n.
        scenario: a name, the path of a YAML file, a dict or a Scenario.
        overrides: values by dotted key that replace the scenario's.
        observation: "dict" or "flat".
        action: "continuous" or "discrete".
        render_mode: None or "rgb_array".
        autoreset_mode: what happens with a row whose episode has ended. NEXT_STEP: its next step is a reset, the action
            is ignored. SAME_STEP: it is reset at once, `final_obs` and `final_info` hold the end. DISABLED: the caller
            resets it, `reset(options={"reset_mask": mask})`.
        max_episode_steps: cuts off episodes after so many steps where the scenario's time limit comes later; in the last of
            these `truncated` is true however the episode ends, as with Gymnasium's TimeLimit; -1: no such limit, as None.
        threads: how many threads share the rows; more pay from some two thousand worlds on.
        info: "named", or "numeric": codes of outcomes and no dicts for reward terms, see NavigationEnv.
        reward_terms: further terms of the reward by name, functions over named arrays: see bug_gym.own_parts.
        observation_fields: further fields of the observation by name, each an ObservationField or a dict that says the same.
        trust: whether code that the scenario only names may be imported, which runs the code of their modules.

    Raises:
        ValueError: a scenario that can't be, or with several robots; another form or mode than these.
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        scenario: ScenarioSource = "static",
        overrides: Mapping[str, Any] | None = None,
        observation: ObservationForm = "dict",
        action: ActionForm = "continuous",
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        threads: int = 1,
        info: InfoForm = "named",
        reward_terms: OwnTerms | None = None,
        observation_fields: OwnFields | None = None,
        trust: bool = False,
    ) -> None:
        require_one_of("render_mode", render_mode, (None, *self.metadata["render_modes"]))
        own: OwnArguments = {"reward_terms": reward_terms, "observation_fields": observation_fields, "trust": trust}
        most = max_episode_steps
        self._most_steps = None if isinstance(most, (int, np.integer)) and most == -1 else most
        settings = with_most_steps(load(scenario, overrides, **own), self._most_steps)
        self.simulation = Simulation(settings, num_envs, threads=threads)
        require_one_robot(self.simulation)
        self.spaces = RobotSpaces(self.simulation, observation, action)
        self.num_envs = num_envs = self.simulation.count
        self.single_observation_space = self.spaces.observation
        self.single_action_space = self.spaces.action
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "render_fps": 1.0 / settings.time.step,
            "autoreset_mode": self.autoreset_mode,
        }
        self._pictures = Pictures(self.simulation, render_mode)
        self._ended = np.zeros(num_envs, dtype=bool)
        self._waiting: Waiting | None = None
        self._is_numeric = is_numeric(info)
        self._of_rows: dict[str, tuple[Any, ...]] = {}  # attributes that callers have given the rows

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, Infos]:
        """Start an episode in each row, or in those of `options["reset_mask"]` only.

        Args:
            seed: row k gets seed + k, or the k-th of a sequence; where there is none, the row's next episode begins.
            options: `reset_mask` (n,) bool, `shortest_path` and `drawn` as NavigationEnv takes them.

        Raises:
            ValueError: a mask or a sequence of seeds of another length than n, a seed that is no integer from 0 on,
                options that are no dict, or of another name, or a world that found no place for its obstacles; a further
                reset of its row passes over a next episode that did not. All rows are then as they were.
        """
        wanted, seeds = checked_options(options, (RESET_MASK, *OPTIONS)), self._seeds(seed)
        mask = self._everywhere() if wanted.get(RESET_MASK) is None else self._checked(wanted[RESET_MASK])
        rows = np.flatnonzero(mask)
        self.simulation.reset(rows, None if seeds is None else [seeds[row] for row in rows.tolist()])
        if isinstance(seed, (int, np.integer)):
            super().reset(seed=int(seed))
        self._ended[rows] = False
        if self._waiting is not None:
            # What waits is handed over for the other rows, and for those that had ended by themselves.
            self._waiting.reward[mask & ~(self._waiting.terminated | self._waiting.truncated)] = 0.0
            self._waiting = None if mask.all() else self._waiting
        infos = self._infos(mask)
        if wanted.get("shortest_path"):
            lengths = np.array([self.simulation.shortest_length(row) for row in rows.tolist()])
            infos |= with_masks({"shortest_path_length": lengths}, mask)
        if wanted.get("drawn"):
            world = self.simulation.world
            columns = dict(zip(world.drawn_keys, world.drawn[rows].T, strict=True))
            infos |= with_masks(told_draws(columns), mask)
        self._pictures.record()
        return self.spaces.present_batch(self.simulation.observations()[:, 0]), infos

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]  # as SyncVectorEnv's
        """The seed of each row, which starts its first episode again; -1 for one that has not been reset."""
        return self.simulation.seeds()

    def _seeds(self, seed: Any) -> list[int | None] | None:
        """A seed for each row; None where all rows go on with their own."""
        if seed is None:
            return None
        if isinstance(seed, (list, tuple, range)) or (isinstance(seed, np.ndarray) and seed.ndim == 1):
            if len(seed) != self.num_envs:
                raise ValueError(f"got {len(seed)} seeds for {self.num_envs} rows")
            return list(seed)  # the core checks those of the rows that it resets
        first = checked_seed(seed)
        return [first + k for k in range(self.num_envs)]

    def _everywhere(self) -> Bools:
        return np.ones(self.num_envs, dtype=bool)

    def _checked(self, mask: object) -> Bools:
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise ValueError(f"reset_mask is an array of {self.num_envs} bools, got {shortened(mask)}")
        if not mask.any():
            raise ValueError("reset_mask names no row, expected at least one")
        return mask.copy()  # infos keep it

    def step(self, actions: Any) -> tuple[Observation, NDArray[np.float64], Bools, Bools, Infos]:
        """Drive for one step in each row; with NEXT_STEP, start anew instead in rows that ended in the last one.

        Where the next world of a row that has ended finds no place, a further call tries the one after it; call again with
        the same actions. With SAME_STEP the rows have been driven by then: the further call drives nothing, whatever its
        actions, and returns what came of that step.

        What a function of one's own raises comes when the rows have been driven, and what came of that is lost: rows that
        ended begin anew in the next step, or need their reset with DISABLED.

        Raises:
            ValueError: actions of another shape, or not finite, or a world that found no place for its obstacles; all rows are
                then as they were, or with SAME_STEP as said above.
            gymnasium.error.ResetNeeded: a row that has never been reset, or with DISABLED one that has ended.
        """
        velocities = self.spaces.velocities(actions, (self.num_envs,))[:, None]
        simulation, waiting = self.simulation, self._waiting
        if waiting is None:
            self._drive(velocities)
            status = simulation.status(simulation.all_rows)
            flat, reward, terminated, truncated = self._transition(status)
            self._ended = terminated | truncated
        else:
            status, flat = simulation.status(simulation.all_rows), simulation.observations()[:, 0]
            reward, terminated, truncated, _ = waiting
        infos: Infos = {} if waiting is None else waiting.infos
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            ended = np.flatnonzero(self._ended)
            infos = infos or self._final_infos(flat)
            self._waiting = Waiting(reward, terminated, truncated, infos)
            flat[ended] = simulation.reset(ended)[:, 0]
            self._ended[:] = False
            status = simulation.status(simulation.all_rows)
        self._waiting = None
        self._pictures.record()
        infos |= self._infos(self._everywhere(), status)
        return self.spaces.present_batch(flat), reward, terminated, truncated, infos

    def _drive(self, velocities: NDArray[np.float64]) -> None:
        """Drive the rows that go on; those that have ended begin anew, first of all, as a draw may find no place."""
        simulation, rows, ended = self.simulation, self.simulation.all_rows, np.flatnonzero(self._ended)
        if len(ended):
            if self.autoreset_mode == AutoresetMode.DISABLED:
                raise ResetNeeded(f"row {ended[0]} has ended: reset it with options={{'reset_mask': mask}}")
            rows = np.flatnonzero(~self._ended)
            velocities = velocities.take(rows, axis=0)
        velocities = simulation.checked(velocities, rows)
        if len(ended):
            simulation.reset(ended)
        try:
            simulation.drive(velocities, rows)
        except BaseException:
            _, _, terminated, truncated = self._transition(simulation.status(simulation.all_rows))
            self._ended = terminated | truncated
            raise

    def _transition(self, status: RobotStatus) -> Transition:
        """What the last step gave for the rows, whose status has been read."""
        transition = self.simulation.transition(self.simulation.all_rows, status).of_robot(0)
        if self._most_steps is None:
            return transition
        # The wrapper's word, which does not ask whether an episode ended by itself.
        is_last = self.simulation.world.steps >= self._most_steps
        return transition._replace(truncated=transition.truncated | is_last)

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture (H, W, 3) of each row, RGB uint8; None without a render mode."""
        return self._pictures.frames() or None

    def _infos(self, mask: Bools, status: RobotStatus | None = None) -> Infos:
        """The contract's info of the rows in the mask, as arrays with masks; `status`: of those rows, if read before."""
        status = status or self.simulation.status(np.flatnonzero(mask))
        infos: Infos = {name: values[:, 0] for name, values in self.simulation.info(status=status).items()}
        infos["reward_terms"] = dict(zip(self.simulation.term_names, infos["reward_terms"].T, strict=True))
        return with_masks(with_codes(infos, status.outcome[:, 0]) if self._is_numeric else infos, mask)

    def _final_infos(self, flat: NDArray[np.float32]) -> Infos:
        """Last observations and infos of the rows that have ended, before they start anew."""
        mask = self._ended.copy()
        observations = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(mask):
            observations[row] = self.spaces.present(flat[row].copy())
        return {
            "final_obs": observations,
            "_final_obs": mask,
            "final_info": self._infos(mask),
            "_final_info": mask.copy(),
        }

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of each row, or read an attribute, as `SyncVectorEnv.call`.

        Rows are rows of arrays: they share what this env has but for their spaces, their seeds, `render`, and what
        `set_attr` gave them.

        Raises:
            AttributeError: nothing of this name, or a method that rows do not have: `reset`, `step`, `close`.
        """
        if name in self._of_rows:
            found = self._of_rows[name]
        elif name == "render":
            return self.render() or (None,) * self.num_envs
        elif name == "np_random_seed":
            found = self.np_random_seed
        elif name in ("observation_space", "action_space"):
            found = (getattr(self, f"single_{name}"),) * self.num_envs
        elif callable(getattr(type(self), name, None)):
            expected = "rows have only `render`; they are stepped together, and reset by options={'reset_mask': mask}"
            raise AttributeError(f"a row of {type(self).__name__} has no method {shortened(name)}: {expected}")
        else:
            found = (getattr(self, name),) * self.num_envs
        return tuple(value(*args, **kwargs) if callable(value) else value for value in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each row, as `call` finds it.

        Raises:
            AttributeError: nothing of this name.
        """
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Give each row an attribute of its own, which `get_attr` reads: a list or tuple of n values, or one for all.

        Raises:
            ValueError: another number of values.
            AttributeError: this env has one of that name, which the rows share.
        """
        if not isinstance(values, (list, tuple)):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"got {len(values)} values of {shortened(name)} for {self.num_envs} rows")
        if hasattr(self, name):
            raise AttributeError(f"the rows share {shortened(name)}: it can't be set for each of them")
        self._of_rows[name] = tuple(values)

    def close_extras(self) -> None:
        """Let the threads and the pictures go."""
        self.simulation.close()
        self._pictures.close()


def with_masks(infos: Infos, mask: Bools) -> Infos:
    """Values of the rows in a mask (n,) as gymnasium's vector infos.

    Each value becomes an array (n,), zero (None for objects) in the other rows, beside `_key`: the rows that have it, which
    is one array for all keys.
    """
    masked: Infos = {}
    for name, values in infos.items():
        if isinstance(values, dict):
            masked[name] = with_masks(values, mask)
        elif len(values) == len(mask):
            masked[name] = values
        else:
            masked[name] = np.full(len(mask), None if values.dtype == object else 0, dtype=values.dtype)
            masked[name][mask] = values
        masked[f"_{name}"] = mask
    return masked
