"""`bug-gym warm-up`: what it tells, that nobody compiles anything after it, and that what it compiles is kept."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bug_gym.agents import AGENTS, TEAMS
from bug_gym.commands.warm_up import POLICIES, WORLDS
from bug_gym.config import Scenario, load, scenario_names

Used = set[tuple[str, str]]
"""Kernels by name, and the arguments that they were compiled for."""

USED = """
import json
from bug_gym.compiling import KERNELS
names = [f"{one.py_func.__module__}.{one.py_func.__qualname__}" for one in KERNELS]
print(json.dumps([(name, str(which)) for name, one in zip(names, KERNELS) for which in one.signatures]))
"""
WARM_UP = "from bug_gym.cli import main\nassert not main(['warm-up'])" + USED
USE = """
import gymnasium
import numpy
import bug_gym
from bug_gym.evaluation import evaluate
from bug_gym.simulation import Simulation

for name in ("static", "moving_target", "crowd", "evading_target", "replay", "terrain", "crossing_robots", "hexagon"):
    simulation = Simulation(name, 3)
    simulation.reset(seeds=[4, 5, 6])
    for _ in range(5):
        simulation.step(numpy.ones((3, simulation.robots, 2)))
    simulation.info()
env = gymnasium.make("BugGym/Static-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
evaluate(["bug2", "tangent_bug", "hd_bug", "hd_bug_map"], "moving_target", episodes=1)
evaluate(["go_to_goal", "hd_bug", "minimum_risk"], ["dynamic", "terrain", "u_trap"], episodes=1)
for policies, scenarios in (
    (["go_to_goal", "bug0", "vis_bug_21", "hd_bug_map", "operative_critical_point_bug"], ["ackermann", "jackal"]),
    (["random", "go_to_goal", "orca", "modified_critical_point_bug"], ["rectangle_pair", "corridor_swap"]),
    (["bfs", "d_star"], "replay"),
    (["com1_rev3", "bug1_pair"], "oni_wang_pair"),
    ("hd_bug:predictor=supervised", "dynamic"),
):
    evaluate(policies, scenarios, episodes=1, overrides={"time.limit": 5.0})
"""
FIRST = """
from bug_gym.cli import main
from bug_gym.commands import warm_up
name = next(iter(warm_up.WORLDS))
warm_up.WORLDS = {name: warm_up.WORLDS[name]}
warm_up._draw = lambda: None
warm_up._use_policies = lambda: iter(())
assert not main(['warm-up'])
"""
MISSES = """
from bug_gym.compiling import KERNELS
print(sum(sum(one.stats.cache_hits.values()) for one in KERNELS))
print([one.py_func.__name__ for one in KERNELS if one.stats.cache_misses])
"""


def run(code: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """What a process of its own prints."""
    beside = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, env=beside, check=True, capture_output=True, text=True
    )


def used(printed: str) -> Used:
    return {(name, which) for name, which in json.loads(printed)}


Kind = tuple[bool, str, bool, bool, bool]


def kind(scenario: Scenario) -> Kind:
    """What of robots has kernels of its own: several in a world, how they drive, a long body, inertia, latency."""
    robot = scenario.robot
    return (
        scenario.robots.count > 1,
        robot.kinematics,
        len(robot.circles or ()) > 1,
        robot.max_acceleration is not None,
        robot.latency > 0.0,
    )


def test_policies_are_driven_as_robots_of_each_kind_that_scenarios_have() -> None:
    assert {kind(load(name)) for name in scenario_names()} == {kind(load(name)) for name in POLICIES}


@pytest.mark.slow
def test_after_a_warm_up_nothing_is_left_to_compile(tmp_path: Path) -> None:
    """All kernels that come to be used, for the arguments that they get, are among those that it uses."""
    *told, kept, printed = run(WARM_UP, tmp_path).stdout.splitlines()
    named = [line.partition(" s  ")[2] for line in told]
    assert named[: len(WORLDS)] == list(WORLDS)
    assert {*TEAMS, *(name for name, agent in AGENTS.items() if not agent.model)} <= set(named)
    assert " kernels are kept under " in kept
    warm, later = used(printed), used(run(USE + USED, tmp_path).stdout)
    assert len({name for name, _ in later}) > 20
    assert later <= warm


@pytest.mark.slow
def test_what_it_compiles_is_kept_and_nobody_is_told_to_wait_again(tmp_path: Path) -> None:
    """Where nothing has been compiled yet, with its first world alone."""
    cold = {"NUMBA_CACHE_DIR": str(tmp_path)}
    first = run(FIRST, tmp_path, **cold)
    assert "compiling the simulation's kernels" in first.stderr and str(tmp_path) in first.stdout
    later = run(FIRST + MISSES, tmp_path, **cold)
    *_, hits, misses = later.stdout.splitlines()
    assert (int(hits) > 0, misses, later.stderr) == (True, "[]", "")
