"""THE core: N worlds that reset and step by rows. Faces, evaluation and training all stand on this class.

It composes the world (arrays), the families (layouts), the kernels (motion, contact, scan, reward) and the field table
of observations, and decides nothing about episodes following one another: who resets what and when is the business of
a face.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import ArrayLike, NDArray

from bug_gym import kernels, observation, scenarios, task
from bug_gym.checks import checked_count, checked_seed, real_numbers, row_numbers
from bug_gym.compiling import types_of
from bug_gym.config import Scenario, load
from bug_gym.limits import MOST_WORKERS
from bug_gym.log import warn_once
from bug_gym.own_parts import OwnParts, asks_for
from bug_gym.schema.errors import shortened
from bug_gym.world import Capacity, Snapshot, World, world_span
from bug_gym.worlds.field import FieldWorld
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.own import required_trust
from bug_gym.worlds.scattering import told_gaps

if TYPE_CHECKING:
    from bug_gym.shortest_path import Path as ShortestPath


Rows = NDArray[np.int64]
State = tuple[Snapshot, NDArray[np.int64]]
"""What `Simulation.snapshot` gives: the world's arrays, and how far on each row's next episode is (0: it has none yet)."""
Futures = Literal["same", "shared", "own"]
"""Which numbers branches draw from then on: the original's, others that all of them share, or each its own."""
Scratch = tuple[NDArray[np.float64], NDArray[np.int64]]

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
    """Out of time, or another robot has ended the mission (n, R)."""

    def of_robot(self, robot: int) -> Transition:
        """The same of one robot, views (n, ...)."""
        observation, reward, terminated, truncated = self
        return Transition(observation[:, robot], reward[:, robot], terminated[:, robot], truncated[:, robot])


class Starts(NamedTuple):
    """What some rows (n,) begin with."""

    seed: NDArray[np.int64]
    episode: NDArray[np.int64]


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
    """Reward terms (n, R, terms), as Simulation.term_names."""


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
        ValueError: a scenario that can't be, or that names code which nobody trusts (`config.load`), a count or a
            number of threads below 1, or more worlds than memory holds.
    """

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        count: int = 1,
        *,
        overrides: Mapping[str, Any] | None = None,
        threads: int = 1,
    ) -> None:
        count, threads = (
            checked_count("the number of worlds", count),
            checked_count("threads", threads, most=MOST_WORKERS),
        )
        self.scenario = load(scenario, overrides)
        self.count = count
        required_trust(self.scenario.world)
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
            span=world_span(self.scenario),
            own_terms=len(self.scenario.reward_terms),
            clearance_reach=world_span(self.scenario) if asks_for(self.scenario, "clearance") else None,
            capacity=capacity,
        )
        has_own = self.scenario.reward_terms or self.scenario.observation_fields
        self._own = OwnParts(self.scenario, self.world, self.fields) if has_own else None
        self.term_names = (*task.REWARD_TERMS, *self.scenario.reward_terms)
        self.all_rows: Rows = np.arange(count)
        # How far on from its episode the next one of each row is: 1, and one more for each that found no place; 0: it has none.
        self._ahead: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self._all_seeded = False
        self._threads = threads
        self._pool: ThreadPoolExecutor | None = None
        self._pool_of = 0
        if threads > 1:
            self._start_threads()
        self._scratch: list[Scratch] = []
        self._bound_world: object = None
        self._bind()
        self._one_world: object = None
        self._one_kept: tuple[Any, ...] = ()
        arguments = (*self._arrays, *self._scratch[0], self._no_actions(self.all_rows), self.all_rows)
        announce_compilation(types_of(kernels.STEP, *arguments))

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
            ValueError: a seed that is no integer from 0 on, or a world that found no place for its obstacles; all rows
                are then as they were, but a next episode that found no place is passed over from then on.
        """
        rows = self.all_rows if rows is None else rows
        starts = self._next_episodes(rows, seeds)
        if self._field_record is not None:
            self._place_fields(rows, starts, self._field_record)
        else:
            self._place_layouts(rows, starts)
        self._ahead[rows] = 1
        self.begin(rows)
        return self.observations(rows)

    def has_episode(self, row: int) -> bool:
        """Whether a row has been reset."""
        return bool(self._ahead[row])

    def seeds(self) -> tuple[int, ...]:
        """The seed of each row's episode (N,); -1 for a row that has not been reset."""
        return tuple(np.where(self._ahead > 0, self.world.seed, -1).tolist())

    def begin(self, rows: Rows) -> None:
        """Start the episodes of rows (n,) whose worlds lie ready: what `reset` does once it has placed them."""
        self.world.draw(rows)
        self._do(kernels.BEGIN, rows, self._no_actions(rows))
        if self._own is not None:
            self._own.begin(rows)

    def place(self, layouts: Sequence[Layout], rows: Rows | None = None) -> NDArray[np.float32]:
        """Start an episode in rows whose worlds are told instead of drawn: a planner's model of what it knows.

        Args:
            layouts: one for each row, taken as they are: nothing looks whether robots stand clear.
            rows: numbers of the rows (n,), all by default; they keep their seeds.

        Returns:
            Flat observations (n, R, D), a copy.

        Raises:
            ValueError: another number of layouts than of rows.
        """
        rows = self.all_rows if rows is None else rows
        if len(layouts) != len(rows):
            raise ValueError(f"got {len(layouts)} layouts for {len(rows)} rows")
        self.world.load_all(rows, layouts)
        self._ahead[rows] = np.maximum(self._ahead[rows], 1)
        self.begin(rows)
        return self.observations(rows)

    def restart_robots(self, rows: Rows, starts: NDArray[np.float64]) -> NDArray[np.float32]:
        """Put robots whose runs have ended back to a start, while their worlds go on; not where something stands there.

        Args:
            rows: numbers of the rows (n,).
            starts: poses (n, R, 3) of all their robots: x, y [m], heading [rad].

        Returns:
            Flat observations (n, R, D), a copy.
        """
        if self._bound_world is not self.world.floats:
            self._bind()
        world = self.world
        starts = np.ascontiguousarray(starts, dtype=np.float64)
        rested = ~world.active[rows]
        kernels.restart_robots(world.floats, world.ints, world.spec, self._footprint, starts, rows)
        self._do(kernels.LOOK, rows, self._no_actions(rows))
        if self._own is not None:
            self._own.begin(rows, (rested & world.active[rows]).ravel())
        return self.observations(rows)

    def _next_episodes(self, rows: Rows, seeds: Sequence[int | None] | None) -> Starts:
        """Which seed and episode each of the rows begins next; nothing is written yet."""
        if seeds is not None and len(seeds) != len(rows):
            raise ValueError(f"got {len(seeds)} seeds for {len(rows)} rows")
        given = [None if value is None else checked_seed(value) for value in (() if seeds is None else seeds)]
        seed, episode = self.world.seed[rows], self.world.episode[rows] + self._ahead[rows]
        fresh = np.flatnonzero(self._ahead[rows] == 0) if not self._all_seeded else ()
        if len(fresh):
            seed[fresh] = np.random.SeedSequence().generate_state(len(fresh), np.uint64) >> np.uint64(2)
            episode[fresh] = 0
        for number, value in enumerate(given):
            if value is not None:
                seed[number], episode[number] = value, 0
        return Starts(seed, episode)

    def _pass_over(self, rows: Rows, episodes: NDArray[np.int64]) -> None:
        """Have rows (n,) go on with the episode after one that found no place, where it was the next of their seed."""
        self._ahead[rows[episodes > 0]] += 1

    def _place_fields(self, rows: Rows, starts: Starts, record: NDArray[Any]) -> None:
        world = self.world
        before = world.copy_placed(rows)
        placed = np.zeros(len(rows), dtype=np.int64)
        world.seed[rows], world.episode[rows] = starts
        kernels.place_fields(world.floats, world.ints, world.common, record, rows, placed)
        wanted = int(record["discs"][0] + record["polygons"][0])
        failed = np.nonzero(placed < wanted)[0]
        if len(failed) == 0:
            return
        row, count = int(rows[failed[0]]), int(placed[failed[0]])
        where = f"{self.scenario.name}, seed {world.seed[row]}, episode {world.episode[row]}"
        share = scenarios.covered_share(world, row) if count >= 0 else 0.0
        for part, old in zip(world.placed, before, strict=True):
            part[rows] = old
        self._pass_over(rows[failed], starts.episode[failed])
        if count < 0:
            keys = "world.start_clearance, world.goal_clearance, world.separation"
            raise ValueError(
                f"{where}: no start and goal with their clearance and separation fit into the bounds ({keys})"
            )
        raise ValueError(
            f"{where}: only {count} of {wanted} obstacles found a free place in {kernels.ATTEMPTS} attempts; "
            f"they cover {100.0 * share:.0f} % of the world{told_gaps(getattr(self.scenario.world, 'solvable', None))}"
        )

    def _place_layouts(self, rows: Rows, starts: Starts) -> None:
        layouts: list[Layout] = []
        for number, key in enumerate(zip(*(numbers.tolist() for numbers in starts), strict=True)):
            try:
                layouts.append(scenarios.draw_layout(self.scenario, *key))
            except ValueError:
                self._pass_over(rows[[number]], starts.episode[[number]])
                raise
        self.world.seed[rows], self.world.episode[rows] = starts
        self.world.load_all(rows, layouts)

    def step(self, actions: ArrayLike, rows: Rows | None = None) -> Transition:
        """Advance the rows by one step.

        Args:
            actions: (n, R, 2) in [-1, 1], see the action space; larger values are cut.
            rows: numbers of the rows (n,), all by default.

        Raises:
            ValueError: actions of another shape, not real or not finite.
            gymnasium.error.ResetNeeded: a row that has never been reset.
        """
        rows = self.all_rows if rows is None else rows
        self.advance(actions, rows)
        return self.transition(rows)

    def advance(self, actions: ArrayLike, rows: Rows | None = None) -> None:
        """Do what `step` does, and read nothing back."""
        rows = self.all_rows if rows is None else rows
        self.drive(self.checked(actions, rows), rows)

    def checked(self, actions: ArrayLike, rows: Rows) -> NDArray[np.float64]:
        """Actions for `drive`, where `step` would take them; nothing is driven yet.

        Raises:
            ValueError: actions of another shape, not real or not finite.
            gymnasium.error.ResetNeeded: a row that has never been reset.
        """
        array = np.ascontiguousarray(real_numbers("actions", actions))
        if array.shape != (len(rows), self.robots, 2):
            raise ValueError(f"actions have shape {array.shape}, expected {(len(rows), self.robots, 2)}")
        if not is_finite(array):
            raise ValueError(f"actions must be finite, got {array[~np.isfinite(array)][0]}")
        if not self._all_seeded:
            self.require_episodes(rows)
        return array

    def drive(self, actions: NDArray[np.float64], rows: Rows) -> None:
        """Advance the rows by one step with actions that are `checked`.

        What a function of one's own raises comes after the worlds have gone on: the step is done, without what it adds.
        """
        if self._own is None or len(rows) == 0:  # functions of one's own are asked about rows that there are
            self._do(kernels.STEP, rows, actions)
        else:
            before = self._own.before(rows)
            self._do(kernels.STEP, rows, actions)
            self._own.after(rows, before)

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
        if self._one_steering:
            kernels.steer_rows(kernels.STEP, *self._one_steering)
        self.world.is_behind = True
        numbers = kernels.step_one(self._one_address, first, second, *self._one_body_and_ground)
        reward, terminated, truncated, info = robot_step_of(*numbers)
        return self._one_observation.copy(), reward, terminated, truncated, info

    def require_episodes(self, rows: Rows | None = None) -> None:
        """Refuse rows that hold no episode; all rows are asked for by default.

        Raises:
            gymnasium.error.ResetNeeded: a row that has never been reset.
        """
        rows = self.all_rows if rows is None else rows
        missing = rows[self._ahead[rows] == 0]
        if len(missing):
            raise ResetNeeded(f"row {missing[0]} has no episode yet: call reset first")
        self._all_seeded = bool(self._ahead.all())

    def _no_actions(self, rows: Rows) -> NDArray[np.float64]:
        return np.empty((len(rows), self.robots, 2))

    def _do(self, task: int, rows: Rows, actions: NDArray[np.float64]) -> None:
        """Have the rows do a task of the kernels, in blocks where there are threads to share them."""
        if self._bound_world is not self.world.floats:
            self._bind()
        pool = self._pool
        if pool is None or len(rows) < 2 * self._threads:
            self._do_block(task, self._scratch[0], actions, rows)
            return
        if self._pool_of != os.getpid():  # forked: the threads are the parent's alone, and would never answer
            pool = self._start_threads()
        blocks = np.array_split(np.arange(len(rows)), self._threads)
        jobs = [
            pool.submit(self._do_block, task, scratch, actions[block], rows[block])
            for scratch, block in zip(self._scratch, blocks, strict=True)
        ]
        wait(jobs)
        for job in jobs:
            job.result()

    def _do_block(self, task: int, scratch: Scratch, actions: NDArray[np.float64], rows: Rows) -> None:
        world = self.world
        world.is_behind = True
        if world.capacity.steered and task != kernels.LOOK:
            kernels.steer_rows(task, world.floats, world.ints, world.spec, world.footprint, *scratch, rows)
        kernels.run_rows(task, *self._arrays, *scratch, actions, rows)

    def _bind(self) -> None:
        """Take hold of the world's buffers, which are new ones once it has grown."""
        world = self.world
        self._scratch = [world.make_scratch() for _ in range(self._threads)]
        self._bound_world = world.floats
        # None where there is little to say: less is compiled for that.
        is_disc = self.robots == 1 and len(world.footprint) == 1 and not world.footprint[0, :2].any()
        self._footprint = None if is_disc and not self.scenario.goes_on_arcs else world.footprint
        regions = world.regions if self.scenario.world.regions else None
        constants = (world.spec, world.beams, self._footprint, regions)
        self._arrays = (world.floats, world.ints, world.observation, *constants)
        self._begins = {name: int(world.spec[name][0]) for name in REPORTED}
        numbers = {name: begin for name, begin in self._begins.items() if name != "outcome"}
        self._report_end = max(numbers.values()) + kernels.TERMS * self.robots

    def _bind_one(self) -> None:
        """Take hold of the buffers for `step_one`, by their addresses."""
        if (self.count, self.robots) != (1, 1):
            raise ValueError(f"got {self.count} worlds of {self.robots} robots, expected one world of one robot")
        self._bind()
        world, scratch = self.world, self._scratch[0]
        arguments = (*self._arrays, *scratch, np.zeros((1, 1, 2)), self.all_rows)
        self._one_address, self._one_kept = 0, ()
        self._one_body_and_ground = self._arrays[-2:]
        steering = (world.floats, world.ints, world.spec, world.footprint, *scratch, self.all_rows)
        self._one_steering = steering if world.capacity.steered else ()
        if kernels.HAS_ADDRESSES and self._own is None:
            table = kernels.address_table(kernels.run_rows, (kernels.STEP, *arguments))
            self._one_address, self._one_kept = table.ctypes.data, (table, arguments)
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
        read, count = kernels.STATUS + kernels.TERMS, len(rows) * self.robots
        # An odd number of cache lines apart: with 1,024 rows the numbers of one robot would all lie at one place of a cache.
        width = (-(-count // 8) | 1) * 8
        numbers = np.empty((read if self._own is None else read + len(self._own.term_names), width))
        outcome = np.empty((len(rows), self.robots), dtype=np.int64)
        kernels.read_status(self.world.floats, self.world.ints, self.world.spec, rows, numbers[:read], outcome)
        told = numbers[:, :count].reshape(len(numbers), len(rows), self.robots)
        if self._own is not None:
            told[read:] = self._own.terms(rows).transpose(2, 0, 1)
        reward, path_length, time, min_clearance, goal_distance = told[: kernels.STATUS]
        terms = told[kernels.STATUS :].transpose(1, 2, 0)
        return RobotStatus(outcome, reward, path_length, time, min_clearance, goal_distance, terms)

    def transition(self, rows: Rows, status: RobotStatus | None = None) -> Transition:
        """What the last step gave for the rows."""
        outcome, reward = (status or self.status(rows))[:2]
        terminated = (outcome == kernels.SUCCESS) | (outcome == kernels.COLLISION)
        return Transition(self.observations(rows), reward, terminated, outcome >= kernels.TIMEOUT)

    def info(self, rows: Rows | None = None, status: RobotStatus | None = None) -> dict[str, NDArray[Any]]:
        """The contract's info as arrays (n, R), by name; `reward_terms` is (n, R, terms), as `term_names`."""
        status = status or self.status(self.all_rows if rows is None else rows)
        _, _, path_length, time, min_clearance, goal_distance, terms = status
        outcome = task.OUTCOME_NAMES.take(status.outcome)
        return info_of(status.outcome, outcome, path_length, time, min_clearance, goal_distance, terms)

    def robot_step(self, row: int = 0, robot: int = 0) -> RobotStep:
        """What the last step (or reset) gave one robot; the quick way for a face of one world."""
        return self._robot_step(row, robot, self._reported(row))

    def robot_steps(self, row: int = 0) -> list[RobotStep]:
        """What the last step (or reset) gave each robot of a row, for a face of one world."""
        reported = self._reported(row)
        return [self._robot_step(row, robot, reported) for robot in range(self.world.robots)]

    def _reported(self, row: int) -> list[float]:
        """The part of a row's numbers that tells how its robots are doing."""
        if self._bound_world is not self.world.floats:
            self._bind()
        reported: list[float] = self.world.floats[row, : self._report_end].tolist()
        return reported

    def _robot_step(self, row: int, robot: int, values: list[float]) -> RobotStep:
        begin = self._begins
        outcome = self.world.ints.item(row, begin["outcome"] + robot)
        terms = begin["terms"] + kernels.TERMS * robot
        step = RobotStep(
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
        if self._own is not None:
            step.info["reward_terms"] |= self._own.told(row, robot)
        return step

    def shortest_path(self, row: int = 0, robot: int = 0) -> ShortestPath:
        """The shortest path among the still obstacles for a robot of a row from where it stands to its goal.

        A body that is no disc counts as the disc about it. It is short in metres: what regions cost doesn't count.
        """
        from bug_gym.shortest_path import shortest_path  # scipy and shapely are slow to load

        layout = self.world.layout(row)
        goal = layout.goals[min(robot, len(layout.goals) - 1)]
        start, radius = layout.starts[robot, :2], self.world.own(row, "body_reach")
        return shortest_path(layout.circles, layout.polygons, layout.border, start, goal, radius=radius)

    def shortest_length(self, row: int = 0, robot: int = 0) -> float:
        """Length of the shortest path [m]; infinite where there is none, NaN where the robot does not fit at its start or goal.

        A goal may be nearer to a wall than the body: it is reached from beside it.
        """
        try:
            return self.shortest_path(row, robot).length
        except ValueError:
            return math.nan

    def drawn(self, row: int = 0) -> dict[str, float]:
        """What the scenario drew for a row's episode, by dotted key: {"robot.max_speed": 0.83}; empty: it draws nothing."""
        return dict(zip(self.world.drawn_keys, self.world.drawn[row].tolist(), strict=True))

    # ------------------------------------------------------------------------------------------ snapshots

    def snapshot(self) -> State:
        """Copy all that the future depends on, but for the actions."""
        return self.world.save(), self._ahead.copy()

    save = snapshot
    """Its name before there were branches."""

    def restore(self, state: State) -> None:
        """Go back to a snapshot of a Simulation of the same scenario and count; it goes on bit for bit.

        Raises:
            ValueError: the state is of another scenario, or of another number of worlds.
        """
        if not isinstance(state, tuple) or len(state) != 2 or not isinstance(state[0], Snapshot):
            raise ValueError(f"expected what `snapshot` returned, got {shortened(state)}")
        snapshot, ahead = state
        if len(snapshot.observation) != len(ahead):
            raise ValueError(f"the state is of {len(snapshot.observation)} worlds and seeds of {len(ahead)}")
        self.world.restore(snapshot)
        self._ahead[:] = ahead  # in older states bools: which rows have an episode
        self._all_seeded = bool(self._ahead.all())

    def branches(self, count: int, row: int = 0, *, futures: Futures = "same", threads: int = 1) -> Simulation:
        """Another Simulation whose worlds all begin as one row of this one stands now, for planners that roll out.

        Args:
            count: how many branches.
            row: number of the row that they leave.
            futures: see `copy_rows`; a planner that must not know what is to come takes "shared" or "own".
            threads: how many threads share the branches.

        Raises:
            ValueError: a row that there is not, or what Simulation refuses.
            gymnasium.error.ResetNeeded: the row has never been reset.
        """
        (left,) = row_numbers("row", np.atleast_1d(row), self.count)
        many = Simulation(self.scenario, count, threads=threads)
        many.copy_rows(self, np.full(many.count, left), futures=futures)
        return many

    def copy_rows(
        self, source: Simulation, source_rows: ArrayLike, rows: ArrayLike | None = None, *, futures: Futures = "same"
    ) -> None:
        """Make rows of this Simulation copies of rows of another, or of its own: so a tree of states branches.

        What is drawn at random (noise of scans and odometry, where walkers and crowds turn) is a function of seed,
        episode and time. A copy has the original's seed: given the same actions it goes on bit for bit as the original,
        and whoever plans with it knows noise and turns before they come. With other `futures` it gets another seed, which
        is a function of the original's seed, episode and time: what is there stays, what comes is drawn anew.

        Args:
            source: of the same scenario.
            source_rows: numbers of its rows (n,).
            rows: numbers of the rows (n,) here that become these, all by default; each once.
            futures: "same": as the original's; "shared": others, the same for all copies of a row, so that only their
                actions tell them apart (common random numbers); "own": each copy draws for itself.

        Raises:
            ValueError: another scenario, rows that there are not, rows twice, or another number of one than of the other.
            gymnasium.error.ResetNeeded: a source row that has never been reset.
        """
        if futures not in get_args(Futures):
            raise ValueError(f"futures must be one of {list(get_args(Futures))}, got {shortened(futures)}")
        taken = row_numbers("source_rows", source_rows, source.count)
        kept = self.all_rows if rows is None else row_numbers("rows", rows, self.count)
        if len(taken) != len(kept) or len(np.unique(kept)) != len(kept):
            raise ValueError(
                f"got {len(taken)} source_rows for rows {kept.tolist()}, expected one for each, none twice"
            )
        source.require_episodes(taken)
        self.world.copy_rows(source.world, taken, kept)
        if futures != "same":
            self.world.seed[kept] = self._other_seeds(kept, taken, is_shared=futures == "shared")
        self._ahead[kept] = source._ahead[taken] if futures == "same" else 1

    def _other_seeds(self, rows: Rows, sources: Rows, *, is_shared: bool) -> NDArray[np.int64]:
        """Seeds (n,) for rows just copied from rows of a source, functions of what stands in them."""
        seeds = np.empty(len(rows), dtype=np.int64)
        for source in np.unique(sources).tolist():
            (copies,) = np.nonzero(sources == source)
            row = int(rows[copies[0]])
            key = [int(numbers[row]) for numbers in (self.world.seed, self.world.episode, self.world.steps)]
            words = np.random.SeedSequence(key).generate_state(1 if is_shared else len(copies), np.uint64)
            seeds[copies] = words >> np.uint64(2)
        return seeds

    def _start_threads(self) -> ThreadPoolExecutor:
        self._pool = ThreadPoolExecutor(self._threads, thread_name_prefix="bug_gym")
        self._pool_of = os.getpid()
        return self._pool

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
            self._start_threads()


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
    return reward, info["is_success"] or info["collision"], outcome >= kernels.TIMEOUT, info


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
def announce_compilation(types: tuple[Any, ...]) -> None:
    """Say in the log, once in a process, that kernels will be compiled for these types, where none are kept on disk."""
    if not kernels.is_compiled(types):
        warn_once("compiling the simulation's kernels, once on this machine (some ten seconds, more on a busy one)")
