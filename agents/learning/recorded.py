"""Recorded episodes as arrays: what offline learning learns from, whoever has driven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.learning.history import History
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.geometry import F32, F64


@dataclass(frozen=True)
class Recorded:
    """Episodes one after the other, n of them with T steps in all."""

    observations: F32
    """Flat observations (T + n, D): each episode's first, and one after each of its steps."""
    actions: NDArray[Any]
    """Actions (T, 2) in [-1, 1], or numbers (T,) of discrete ones: what is to be learnt."""
    rewards: F64
    """Rewards (T,)."""
    steps: NDArray[np.int64]
    """Steps of each episode (n,), at least 1."""
    terminated: NDArray[np.bool_]
    """Whether each ended by what the robot did (n,); else it was cut off, and would have gone on."""
    origin: dict[str, Any] = field(default_factory=dict)
    """What they were collected of, as JSON has it."""

    @property
    def ends(self) -> NDArray[np.int64]:
        """Number of the step (n,) after each episode's last one."""
        return np.cumsum(self.steps)

    @property
    def seen(self) -> NDArray[np.int64]:
        """Which observation each step (T,) was decided from; the next one is what came of it."""
        return np.arange(len(self.actions)) + np.repeat(np.arange(len(self.steps)), self.steps)

    @property
    def is_final(self) -> NDArray[np.bool_]:
        """Whether an episode terminated with a step (T,), so that nothing is worth anything after it."""
        final = np.zeros(len(self.actions), dtype=bool)
        final[self.ends - 1] = self.terminated
        return final

    def scores(self) -> F64:
        """Undiscounted sum of the rewards of each episode (n,)."""
        return np.add.reduceat(self.rewards, self.ends - self.steps)

    def summed(self, steps: int, gamma: float) -> tuple[F64, NDArray[np.int64], F64]:
        """What came of each step (T,) and those after it, at most `steps` in all and no further than its episode.

        Returns:
            Discounted sum of their rewards (T,), which observation came after them (T,), and the discount of what it is
            worth (T,) over that of one step: 0 where the episode terminated with them.
        """
        number = np.arange(len(self.rewards))
        left = np.repeat(self.ends, self.steps) - number
        taken = np.minimum(steps, left)
        sums = self.rewards.copy()
        for later in range(1, min(steps, int(left.max()))):
            going = np.flatnonzero(later < left)
            sums[going] += gamma**later * self.rewards[going + later]
        worth = np.where(self.is_final[number + taken - 1], 0.0, gamma ** (taken - 1.0))
        return sums, self.seen + taken, worth

    def best(self, share: float) -> Recorded:
        """The share of the episodes with the highest scores, at least one, in their order."""
        count = max(1, round(share * len(self.steps)))
        order = np.argsort(-self.scores(), kind="stable")
        return self.chosen(np.sort(order[:count]))

    def chosen(self, episodes: NDArray[np.int64]) -> Recorded:
        """Some of the episodes (k,), in this order."""
        ends = self.ends
        taken = np.concatenate([np.arange(ends[n] - self.steps[n], ends[n]) for n in episodes])
        watched = np.concatenate([np.arange(ends[n] - self.steps[n] + n, ends[n] + n + 1) for n in episodes])
        return Recorded(
            self.observations[watched],
            self.actions[taken],
            self.rewards[taken],
            self.steps[episodes],
            self.terminated[episodes],
            self.origin,
        )

    def with_history(self, robot: RobotModel, lags: Sequence[int]) -> Recorded:
        """The same, each observation followed by what a History of these lags told there (T + n, W)."""
        if not lags:
            return self
        lengths = self.steps + 1
        first = np.cumsum(lengths) - lengths
        history = History(robot, lags, len(lengths))
        told: F32 = np.zeros((len(self.observations), len(lags) * (robot.beams + 2)), dtype=np.float32)
        for step in range(int(lengths.max())):
            now = first + np.minimum(step, lengths - 1)
            found = history.add(self.observations[now], np.full(len(now), step == 0))
            going = step < lengths
            told[now[going]] = found[going]
        return replace(self, observations=np.concatenate([self.observations, told], axis=1))


def joined(parts: Sequence[Recorded]) -> Recorded:
    """The episodes of several, one after the other's; they are of the origin of the first."""
    return Recorded(
        np.concatenate([part.observations for part in parts]),
        np.concatenate([part.actions for part in parts]),
        np.concatenate([part.rewards for part in parts]),
        np.concatenate([part.steps for part in parts]),
        np.concatenate([part.terminated for part in parts]),
        parts[0].origin,
    )


def parts_of(origin: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What episodes were collected of, policy by policy; those of one are one part."""
    of = origin.get("of")
    return list(of.values()) if isinstance(of, Mapping) else [origin]


def worlds_of(origin: Mapping[str, Any], seeds: range) -> int:
    """In how many of the worlds of these seeds episodes were collected, as far as it is known where they were."""
    found: set[int] = set()
    for part in parts_of(origin):
        first, count = part.get("first_seed"), part.get("episodes")
        if isinstance(first, int) and isinstance(count, int):
            found.update(range(max(first, seeds.start), min(first + count, seeds.stop)))
    return len(found)
