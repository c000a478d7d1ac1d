"""Shortest paths, against which the ways of policies are measured: once a world, whoever drives in it."""

from __future__ import annotations

from bug_gym.evaluation.entries import ScenarioEntry
from bug_gym.simulation import Simulation

World = tuple[str, int]
"""Label of a scenario and seed."""
Lengths = dict[World, list[float]]
"""Shortest paths [m] of the robots of each world."""


def shortest_lengths(scenario: ScenarioEntry, seed: int) -> list[float]:
    """Shortest paths [m] of the robots of one world; NaN where a robot does not fit at its start or goal."""
    simulation = Simulation(scenario.scenario)
    simulation.reset(seeds=[seed])
    return [simulation.shortest_length(robot=robot) for robot in range(simulation.robots)]
