"""THE queue of episodes: worlds side by side in the rows of a Simulation, each of which takes the next seed in turn.

Who decides, what is kept of an episode, and when a policy gives up is the business of the loop that stands on it:
`held_out.play` (many worlds, outcomes only) and the rollouts of an evaluation (all that is measured).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.simulation import Simulation

Rows = NDArray[np.int64]

NOBODY = np.zeros((0, 2), dtype=np.int64)
"""Row and robot of no run."""


class Episodes:
    """Episode 0 of each of many seeds, as many at a time as a simulation has rows.

    A row starts with its seed, so what happens in it does not depend on the other rows. Its episode has ended when the
    runs of all its robots have; it rests once there is no seed left for it.

    Args:
        simulation: whose rows are driven.
        seeds: of the worlds (n,); the first rows take the first ones.
    """

    def __init__(self, simulation: Simulation, seeds: Sequence[int]) -> None:
        count, robots = simulation.count, simulation.robots
        self.simulation = simulation
        self.number: Rows = np.zeros(count, dtype=np.int64)
        """Which of the seeds each row (N,) drives in, or drove in last."""
        self.going = np.zeros((count, robots), dtype=bool)
        """Robots (N, R) whose runs go on."""
        self.observation = np.zeros((count, robots, simulation.world.observation.shape[-1]), dtype=np.float32)
        """What the robots saw last (N, R, D)."""
        self.reward = np.zeros((count, robots))
        """What the last step gave the robots (N, R)."""
        self._seeds = seeds
        self._next = 0

    @property
    def are_over(self) -> bool:
        """Whether all that have begun have ended."""
        return not self.going.any()

    def begin(self, rows: Rows) -> Rows:
        """Start the next seeds in some rows (k,), in their order; returns those that there was a seed for."""
        fresh = rows[: len(self._seeds) - self._next]
        if len(fresh):
            self.number[fresh] = np.arange(self._next, self._next + len(fresh))
            seeds = [self._seeds[number] for number in self.number[fresh]]
            self.observation[fresh] = self.simulation.reset(fresh, seeds)
            self.going[fresh] = True
            self._next += len(fresh)
        return fresh

    def step(self, actions: NDArray[np.floating]) -> NDArray[np.int64]:
        """One step in each row that does not rest; returns row and robot (k, 2) of the runs that ended with it.

        Args:
            actions: of all robots (N, R, 2); those of robots whose runs have ended count as long as their world goes on.
        """
        (rows,) = np.nonzero(self.going.any(axis=1))
        if len(rows) == 0:
            return NOBODY
        simulation = self.simulation
        simulation.advance(actions[rows], rows)
        self.observation[rows], self.reward[rows] = simulation.observations(rows), simulation.status(rows).reward
        ended = (self.going & (simulation.world.outcome != kernels.RUNNING)).nonzero()
        if len(ended[0]) == 0:
            return NOBODY
        self.going[ended] = False
        return np.stack(ended, axis=1)

    def end(self, row: int, robot: int) -> None:
        """End the run of a robot before the world does: it stands then, an obstacle to the others.

        Where the first arrival ends the mission, its own counts no more: a goal that moves may come to where it stands.
        """
        self.going[row, robot] = False
        if self.simulation.scenario.mission == "first" and self.going[row].any():
            world = self.simulation.world
            world.outcome[row, robot], world.velocity[row, robot] = kernels.ENDED, 0.0
