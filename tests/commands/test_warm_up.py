"""`bug-gym warm-up`: what it tells, and that nobody compiles anything after it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bug_gym.agents import AGENTS
from bug_gym.commands.warm_up import WORLDS

WARM_UP = "from bug_gym.cli import main; raise SystemExit(main(['warm-up']))"
USE = """
import gymnasium
import numpy
import bug_gym
from bug_gym.compiling import KERNELS
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
print(sum(sum(kernel.stats.cache_hits.values()) for kernel in KERNELS))
print([kernel.py_func.__name__ for kernel in KERNELS if kernel.stats.cache_misses])
"""


@pytest.mark.slow
def test_after_a_warm_up_nothing_is_compiled_and_nobody_is_told_to_wait(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}

    def run(code: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env=environment, check=True, capture_output=True, text=True
        )

    told = run(WARM_UP)
    assert "compiling the simulation's kernels" in told.stderr
    *parts, kept = told.stdout.splitlines()
    named = [part.partition(" s  ")[2] for part in parts]
    assert named[: len(WORLDS)] == list(WORLDS)
    assert {name for name, agent in AGENTS.items() if not agent.model} <= set(named)
    assert " kernels are kept under " in kept and str(tmp_path) in kept
    later = run(USE)
    hits, misses = later.stdout.splitlines()
    assert (int(hits) > 6, misses, later.stderr) == (True, "[]", "")
