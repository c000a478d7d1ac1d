"""What a policy sees, does and gets in worlds, step by step, as arrays: what datasets are made of.

Worlds are driven in blocks, side by side in the rows of one Simulation. A block always has the same worlds and is always
driven from its beginning, so that what is in it is a function of policy, scenario and seeds, to the last bit: a learned policy
is asked for all rows in one call, and what it answers may depend in its last bits on how many there are.
"""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels, kinematics
from bug_gym.agents.floors.random import Random, RandomMemory
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.walls.contour import BugMemory
from bug_gym.episodes import Episodes
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import noted, prepared
from bug_gym.files import replaced_when_done
from bug_gym.geometry import F32, Point
from bug_gym.policy import Policy, checked_actions
from bug_gym.schema.errors import shortened
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.view import Sensors

SLOTS = 50
"""Worlds side by side. Another number would change the last bits of what learned policies do."""

ENDINGS = (*OUTCOMES, "gave_up")
"""Outcomes of episodes, by their code in a dataset: the core's, and that of a policy that has given its verdict."""
GAVE_UP = ENDINGS.index("gave_up")

MODE = np.dtype("S32")
"""The state of a policy's state machine; longer names are cut."""
NOWHERE = (math.nan, math.nan)
"""A hit or leave point that there is not."""
FAR_APART = 20
"""Bits that lie between the draws of the random policy in two worlds: 2^19 steps of two draws."""


BROKEN = (OSError, ValueError, KeyError, EOFError, MemoryError, NotImplementedError, RuntimeError)
"""What NumPy and zipfile raise for broken files, beside errors of their own."""


@dataclass(frozen=True)
class Demonstrations:
    """Episodes one after the other, n of them with T steps in all."""

    seeds: NDArray[np.int64]
    """Seeds of the worlds (n,)."""
    steps: NDArray[np.int64]
    """Steps of each episode (n,), at least 1."""
    outcomes: NDArray[np.int8]
    """How each ended (n,), by its number in ENDINGS."""
    observations: F32
    """Flat observations (T + n, D): each episode's first, and one after each of its steps."""
    actions: F32
    """Actions (T, 2) in [-1, 1], as the env takes them."""
    rewards: NDArray[np.float64]
    """Rewards (T,)."""
    modes: NDArray[np.bytes_]
    """State of the policy when it decided (T,), or (0,) where nobody asked."""
    points: F32
    """Its last hit point and its last leave point then (T, 2, 2), odometry frame [m], or (0, 2, 2); NaN where there is none."""
    shortest: NDArray[np.float64]
    """Length of the shortest path of each world (n,) [m], or (0,) where nobody asked."""

    def fits(self, worlds: int) -> bool:
        """Whether the arrays are of so many episodes, and of what they should be."""
        if self.steps.shape != (worlds,) or self.steps.dtype.kind != "i" or (self.steps < 1).any():
            return False
        steps = int(self.steps.sum())
        expected = {
            "seeds": ("i", [(worlds,)]),
            "outcomes": ("i", [(worlds,)]),
            "observations": ("f", [(steps + worlds, *self.observations.shape[1:2])]),
            "actions": ("f", [(steps, 2)]),
            "rewards": ("f", [(steps,)]),
            "modes": ("S", [(steps,), (0,)]),
            "points": ("f", [(steps, 2, 2), (0, 2, 2)]),
            "shortest": ("f", [(worlds,), (0,)]),
        }
        for name, (kind, shapes) in expected.items():
            array = getattr(self, name)
            if array.dtype.kind != kind or array.shape not in shapes:
                return False
        return self.observations.ndim == 2 and bool(np.isin(self.outcomes, range(len(ENDINGS))).all())

    def returns(self) -> NDArray[np.float64]:
        """Undiscounted sum of the rewards of each episode (n,)."""
        return np.array([math.fsum(some) for some in np.split(self.rewards, np.cumsum(self.steps)[:-1])])

    def episodes(self) -> Iterator[Demonstrations]:
        """The episodes one by one."""
        ends = np.cumsum(self.steps)
        for number, (steps, end) in enumerate(zip(self.steps.tolist(), ends.tolist(), strict=True)):
            one, taken = slice(number, number + 1), slice(end - steps, end)
            seen = slice(end - steps + number, end + number + 1)
            yield Demonstrations(
                self.seeds[one],
                self.steps[one],
                self.outcomes[one],
                self.observations[seen],
                self.actions[taken],
                self.rewards[taken],
                self.modes[taken],
                self.points[taken],
                self.shortest[one],
            )

    def write(self, path: Path) -> None:
        """Keep them in a file `.npz`, which is there whole or not at all."""
        with replaced_when_done(path) as partial_file:
            np.savez(partial_file, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def read(cls, path: Path, seeds: Sequence[int]) -> Demonstrations:
        """What `write` has kept.

        Args:
            path: of the file.
            seeds: of the worlds that it is to be about.

        Raises:
            ValueError: the file is damaged, or about other worlds.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                found = cls(**{field.name: file[field.name] for field in fields(cls)})
        except (*BROKEN, zipfile.BadZipFile, zlib.error) as error:
            told = shortened(str(error), 200)
            raise ValueError(f"{path} is damaged ({told}); without it, its episodes are driven again") from None
        if not found.fits(len(seeds)):
            raise ValueError(f"{path} is damaged: its arrays do not fit each other")
        if found.seeds.tolist() != list(seeds):
            raise ValueError(f"{path} is of other worlds, expected seeds {seeds[0]} to {seeds[-1]}")
        return found


class Extras(NamedTuple):
    """What else is recorded."""

    modes: bool = False
    """The policy's state at each decision, and its last hit and leave points."""
    shortest_path: bool = False
    """The length of the shortest path of each world, which takes time."""


class RandomByWorld(Random):
    """The random policy with draws by the world's seed in place of the first observation, as datasets have had them."""

    def __init__(self, simulation: Simulation, **parameters: Any) -> None:
        super().__init__(Sensors.of(simulation.scenario), **parameters)
        self._simulation = simulation

    def begin(self, robot: int) -> RandomMemory:
        """Memory of the episode that a robot has begun."""
        seed = int(self._simulation.world.seed[robot // self._simulation.robots])
        return RandomMemory(mode="random", draw=(seed % 2 ** (62 - FAR_APART)) << FAR_APART)


def demonstrate(
    entry: PolicyEntry,
    scenario: ScenarioEntry,
    seeds: Sequence[int],
    extras: Extras | None = None,
    *,
    slots: int | None = None,
) -> Demonstrations:
    """Drive a policy in a block of worlds with one robot each, an episode a world.

    A policy that gives up stands for one step, which is the last one of its episode.

    Args:
        entry: the policy.
        scenario: the scenario.
        seeds: one a world.
        extras: what else is recorded.
        slots: worlds side by side; None: SLOTS.
    """
    recording = _Recording(entry, scenario, seeds, extras or Extras(), SLOTS if slots is None else slots)
    while not recording.is_over:
        recording.advance()
    return recording.demonstrations()


def _made(entry: PolicyEntry, simulation: Simulation) -> Policy:
    policy = entry.make(simulation)
    return RandomByWorld(simulation, **entry.parameters) if type(policy) is Random else policy


def _last_points(memory: Any) -> tuple[Point, Point]:
    """Where a policy last hit and last left a boundary, by its memory, or by that of the bug that works for it."""
    bug = memory.follow if isinstance(memory, HDBugMemory) and memory.follow else memory
    if not isinstance(bug, BugMemory):  # fields of others may have these names
        return NOWHERE, NOWHERE
    return (bug.hits or [NOWHERE])[-1], (bug.leaves or [NOWHERE])[-1]


class _Taken(NamedTuple):
    """One step of the rows (k,) that were driving."""

    numbers: NDArray[np.int64]
    """Which episode each drives."""
    observations: F32
    """What they saw before it (k, D)."""
    actions: F32
    """(k, 2)."""
    rewards: NDArray[np.float64]
    """(k,)."""
    modes: NDArray[np.bytes_]
    """(k,), or (0,)."""
    points: F32
    """(k, 2, 2), or (0, 2, 2)."""


class _Recording:
    """A block as it is driven; see `demonstrate`."""

    def __init__(
        self, entry: PolicyEntry, scenario: ScenarioEntry, seeds: Sequence[int], extras: Extras, slots: int
    ) -> None:
        make = partial(_made, entry)
        self._simulation, _, self._driver = prepared(make, scenario, min(slots, len(seeds)), at_once=True)
        drive = Sensors.of(scenario.scenario).drive
        self._discrete_actions = kinematics.discrete_actions(drive)
        self._standing = kinematics.steering(drive, (0.0, 0.0))
        self._entry, self._scenario, self._seeds, self._extras = entry, scenario, seeds, extras
        self._episodes = Episodes(self._simulation, seeds)
        self._actions = np.tile(self._standing, (self._simulation.count, 1))
        self._taken: list[_Taken] = []
        self._outcomes = np.zeros(len(seeds), dtype=np.int8)
        self._last = np.zeros((len(seeds), self._episodes.observation.shape[-1]), dtype=np.float32)
        self._shortest = np.full(len(seeds) if extras.shortest_path else 0, np.nan)
        self._begin(self._simulation.all_rows)

    @property
    def is_over(self) -> bool:
        """Whether all worlds have been driven in."""
        return self._episodes.are_over

    def advance(self) -> None:
        """One decision and one step in each world."""
        rows = np.flatnonzero(self._episodes.going[:, 0])
        before = self._episodes.observation[:, 0]
        numbers, seen = self._episodes.number[rows], before[rows]
        with self._told(rows):
            decided, _ = self._driver.decide(before, rows)
            given_up = self._decide(rows, decided)
        modes, points = self._states(rows if self._extras.modes else rows[:0])
        self._episodes.step(self._actions[:, None])
        actions, rewards = self._actions[rows], self._episodes.reward[rows, 0]
        self._taken.append(_Taken(numbers, seen, actions, rewards, modes, points))
        self._end(rows, given_up)

    def _decide(self, rows: NDArray[np.int64], decided: NDArray[Any]) -> list[int]:
        """Take over the actions; returns the rows whose policy gives up and stands."""
        chosen = checked_actions(decided, len(rows), self._discrete_actions)
        self._actions[rows] = np.clip(np.asarray(chosen, dtype=np.float32), -1.0, 1.0)
        if not self._driver.has_memories:
            return []
        given_up = [row for row in rows.tolist() if getattr(self._driver.memory(row), "verdict", "")]
        self._actions[given_up] = self._standing
        return given_up

    def _states(self, rows: NDArray[np.int64]) -> tuple[NDArray[np.bytes_], F32]:
        """The modes (k,) of the policy in some rows, and its last hit and leave points (k, 2, 2)."""
        memories = [self._driver.memory(row) for row in rows.tolist()]
        names = [str(getattr(memory, "mode", "")).encode("ascii", "replace") for memory in memories]
        points = np.array([_last_points(memory) for memory in memories], dtype=np.float32)
        return np.array(names, dtype=MODE), points.reshape(-1, 2, 2)

    def _end(self, rows: NDArray[np.int64], given_up: Sequence[int]) -> None:
        """Keep how the episodes ended that did with this step, and begin the next ones."""
        for row in given_up:
            self._episodes.end(row, 0)
        over = rows[~self._episodes.going[rows, 0]]
        if len(over) == 0:
            return
        outcomes = self._simulation.world.outcome[over, 0]
        numbers = self._episodes.number[over]
        self._outcomes[numbers] = np.where(outcomes == kernels.RUNNING, GAVE_UP, outcomes)
        self._last[numbers] = self._episodes.observation[over, 0]
        self._begin(over)

    def _told(self, rows: NDArray[np.int64]) -> AbstractContextManager[None]:
        """Have an exception of the policy say who was asked, and in which worlds."""
        return noted(self._entry, self._scenario, self._simulation, rows)

    def _begin(self, rows: NDArray[np.int64]) -> None:
        for row in self._episodes.begin(rows).tolist():
            with self._told(np.array([row])):
                self._driver.begin(row)
            if self._extras.shortest_path:
                self._shortest[self._episodes.number[row]] = self._simulation.shortest_path(row).length

    def demonstrations(self) -> Demonstrations:
        """All that was recorded, episode by episode."""
        parts = (np.concatenate(parts) for parts in zip(*self._taken, strict=True))
        numbers, seen, actions, rewards, modes, points = parts
        order = np.argsort(numbers, kind="stable")  # within an episode by time
        steps = np.bincount(numbers, minlength=len(self._seeds))
        place = np.empty_like(numbers)
        place[order] = np.arange(len(numbers)) + numbers[order]  # behind the last observation of each earlier episode
        observations = np.empty((len(seen) + len(steps), seen.shape[1]), dtype=np.float32)
        observations[place] = seen
        observations[np.cumsum(steps) + np.arange(len(steps))] = self._last
        return Demonstrations(
            np.array(self._seeds, dtype=np.int64),
            steps.astype(np.int64),
            self._outcomes,
            observations,
            actions[order],
            rewards[order],
            modes[order] if self._extras.modes else modes,
            points[order] if self._extras.modes else points,
            self._shortest,
        )
