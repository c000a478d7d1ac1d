"""How fast it is on this machine: environments, new worlds, imports, plans and the decisions of policies.

Worlds of 20 m x 20 m in which everything moves, a LIDAR of 5 m, random actions, one thread. Each speed is measured
several times over: the median counts, the least and the greatest say how quiet the machine was.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.utils.performance import benchmark_step

import bug_gym
from bug_gym.agents import make_policy, playable_names
from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.ants import Colony, eaco
from bug_gym.agents.planning.grid import grid_of
from bug_gym.agents.planning.triangulated import Manner, find_way
from bug_gym.drawing.canvas import Canvas
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.progress import progress_bar
from bug_gym.files import machine, replaced_when_done
from bug_gym.reproductions import d2t_worlds
from bug_gym.reproductions.d2t_tables import map_of
from bug_gym.simulation import Simulation

WORLDS = 1024
CASES = ((20, 64), (100, 180), (500, 180))
"""Obstacles and beams."""
DENSITY = 0.25
"""Obstacles a square metre in the worlds that grow."""
GROWING = (20, 100, 500, 2000, 5000)
"""Their obstacles."""
TEAM = 2
"""Robots in a world where there are several."""
SHARED = {
    "com1": (1,),
    "rev3": (1,),
    **dict.fromkeys(("tangent_bug", "orca"), (1, 2, 4, 8, 16)),
    "com1_rev3": (2, 4, 8, 16),
}
"""Robots of worlds that several share, by who drives them; the laws of a team drive alone beside it."""
BATCHED = ("bug0", "bug2", "tangent_bug", "orca", "ppo_dynamic")
"""Whose decisions for many worlds at once are counted."""
ELSEWHERE = {"ppo_crossing_robots": "crossing_robots"}
"""Where policies decide that were made for another robot than that of `dynamic`."""
BATCHES = 16
"""Batches of random actions, drawn beforehand and taken in turn."""

IMPORT = "from time import perf_counter as now; begin = now(); import bug_gym; print(now() - begin)"
MAKE = (
    "import gymnasium as gym, bug_gym; from time import perf_counter as now; begin = now(); "
    "gym.make('BugGym/Dynamic-v0').reset(seed=0); print(now() - begin)"
)
COMPILE = (
    "from time import perf_counter as now; begin = now(); import gymnasium as gym, bug_gym; "
    "env = gym.make('BugGym/Dynamic-v0'); env.reset(seed=0); env.step(env.action_space.sample()); print(now() - begin)"
)
"""What a fresh interpreter is asked to time, and prints [s]."""


@dataclass(frozen=True)
class Measurement:
    """One line of the table."""

    name: str
    unit: str
    median: float
    least: float
    greatest: float


class Task(NamedTuple):
    """What is measured."""

    name: str
    unit: str
    once: Callable[[], float]
    """Measures it once."""
    is_cold: bool = False
    """Whether it counts the first time, and is not repeated."""


def run_benchmark(
    *, repeats: int = 5, seconds: float = 0.5, worlds: int = WORLDS, out: Path | None = None
) -> list[Measurement]:
    """Measure everything, write it where that is asked for, and print a table.

    Where it is ended before that, or something cannot be measured, the file has what was measured until then, and the names
    of what is missing; a file that is there stays as it is, and the new one lies beside it.

    Args:
        repeats: how many times each.
        seconds: how long each time [s].
        worlds: how many worlds side by side.
        out: JSON to write.

    Raises:
        ValueError: repeats or worlds below 1, or seconds that are not positive.
    """
    if repeats < 1 or worlds < 1 or not seconds > 0.0:
        raise ValueError(f"expected repeats, worlds >= 1 and seconds > 0, got {repeats}, {worlds} and {seconds}")
    tasks = [
        *speed_tasks(worlds, seconds),
        *part_tasks(worlds, seconds),
        *start_tasks(),
        *plan_tasks(),
        *decision_tasks(worlds, seconds),
    ]
    settings = {**machine(), "worlds": worlds, "repeats": repeats, "seconds": seconds}
    measurements: list[Measurement] = []
    try:
        with progress_bar(shown=True) as track:
            for task in track(tasks, "measurements", len(tasks)):
                measurements.append(measure(task, repeats))
    except BaseException as error:
        if out is not None and measurements:
            kept = out.with_name(f"{out.stem}-incomplete{out.suffix}") if out.is_file() else out
            _write(kept, settings, measurements, tasks)
            error.add_note(f"{kept} keeps {len(measurements)} of {len(tasks)} measurements")
        raise
    try:  # the file first: where nobody reads the table, printing it ends the command
        if out is not None:
            _write(out, settings, measurements, tasks)
    finally:
        print_measurements(settings, measurements)
    return measurements


def _write(out: Path, settings: Mapping[str, Any], measurements: Sequence[Measurement], tasks: Sequence[Task]) -> None:
    """Write how it was measured, what was, and the names of what was not."""
    missing = [task.name for task in tasks[len(measurements) :]]
    lines = [asdict(measurement) for measurement in measurements]
    data = {"settings": dict(settings), "measurements": lines, "missing": missing}
    with replaced_when_done(out) as partial_file:
        partial_file.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def measure(task: Task, repeats: int) -> Measurement:
    """Measure one thing several times, after once that doesn't count: it compiles and warms up."""
    if not task.is_cold:
        task.once()
    samples = [task.once() for _ in range(1 if task.is_cold else repeats)]
    return Measurement(task.name, task.unit, statistics.median(samples), min(samples), max(samples))


def print_measurements(settings: dict[str, Any], measurements: Sequence[Measurement]) -> None:
    """Print the machine and how it was measured, and the table."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, padding=0, pad_edge=False)
    table.add_column("")
    for title in ("median", "least", "greatest"):
        table.add_column(title, justify="right")
    table.add_column("")
    for line in measurements:
        values = (line.median, line.least, line.greatest)
        numbers = (f"{value:,.0f}" if value >= 1000.0 else f"{value:.3g}" for value in values)
        table.add_row(line.name, *numbers, line.unit)
    console = Console()
    console.print(", ".join(f"{name} {value}" for name, value in settings.items()), markup=False, highlight=False)
    console.print(table, highlight=False)


# ---------------------------------------------------------------------------------------------------------------------
# Environments
# ---------------------------------------------------------------------------------------------------------------------


def busy_world(shapes: str, obstacles: int, beams: int) -> dict[str, Any]:
    """The scenario that is measured."""
    world = {"family": "field", "obstacles": obstacles, "shapes": shapes, "moving": 1.0, "laws": ["bounce"]}
    lidar = {"beams": beams, "range": 5.0}
    return {"robot": {"kinematics": "differential"}, "lidar": lidar, "time": {"limit": 60.0}, "world": world}


def growing_world(obstacles: int) -> dict[str, Any]:
    """A world that is the larger the more obstacles it has: what is near a robot stays as much."""
    scenario = busy_world("circles", obstacles, 180)
    half = 0.5 * math.sqrt(obstacles / DENSITY)
    scenario["world"] |= {"bounds": [-half, -half, half, half], "sizes": [0.2, 0.4], "separation": 0.5 * half}
    return scenario


def speed_tasks(worlds: int, seconds: float) -> Iterator[Task]:
    """Steps a second of each face."""
    unit = "thousand steps/s"
    for shapes in ("circles", "squares"):
        for obstacles, beams in CASES:
            once = partial(vector_speed, busy_world(shapes, obstacles, beams), worlds, seconds)
            yield Task(f"VectorEnv: {obstacles} {shapes}, {beams} beams", unit, once)
    if find_spec("stable_baselines3"):
        yield Task("SB3 VecEnv: 20 circles, 64 beams", unit, partial(sb3_speed, worlds, seconds))
        title = f"SB3 VecEnv, {TEAM} robots a world: 20 circles, 64 beams"
        yield Task(title, "thousand robot steps/s", partial(robots_speed, worlds, seconds))
    title = f"parallel_env, {TEAM} robots: 20 circles, 64 beams"
    yield Task(title, "thousand world steps/s", partial(parallel_speed, seconds))
    for obstacles in (20, 100):
        scenario, title = busy_world("circles", obstacles, 180), f"gym.make: {obstacles} circles, 180 beams"
        yield Task(title, unit, partial(single_speed, scenario, seconds))
        yield Task(f"{title}, each action drawn", unit, partial(single_speed_with_draws, scenario, seconds))


def random_actions(worlds: int) -> np.ndarray:
    """Batches of actions (BATCHES, n, 2)."""
    return np.random.default_rng(0).uniform(-1.0, 1.0, (BATCHES, worlds, 2)).astype(np.float32)


def vector_speed(scenario: dict[str, Any], worlds: int, seconds: float) -> float:
    """Thousand steps a second of the vector env; a step that only starts a new world is none."""
    env = gym.make_vec("BugGym/Navigation-v0", num_envs=worlds, scenario=scenario, observation="flat")
    env.reset(seed=0)
    actions, steps, number, ended = random_actions(worlds), 0, 0, 0
    begin = perf_counter()
    while (elapsed := perf_counter() - begin) < seconds:
        _, _, terminated, truncated, _ = env.step(actions[number % BATCHES])
        steps += worlds - ended
        ended = int(np.count_nonzero(terminated | truncated))
        number += 1
    env.close()
    return steps / elapsed / 1000.0


def sb3_speed(worlds: int, seconds: float) -> float:
    """Thousand steps a second of SB3's VecEnv."""
    from bug_gym.agents.sb3 import make_vec_env  # needs the extra `train`

    env = make_vec_env(busy_world("circles", 20, 64), worlds, seed=0, observation="flat")
    env.reset()
    actions, number = random_actions(worlds), 0
    begin = perf_counter()
    while (elapsed := perf_counter() - begin) < seconds:
        env.step(actions[number % BATCHES])
        number += 1
    env.close()
    return number * worlds / elapsed / 1000.0


def robots_speed(worlds: int, seconds: float) -> float:
    """Thousand steps of robots a second of SB3's VecEnv with several robots in a world, in as many rows as the other's."""
    from bug_gym.agents.sb3 import make_robots_vec_env  # needs the extra `train`

    worlds = max(worlds // TEAM, 1)
    env = make_robots_vec_env(busy_world("circles", 20, 64), TEAM, worlds, seed=0)
    env.reset()
    actions, number = random_actions(env.num_envs), 0
    begin = perf_counter()
    while (elapsed := perf_counter() - begin) < seconds:
        env.step(actions[number % BATCHES])
        number += 1
    env.close()
    return number * env.num_envs / elapsed / 1000.0


def parallel_speed(seconds: float) -> float:
    """Thousand steps of a world a second through PettingZoo's face, resets included, actions drawn beforehand."""
    env = bug_gym.parallel_env(busy_world("circles", 20, 64), robots=TEAM)
    env.reset(seed=0)
    actions, number = random_actions(TEAM), 0
    drawn = [dict(zip(env.possible_agents, batch, strict=True)) for batch in actions]
    begin = perf_counter()
    while (elapsed := perf_counter() - begin) < seconds:
        batch = drawn[number % BATCHES]
        env.step({agent: batch[agent] for agent in env.agents})
        if not env.agents:
            env.reset()
        number += 1
    env.close()
    return number / elapsed / 1000.0


def single_speed(scenario: dict[str, Any], seconds: float) -> float:
    """Thousand steps a second of one env with its default wrappers, resets included, actions drawn beforehand."""
    env = gym.make("BugGym/Navigation-v0", scenario=scenario)
    env.reset(seed=0)
    actions, number = random_actions(WORLDS).reshape(-1, 2), 0
    begin = perf_counter()
    while (elapsed := perf_counter() - begin) < seconds:
        _, _, terminated, truncated, _ = env.step(actions[number % len(actions)])
        if terminated or truncated:
            env.reset()
        number += 1
    env.close()
    return number / elapsed / 1000.0


def single_speed_with_draws(scenario: dict[str, Any], seconds: float) -> float:
    """The same by Gymnasium's own benchmark, which draws each action from the space."""
    env = gym.make("BugGym/Navigation-v0", scenario=scenario)
    duration: Any = seconds  # a whole number by its annotation, though part of a second will do
    return benchmark_step(env, duration, seed=0) / 1000.0


# ---------------------------------------------------------------------------------------------------------------------
# Where a step's time goes
# ---------------------------------------------------------------------------------------------------------------------


def part_tasks(worlds: int, seconds: float) -> Iterator[Task]:
    """Microseconds of each part of a step of one world among many, and of a new world."""
    scenario, blind = busy_world("circles", 100, 180), busy_world("circles", 100, 1)
    title = "step (100 circles, 180 beams)"
    yield Task(f"{title}: core", "us", partial(part_time, "core", scenario, worlds, seconds))
    yield Task("step (100 circles, 1 beam): core", "us", partial(part_time, "core", blind, worlds, seconds))
    yield Task(f"{title}: infos", "us", partial(part_time, "reading", scenario, worlds, seconds))
    yield Task(f"{title}: resets", "us", partial(part_time, "new worlds", scenario, worlds, seconds))
    for obstacles in GROWING:
        title = f"step ({obstacles} circles, {DENSITY} a square metre, 180 beams): core"
        yield Task(
            title,
            "us",
            partial(part_time, "core", growing_world(obstacles), min(worlds, WORLDS * 100 // obstacles), seconds),
        )
    if find_spec("pygame"):
        yield Task("frame of 600 x 600 pixels: 500 moving squares", "ms", partial(frame_time, seconds))
    for obstacles, beams in CASES:
        scenario = busy_world("circles", obstacles, beams)
        yield Task(
            f"new world: {obstacles} circles, {beams} beams", "us", partial(new_world_time, scenario, worlds, seconds)
        )
    yield Task("new world: rooms", "us", partial(new_world_time, "rooms", worlds, seconds))


def part_time(part: str, scenario: dict[str, Any], worlds: int, seconds: float) -> float:
    """Time of one part of a step [us], of one world among many."""
    simulation = Simulation(scenario, worlds)
    simulation.reset(seeds=range(worlds))
    actions = random_actions(worlds).astype(np.float64)[:, :, None]
    spent = dict.fromkeys(("core", "reading", "new worlds"), 0.0)
    number = 0
    while sum(spent.values()) < seconds:
        times = [perf_counter()]
        simulation.advance(actions[number % BATCHES])
        times.append(perf_counter())
        _, _, terminated, truncated = simulation.transition(simulation.all_rows)
        simulation.info()
        times.append(perf_counter())
        ended = np.flatnonzero(terminated | truncated)
        if len(ended):
            simulation.reset(ended)
        times.append(perf_counter())
        for name, duration in zip(spent, np.diff(times).tolist(), strict=True):
            spent[name] += duration
        number += 1
    return 1e6 * spent[part] / (number * worlds)


def frame_time(seconds: float) -> float:
    """Time of a picture [ms]."""
    scenario = busy_world("squares", 500, 180)
    scenario["world"] |= {"bounds": [-20, -20, 20, 20], "sizes": [0.15, 0.35]}
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    canvas, number, spent = Canvas(simulation, size=600), 0, 0.0
    canvas.draw()  # what stands is painted once an episode
    while spent < seconds:
        simulation.advance(np.zeros((1, 1, 2)))
        begin = perf_counter()
        canvas.draw()
        spent += perf_counter() - begin
        number += 1
    return 1000.0 * spent / number


def new_world_time(scenario: str | dict[str, Any], worlds: int, seconds: float) -> float:
    """Time of a new world with its first observation [us]."""
    simulation = Simulation(scenario, worlds)
    number = 0
    begin = perf_counter()
    while (elapsed := perf_counter() - begin) < seconds:
        simulation.reset()
        number += 1
    return 1e6 * elapsed / (number * worlds)


# ---------------------------------------------------------------------------------------------------------------------
# Starting, deciding
# ---------------------------------------------------------------------------------------------------------------------


def start_tasks() -> Iterator[Task]:
    """Seconds until a fresh interpreter is ready."""
    yield Task("import bug_gym", "s", partial(fresh_time, IMPORT))
    yield Task("gym.make and reset, compiled before", "s", partial(fresh_time, MAKE))
    yield Task("import, gym.make, reset and step, nothing compiled before (once)", "s", compilation_time, is_cold=True)


def fresh_time(code: str, **settings: str) -> float:
    """What a fresh interpreter prints [s], with settings of its environment.

    It keeps the bytecode of what it imports, as Python and pip do where they are not told otherwise.
    """
    checkout = Path(bug_gym.__file__).parents[1]  # so that it is found there where it is not installed
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=checkout,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": ""} | settings,
    )
    return float(run.stdout)


def compilation_time() -> float:
    """Time until a first environment has made its first step where numba has kept nothing [s]."""
    with TemporaryDirectory() as empty:
        return fresh_time(COMPILE, NUMBA_CACHE_DIR=empty)


def plan_tasks() -> Iterator[Task]:
    """Milliseconds of a plan on a known map."""
    wide = d2t_worlds.field(9, 600, 100.0, 100.0, sizes=(0.3, 1.2))
    plan = map_of(wide)
    grid = grid_of(plan, 0.1, wide.radius)
    start, goal = (grid.lattice.node_at(place) for place in (wide.start, wide.goal))
    short = find_way(d2t_worlds.field(3, 30, goal=(20.0, 12.0)), Manner("funnel", facets=1))
    assert short is not None and short.sleeve is not None
    plans: dict[str, Callable[[], Any]] = {
        "plan among 600 obstacles: Delaunay triangles and funnel": partial(find_way, wide, Manner("funnel", facets=1)),
        "plan among 600 obstacles: exactly": partial(plan.shortest_path, wide.start, wide.goal, radius=wide.radius),
        "plan among 600 obstacles: A* over cells of 10 cm": partial(a_star, grid, start, goal),
        "50 iterations of ants through a sleeve of up to 20 edges": partial(eaco, short.sleeve, Colony(patience=50)),
    }
    for title, way in plans.items():
        yield Task(title, "ms", partial(plan_time, way))


def plan_time(plan: Callable[[], Any]) -> float:
    """Time of the processor that a plan takes [ms]."""
    begin = process_time()
    plan()
    return 1000.0 * (process_time() - begin)


def decision_tasks(worlds: int, seconds: float) -> Iterator[Task]:
    """Microseconds of a decision of each policy, and how many a second some make for many worlds at once."""
    for name in playable_names():
        yield Task(f"decision: {name}", "us", partial(decision_time, name, ELSEWHERE.get(name, "dynamic")))
    for name, counts in SHARED.items():
        for robots in counts:
            title = f"decision a robot: {name}, {robots} in a world"
            yield Task(title, "us", partial(decision_time, name, shared_world(robots)))
    for name in BATCHED:
        title = f"decisions in a batch: {name}, {worlds:,} worlds"
        yield Task(title, "thousand decisions/s", partial(batch_speed, name, worlds, seconds))


def shared_world(robots: int) -> dict[str, Any]:
    """A world of still obstacles with room for many robots, for 5 s."""
    world = {"family": "field", "obstacles": 80, "bounds": [-20, -20, 20, 20]}
    lidar = {"beams": 64, "range": 5.0, "noise": 0.01}
    robot = {"kinematics": "differential"}
    return {"robot": robot, "robots": {"count": robots}, "lidar": lidar, "time": {"limit": 5.0}, "world": world}


def decision_time(policy: str, scenario: str | dict[str, Any]) -> float:
    """Mean time of a robot's decision [us] over two episodes."""
    rows = evaluate([policy], scenario, episodes=2)
    decisions = sum(row.decision_time_total / row.decision_time_mean for row in rows)
    return 1e6 * sum(row.decision_time_total for row in rows) / decisions


def batch_speed(policy: str, worlds: int, seconds: float) -> float:
    """Thousand decisions a second of a policy that is asked for many worlds at once; the worlds' own time doesn't count."""
    env = gym.make_vec("BugGym/Dynamic-v0", num_envs=worlds, observation="flat")
    decider, state = make_policy(policy, env), None
    observations, _ = env.reset(seed=0)
    starts, asked, spent = np.ones(worlds, dtype=np.bool_), 0, 0.0
    while spent < seconds:
        begin = perf_counter()
        actions, state = decider.predict(observations, state, starts)
        spent += perf_counter() - begin
        asked += worlds
        observations, _, terminated, truncated, _ = env.step(actions)
        starts = terminated | truncated
    env.close()
    return asked / spent / 1000.0
