"""THE core: N worlds that reset and step by rows. Faces, evaluation and training all stand on this class.

It composes the world (arrays), the families (layouts), the kernels (motion, contact, scan, reward) and the field table
of observations, and decides nothing about episodes following one another: who resets what and when is the business of
a face.
"""

from __future__ import annotations

import functools
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from bug_gym import kernels, observation, scenarios, task
from bug_gym.config import Scenario, load
from bug_gym.world import Capacity, Snapshot, World
from bug_gym.worlds.field import FieldWorld

if TYPE_CHECKING:
    from bug_gym.shortest_path import Path as ShortestPath

logger = logging.getLogger("bug_gym")

Rows = NDArray[np.int64]

REPORTED = ("time", "path_length", "min_clearance", "goal_distance", "reward", "terms", "outcome")
"""Arrays of a row that tell how its robots are doing."""


class Transition(NamedTuple):
    """What one step gives for each of its rows (n,) and robots (R,)."""

    observation: NDArray[np.float32]
    """Flat observations (n, R, D)."""
    reward: NDArray[np.float64]
    """Sum of the weighted reward terms (n, R)."""
    terminated: NDArray[np.bool_]
    """Goal reached or something touched (n, R)."""
    truncated: NDArray[np.bool_]
    """Out of time (n, R)."""

    def of_robot(self, robot: int) -> Transition:
        """The same of one robot, views (n, ...)."""
        observation, reward, terminated, truncated = self
        return Transition(observation[:, robot], reward[:, robot], terminated[:, robot], truncated[:, robot])


class RobotStatus(NamedTuple):
    """How the robots (n, R) of some rows are doing."""

    outcome: NDArray[np.int64]
    """Codes, as task.OUTCOMES."""
    reward: NDArray[np.float64]
    path_length: NDArray[np.float64]
    time: NDArray[np.float64]
    min_clearance: NDArray[np.float64]
    goal_distance: NDArray[np.float64]
    terms: NDArray[np.float64]
    """Reward terms (n, R, terms), as task.REWARD_TERMS."""


class RobotStep(NamedTuple):
    """What the last step gave one robot, as Python's own values."""

    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]
    """The contract's info; `reward_terms` by name."""


class Simulation:
    """N worlds of one scenario.

    Args:
        scenario: a Scenario, or what `config.load` takes: a name, a path or a dict.
        count: how many worlds, N.
        overrides: values by dotted key that replace the scenario's.
        threads: how many threads share the rows of a call; results do not depend on it.

    Raises:
        ValueError: a scenario that can't be, or a count or a number of threads below 1.
    """

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        count: int = 1,
        *,
        overrides: Mapping[str, Any] | None = None,
        threads: int = 1,
    ) -> None:
        if count < 1 or threads < 1:
            raise ValueError(f"count and threads must be at least 1, got {count} and {threads}")
        self.scenario = load(scenario, overrides)
        self.count = count
        self.fields = observation.fields(self.scenario)
        self._field_record: NDArray[Any] | None = None
        capacity = Capacity()
        world = self.scenario.world
        if isinstance(world, FieldWorld):
            self._field_record = scenarios.field_record(self.scenario, world)
            capacity = field_capacity(self._field_record)
        self.world = World(
            self.scenario,
            count,
            width=observation.width(self.fields),
            weights=task.weights(self.scenario.reward),
            clearance_scale=task.CLEARANCE_SCALE,
            span=observation.world_span(self.scenario),
            capacity=capacity,
        )
        self.all_rows: Rows = np.arange(count)
        self._seeded = np.zeros(count, dtype=bool)
        self._all_seeded = False
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="bug_gym") if threads > 1 else None
        self._scratch: list[tuple[NDArray[np.float64], NDArray[np.int64]]] = []
        self._bound_world: object = None
        self._bind()
        self._one_world: object = None
        self._one_kept: tuple[Any, ...] = ()
        announce_compilation()

    @property
    def robots(self) -> int:
        """Robots in each world, R."""
        return self.world.robots

    # ------------------------------------------------------------------------------------------ episodes

    def reset(self, rows: Rows | None = None, seeds: Sequence[int | None] | None = None) -> NDArray[np.float32]:
        """Start an episode in each of the rows.

        Args:
            rows: numbers of the rows (n,), all by default.
            seeds: one for each row: a number starts episode 0 of that seed, None the next episode of the seed that
                the row has (a first one without a seed draws it from entropy).

        Returns:
            Flat observations (n, R, D), a copy.

        Raises:
            ValueError: a seed that is no integer from 0 on, or a world that found no place for its obstacles.
        """
        rows = self.all_rows if rows is None else rows
        self._seed(rows, seeds)
        if self._field_record is not None:
            self._place_fields(rows, self._field_record)
        else:
            self._place_layouts(rows)
        self._run(kernels.begin_rows, rows)
        return self.observations(rows)

    def restart_robots(self, rows: Rows, starts: NDArray[np.float64]) -> NDArray[np.float32]:
        """Put robots whose runs have ended back to a start, while their worlds go on; not where something stands there.

        Args:
            rows: numbers of the rows (n,).
            starts: poses (n, R, 3) of all their robots: x, y [m], heading [rad].

        Returns:
            Flat observations (n, R, D), a copy.
        """
        self._run(kernels.restart_robots, rows, np.ascontiguousarray(starts, dtype=np.float64))
        return self.observations(rows)

    def _seed(self, rows: Rows, seeds: Sequence[int | None] | None) -> None:
        seed, episode = self.world.seed, self.world.episode
        if seeds is None:
            episode[rows] += 1
            fresh = rows[~self._seeded[rows]] if not self._all_seeded else ()
            if len(fresh):
                seed[fresh] = np.random.SeedSequence().generate_state(len(fresh), np.uint64) >> np.uint64(2)
                episode[fresh] = 0
        else:
            if len(seeds) != len(rows):
                raise ValueError(f"got {len(seeds)} seeds for {len(rows)} rows")
            for row, value in zip(rows, seeds, strict=True):
                if value is None:
                    self._seed(np.array([row]), None)
                    continue
                if not isinstance(value, (int, np.integer)) or not 0 <= value < 2**63:
                    raise ValueError(f"a seed is an integer from 0 to 2**63 - 1, got {value!r}")
                seed[row], episode[row] = value, 0
        self._seeded[rows] = True

    def _place_fields(self, rows: Rows, record: NDArray[Any]) -> None:
        world = self.world
        placed = np.zeros(len(rows), dtype=np.int64)
        kernels.place_fields(world.floats, world.ints, world.spec, record, rows, placed)
        wanted = int(record["discs"][0] + record["polygons"][0])
        failed = np.nonzero(placed < wanted)[0]
        if len(failed) == 0:
            return
        row, count = int(rows[failed[0]]), int(placed[failed[0]])
        where = f"{self.scenario.name}, seed {world.seed[row]}, episode {world.episode[row]}"
        if count < 0:
            raise ValueError(f"{where}: no start and goal with their clearance and separation fit into the bounds")
        share = scenarios.covered_share(world, row)
        raise ValueError(
            f"{where}: only {count} of {wanted} obstacles found a free place in {kernels.ATTEMPTS} attempts; "
            f"they cover {100.0 * share:.0f} % of the world"
        )

    def _place_layouts(self, rows: Rows) -> None:
        seeds, episodes = self.world.seed[rows].tolist(), self.world.episode[rows].tolist()
        layouts = [scenarios.draw_layout(self.scenario, *key) for key in zip(seeds, episodes, strict=True)]
        for row, layout in zip(rows, layouts, strict=True):
            self.world.load(int(row), layout)

    def step(self, actions: ArrayLike, rows: Rows | None = None) -> Transition:
        """Advance the rows by one step.

        Args:
            actions: (n, R, 2) in [-1, 1], see the action space; larger values are cut.
            rows: numbers of the rows (n,), all by default.

        Raises:
            ValueError: actions of another shape, or not finite.
            gymnasium.error.ResetNeeded: a row that has never been reset.
        """
        rows = self.all_rows if rows is None else rows
        self.advance(actions, rows)
        return self.transition(rows)

    def advance(self, actions: ArrayLike, rows: Rows | None = None) -> None:
        """Do what `step` does, and read nothing back."""
        rows = self.all_rows if rows is None else rows
        array = np.ascontiguousarray(actions, dtype=np.float64)
        if array.shape != (len(rows), self.robots, 2):
            raise ValueError(f"actions have shape {array.shape}, expected {(len(rows), self.robots, 2)}")
        if not is_finite(array):
            raise ValueError(f"actions must be finite, got {array[~np.isfinite(array)][0]}")
        if not self._all_seeded:
            self._require_episodes(rows)
        self._run(kernels.step_rows, rows, array)

    def step_one(self, first: float, second: float) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Advance the one world of one robot: what `step` and `robot_step` do, in a third of their time.

        Args:
            first: number of the action, as `step` takes it.
            second: the other number.

        Returns:
            Flat observation (D,), a copy; reward, terminated, truncated and info as RobotStep has them.

        Raises:
            ValueError: a number that is not finite, or several worlds or robots.
            gymnasium.error.ResetNeeded: the world has never been reset.
        """
        if self._one_world is not self.world.floats:
            self._bind_one()
        # The sum alone may be too large; the other way tells, and does the same in more time.
        if not (math.isfinite(first + second) and self._all_seeded and self._one_address):
            self.advance([[[first, second]]])
            return (self._one_observation.copy(), *self.robot_step())
        reward, terminated, truncated, info = robot_step_of(*kernels.step_one(self._one_address, first, second))
        return self._one_observation.copy(), reward, terminated, truncated, info

    def _require_episodes(self, rows: Rows) -> None:
        missing = rows[~self._seeded[rows]]
        if len(missing):
            raise ResetNeeded(f"row {missing[0]} has no episode yet: call reset first")
        self._all_seeded = bool(self._seeded.all())

    def _run(self, kernel: Callable[..., None], rows: Rows, *per_row: NDArray[Any]) -> None:
        """Call a kernel over the rows, in blocks where there are threads to share them."""
        if self._bound_world is not self.world.floats:
            self._bind()
        if self._pool is None or len(rows) < 2 * self._threads:
            kernel(*self._arrays, *self._scratch[0], *per_row, rows)
            return
        jobs = []
        for number, block in enumerate(np.array_split(np.arange(len(rows)), self._threads)):
            parts = [array[block] for array in per_row]
            jobs.append(self._pool.submit(kernel, *self._arrays, *self._scratch[number], *parts, rows[block]))
        wait(jobs)
        for job in jobs:
            job.result()

    def _bind(self) -> None:
        """Take hold of the world's buffers, which are new ones once it has grown."""
        world = self.world
        self._scratch = [world.make_scratch() for _ in range(self._threads)]
        self._bound_world = world.floats
        constants = (world.spec, world.beams, world.footprint, world.regions)
        self._arrays = (world.floats, world.ints, world.observation, *constants)
        self._begins = {name: int(world.spec[name][0]) for name in REPORTED}
        numbers = {name: begin for name, begin in self._begins.items() if name != "outcome"}
        self._report_end = max(numbers.values()) + kernels.TERMS * self.robots

    def _bind_one(self) -> None:
        """Take hold of the buffers for `step_one`, by their addresses."""
        if (self.count, self.robots) != (1, 1):
            raise ValueError(f"got {self.count} worlds of {self.robots} robots, expected one world of one robot")
        self._bind()
        arrays = (*self._arrays, *self._scratch[0], np.zeros((1, 1, 2)), self.all_rows)
        self._one_address, self._one_kept = 0, ()
        if kernels.HAS_ADDRESSES:
            table = kernels.address_table(kernels.step_rows, arrays)
            self._one_address, self._one_kept = table.ctypes.data, (table, arrays)
        self._one_observation = self.world.observation[0, 0]
        self._one_world = self.world.floats

    # ------------------------------------------------------------------------------------------ reading

    def observations(self, rows: Rows | None = None) -> NDArray[np.float32]:
        """Flat observations (n, R, D), a copy."""
        if rows is None or rows is self.all_rows:
            return self.world.observation.copy()
        return self.world.observation[rows]

    def status(self, rows: Rows) -> RobotStatus:
        """How the robots of the rows are doing, copies; what asks for both `transition` and `info` reads it once for both."""
        numbers = np.empty((kernels.STATUS + kernels.TERMS, len(rows), self.robots))
        outcome = np.empty((len(rows), self.robots), dtype=np.int64)
        kernels.read_status(self.world.floats, self.world.ints, self.world.spec, rows, numbers, outcome)
        reward, path_length, time, min_clearance, goal_distance = numbers[: kernels.STATUS]
        terms = numbers[kernels.STATUS :].transpose(1, 2, 0)
        return RobotStatus(outcome, reward, path_length, time, min_clearance, goal_distance, terms)

    def transition(self, rows: Rows, status: RobotStatus | None = None) -> Transition:
        """What the last step gave for the rows."""
        outcome, reward = (status or self.status(rows))[:2]
        terminated = (outcome == kernels.SUCCESS) | (outcome == kernels.COLLISION)
        return Transition(self.observations(rows), reward, terminated, outcome == kernels.TIMEOUT)

    def info(self, rows: Rows | None = None, status: RobotStatus | None = None) -> dict[str, NDArray[Any]]:
        """The contract's info as arrays (n, R), by name; `reward_terms` is (n, R, terms), as task.REWARD_TERMS."""
        status = status or self.status(self.all_rows if rows is None else rows)
        _, _, path_length, time, min_clearance, goal_distance, terms = status
        outcome = task.OUTCOME_NAMES.take(status.outcome)
        return info_of(status.outcome, outcome, path_length, time, min_clearance, goal_distance, terms)

    def robot_step(self, row: int = 0, robot: int = 0) -> RobotStep:
        """What the last step (or reset) gave one robot; the quick way for a face of one world."""
        if self._bound_world is not self.world.floats:
            self._bind()
        begin = self._begins
        values = self.world.floats[row, : self._report_end].tolist()
        outcome = self.world.ints.item(row, begin["outcome"] + robot)
        terms = begin["terms"] + kernels.TERMS * robot
        return RobotStep(
            *robot_step_of(
                outcome,
                values[begin["reward"] + robot],
                values[begin["path_length"] + robot],
                values[begin["time"]],
                values[begin["min_clearance"] + robot],
                values[begin["goal_distance"] + robot],
                *values[terms : terms + kernels.TERMS],
            )
        )

    def shortest_path(self, row: int = 0, robot: int = 0) -> ShortestPath:
        """The shortest path among the still obstacles for a robot of a row from where it stands to its goal.

        A body that is no disc counts as the disc about it. It is short in metres: what regions cost doesn't count.
        """
        from bug_gym.shortest_path import shortest_path  # scipy and shapely are slow to load

        layout = self.world.layout(row)
        goal = layout.goals[min(robot, len(layout.goals) - 1)]
        start, radius = layout.starts[robot, :2], self.scenario.robot.reach
        return shortest_path(layout.circles, layout.polygons, layout.border, start, goal, radius=radius)

    # ------------------------------------------------------------------------------------------ snapshots

    def save(self) -> tuple[Snapshot, NDArray[np.bool_]]:
        """Copy all that the future depends on, but for the actions."""
        return self.world.save(), self._seeded.copy()

    def restore(self, state: tuple[Snapshot, NDArray[np.bool_]]) -> None:
        """Go back to a saved state of a Simulation of the same scenario and count; it goes on bit for bit."""
        snapshot, seeded = state
        self.world.restore(snapshot)
        self._seeded[:] = seeded
        self._all_seeded = bool(seeded.all())

    def close(self) -> None:
        """Let the threads go."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __getstate__(self) -> dict[str, Any]:
        """Pickle everything but the threads and what is bound to the buffers."""
        unbound: dict[str, Any] = {
            "_scratch": [],
            "_bound_world": None,
            "_arrays": (),
            "_one_world": None,
            "_one_kept": (),
        }
        return {**self.__dict__, "_pool": None, **unbound}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Unpickle and start the threads again."""
        self.__dict__.update(state)
        if self._threads > 1:
            self._pool = ThreadPoolExecutor(self._threads, thread_name_prefix="bug_gym")


def robot_step_of(
    outcome: int,
    reward: float,
    path_length: float,
    time: float,
    min_clearance: float,
    goal_distance: float,
    *terms: float,
) -> tuple[float, bool, bool, dict[str, Any]]:
    """A RobotStep as a plain tuple, which is made in half the time."""
    name, named = task.OUTCOMES[outcome], task.named_terms(*terms)
    info = info_of(outcome, name, path_length, time, min_clearance, goal_distance, named)
    return reward, info["is_success"] or info["collision"], outcome == kernels.TIMEOUT, info


def info_of(
    code: Any, outcome: Any, path_length: Any, time: Any, min_clearance: Any, goal_distance: Any, terms: Any
) -> dict[str, Any]:
    """The contract's info, of one robot or as arrays of many; `code` is the number of the outcome."""
    return {
        "is_success": code == kernels.SUCCESS,
        "collision": code == kernels.COLLISION,
        "outcome": outcome,
        "path_length": path_length,
        "time": time,
        "min_clearance": min_clearance,
        "goal_distance": goal_distance,
        "reward_terms": terms,
    }


def is_finite(array: NDArray[np.float64]) -> bool:
    """Whether all numbers are finite."""
    if array.size <= 8:  # NumPy's two calls take 2 us, as much as a step of one world
        return all(map(math.isfinite, array.ravel().tolist()))
    return bool(np.isfinite(array).all())


def field_capacity(record: NDArray[Any]) -> Capacity:
    """Room for any world of a `field` scenario."""
    discs, polygons = int(record["discs"][0]), int(record["polygons"][0])
    corners = 4 if record["squares"][0] else kernels.MAX_VERTICES
    has_crowd = record["laws"][0] & kernels.CROWD_BIT > 0 or record["pedestrians"][0] > 0
    steered = int(has_crowd or record["target_law"][0] >= kernels.CROWD)
    return Capacity(discs=discs, polygons=polygons, walls=4 + corners * polygons, steered=steered)


@functools.cache  # they are compiled at the first step, before which many environments may be made
def announce_compilation() -> None:
    """Say in the log, once in a process, that the kernels will be compiled, where they are not kept on disk."""
    if not kernels.is_compiled():
        logger.warning("compiling the simulation's kernels, once on this machine (up to half a minute)")
