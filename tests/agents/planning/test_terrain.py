"""Planners that weigh the ground: they agree with a slow search, bend as light does, and what is not dear stays as it was."""

from __future__ import annotations

import heapq
import itertools
import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode
from scipy.optimize import minimize_scalar

from bug_gym.agents import make_policy
from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.d_star_lite import DStarLite
from bug_gym.agents.planning.dijkstra import dijkstra
from bug_gym.agents.planning.grid import DIAGONAL, FAR, STRAIGHT, UNIT, Grid, Lattice, make_grid
from bug_gym.agents.planning.map import Ground, PlanningMap, ground_of
from bug_gym.agents.planning.terrain import WeighedGround, weights_of
from bug_gym.agents.planning.theta_star import theta_star
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.simulation import Simulation

WEIGHING = ["a_star", "dijkstra", "theta_star", "d_star_lite"]
STEPS = [step for step in itertools.product((-1, 0, 1), repeat=2) if step != (0, 0)]


def weighed_grid(seed: int, rows: int = 20, columns: int = 26, **kind: Any) -> Grid:
    """Random cells, a quarter of them blocked, on ground in patches that cost from 1 to 9 times as much."""
    generator = np.random.default_rng(seed)
    grid = make_grid((generator.random((rows, columns)) < 0.25).astype(np.uint8), **kind)
    patches = generator.integers(UNIT, 9 * UNIT, (rows // 4 + 1, columns // 4 + 1))
    weights = np.kron(patches, np.ones((4, 4), dtype=np.int64))[: rows + 2, : columns + 2]
    return grid._replace(weights=np.ascontiguousarray(weights.ravel()))


def slow_cost(grid: Grid, start: int, goal: int) -> int:
    """Dijkstra in plain Python over the blocked cells and their weights."""
    assert grid.weights is not None
    free = (grid.blocked == 0).tolist()
    weights: Any = grid.weights.reshape(grid.blocked.shape).tolist()
    columns = grid.lattice.columns
    best, queue = {divmod(start, columns): 0}, [(0, divmod(start, columns))]
    while queue:
        so_far, (row, column) = heapq.heappop(queue)
        if (row, column) == divmod(goal, columns):
            return so_far
        if so_far > best[row, column]:
            continue
        for down, across in STEPS:
            is_diagonal = down != 0 and across != 0
            other = row + down, column + across
            if not free[other[0]][other[1]] or (is_diagonal and grid.connectivity == 4):
                continue
            beside = free[row + down][column], free[row][column + across]
            if is_diagonal and not (any(beside) if grid.cut_corners else all(beside)):
                continue
            step = (DIAGONAL if is_diagonal else STRAIGHT) * (weights[row][column] + weights[other[0]][other[1]])
            total = so_far + step // (2 * UNIT)
            if total < best.get(other, FAR):
                best[other] = total
                heapq.heappush(queue, (total, other))
    return FAR


def some_ends(grid: Grid, seed: int, count: int) -> list[tuple[int, int]]:
    """Pairs of free cells."""
    pairs = np.random.default_rng(seed).choice(np.flatnonzero(grid.blocked.ravel() == 0), size=(count, 2))
    return [(int(a), int(b)) for a, b in pairs]


@pytest.mark.parametrize(("connectivity", "cut"), [(8, False), (8, True), (4, False)])
def test_every_search_finds_the_cost_of_a_slow_one(connectivity: int, cut: bool) -> None:
    for seed in range(4):
        grid = weighed_grid(seed, connectivity=connectivity, cut_corners=cut)
        for start, goal in some_ends(grid, seed, 6):
            expected = slow_cost(grid, start, goal)
            assert dijkstra(grid, start, goal).cost == expected
            assert a_star(grid, start, goal).cost == expected
            assert DStarLite(grid, goal).find(start).cost == expected


def test_d_star_lite_equals_a_star_after_each_of_many_changes() -> None:
    generator = np.random.default_rng(5)
    grid = weighed_grid(5, 30, 30)
    free = np.flatnonzero(grid.blocked.ravel() == 0)
    start, goal = int(free[0]), int(free[-1])
    search = DStarLite(grid, goal)
    search.find(start)
    anew = repaired = 0
    for _ in range(200):
        row, column = (int(value) for value in generator.integers(1, 31, 2))
        cell = row * grid.lattice.columns + column
        if cell in (start, goal):
            continue
        blocked = grid.blocked.copy()
        blocked[row, column] ^= 1
        grid = make_grid(blocked, grid.lattice)._replace(weights=grid.weights)
        search.grid = grid
        search.change(np.array([cell], dtype=np.int32))
        found, expected = search.find(start), a_star(grid, start, goal)
        assert found.cost == expected.cost
        anew, repaired = anew + expected.expanded, repaired + found.expanded
    assert repaired < anew


@pytest.mark.parametrize("name", WEIGHING)
def test_ground_that_costs_the_same_everywhere_changes_no_way(name: str) -> None:
    # Theta* finds no best ways, and with a bound that is a third of what is left it finds others.
    factor = 1 if name == "theta_star" else 3
    searches: dict[str, Any] = {"a_star": a_star, "dijkstra": dijkstra, "theta_star": theta_star}
    searches["d_star_lite"] = lambda grid, start, goal: DStarLite(grid, goal).find(start)
    for seed in range(3):
        plain = weighed_grid(seed)._replace(weights=None)
        even = plain._replace(weights=np.full(plain.blocked.size, factor * UNIT))
        for start, goal in some_ends(plain, seed, 6):
            without, dear = searches[name](plain, start, goal), searches[name](even, start, goal)
            if without.cost == FAR:
                assert dear.cost == FAR
            else:
                assert dear.cost == pytest.approx(factor * without.cost, rel=1e-7)


def test_theta_stars_cost_is_that_of_its_way() -> None:
    for seed in range(4):
        grid = weighed_grid(seed)
        assert grid.weights is not None
        ground = WeighedGround(grid.weights, grid.lattice)
        for start, goal in some_ends(grid, seed, 8):
            found = theta_star(grid, start, goal)
            assert (found.cost == FAR) == (a_star(grid, start, goal).cost == FAR)
            if found.cost < FAR:
                places = [tuple(place) for place in grid.lattice.places(found.nodes).tolist()]
                along = sum(ground.cost_of(a, b) for a, b in itertools.pairwise(places))
                assert found.length == pytest.approx(along, rel=1e-6, abs=1e-6)


REGIONS: list[dict[str, Any]] = [
    {"polygon": [[0, 0], [4, 0], [4, 4], [0, 4]], "factor": 2.0},
    {"circle": [4, 2, 1.5], "factor": 3.5},
    {"circle": [4, 2, 0.7], "factor": 1.5},
]


def test_the_weight_of_a_cell_is_the_largest_factor_there() -> None:
    regions = [ground_of(WeightedRegion(**one)) for one in REGIONS]
    border = np.array([[-2.0, -2.0], [8.0, -2.0], [8.0, 6.0], [-2.0, 6.0]])
    lattice = Lattice(-2.05, -2.05, 0.1, 82, 102)
    weights = weights_of(PlanningMap(border, np.zeros((0, 3)), (), tuple(regions)), lattice)
    assert weights is not None
    for (x, y), weight in zip(
        lattice.places(np.arange(weights.size, dtype=np.int32)).tolist(), weights.tolist(), strict=True
    ):
        in_square, in_disc = 0.0 < x < 4.0 and 0.0 < y < 4.0, math.hypot(x - 4.0, y - 2.0) <= 1.5
        assert weight == UNIT * (3.5 if in_disc else 2.0 if in_square else 1.0)
    assert weights_of(PlanningMap(border, np.zeros((0, 3))), lattice) is None


def test_what_lies_in_a_hole_of_a_region_is_open_ground() -> None:
    shell, hole = (half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) for half in (3.0, 1.0))
    lattice = Lattice(-4.0, -4.0, 0.25, 33, 33)
    weights = weights_of(PlanningMap(4.0 * shell, np.zeros((0, 3)), (), (Ground(2.0, None, (shell, hole)),)), lattice)
    assert weights is not None
    farthest = np.abs(lattice.places(np.arange(weights.size, dtype=np.int32))).max(axis=1)
    for cells, factor in (((farthest > 1.1) & (farthest < 2.9), 2.0), ((farthest < 0.9) | (farthest > 3.1), 1.0)):
        assert (weights[cells] == factor * UNIT).all() and cells.sum() > 40


DEAR = 3.0
HALVES: dict[str, Any] = {
    "world": {
        "family": "explicit",
        "bounds": [-2, -8, 12, 8],
        "regions": [{"polygon": [[5, -8], [12, -8], [12, 8], [5, 8]], "factor": DEAR}],
        "start": [0, -5, 0],
        "goal": [10, 5],
    },
    "robot": {"kinematics": "holonomic"},
}


def least_cost() -> float:
    """What the way from open into dear ground costs that bends as light does: Snell's, by one number."""
    return float(minimize_scalar(lambda y: math.hypot(5.0, y + 5.0) + DEAR * math.hypot(5.0, 5.0 - y)).fun)


def cost_on_halves(path: Any) -> float:
    """What a path (t, 2) costs, its short pieces by their middles [m]."""
    steps, middle = np.hypot(*np.diff(path, axis=0).T), 0.5 * (path[1:, 0] + path[:-1, 0])
    return float((steps * np.where(middle > 5.0, DEAR, 1.0)).sum())


@pytest.mark.parametrize("name", WEIGHING)
def test_a_way_into_dear_ground_bends_as_light_does(name: str) -> None:
    weighed, short = (run_episode(name, HALVES, terrain=terrain) for terrain in (True, False))
    assert weighed.outcome == short.outcome == "success"
    straight = math.hypot(5.0, 5.0) + DEAR * math.hypot(5.0, 5.0)
    rest = DEAR * weighed.goal_distance, DEAR * short.goal_distance
    assert cost_on_halves(short.path[:, :2]) + rest[1] == pytest.approx(straight, rel=0.01)
    # Eight directions cost at most 8.3 % more than all, and drawing straight never makes a way dearer.
    most = 1.02 if name == "theta_star" else 1.083
    assert 0.995 * least_cost() <= cost_on_halves(weighed.path[:, :2]) + rest[0] <= most * least_cost()
    assert len(weighed.modes) < len(short.modes)  # dear ground is slow: it arrives sooner


@pytest.mark.parametrize("name", WEIGHING)
def test_round_the_bog_is_faster_than_through_it(name: str) -> None:
    weighed, short = (run_episode(name, "terrain", terrain=terrain) for terrain in (True, False))
    assert weighed.outcome == short.outcome == "success"
    assert len(weighed.modes) < len(short.modes) and weighed.full_length > short.full_length


def test_who_cannot_weigh_the_ground_says_so() -> None:
    env = Simulation("terrain")
    for name in ("bfs", "d_star", "bidirectional_a_star", "rrt_star", "visibility_graph", "d2t_eaco"):
        with pytest.raises(ValueError, match=f"policy '{name}' has no parameter 'terrain'"):
            make_policy(name, env, terrain=True)
    with pytest.raises(ValueError, match="terrain=True needs known=True"):
        make_policy("d_star_lite", env, known=False, terrain=True)
