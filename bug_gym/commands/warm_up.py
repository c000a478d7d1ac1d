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

DRIVEN = 12.0
"""Seconds of an episode that policies are driven for: whole ones compile nothing that ten seconds do not."""


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
    """Begin to drive each policy among movers, over weighted ground, after a target, in a trap and in a maze."""
    from bug_gym.agents import AGENTS, playable_names  # loads the compiler
    from bug_gym.evaluation import evaluate  # loads the compiler

    names = [name for name in playable_names() if name in AGENTS and not AGENTS[name].model]
    scenarios = ["dynamic", "terrain", "moving_target", "u_trap", "maze"]
    for name in names:
        asked: list[tuple[Any, str | list[str]]] = [(name, scenarios)]
        if name == "d_star_lite":
            asked.append(({"name": name, "label": "unknown terrain", "parameters": {"known": False}}, "maze"))
        if name in ("a_star", "dijkstra", "theta_star", "d_star_lite"):
            asked.append(({"name": name, "label": "weighed ground", "parameters": {"terrain": True}}, "terrain"))
        for policy, where in asked:
            evaluate([policy], where, episodes=1, overrides={"time.limit": DRIVEN})
        yield name
