"""One episode of a team as data: its robots in one world, or each alone in a world of its own, without bodies."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents import TEAMS, make_policy
from bug_gym.policy import source_scenario
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors


@dataclass(frozen=True)
class TeamRun:
    """What came of one episode of a team of R robots."""

    outcomes: tuple[str, ...]
    verdicts: tuple[str, ...]
    lengths: NDArray[np.float64]
    """Ways (R,) [m], a winner's with the rest of it to the goal."""
    paths: NDArray[np.float64]
    """True poses (T, R, 3)."""
    modes: tuple[tuple[str, ...], ...]
    """Of all robots after each decision."""
    memories: tuple[Any, ...]
    winner: int | None
    """Who was named to arrive first."""
    named_at: int
    """Number of the decision at which it was."""
    least_gap: float
    """Smallest distance between two robots' centres [m]."""
    simulation: Simulation

    @property
    def won_after(self) -> float:
        """Way of the winner when it was named [m]."""
        assert self.winner is not None
        steps = np.diff(self.paths[: self.named_at + 1, self.winner, :2], axis=0)
        return float(np.hypot(*steps.T).sum())


def run_team(
    policy: Any,
    scenario: Any,
    overrides: Mapping[str, Any] | None = None,
    *,
    robots: int = 2,
    ghosts: bool = False,
    seed: int = 0,
    max_steps: int = 100_000,
    **parameters: Any,
) -> TeamRun:
    """Run a team until one arrives or it has given up.

    With `ghosts` the robots have one start and no bodies to one another: each is alone in a world of its own.
    """
    simulation, team, flat = _begin(policy, scenario, dict(overrides or {}), robots, ghosts, seed, parameters)
    state: Any = None
    shape = (robots, 1, 2) if ghosts else (1, robots, 2)
    poses = simulation.world.pose.reshape(-1, 3)
    paths, modes, winner, named_at, least = [poses.copy()], [], None, 0, np.inf
    for step in range(max_steps):
        actions, state = team.predict(flat, state)
        modes.append(tuple(memory.mode for memory in state))
        if winner is None and state[0].winner is not None:
            winner, named_at = state[0].winner, step
        if all(memory.verdict for memory in state):
            break
        after = simulation.step(actions.reshape(shape))
        flat = after.observation.reshape(len(poses), -1)
        poses = simulation.world.pose.reshape(-1, 3)
        paths.append(poses.copy())
        for one in range(len(poses)):
            for other in range(one):
                least = min(least, float(np.hypot(*(poses[one, :2] - poses[other, :2]))))
        if after.terminated.any() or after.truncated.all():
            break
    info = simulation.info()
    outcomes = tuple(str(outcome) for outcome in info["outcome"].ravel())
    rest = np.where(np.array(outcomes) == "success", info["goal_distance"].ravel(), 0.0)
    return TeamRun(
        outcomes=outcomes,
        verdicts=tuple(memory.verdict for memory in state),
        lengths=info["path_length"].ravel() + rest,
        paths=np.array(paths),
        modes=tuple(modes),
        memories=state,
        winner=winner,
        named_at=named_at,
        least_gap=least,
        simulation=simulation,
    )


def _begin(
    policy: Any,
    scenario: Any,
    settings: dict[str, Any],
    robots: int,
    ghosts: bool,
    seed: int,
    parameters: dict[str, Any],
) -> tuple[Simulation, Any, Any]:
    """Worlds, the team in them, and what its robots see at first (R, D)."""
    if ghosts:
        simulation = Simulation(scenario, robots, overrides=settings)
        names = [f"robot_{number}" for number in range(robots)]
        team = make_team(policy, source_scenario(simulation), names, **parameters)
        return simulation, team, simulation.reset(seeds=[seed] * robots)[:, 0]
    simulation = Simulation(scenario, 1, overrides=settings)
    return simulation, make_policy(policy, simulation, **parameters), simulation.reset(seeds=[seed])[0]


def make_team(name: str, scenario: Any, agents: list[str], **parameters: Any) -> Any:
    """A team for robots that are each alone in a world of the scenario."""
    module, class_name = TEAMS[name].entry_point.split(":")
    team_class = getattr(importlib.import_module(f"bug_gym.agents.{module}"), class_name)
    return team_class(Sensors.of(scenario), agents=agents, **parameters)
