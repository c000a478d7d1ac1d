"""N worlds as a `VecEnv` of stable-baselines3 (Raffin et al. 2021), which has to be installed; each robot is a row.

SB3 restarts an episode in the step that ends it, and reads infos only there: so they are made only there.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from bug_gym.checks import checked_options, checked_seed, install_command, shortened
from bug_gym.config import load
from bug_gym.drawing.pictures import Pictures
from bug_gym.geometry import F32
from bug_gym.log import warn_once
from bug_gym.references import told_of
from bug_gym.simulation import Simulation
from bug_gym.spaces import (
    OPTIONS,
    ActionForm,
    Observation,
    ObservationForm,
    OwnArguments,
    OwnFields,
    OwnTerms,
    RobotSpaces,
    ScenarioSource,
    asked_info,
    require_one_of,
    require_one_robot,
)
from bug_gym.world import Capacity, Snapshot

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices
except ModuleNotFoundError as error:
    raise ImportError(
        f"bug_gym.agents.sb3 needs stable-baselines3, of the extra `train`: {install_command('train')}"
    ) from error


Saved = dict[str, Any]
"""A state of an env as plain numbers and arrays."""

Restart = Literal["world", "robot"]
"""What starts anew where a robot's run has ended: its world once all its robots' have, or the robot alone, at once."""

TRIES = 100
"""Episodes of a world that a step tries after one that found no place, before it gives up."""


class Waiting(NamedTuple):
    """What a step gave that cannot be handed over yet: a world that ended in it has found no place for its next episodes."""

    reward: NDArray[np.float64]
    done: NDArray[np.bool_]
    infos: list[dict[str, Any]]


def make_vec_env(
    source: ScenarioSource,
    n_envs: int = 1,
    *,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    observation: ObservationForm | None = None,
    action: ActionForm | None = None,
    render_mode: str | None = None,
    threads: int = 1,
    scenario: ScenarioSource | None = None,
    reward_terms: OwnTerms | None = None,
    observation_fields: OwnFields | None = None,
    trust: bool = False,
) -> NavigationVecEnv:
    """Make a `VecEnv` of stable-baselines3.

    Args:
        source: a registered id such as "BugGym/Dynamic-v0", or a scenario: a name, the path of a YAML file, a dict.
        n_envs: how many worlds, n.
        seed: row k gets seed + k; None: from entropy.
        overrides: values by dotted key that replace the scenario's.
        observation: "dict" or "flat"; None: the form that the id binds, else "dict".
        action: "continuous" or "discrete"; None: the form that the id binds, else "continuous".
        render_mode: None or "rgb_array", which SB3's VecVideoRecorder needs.
        threads: how many threads share the worlds; more pay from some two thousand worlds on.
        scenario: takes the place of the one that the id binds, as with `gym.make(id, scenario=...)`.
        reward_terms: further terms of the reward by name, functions over named arrays: see bug_gym.own_parts.
        observation_fields: further fields of the observation by name, each an ObservationField or a dict that says the same.
        trust: whether code that the scenario only names may be imported, which runs the code of their modules.

    Raises:
        ValueError: an id that is not registered or that binds no scenario, a scenario that can't be or has several robots,
            or two scenarios.
    """
    bound: dict[str, Any] = {}
    if isinstance(source, str) and source.startswith("BugGym/"):
        bound = bound_arguments(source)
        source = bound["scenario"]
    elif scenario is not None:
        raise ValueError(
            f"scenario goes with a registered id, such as 'BugGym/Navigation-v0', got {source!r} beside it"
        )
    own: OwnArguments = {"reward_terms": reward_terms, "observation_fields": observation_fields, "trust": trust}
    settings = load(source if scenario is None else scenario, overrides, **own)
    simulation = Simulation(settings, n_envs, threads=threads)
    made = NavigationVecEnv(
        simulation,
        observation=observation or bound.get("observation", "dict"),
        action=action or bound.get("action", "continuous"),
        render_mode=render_mode,
    )
    if seed is not None:
        made.seed(seed)
    return made


def make_robots_vec_env(
    source: ScenarioSource = "crossing_robots",
    robots: int | None = None,
    n_envs: int = 1,
    *,
    seed: int | None = None,
    overrides: Mapping[str, Any] | None = None,
    observation: ObservationForm = "flat",
    action: ActionForm = "continuous",
    restart: Restart = "world",
    threads: int = 1,
    reward_terms: OwnTerms | None = None,
    observation_fields: OwnFields | None = None,
    trust: bool = False,
) -> RobotsVecEnv:
    """Make a `VecEnv` of stable-baselines3 whose rows are the robots of several worlds, for one policy that drives them all.

    Args:
        source: a scenario: a name, the path of a YAML file, a dict or a Scenario.
        robots: how many in each world, R, instead of the scenario's number.
        n_envs: how many worlds, N; the env has N R rows, row n R + r is robot r of world n.
        seed: world n gets seed + n; None: from entropy.
        overrides: values by dotted key that replace the scenario's.
        observation: "dict" or "flat".
        action: "continuous" or "discrete".
        restart: "world": all robots of a world start its next episode when the last one's run has ended; "robot": see
            RobotsVecEnv.
        threads: how many threads share the worlds; more pay from some two thousand worlds on.
        reward_terms: further terms of the reward by name, functions over named arrays: see bug_gym.own_parts.
        observation_fields: further fields of the observation by name, each an ObservationField or a dict that says the same.
        trust: whether code that the scenario only names may be imported, which runs the code of their modules.

    Raises:
        ValueError: a scenario that can't be, or without places for so many robots; another form than these.
    """
    own: OwnArguments = {"reward_terms": reward_terms, "observation_fields": observation_fields, "trust": trust}
    scenario = load(source, overrides, **own)
    if robots is not None:
        scenario = load(scenario, {"robots.count": robots})
    made = RobotsVecEnv(
        Simulation(scenario, n_envs, threads=threads), observation=observation, action=action, restart=restart
    )
    if seed is not None:
        made.seed(seed)
    return made


def bound_arguments(name: str) -> dict[str, Any]:
    """What a registered id binds: its scenario, and the forms of observations and actions where its name says them."""
    try:
        bound = gym.spec(name).kwargs
    except gym.error.UnregisteredEnv as error:
        raise ValueError(str(error)) from None
    if "scenario" not in bound:
        raise ValueError(
            f"{name} binds no scenario, expected an id such as 'BugGym/Dynamic-v0': make it with gymnasium.make"
        )
    return bound


class ArrayVecEnv(VecEnv):
    """A `VecEnv` whose rows are rows of arrays: they share its attributes, and have no methods of their own."""

    def _get_indices(self, indices: VecEnvIndices) -> list[int]:
        """Numbers of the rows that are meant; -1 is the last one.

        Raises:
            IndexError: there is no such row.
        """
        rows = list(super()._get_indices(indices))
        for row in rows:
            if not -self.num_envs <= row < self.num_envs:
                raise IndexError(f"expected numbers of {self.num_envs} rows, got {row}")
        return [row % self.num_envs for row in rows]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of this env, once for each row: the rows share them all."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of this env.

        Raises:
            ValueError: some rows only are meant, but they share their attributes.
        """
        if len(set(self._get_indices(indices))) != self.num_envs:
            raise ValueError(f"the rows share {attr_name!r}: set it for all of them, not for {indices}")
        setattr(self, attr_name, value)

    def set_options(self, options: Sequence[Mapping[str, Any]] | Mapping[str, Any] | None = None) -> None:
        """What the next reset is asked for, as the `options` of NavigationEnv's: of all rows, or a dict a row.

        Raises:
            ValueError: an option of another name, what is no dict, or not one a row.
        """
        each = [options] * self.num_envs if options is None or isinstance(options, Mapping) else options
        if isinstance(each, str) or not isinstance(each, Sequence) or len(each) != self.num_envs:
            raise ValueError(f"options are a dict, or {self.num_envs} of them, one a row, got {shortened(options)}")
        self._options = [dict(checked_options(one, OPTIONS)) for one in each]

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Always an AttributeError: the rows are rows of arrays, with no methods of their own."""
        raise AttributeError(f"a row of {type(self).__name__} has no method {method_name!r}")

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """True for Monitor, because infos hold what it would add; False for any other."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]


class SimulationVecEnv(ArrayVecEnv):
    """The robots of a simulation's worlds: with R robots each, row n R + r is robot r of world n.

    A training never calls a step again. So where the next episode of a world that has ended finds no place, the step passes
    it over and tries up to TRIES after it; the log tells of the first one that a scenario has passed over. Where none of
    them finds its place the step raises a ValueError, and what came of it waits: a further step drives nothing, whatever
    its actions, tries the episodes after those, and returns what came of the first. A `reset` drops what waits, and `save`
    leaves it out.

    Args:
        simulation: the worlds.
        spaces: what a robot sees and does.
        render_mode: None or "rgb_array".
    """

    def __init__(self, simulation: Simulation, spaces: RobotSpaces, render_mode: str | None) -> None:
        self.simulation, self.spaces, self.render_mode = simulation, spaces, render_mode
        rows = simulation.count * simulation.robots
        super().__init__(rows, spaces.observation, spaces.action)
        self._velocities = np.zeros((simulation.count, simulation.robots, 2))
        self._returns = np.zeros(rows)
        self._waiting: Waiting | None = None
        self._made_at = time.time()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """At the next reset, world n starts episode 0 of seed + n; None: each world goes on with its own seed."""
        robots, first = self.simulation.robots, None if seed is None else checked_seed(seed)
        self._seeds = [None if first is None else checked_seed(first + row // robots) for row in range(self.num_envs)]
        return self._seeds

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of the next `step_wait`."""
        shape = (self.simulation.count, self.simulation.robots, 2)
        self._velocities = self.spaces.velocities(actions, (self.num_envs,)).reshape(shape)

    def _begin(self, worlds: NDArray[np.int64], seeds: Sequence[int | None] | None = None) -> None:
        """Start an episode in each of the worlds, as `Simulation.reset` does."""
        self.simulation.reset(worlds, seeds)

    def _begin_next(self, worlds: NDArray[np.int64], waiting: Waiting) -> None:
        """Start the next episodes that find their place, in those of the worlds that have not begun one since they ended.

        Raises:
            ValueError: a world finds none in TRIES; `waiting` waits from then on.
        """
        self._waiting = None
        world = self.simulation.world
        left = worlds[world.steps[worlds] > 0]
        refusal = self._refusal(left)
        if refusal is None:
            return
        before = world.episode[left]
        for number in left:
            tries = 0
            while (last := self._refusal(np.array([number]))) is not None:
                tries += 1
                if tries >= TRIES:
                    self._waiting = waiting
                    last.add_note(f"{tries} episodes in a row found no place")
                    raise last
        first = int(np.argmax(world.episode[left] > before + 1))
        where, told = f"seed {world.seed[left[first]]}, episode {before[first] + 1}", told_of(refusal)
        name = self.simulation.scenario.name
        passed = "it is passed over, as any further one that finds no place"
        warn_once(f"{told if where in told else f'{where}: {told}'}; {passed}", f"passed over in {name}")

    def _refusal(self, worlds: NDArray[np.int64]) -> ValueError | None:
        """Start the next episode in each of the worlds; or in none, and return what says so, where one finds no place."""
        try:
            self._begin(worlds)
        except ValueError as error:
            if not self.simulation.world.steps[worlds].all():  # they have begun: a function of one's own has failed
                raise
            return error
        return None

    def _tell_resets(self, rows: Iterable[int]) -> None:
        """Fill the `reset_infos` of rows whose episodes begin, with what `set_options` asks of them."""
        for row in rows:
            world, robot = divmod(row, self.simulation.robots)
            asked = asked_info(self.simulation, self._options[row], world, robot)
            self.reset_infos[row] = self.simulation.robot_step(world, robot).info | asked

    def _final_info(self, row: int, observation: Observation, steps: int) -> dict[str, Any]:
        """The info of a row whose episode has ended, after so many steps, with its last observation."""
        last = self.simulation.robot_step(*divmod(row, self.simulation.robots))
        seconds = round(time.time() - self._made_at, 6)
        return last.info | {
            "terminal_observation": observation,
            "TimeLimit.truncated": last.truncated,
            "episode": {"r": float(self._returns[row]), "l": steps, "t": seconds},
        }

    def _save_simulation(self) -> Saved:
        saved, seeded = self.simulation.save()
        arrays = [saved.floats, saved.ints, saved.observation]  # what was drawn follows from seed and episode
        return {"capacity": list(saved.capacity), "arrays": arrays, "digest": saved.digest, "seeded": seeded}

    def _restore_simulation(self, saved: Saved) -> None:
        floats, ints, observation = saved["arrays"]
        snapshot = Snapshot(Capacity(*saved["capacity"]), floats, ints, observation, saved["digest"])
        self.simulation.restore((snapshot, saved["seeded"]))
        self._waiting = None

    def close(self) -> None:
        """Let the threads go."""
        self.simulation.close()


class NavigationVecEnv(SimulationVecEnv):
    """`num_envs` worlds of NavigationEnv, see there for what a robot sees, does and gets; `make_vec_env` makes one.

    Infos are `{}` except where an episode ends; there they hold NavigationEnv's keys of the last step and
    `terminal_observation`, `TimeLimit.truncated` and `episode` {r: return, l: steps, t: seconds since the env was made}
    as SB3's Monitor would give them.
    """

    def __init__(
        self, simulation: Simulation, *, observation: ObservationForm, action: ActionForm, render_mode: str | None
    ) -> None:
        require_one_robot(simulation)
        require_one_of("render_mode", render_mode, (None, "rgb_array"))
        super().__init__(simulation, RobotSpaces(simulation, observation, action), render_mode)
        self.metadata: dict[str, Any] = {**self.metadata, "render_fps": 1.0 / simulation.scenario.time.step}
        self._pictures = Pictures(simulation, render_mode)

    def reset(self) -> Observation:
        """Start an episode in each row; `reset_infos` tell what `set_options` asked for as NavigationEnv's `reset` would."""
        flat = self.simulation.reset(seeds=None if self._seeds[0] is None else self._seeds)
        self._returns[:], self._waiting = 0.0, None
        self._tell_resets(range(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        self._pictures.record()
        return self.spaces.present_batch(flat[:, 0])

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive for one step in each row, and start anew in those whose episode ends.

        Raises:
            ValueError: a row that ends finds no place for its next episodes; a further step hands over what came of this one.
        """
        simulation = self.simulation
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if self._waiting is None:
            simulation.advance(self._velocities)
            flat, reward, terminated, truncated = simulation.transition(simulation.all_rows).of_robot(0)
            self._returns += reward
            done = terminated | truncated
            ended = np.flatnonzero(done)
            for row in ended.tolist():
                steps = int(simulation.world.steps[row])
                infos[row] = self._final_info(row, self.spaces.present(flat[row].copy()), steps)
        else:
            flat, (reward, done, infos) = simulation.observations()[:, 0], self._waiting
            ended = np.flatnonzero(done)
        if len(ended):
            self._begin_next(ended, Waiting(reward, done, infos))
            flat[ended] = simulation.observations(ended)[:, 0]
            self._returns[ended] = 0.0
            self._tell_resets(ended.tolist())
        self._pictures.record()
        return self.spaces.present_batch(flat), reward.astype(np.float32), done, infos

    def save(self) -> Saved:
        """Copy all that the future depends on, but for the actions: plain numbers and arrays."""
        return {**self._save_simulation(), "returns": self._returns.copy()}

    def restore(self, saved: Saved) -> None:
        """Go back to what `save` of an env of the same scenario and size gave; it goes on bit for bit."""
        self._restore_simulation(saved)
        self._returns[:] = saved["returns"]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """A picture (H, W, 3) of each row, RGB uint8."""
        return self._pictures.frames() or [None] * self.num_envs

    def close(self) -> None:
        """Let the threads and the pictures go."""
        super().close()
        self._pictures.close()


class RobotsVecEnv(SimulationVecEnv):
    """Worlds with several robots each, row n R + r = robot r of world n; `make_robots_vec_env` makes one.

    With `restart="world"` a robot whose run has ended stands where it is, an obstacle to the others, as in PettingZoo's
    `parallel_env`. Its row tells in each step of an end, with reward 0 and no `episode` in its info; when the last
    robot's run ends, or the world's time is over, the world starts its next episode in the same step. So learners take
    nothing of the waiting for a part of a run, and teams know from `dones` who is out of play and who begins.

    With `restart="robot"` it starts again from its start while the others go on, until the world's time is over; then
    all start anew in the next episode. Where something stands on its start it waits, and its row tells of an end in
    each step.

    Infos are as NavigationVecEnv's: they have `episode` already. SB3's VecMonitor puts its own in their place, and would
    take each step of a robot that waits for an episode of one step; it warns that it does so, and is not needed.

    Args:
        simulation: the worlds.
        observation: "dict" or "flat".
        action: "continuous" or "discrete".
        restart: "world" or "robot".

    Raises:
        ValueError: another form or restart than these.
    """

    def __init__(
        self, simulation: Simulation, *, observation: ObservationForm, action: ActionForm, restart: Restart
    ) -> None:
        require_one_of("restart", restart, ("world", "robot"))
        super().__init__(simulation, RobotSpaces(simulation, observation, action), None)
        self.restart = restart
        self._starts = np.zeros((simulation.count, simulation.robots, 3))
        self._steps = np.zeros(self.num_envs, dtype=np.int64)

    def reset(self) -> Observation:
        """Start an episode in each world; `reset_infos` tell what `set_options` asked for as `parallel_env`'s `reset` would."""
        seeds = self._seeds[:: self.simulation.robots]
        self._begin(self.simulation.all_rows, None if seeds[0] is None else seeds)
        self._returns[:], self._steps[:], self._waiting = 0.0, 0, None
        self._tell_resets(range(self.num_envs))
        self._reset_seeds()
        self._reset_options()
        return self.spaces.present_batch(self._flat())

    def _flat(self) -> F32:
        return self.simulation.observations().reshape(self.num_envs, -1)

    def state(self) -> F32:
        """What all robots of each world observe (N, R D), whether they are still in play or not: for central critics.

        Raises:
            gymnasium.error.ResetNeeded: a world that has never been reset.
        """
        self.simulation.require_episodes()
        return self.simulation.observations().reshape(self.simulation.count, -1)

    def _begin(self, worlds: NDArray[np.int64], seeds: Sequence[int | None] | None = None) -> None:
        super()._begin(worlds, seeds)
        self._starts[worlds] = self.simulation.world.pose[worlds]

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Drive for one step in each world, and start anew what its end starts anew.

        Raises:
            ValueError: a world that ends finds no place for its next episodes; a further step hands over what came of this one.
        """
        simulation, world = self.simulation, self.simulation.world
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if self._waiting is None:
            drove = world.active.ravel()
            simulation.advance(self._velocities)
            observation, reward, _, _ = simulation.transition(simulation.all_rows)
            flat, rewards = observation.reshape(self.num_envs, -1), reward.ravel()
            self._returns += rewards
            self._steps += 1
            done = ~world.active.ravel()
            for row in np.flatnonzero(done).tolist():
                last = self.spaces.present(flat[row].copy())
                infos[row] = {"terminal_observation": last}
                if drove[row]:
                    infos[row] = self._final_info(row, last, int(self._steps[row]))
        else:
            rewards, done, infos = self._waiting
        if self._start_anew(Waiting(rewards, done, infos)):
            flat = self._flat()
            self._tell_resets(np.flatnonzero(done & world.active.ravel()).tolist())
        self._returns[done], self._steps[done] = 0.0, 0
        return self.spaces.present_batch(flat), rewards.astype(np.float32), done, infos

    def _start_anew(self, came: Waiting) -> bool:
        """Start worlds, or robots, anew where runs are done by what came of a step; returns whether any did."""
        simulation, done = self.simulation, came.done.reshape(self.simulation.world.outcome.shape)
        if self.restart == "world":
            worlds = over = np.flatnonzero(done.all(axis=1))
        else:
            worlds = np.flatnonzero(done.any(axis=1))
            is_over = simulation.world.steps[worlds] >= simulation.scenario.time.steps
            over, going = worlds[is_over], worlds[~is_over]
            if len(going) and self._waiting is None:  # else they have been put back already
                simulation.restart_robots(going, self._starts[going])
        if len(over):
            self._begin_next(over, came)
        return len(worlds) > 0

    def save(self) -> Saved:
        """Copy all that the future depends on, but for the actions."""
        own = [self._starts.copy(), self._returns.copy(), self._steps.copy()]
        return {**self._save_simulation(), "own": own}

    def restore(self, saved: Saved) -> None:
        """Go back to what `save` gave."""
        self._restore_simulation(saved)
        for mine, value in zip((self._starts, self._returns, self._steps), saved["own"], strict=True):
            mine[:] = value
