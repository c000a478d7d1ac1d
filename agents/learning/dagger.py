"""DAgger (Ross, Gordon and Bagnell 2011): the learner drives, the expert says at each state what it would have done.

Their parameter-free choice of who drives (section 3): the expert in the first round, the learner alone in all that follow;
a round's answers join those of all earlier ones. What is learnt is cloned by agents/learning/cloning.py, which may have a
second learner for driving.

A scripted expert has a memory: a map, tracks of what moves, the state of its machine, what it meant to do last. It is asked at
every step from the first one of an episode on, so that its memory runs along the learner's way: it holds what the expert
would know and intend had somebody else held its wheel all along. What it knows of its motion is its odometry, so nothing
there supposes that its advice was taken; what it intends may lag behind, a wall to follow that the learner has left. Such
answers are learnt too, for the learner will stand there again. Where it gives up it says to stand once, and the episode ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.learning.recorded import Recorded
from bug_gym.checks import shortened
from bug_gym.config import Scenario
from bug_gym.episodes import Episodes
from bug_gym.geometry import F32
from bug_gym.kinematics import discrete_actions
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import Memory, Policy, ScriptedPolicy
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors


def make_expert(name: str, scenario: Scenario, *, discrete: bool = False) -> ScriptedPolicy:
    """The scripted policy that is asked.

    Args:
        name: of it.
        scenario: with one robot.
        discrete: whether it answers with numbers of discrete actions.

    Raises:
        ValueError: several robots, no such policy, a learned one, or one that reads the map.
    """
    if scenario.robots.count != 1:
        raise ValueError(f"an expert is asked about one robot, {scenario.name} has {scenario.robots.count}")
    expert = make_policy(name, NavigationEnv(scenario, action="discrete") if discrete else scenario)
    if not isinstance(expert, ScriptedPolicy) or expert.privileged:
        raise ValueError(f"expert: expected a scripted policy that does not read the map, got {shortened(name)}")
    return expert


def ask(
    expert: ScriptedPolicy, learner: Policy | None, scenario: Scenario, seeds: Sequence[int], rows: int
) -> Recorded:
    """What an expert says at each state of somebody's episodes, one a seed.

    Args:
        expert: is asked.
        learner: drives; None: the expert does.
        scenario: with one robot.
        seeds: of the worlds (n,).
        rows: worlds side by side.
    """
    questions = _Questions(expert, learner, scenario, seeds, rows)
    while not questions.are_over:
        questions.advance()
    return questions.recorded()


class _Questions:
    """Worlds in which an expert is asked; see `ask`."""

    def __init__(
        self, expert: ScriptedPolicy, learner: Policy | None, scenario: Scenario, seeds: Sequence[int], rows: int
    ) -> None:
        self._expert, self._learner = expert, learner
        simulation = Simulation(scenario, min(rows, len(seeds)))
        self._outcome = simulation.world.outcome
        self._episodes = Episodes(simulation, seeds)
        self._memories: list[Memory] = [expert.start() for _ in range(simulation.count)]
        self._state: Any = None
        self._starts = np.ones(simulation.count, dtype=bool)
        self._actions: F32 = np.zeros((simulation.count, 2), dtype=np.float32)
        self._table = discrete_actions(Sensors.of(scenario).drive)
        self._taken: list[tuple[NDArray[Any], ...]] = []
        self._episodes.begin(simulation.all_rows)
        self._last = np.zeros((len(seeds), self._episodes.observation.shape[-1]), dtype=np.float32)
        self._terminated = np.zeros(len(seeds), dtype=bool)

    @property
    def are_over(self) -> bool:
        """Whether all worlds have been driven in."""
        return self._episodes.are_over

    def advance(self) -> None:
        """One answer and one step in each world."""
        rows = np.flatnonzero(self._episodes.going[:, 0])
        seen = self._episodes.observation[:, 0]
        numbers, before = self._episodes.number[rows], seen[rows]
        answers = self._answers(before, rows)
        self._actions[rows] = self._as_driven(answers)
        if self._learner is not None:  # asked for all rows: its state is that of all
            chosen, self._state = self._learner.predict(seen, self._state, self._starts.copy(), deterministic=True)
            self._actions[rows] = self._as_driven(chosen[rows])
        self._starts[:] = False
        self._episodes.step(self._actions[:, None])
        self._taken.append((numbers, before, answers, self._episodes.reward[rows, 0]))
        self._end(rows)

    def _as_driven(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Actions (k, 2) of themselves, or of the numbers (k,) of discrete ones."""
        return self._table[actions] if actions.dtype.kind in "iu" else actions

    def _answers(self, seen: F32, rows: NDArray[np.int64]) -> NDArray[Any]:
        """What the expert would do, (k, 2) or numbers (k,) of discrete actions, its memories taken on."""
        memories = tuple(self._memories[row] for row in rows)
        answers, memories = self._expert.predict(seen, memories, self._starts[rows])
        for row, memory in zip(rows.tolist(), memories, strict=True):
            self._memories[row] = memory
        return answers if self._expert.discrete else np.clip(np.asarray(answers, dtype=np.float32), -1.0, 1.0)

    def _end(self, rows: NDArray[np.int64]) -> None:
        """Keep how the episodes ended that did with this step, and begin the next ones."""
        for row in rows.tolist():
            if self._memories[row].verdict:
                self._episodes.end(row, 0)
        over = rows[~self._episodes.going[rows, 0]]
        if len(over) == 0:
            return
        numbers = self._episodes.number[over]
        self._last[numbers] = self._episodes.observation[over, 0]
        self._terminated[numbers] = np.isin(self._outcome[over, 0], (kernels.SUCCESS, kernels.COLLISION))
        self._starts[self._episodes.begin(over)] = True

    def recorded(self) -> Recorded:
        """All answers, episode by episode."""
        numbers, seen, answers, rewards = (np.concatenate(parts) for parts in zip(*self._taken, strict=True))
        order = np.argsort(numbers, kind="stable")  # within an episode by time
        steps = np.bincount(numbers, minlength=len(self._last)).astype(np.int64)
        observations = np.insert(seen[order], np.cumsum(steps), self._last, axis=0)
        return Recorded(observations, answers[order], rewards[order], steps, self._terminated)
