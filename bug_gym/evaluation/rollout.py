"""Episodes of one policy, side by side in the rows of one Simulation, measured: one EpisodeRow a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from itertools import groupby
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from bug_gym import kinematics
from bug_gym.episodes import Episodes
from bug_gym.evaluation.entries import PolicyEntry, PolicyNote, ScenarioEntry
from bug_gym.evaluation.lengths import Lengths
from bug_gym.evaluation.rows import EpisodeRow, earliest_intercept, spl, turns_and_turning
from bug_gym.geometry import F32
from bug_gym.observation import Field as ObservationField
from bug_gym.observation import as_dict
from bug_gym.policy import Drawing, Policy, ScriptedPolicy, checked_actions, checked_drawing
from bug_gym.references import kept_in_process
from bug_gym.schema.errors import shortened
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.team_policy import TeamMemory, TeamPolicy
from bug_gym.view import Sensors

SLOTS = 16
"""Worlds that one simulation drives side by side."""

STANDING = 0.01
"""A robot that is nowhere farther than this from where it ended has stood there [m]."""


def is_privileged(policy: Policy) -> bool:
    """Whether a policy reads the world's map."""
    return bool(getattr(policy, "privileged", False))


@runtime_checkable
class Planner(Policy, Protocol):
    """A policy that is told whose map it reads."""

    def begin(self, robot: int) -> Any:
        """Memory of the episode that a robot has begun, the robots of the simulation numbered row by row."""
        ...


class _OneByOne:
    """Asks a policy robot by robot, so that each decision has a time of its own."""

    def __init__(self, policy: Policy, robots: int) -> None:
        self._policy = policy
        self._memories: list[tuple[Any, ...] | None] = [None] * robots

    def begin(self, robot: int) -> None:
        self._memories[robot] = (self._policy.begin(robot),) if isinstance(self._policy, Planner) else None

    @property
    def has_memories(self) -> bool:
        """Whether `memory` tells of any robot."""
        return True

    def memory(self, robot: int) -> Any:
        memories = self._memories[robot]
        return memories[0] if memories else None

    def decide(self, observation: F32, robots: NDArray[np.int64]) -> tuple[NDArray[Any], list[float]]:
        """Actions (k, ...) of some robots and the time that each decision took [s]."""
        actions, seconds = [], []
        for robot in robots.tolist():
            row, state = observation[robot], self._memories[robot]
            begin = perf_counter()
            action, state = self._policy.predict(row, state, deterministic=True)
            seconds.append(perf_counter() - begin)
            actions.append(action)
            self._memories[robot] = state
        return (np.stack(actions) if len(actions) > 1 else np.asarray(actions[0])[None]), seconds


class _WorldByWorld(_OneByOne):
    """Asks a policy written by hand for those robots of a world that decide, as a parallel env does."""

    def __init__(self, policy: ScriptedPolicy, worlds: int, robots: int) -> None:
        super().__init__(policy, worlds * robots)
        self._scripted = policy
        self._robots = robots

    def decide(self, observation: F32, robots: NDArray[np.int64]) -> tuple[NDArray[Any], list[float]]:
        """Actions (k, ...) of some robots and each one's share of the time that its world took [s]."""
        actions, seconds = [], []
        for _, group in groupby(robots.tolist(), lambda robot: robot // self._robots):
            numbers = list(group)
            rows = observation[numbers]
            begin = perf_counter()
            memories: list[Any] = []
            for row, robot in enumerate(numbers):
                known = self._memories[robot] or (self._scripted.first_memory(rows[row : row + 1], 0),)
                self._memories[robot] = known
                memories += known
            actions += self._scripted.decide(rows, memories)
            seconds += [(perf_counter() - begin) / len(numbers)] * len(numbers)
        return np.array(actions), seconds


class _AllAtOnce:
    """Asks a policy for all robots in one call, as SB3's evaluate_policy does: its state may be of any form."""

    def __init__(self, policy: Policy, robots: int, fields: tuple[ObservationField, ...]) -> None:
        self._policy = policy
        self._state: tuple[Any, ...] | None = None
        self._starts = np.ones(robots, dtype=bool)
        self._fields = fields if isinstance(getattr(policy, "observation_space", None), gym.spaces.Dict) else None

    def begin(self, robot: int) -> None:
        self._starts[robot] = True

    @property
    def has_memories(self) -> bool:
        """Whether `memory` tells of any robot: a recurrent policy's state is a tuple too, of arrays for all together."""
        return isinstance(self._state, tuple) and len(self._state) == len(self._starts)

    def memory(self, robot: int) -> Any:
        return self._state[robot] if self.has_memories and self._state else None

    def decide(self, observation: F32, robots: NDArray[np.int64]) -> tuple[NDArray[Any], list[float]]:
        """Actions (k, ...) of some robots and each one's share of the time that the call took [s]."""
        batch = as_dict(observation, self._fields) if self._fields else observation
        begin = perf_counter()
        answer = self._policy.predict(batch, self._state, self._starts.copy(), deterministic=True)
        share = (perf_counter() - begin) / len(observation)
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise ValueError(f"the policy's predict answered {shortened(answer)}, expected actions and a state")
        actions, self._state = np.asarray(answer[0]), answer[1]
        if actions.shape[:1] != (len(observation),):
            rows = len(observation)
            raise ValueError(
                f"the policy answered with shape {actions.shape} for a batch of {rows}, expected ({rows}, ...)"
            )
        self._starts[:] = False
        return actions[robots], [share] * len(robots)


class _Together:
    """Asks a team world by world; a robot whose run has ended does not answer any more."""

    def __init__(self, policy: TeamPolicy, worlds: int) -> None:
        self._policy = policy
        self._memories = policy.started(worlds)

    def begin(self, robot: int) -> None:
        robots = self._policy.robots
        if robot % robots == 0:  # the robots of a world begin together
            self._memories[robot : robot + robots] = self._policy.started(1)

    @property
    def has_memories(self) -> bool:
        """Whether `memory` tells of any robot."""
        return True

    def memory(self, robot: int) -> Any:
        return self._memories[robot]

    def decide(self, observation: F32, robots: NDArray[np.int64]) -> tuple[NDArray[Any], list[float]]:
        """Actions (k, ...) of some robots and each one's share of the time that its team took [s]."""
        count = self._policy.robots
        actions: dict[int, NDArray[Any]] = {}
        seconds: dict[int, float] = {}
        for first in np.unique(robots // count * count).tolist():
            deciding = [robot for robot in range(first, first + count) if robot in set(robots.tolist())]
            seen = [observation[robot] if robot in deciding else None for robot in range(first, first + count)]
            begin = perf_counter()
            decided = self._policy.decide(seen, self._memories[first : first + count])
            share = (perf_counter() - begin) / len(deciding)
            actions |= {robot: decided[robot - first] for robot in deciding}
            seconds |= dict.fromkeys(deciding, share)
        return np.stack([actions[robot] for robot in robots.tolist()]), [seconds[robot] for robot in robots.tolist()]


Driver = _OneByOne | _AllAtOnce | _Together


def prepared(
    make: Callable[[Simulation], Policy], scenario: ScenarioEntry, slots: int, *, at_once: bool = False
) -> tuple[Simulation, Policy, Driver]:
    """Worlds, a policy for their robots, and who asks it.

    Args:
        make: gives the policy for the robots of a simulation.
        scenario: the scenario.
        slots: how many worlds. A policy that reads the map, and has no `begin`, gets one: it has to know whose map it
            reads.
        at_once: whether to ask one that is not scripted for all robots in one call, where no decision's time is asked for.

    Raises:
        ValueError: code that the scenario names is not what was planned, see `ScenarioEntry.held`.
    """
    scenario.require_held()
    simulation = Simulation(scenario.scenario, slots)
    policy = make(simulation)
    is_told = not is_privileged(policy) or isinstance(policy, Planner)
    if not is_told and simulation.count > 1:
        simulation = Simulation(scenario.scenario)
        policy = make(simulation)
    robots = simulation.count * simulation.robots
    if isinstance(policy, TeamPolicy):
        return simulation, policy, _Together(policy, simulation.count)
    one_by_one = getattr(policy, "one_by_one", False) and (isinstance(policy, ScriptedPolicy) or not at_once)
    if one_by_one and is_told and isinstance(policy, ScriptedPolicy) and simulation.robots > 1:
        return simulation, policy, _WorldByWorld(policy, simulation.count, simulation.robots)
    if one_by_one and is_told:
        return simulation, policy, _OneByOne(policy, robots)
    return simulation, policy, _AllAtOnce(policy, robots, simulation.fields)


@contextmanager
def noted(
    entry: PolicyEntry, scenario: ScenarioEntry, simulation: Simulation, rows: NDArray[np.int64]
) -> Iterator[None]:
    """Have an exception of a policy that is asked say who it is, and in which worlds, by a note.

    Raises:
        RuntimeError: the policy's code ends the process, as `exit()` does: nothing would say then what is missing.
    """
    try:
        with kept_in_process():
            yield
    except Exception as error:  # of a caller's code: any
        seeds = sorted(set(simulation.world.seed[rows].tolist()))
        many = f"seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}"
        error.add_note(PolicyNote(f"policy {entry.label}, scenario {scenario.label}, {many}"))
        raise


@dataclass
class _Trace:
    """What is kept of one robot's episode while it runs."""

    points: list[list[float]]
    """Places x, y [m], one a step and the start."""
    goals: list[list[float]]
    """Places of a moving goal x, y [m], likewise."""
    seconds: list[float]
    """Time of each decision [s]."""
    gap: float = math.inf
    """Smallest distance to another robot [m]."""


class Rollout:
    """Episodes of one policy, side by side in the rows of one Simulation; a row that has ended takes the next seed.

    Robots are numbered row by row: robot r of row n is n R + r. A row starts with its seed, so what happens in it does
    not depend on the other rows.

    Args:
        entry: the policy.
        scenario: the scenario.
        seeds: one a world.
        lengths: shortest paths that are known.
        slots: how many worlds at a time. A policy that reads the map, and has no `begin`, gets one: it has to know whose
            map it reads.
    """

    def __init__(
        self,
        entry: PolicyEntry,
        scenario: ScenarioEntry,
        seeds: Sequence[int],
        *,
        lengths: Lengths | None = None,
        slots: int = SLOTS,
    ) -> None:
        self.entry, self.scenario = entry, scenario
        self._lengths = lengths or {}
        self.simulation, self.policy, self._driver = prepared(entry.make, scenario, min(slots, len(seeds)))
        count, robots = self.simulation.count, self.simulation.robots
        drive = Sensors.of(scenario.scenario).drive
        self._discrete_actions = kinematics.discrete_actions(drive)
        self._standing = kinematics.steering(drive, (0.0, 0.0))
        self._has_moving_target = scenario.has_moving_target
        self._episodes = Episodes(self.simulation, seeds)
        self._actions = np.tile(self._standing, (count * robots, 1))
        self._traces: dict[int, _Trace] = {}
        self._ended: dict[int, list[EpisodeRow]] = {}
        self._begin(self.simulation.all_rows)

    @property
    def is_over(self) -> bool:
        """Whether all seeds have been driven."""
        return self._episodes.are_over

    def memory(self, robot: int = 0) -> Any:
        """The policy's memory of a robot, None where its state has another form."""
        return self._driver.memory(robot)

    def driven_time(self, robot: int = 0) -> float:
        """How long a robot has driven, others of its world may go on [s]."""
        return len(self._traces[robot].seconds) * self.scenario.scenario.time.step

    def drawings(self) -> list[Drawing | None]:
        """What the policy shows of its mind for each robot of the first row.

        Raises:
            ValueError: it shows what is no Drawing.
        """
        draw = getattr(self.policy, "draw", None)
        memories = [self.memory(robot) for robot in range(self.simulation.robots)]
        with self._told(np.arange(self.simulation.robots)):
            shown = [None if draw is None or memory is None else draw(memory) for memory in memories]
            return [None if one is None else checked_drawing(self.policy, one) for one in shown]

    def verdict(self) -> str:
        """What the policy has decided in the first row, "" where nothing."""
        verdicts = [getattr(self.memory(robot), "verdict", "") for robot in range(self.simulation.robots)]
        return ", ".join(dict.fromkeys(filter(None, verdicts)))

    def states(self) -> list[str]:
        """What a picture writes beside the first row's robots where they share their world: the states of their policies."""
        robots = self.simulation.robots
        modes = [str(getattr(self.memory(robot), "mode", "")) for robot in range(robots)]
        return [mode.replace("_", " ") for mode in modes] if robots > 1 else []

    def state(self) -> str:
        """What a replay says of the first row: the verdict, or the states of its robots."""
        modes = [str(getattr(self.memory(robot), "mode", "")) for robot in range(self.simulation.robots)]
        return self.verdict() or (" / ".join(modes) if any(modes) else "").replace("_", " ")

    def worlds(self) -> Iterator[list[EpisodeRow]]:
        """Drives to the end; yields the rows of each world, one a robot, as it ends."""
        while not self.is_over:
            yield from self.advance()

    def advance(self) -> list[list[EpisodeRow]]:
        """One decision and one step in each world; the rows of the worlds that ended with it."""
        (deciding,) = self._episodes.going.ravel().nonzero()
        observation = self._episodes.observation.reshape(len(self._actions), -1)
        with self._told(deciding):
            actions, seconds = self._driver.decide(observation, deciding)
            self._actions[deciding] = checked_actions(actions, len(deciding), self._discrete_actions)
        for robot, duration in zip(deciding.tolist(), seconds, strict=True):
            self._traces[robot].seconds.append(duration)
            verdict = getattr(self._driver.memory(robot), "verdict", "")
            if verdict:
                self._actions[robot] = self._standing
                self._episodes.end(*divmod(robot, self.simulation.robots))
                self._end(robot, "gave_up", verdict)
        self._step()
        robots = self.simulation.robots
        over = [row for row, ended in self._ended.items() if len(ended) == robots]
        worlds = [sorted(self._ended.pop(row), key=lambda ended: ended.robot) for row in over]
        if over:
            self._begin(np.array(over))
        return worlds

    def _told(self, robots: NDArray[np.int64]) -> AbstractContextManager[None]:
        """Have an exception of the policy say who was asked, and in which worlds."""
        return noted(self.entry, self.scenario, self.simulation, robots // self.simulation.robots)

    def _begin(self, rows: NDArray[np.int64]) -> None:
        """Start the next seeds in some rows; those without one stay as they are."""
        robots = self.simulation.robots
        for row in self._episodes.begin(rows).tolist():
            first, end = row * robots, (row + 1) * robots
            self._actions[first:end] = self._standing
            self._ended[row] = []
            for robot in range(first, end):
                with self._told(np.array([robot])):
                    self._driver.begin(robot)
                self._traces[robot] = _Trace([], [], [])
            self._record(range(first, end))

    def _record(self, robots: Iterable[int]) -> None:
        places = self.simulation.world.pose[:, :, :2].reshape(-1, 2).tolist()
        goals = self.simulation.world.goal.reshape(-1, 2).tolist() if self._has_moving_target else None
        for robot in robots:
            trace = self._traces[robot]
            trace.points.append(places[robot])
            if goals is not None:
                trace.goals.append(goals[robot])
        if self.simulation.robots > 1:
            gaps = self._gaps()
            for robot in robots:
                self._traces[robot].gap = min(self._traces[robot].gap, gaps[robot])

    def _gaps(self) -> list[float]:
        """Distance of each robot to the nearest other one of its world, centre to centre [m]."""
        places = self.simulation.world.pose[:, :, :2]
        gaps = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        gaps[:, np.arange(self.simulation.robots), np.arange(self.simulation.robots)] = np.inf
        return list(gaps.min(axis=2).ravel().tolist())

    def _step(self) -> None:
        count, robots = self.simulation.count, self.simulation.robots
        going = self._episodes.going.ravel().nonzero()[0].tolist()
        ended = self._episodes.step(self._actions.reshape(count, robots, 2))
        self._record(going)
        for row, number in ended.tolist():
            self._end(row * robots + number, OUTCOMES[self.simulation.world.outcome[row, number]], "")

    def _end(self, robot: int, outcome: str, verdict: str) -> None:
        """Keep the row of a robot whose episode has ended; its world may go on for others."""
        row, number = divmod(robot, self.simulation.robots)
        trace, world = self._traces[robot], self.simulation.world
        info = {name: values[0, number] for name, values in self.simulation.info(np.array([row])).items()}
        seed, time, taken = int(world.seed[row]), float(info["time"]), float(info["path_length"])
        lengths = self._lengths.get((self.scenario.label, seed))
        shortest = lengths[number] if lengths else math.nan
        turns, turning = turns_and_turning(trace.points)
        success = outcome == "success"
        memory = self.memory(robot)
        team = memory if isinstance(memory, TeamMemory) else TeamMemory()  # fields of others may have these names
        self._ended[row].append(
            EpisodeRow(
                policy=self.entry.label,
                scenario=self.scenario.label,
                seed=seed,
                robot=number,
                outcome=outcome,
                verdict=verdict,
                success=success,
                time=time,
                steps=int(world.steps[row]),
                path_length=taken,
                goal_distance=float(info["goal_distance"]),
                shortest_path_length=shortest,
                # The shortest path leads to the goal itself, so the rest of the way counts too.
                spl=spl(success=success, shortest=shortest, taken=taken + float(info["goal_distance"])),
                time_ratio=self._time_ratio(row, trace, time),
                min_clearance=float(info["min_clearance"]),
                turns=turns,
                total_turning=turning,
                decision_time_mean=float(np.mean(trace.seconds)),
                decision_time_p99=float(np.percentile(trace.seconds, 99.0)),
                decision_time_total=math.fsum(trace.seconds),
                robots_gap=trace.gap,
                holds=int(team.holds),
                held_time=float(team.held),
                standing_time=self._standing_time(trace) if self.simulation.robots > 1 else 0.0,
                mission=self.scenario.scenario.mission,
            )
        )

    def _standing_time(self, trace: _Trace) -> float:
        """How long a robot has not moved when its episode ends [s]."""
        return _standing_steps(trace.points) * self.scenario.scenario.time.step

    def _time_ratio(self, row: int, trace: _Trace, time: float) -> float:
        """Earliest time of meeting the moving goal on a straight run of the row's robot, over the time taken."""
        if not trace.goals or time == 0.0:
            return math.nan
        times = self.scenario.scenario.time.step * np.arange(len(trace.goals))
        speed, radius = (self.simulation.world.own(row, name) for name in ("max_speed", "goal_radius"))
        return earliest_intercept(trace.points[0], trace.goals, times, speed, capture_radius=radius) / time


def _standing_steps(places: Sequence[Sequence[float]]) -> int:
    """How many of the last steps began and ended where the robot ended, of its places x, y [m], one a step and the start."""
    points = np.array(places)
    elsewhere = np.flatnonzero(np.hypot(*(points - points[-1]).T) > STANDING)
    return len(points) - 1 - (int(elsewhere[-1]) + 1 if len(elsewhere) else 0)
