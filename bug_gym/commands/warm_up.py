"""`bug-gym warm-up`: all that is compiled when it is first used, compiled now and kept on disk.

What a kernel is compiled for is decided by the arguments that it gets, so the worlds are stepped, drawn and played in.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from importlib.util import find_spec
from time import perf_counter
from typing import Any

WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "obstacles": ("dynamic", {}),
    "bodies that look": ("crowd", {}),
    "regions": ("terrain", {}),
    "rooms": ("rooms", {}),
    "several robots": ("crossing_robots", {}),
    "several robots, regions": ("static", {"robots.count": 2, "world.regions": [{"circle": [0, 0, 1], "factor": 2.0}]}),
}
"""What kernels are compiled for -> a scenario of that kind, with overrides."""

POLICIES: dict[str, float] = {
    **dict.fromkeys(("dynamic", "terrain", "moving_target", "u_trap", "maze"), 12.0),
    **dict.fromkeys(("replay", "ackermann", "corridor_swap", "rectangle_pair"), 5.0),
    "jackal": 1.0,
}
"""Scenarios that each policy is driven in -> seconds of an episode: whole ones compile nothing more.

Movers, weighted ground, a target, a trap, a maze, recorded people; a car, two robots in a world that turn and two that go any
way; a long robot with inertia, whose commands act late.
"""

TEAMS: dict[str, float] = {"corridor_swap": 5.0, "oni_wang_pair": 60.0}
"""The same for teams."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of the command."""


def run(options: argparse.Namespace) -> None:
    """Run the command."""
    from bug_gym.compiling import KERNELS  # loads the compiler

    begin = perf_counter()
    for what in _compiled():
        print(f"{perf_counter() - begin:6.1f} s  {what}", flush=True)
    folders = [kernel.stats.cache_path for kernel in KERNELS if kernel.signatures]
    if not folders:
        raise ValueError("this numba keeps nothing of what it compiles")
    print(f"{len(folders)} kernels are kept under {os.path.commonpath(folders)}")


def _compiled() -> Iterator[str]:
    """Compile part after part; yields what has been compiled."""
    for what, (scenario, overrides) in WORLDS.items():
        _use_world(scenario, overrides)
        yield what
    if find_spec("pygame") is not None:
        _draw()
        yield "pictures"
    yield from _use_policies()


def _use_world(scenario: str, overrides: dict[str, Any]) -> None:
    import numpy as np

    from bug_gym.simulation import Simulation  # loads the compiler

    simulation = Simulation(scenario, overrides=overrides)
    simulation.reset(seeds=[0])
    simulation.step(np.zeros((1, simulation.robots, 2)))
    if simulation.robots > 1:
        simulation.restart_robots(simulation.all_rows, simulation.world.pose.copy())


def _draw() -> None:
    from bug_gym.drawing.canvas import Canvas  # loads the compiler
    from bug_gym.drawing.gif import encoded, taken  # loads the compiler
    from bug_gym.simulation import Simulation  # loads the compiler

    simulation = Simulation("static")
    simulation.reset(seeds=[0])
    list(encoded(taken([Canvas(simulation).draw()]), fps=10.0))


def _use_policies() -> Iterator[str]:
    """Begin to drive each policy, and each team, in worlds of each kind."""
    from bug_gym.agents import AGENTS, playable_names, team_names  # loads the compiler
    from bug_gym.agents.prediction import predictor_names  # loads the compiler

    for name in playable_names():
        if name not in AGENTS or AGENTS[name].model:
            continue
        for scenario, seconds in POLICIES.items():
            _drive(name, scenario, seconds)
        if name == "d_star_lite":
            _drive(name, "maze", 12.0, known=False)
        if name in ("a_star", "dijkstra", "theta_star", "d_star_lite"):
            _drive(name, "terrain", 12.0, terrain=True)
        yield name
    for name in team_names():
        for scenario, seconds in TEAMS.items():
            _drive(name, scenario, seconds)
        yield name
    for name in predictor_names():
        _drive("hd_bug", "dynamic", 12.0, predictor=name)
        yield f"predictor {name}"


def _drive(name: str, scenario: str, seconds: float, **parameters: Any) -> None:
    """Begin to drive a policy in a scenario, unless its robot is one that this policy refuses."""
    from bug_gym.agents import AGENTS, make_policy  # loads the compiler
    from bug_gym.config import load  # loads pydantic
    from bug_gym.evaluation import evaluate  # loads the compiler
    from bug_gym.policy import MisfitError  # loads the compiler

    if name not in AGENTS or not AGENTS[name].privileged:  # who reads the map needs a world, and drives any robot
        try:
            make_policy(name, load(scenario))
        except MisfitError:
            return
    policy = {"name": name, "parameters": parameters}
    evaluate([policy], scenario, episodes=1, overrides={"time.limit": seconds})
