"""One episode in each of many worlds, a few hundred at a time: how policies are measured that decide in batches.

Where the worlds come from is fixed here: no model is trained or chosen on a world that it is judged by.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.config import Scenario
from bug_gym.episodes import Episodes
from bug_gym.intervals import wilson_interval
from bug_gym.kinematics import discrete_actions
from bug_gym.policy import Policy
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES
from bug_gym.view import Sensors

TRAINING_SEEDS = 2**40
"""First seed of the worlds that policies are trained in; far above those of suites and evaluations, which begin at 0."""

VALIDATION_SEEDS = 2**41
"""First seed of the worlds by which the best model of a training is chosen."""

TEST_SEEDS = 0
"""First seed of the worlds by which a model is judged, those of `bug-gym evaluate` too."""

ENDS = ("success", "collision", "timeout")
"""Outcomes with which an episode ends."""

SLOTS = 256
"""Worlds side by side."""


class Played(NamedTuple):
    """How n episodes of R robots each went, in the order of their seeds."""

    outcome: NDArray[np.int64]
    """Outcomes (n, R), as numbers of task.OUTCOMES."""
    time: NDArray[np.float64]
    """Times (n, R) [s]."""
    path_length: NDArray[np.float64]
    """Lengths (n, R) of the paths [m]."""
    first_ends: bool = False
    """Whether the first arrival accomplishes the mission of a world; else all of its robots have to arrive."""

    def ended(self, outcome: str) -> NDArray[np.bool_]:
        """Which runs (n, R) ended with an outcome of task.OUTCOMES."""
        which: NDArray[np.bool_] = self.outcome == OUTCOMES.index(outcome)
        return which

    def summary(self) -> dict[str, Any]:
        """Number of worlds, shares of how their missions ended, the Wilson interval of success, and the time of an arrival [s].

        Robots of a world are not independent of one another, so an interval of their own successes would be too narrow.
        A mission that is not accomplished is a collision where a robot had one, else it ran out of time.
        """
        arrived, hit = self.ended("success"), self.ended("collision").any(axis=1)
        won = arrived.any(axis=1) if self.first_ends else arrived.all(axis=1)
        shares = dict(zip(ENDS, (won, hit & ~won, ~hit & ~won), strict=True))
        interval = wilson_interval(int(won.sum()), won.size)
        return {
            "n": won.size,
            **{end: round(float(share.mean()), 6) for end, share in shares.items()},
            "low": round(interval.low, 6),
            "high": round(interval.high, 6),
            "time": round(float(self.time[arrived].mean()), 3) if arrived.any() else None,
        }


def play(policy: Policy, scenario: Scenario, seeds: Sequence[int], *, slots: int = SLOTS) -> Played:
    """Drive a policy through the first episode of each seed; where there are several robots it drives each of them.

    Args:
        policy: asked with the flat observations (slots * R, D) of all robots at once.
        scenario: the scenario.
        seeds: of the worlds (n,).
        slots: worlds side by side; a row whose episode has ended for all its robots takes the next seed.
    """
    simulation = Simulation(scenario, min(slots, len(seeds)))
    table = discrete_actions(Sensors.of(scenario).drive)
    count, robots, world = simulation.count, simulation.robots, simulation.world
    shape = (len(seeds), robots)
    played = Played(np.zeros(shape, dtype=np.int64), np.zeros(shape), np.zeros(shape), scenario.mission == "first")
    episodes, starts, state = Episodes(simulation, seeds), np.ones((count, robots), dtype=bool), None
    episodes.begin(simulation.all_rows)
    while not episodes.are_over:
        flat = episodes.observation.reshape(count * robots, -1)
        actions, state = policy.predict(flat, state, starts.ravel(), deterministic=True)
        starts[:] = False
        chosen = table[actions] if actions.dtype.kind in "iu" else actions
        ended = episodes.step(chosen.reshape(count, robots, 2))
        for row, robot in ended.tolist():
            episode = episodes.number[row]
            played.outcome[episode, robot] = world.outcome[row, robot]
            played.time[episode, robot] = world.time[row]
            played.path_length[episode, robot] = world.array("path_length")[row, robot]
        over = np.unique(ended[:, 0])
        starts[episodes.begin(over[~episodes.going[over].any(axis=1)])] = True
    return played
