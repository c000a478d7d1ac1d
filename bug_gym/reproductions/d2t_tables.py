"""Ways and times of planners on one map, in the manner of Table 2 of Sellers et al. (2026), and what their ants are worth.

The paper's planners search cells of 1 m with eight neighbours: its printed lengths are whole numbers of straight and of
diagonal steps. RRT* and the exact shortest way are added. Times are of the processor, in milliseconds; the paper's, in
seconds, are MATLAB's.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import shapely
from scipy import stats

from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.ants import Colony, Found, aco, eaco, eaco_refined
from bug_gym.agents.planning.bfs import bfs
from bug_gym.agents.planning.bidirectional_a_star import bidirectional_a_star
from bug_gym.agents.planning.d_star import DStar
from bug_gym.agents.planning.funnel import funnel_length
from bug_gym.agents.planning.grid import Grid, grid_of
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.mesh import triangulate
from bug_gym.agents.planning.rrt_star import rrt_star
from bug_gym.agents.planning.search import MANHATTAN
from bug_gym.agents.planning.search import Found as GridFound
from bug_gym.agents.planning.sleeve import Sleeve, path_length
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.agents.planning.triangulated import (
    Manner,
    Optimiser,
    Task,
    clusters_of,
    find_way,
    graph_size,
    shortest_way,
)
from bug_gym.reproductions import d2t_worlds

MARGIN = 0.05
"""What ways keep from obstacles beside the robot [m]."""
RRT_SAMPLES = 2000
RRT_STEP = 5.0
"""The longest piece of RRT*'s tree [m]: with pieces of 1 m so few samples do little more than reach the goal."""
MANNER = Manner("funnel", margin=MARGIN, facets=1)

PRINTED: dict[str, dict[str, tuple[float, float]]] = {
    "S1": {"bfs": (3.37, 49.28), "d_star": (3.44, 51.52), "bidirectional_a_star": (7.10, 50.69),
           "a_star": (2.59, 50.69), "d2t_eaco": (2.43, 46.02)},
    "S2": {"bfs": (12.32, 48.11), "d_star": (3.88, 50.35), "bidirectional_a_star": (5.50, 49.52),
           "a_star": (2.65, 49.52), "d2t_eaco": (2.38, 47.47)},
}  # fmt: skip
"""Time [s] and length [m] as printed."""

PRINTED_CLUSTERS = {"obstacles": "28 -> 9 (the beach)", "nodes": "about 20 fewer", "edges": "about 35 fewer, 60 %"}
"""What clustering saves, as printed."""


class Measured(NamedTuple):
    """Runs of one planner."""

    times: tuple[float, ...]
    """Of the processor [s]."""
    lengths: tuple[float, ...]
    """[m], infinite where there is no way."""


def map_of(task: Task) -> PlanningMap:
    """A task's obstacles as a planner's map."""
    return PlanningMap(
        task.border, np.zeros((0, 3)), tuple((shapely.get_coordinates(one)[:-1],) for one in task.obstacles)
    )


def over_cells(task: Task, size: float, search: Callable[[Grid, int, int], GridFound]) -> Callable[[int], float]:
    """The length of a way over cells [m], the making of the grid included, as it is in the paper's times."""
    plan, growth = map_of(task), task.radius + MARGIN

    def run(seed: int) -> float:
        grid = grid_of(plan, size, growth)
        start, goal = (grid.free_node_near(place, 2.0 * size) for place in (task.start, task.goal))
        return search(grid, start, goal).length * size

    return run


def planners(task: Task) -> dict[str, Callable[[int], float]]:
    """What is compared on a map: name -> the length found with a seed [m]."""

    def triangles(optimiser: Optimiser) -> Callable[[int], float]:
        manner = replace(MANNER, optimiser=optimiser)

        def run(seed: int) -> float:
            found = find_way(task, manner, seed=seed)
            return math.inf if found is None else found.length

        return run

    def tree(seed: int) -> float:
        plan = map_of(task)
        solids = Solids.of(plan, task.radius + MARGIN)
        found = rrt_star(solids, plan.box, task.start, task.goal, samples=RRT_SAMPLES, seed=seed, step=RRT_STEP)
        return path_length(found.places) if len(found.places) else math.inf

    def exact(seed: int) -> float:
        found = shortest_way(task, MANNER)
        return math.inf if found is None else found.length

    return {
        "bfs": over_cells(task, 1.0, bfs),
        "d_star": over_cells(task, 1.0, lambda grid, start, goal: DStar(grid, goal).find(start)),
        "bidirectional_a_star": over_cells(task, 1.0, bidirectional_a_star),
        "a_star": over_cells(task, 1.0, a_star),
        "a_star, Manhattan": over_cells(task, 1.0, lambda grid, a, b: a_star(grid, a, b, guess=MANHATTAN)),
        "a_star, cells of 0.1 m": over_cells(task, 0.1, a_star),
        "d2t_eaco": triangles("eaco"),
        "d2t_eaco, refined": triangles("eaco_refined"),
        "d2t_eaco, funnel": triangles("funnel"),
        "d2t_dijkstra": triangles("vertices"),
        "rrt_star (ours)": tree,
        "shortest way (ours)": exact,
    }


def measure(run: Callable[[int], float], runs: int) -> Measured:
    """Several runs of a planner, the first one, which may compile, left out."""
    run(0)
    times, lengths = [], []
    for seed in range(runs):
        began = time.process_time()
        lengths.append(run(seed))
        times.append(time.process_time() - began)
    return Measured(tuple(times), tuple(lengths))


def interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean and its 95 % interval by the normal law."""
    array = np.asarray(values)
    mean = float(array.mean())
    half = 1.96 * float(array.std(ddof=1)) / math.sqrt(len(array)) if len(array) > 1 else 0.0
    return mean, mean - half, mean + half


def median_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median and its 95 % interval: values between which it lies whatever their law (the binomial law of their ranks)."""
    found = stats.quantile_test(values, p=0.5).confidence_interval(0.95)
    low, high = float(found.low), float(found.high)
    known = min(values), max(values)  # few values tell of no bound
    return float(np.median(values)), low if math.isfinite(low) else known[0], high if math.isfinite(high) else known[1]


# ------------------------------------------------------------------------------------------- clustering


class Graph(NamedTuple):
    """What clustering makes of a map."""

    obstacles: int
    nodes: int
    edges: int
    cluster_ms: float
    """Time of the clustering [ms]."""
    mesh_ms: float
    """Time of the triangulation [ms]."""
    plan_ms: float
    """Time of the whole plan with the ants [ms]."""


def graph_of(task: Task, *, use_clusters: bool) -> Graph:
    """Nodes and edges of the free graph over the vertices of obstacles or clusters, start and goal, and times."""
    began = time.process_time()
    shapes = list(task.obstacles)
    if use_clusters:
        shapes = [part for one in clusters_of(task, MANNER) for part in one.parts]
    clustered = time.process_time()
    mesh = triangulate(shapes, np.array([task.start, task.goal]))
    meshed = time.process_time()
    find_way(task, replace(MANNER, optimiser="eaco", use_clusters=use_clusters))
    planned = time.process_time()
    nodes, edges = graph_size(mesh, shapes, int(mesh.extra[0]))
    steps = (clustered - began, meshed - clustered, planned - meshed)
    return Graph(len(shapes), nodes, edges, *(1e3 * step for step in steps))


def savings(maps: int) -> dict[str, float]:
    """Means over towns: obstacles, nodes and edges without and with clusters."""
    sums = np.zeros((2, 3))
    for seed in range(maps):
        town = d2t_worlds.urban(seed)
        for row, use_clusters in enumerate((False, True)):
            shapes = list(town.obstacles)
            if use_clusters:
                shapes = [part for one in clusters_of(town, MANNER) for part in one.parts]
            mesh = triangulate(shapes, np.array([town.start, town.goal]))
            sums[row] += (len(shapes), *graph_size(mesh, shapes, int(mesh.extra[0])))
    names = ("obstacles", "nodes", "edges")
    plain, fewer = (sums / maps).tolist()
    return {**dict(zip(names, plain, strict=True)), **{f"{k} clustered": v for k, v in zip(names, fewer, strict=True)}}


# ------------------------------------------------------------------------------------------- ants


def sleeves(count: int) -> list[Sleeve]:
    """Sleeves of all lengths: ways of 5 to 38 m through fields."""
    found: list[Sleeve] = []
    seed = 0
    while len(found) < count:
        goal = (6.0 + 3.0 * (seed % 12), 12.0 + seed % 5 - 2.0)
        way = find_way(d2t_worlds.field(1000 + seed, 12 + seed % 40, goal=goal), MANNER, seed=seed)
        seed += 1
        if way is not None and way.sleeve is not None and 1 <= len(way.sleeve.left) <= 50:
            found.append(way.sleeve)
    return found


SEARCHES: dict[str, Callable[[Sleeve, int], Found]] = {
    "eaco": lambda sleeve, seed: eaco(sleeve, seed=seed),
    "eaco, evaporation on all": lambda sleeve, seed: eaco(sleeve, Colony(evaporate="all"), seed=seed),
    "aco (no Levy flights)": lambda sleeve, seed: aco(sleeve, seed=seed),
    "eaco_refined": lambda sleeve, seed: eaco_refined(sleeve, seed=seed),
}


def gaps(chosen: Sequence[Sleeve], search: Callable[[Sleeve, int], Found], seeds: int) -> list[float]:
    """By how much a search's ways are longer than the funnel's, each sleeve's mean over seeds."""
    return [
        float(np.mean([search(sleeve, seed).length for seed in range(seeds)])) / funnel_length(sleeve) - 1.0
        for sleeve in chosen
    ]


VARIED = ("alpha", "beta", "rho", "q0", "levy_rate", "levy_exponent", "levy_scale", "ants")


def median_gap(chosen: Sequence[Sleeve], colony: Colony, seeds: int) -> float:
    """Median over sleeves of how much longer a colony's ways are than the funnel's."""
    return float(np.median(np.array(gaps(chosen, lambda sleeve, seed: eaco(sleeve, colony, seed=seed), seeds))))


def iterations(chosen: Sequence[Sleeve]) -> float:
    """After how many iterations the printed colony stops, in the mean."""
    return float(np.mean([len(eaco(sleeve).curve) for sleeve in chosen]))


def sensitivity(chosen: Sequence[Sleeve], seeds: int) -> dict[str, tuple[float, ...]]:
    """Median gap to the funnel with each parameter a quarter smaller and larger."""
    found = {}
    for name in VARIED:
        value: Any = getattr(Colony(), name)
        less, more = (round(part * value) if name == "ants" else part * value for part in (0.75, 1.25))
        found[name] = tuple(median_gap(chosen, replace(Colony(), **{name: one}), seeds) for one in (less, more))
    return found


def convergence(chosen: Sequence[Sleeve], colonies: Mapping[str, Colony], seeds: int) -> dict[str, list[float]]:
    """What is left after each iteration of the way's excess over the funnel's, as a share of that of the first way.

    A mean over sleeves and seeds; a colony that has stopped keeps its last.
    """
    found = {}
    for name, colony in colonies.items():
        curves = []
        for sleeve in chosen:
            shortest = funnel_length(sleeve)
            excess = path_length(sleeve.crossings(sleeve.middles)) - shortest
            for seed in range(seeds):
                curve = (eaco(sleeve, colony, seed=seed).curve - shortest) / excess
                curves.append(np.pad(curve, (0, colony.iterations - len(curve)), mode="edge"))
        found[name] = np.mean(curves, axis=0).tolist()
    return found
