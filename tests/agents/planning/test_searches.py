"""The searches over grids: all agree with a slow plain one, and what repairs agrees with what begins anew."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from compiled import for_python
from numpy.typing import NDArray

from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.bfs import bfs
from bug_gym.agents.planning.bidirectional_a_star import bidirectional_a_star
from bug_gym.agents.planning.d_star import DStar
from bug_gym.agents.planning.d_star_lite import DStarLite
from bug_gym.agents.planning.dijkstra import dijkstra, distances
from bug_gym.agents.planning.grid import DIAGONAL, FAR, STRAIGHT, Grid, grid_of, make_grid, relink_nodes
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.open_list import open_list
from bug_gym.agents.planning.search import MANHATTAN, Found, cost_of_way
from bug_gym.agents.planning.theta_star import in_sight, search_any_angle, theta_star
from bug_gym.config import load, scenario_names
from bug_gym.simulation import Simulation

sees = for_python(in_sight)

SHORTEST: dict[str, Callable[[Grid, int, int], Found]] = {
    "dijkstra": dijkstra,
    "a_star": a_star,
    "bidirectional_a_star": bidirectional_a_star,
    "d_star": lambda grid, start, goal: DStar(grid, goal).find(start),
    "d_star_lite": lambda grid, start, goal: DStarLite(grid, goal).find(start),
}


def random_cells(seed: int, rows: int = 24, columns: int = 31, share: float = 0.3) -> NDArray[np.uint8]:
    """Cells of which a share is blocked."""
    return (np.random.default_rng(seed).random((rows, columns)) < share).astype(np.uint8)


def node(grid: Grid, row: int, column: int) -> int:
    """Number of a cell of what the grid was made of, without its rim."""
    return (row + 1) * grid.lattice.columns + column + 1


def some_ends(grid: Grid, seed: int, count: int) -> list[tuple[int, int]]:
    """Pairs of free cells."""
    free = np.flatnonzero(grid.blocked.ravel() == 0)
    pairs = np.random.default_rng(seed).choice(free, size=(count, 2))
    return [(int(a), int(b)) for a, b in pairs]


def slow_distances(cells: NDArray[np.uint8], start: tuple[int, int], *, connectivity: int, cut: bool) -> dict[Any, int]:
    """Costs of all cells from one, by Dijkstra in plain Python over cells without a rim."""

    def free(row: int, column: int) -> bool:
        return 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1] and not cells[row, column]

    cost, queue = {start: 0}, [(0, start)]
    while queue:
        so_far, (row, column) = heapq.heappop(queue)
        if so_far > cost[row, column]:
            continue
        for down, across in itertools.product((-1, 0, 1), repeat=2):
            if (down == across == 0) or not free(row + down, column + across):
                continue
            beside = free(row + down, column), free(row, column + across)
            if down and across and (connectivity == 4 or not (any(beside) if cut else all(beside))):
                continue
            other = row + down, column + across
            total = so_far + (DIAGONAL if down and across else STRAIGHT)
            if total < cost.get(other, FAR):
                cost[other] = total
                heapq.heappush(queue, (total, other))
    return cost


KINDS = [(8, False), (8, True), (4, False)]


@pytest.mark.parametrize(("connectivity", "cut"), KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_distances_are_those_of_a_slow_search(connectivity: int, cut: bool, seed: int) -> None:
    cells = random_cells(seed)
    cells[5, 7] = 0
    grid = make_grid(cells, connectivity=connectivity, cut_corners=cut)
    expected = slow_distances(cells, (5, 7), connectivity=connectivity, cut=cut)
    found = distances(grid, node(grid, 5, 7)).reshape(grid.blocked.shape)[1:-1, 1:-1]
    for row, column in np.ndindex(*cells.shape):
        assert found[row, column] == expected.get((row, column), FAR)


@pytest.mark.parametrize("name", SHORTEST)
@pytest.mark.parametrize(("connectivity", "cut"), KINDS)
def test_every_exact_search_finds_a_way_of_the_least_cost(name: str, connectivity: int, cut: bool) -> None:
    for seed in range(8):
        grid = make_grid(random_cells(seed, share=0.05 * seed), connectivity=connectivity, cut_corners=cut)
        for start, goal in some_ends(grid, seed, 12):
            found = SHORTEST[name](grid, start, goal)
            assert found.cost == distances(grid, start)[goal]
            if found.cost == FAR:
                assert len(found.nodes) == 0 and math.isinf(found.length)
                continue
            assert (found.nodes[0], found.nodes[-1]) == (start, goal)
            assert cost_of_way(found.nodes, grid.lattice.columns) == found.cost
            assert is_way(grid, found)


@pytest.mark.parametrize("name", scenario_names())
def test_exact_searches_are_equally_long_in_every_scenarios_map(name: str) -> None:
    simulation = Simulation(load(name))
    simulation.reset(seeds=[1])
    live = Maps(simulation).of_robot(0)
    grid = grid_of(live.still, 0.2, simulation.scenario.robot.reach)
    start, goal = (grid.free_node_near(place, 2.0) for place in (live.pose[:2], live.goal))
    assert min(start, goal) >= 0
    assert len({search(grid, start, goal).cost for search in SHORTEST.values()}) == 1


def is_way(grid: Grid, found: Found) -> bool:
    """Whether each step of a way is open."""
    columns = grid.lattice.columns
    order = [1, columns + 1, columns, columns - 1, -1, -columns - 1, -columns, 1 - columns]
    return all(grid.links[a] >> order.index(int(b - a)) & 1 for a, b in itertools.pairwise(found.nodes.tolist()))


@pytest.mark.parametrize(("connectivity", "cut"), KINDS)
def test_bfs_takes_the_fewest_steps(connectivity: int, cut: bool) -> None:
    for seed in range(8):
        grid = make_grid(random_cells(seed, share=0.25), connectivity=connectivity, cut_corners=cut)
        for start, goal in some_ends(grid, seed, 12):
            found = bfs(grid, start, goal)
            shortest = distances(grid, start)[goal]
            assert (found.cost == FAR) == (shortest == FAR)
            if found.cost == FAR:
                continue
            assert is_way(grid, found) and found.cost >= shortest
            if connectivity == 4:
                assert found.cost == shortest
            # No way of fewer steps: rings about the start by plain flooding.
            rings, seen = {start}, {start}
            columns = grid.lattice.columns
            order = [1, columns + 1, columns, columns - 1, -1, -columns - 1, -columns, 1 - columns]
            steps = 0
            while goal not in rings:
                rings = {one + order[k] for one in rings for k in range(8) if grid.links[one] >> k & 1} - seen
                seen |= rings
                steps += 1
            assert len(found.nodes) - 1 == steps


def test_a_star_expands_no_more_than_dijkstra_and_bidirectional_fewer_in_the_open() -> None:
    grid = make_grid(np.zeros((60, 60), dtype=np.uint8))
    start, goal = node(grid, 5, 5), node(grid, 50, 55)
    by = {name: SHORTEST[name](grid, start, goal).expanded for name in SHORTEST}
    assert by["a_star"] <= 60 < by["dijkstra"] / 20
    for seed in range(5):
        grid = make_grid(random_cells(seed))
        for start, goal in some_ends(grid, seed, 8):
            assert a_star(grid, start, goal).expanded <= dijkstra(grid, start, goal).expanded


def left_in_the_open(grid: Grid, end: int) -> NDArray[np.int64]:
    """What the way from each cell (n,) to an end costs where nothing is blocked."""
    rows, columns = np.divmod(np.arange(grid.blocked.size), grid.lattice.columns)
    down, across = np.abs(rows - rows[end]), np.abs(columns - columns[end])
    diagonal = np.minimum(down, across) if grid.connectivity == 8 else 0
    left: NDArray[np.int64] = STRAIGHT * (down + across - 2 * diagonal) + DIAGONAL * diagonal
    return left


@pytest.mark.parametrize(("connectivity", "cut"), KINDS)
def test_who_has_a_bound_expands_no_cell_through_which_a_way_must_be_longer(connectivity: int, cut: bool) -> None:
    """By the bound that is the distance in the open: octile with eight neighbours, straight steps alone with four."""
    for seed in range(4):
        grid = make_grid(random_cells(seed, share=0.06 * seed), connectivity=connectivity, cut_corners=cut)
        for start, goal in some_ends(grid, seed, 8):
            for search, begin, end in ((a_star, start, goal), (SHORTEST["d_star_lite"], goal, start)):
                left = left_in_the_open(grid, end)
                so_far, found = distances(grid, begin), search(grid, start, goal)
                assert found.expanded <= ((so_far < FAR) & (so_far + left <= found.cost)).sum()


def test_from_both_ends_fewer_cells_are_expanded_than_from_one_and_none_that_neither_would() -> None:
    both = one = 0
    for seed in range(5):
        grid = make_grid(random_cells(seed, 60, 80, 0.2))
        for start, goal in some_ends(grid, seed, 8):
            found = bidirectional_a_star(grid, start, goal)
            ways = [(distances(grid, a), left_in_the_open(grid, b)) for a, b in ((start, goal), (goal, start))]
            reach = [(so_far < FAR) & (so_far + left <= found.cost) for so_far, left in ways]
            assert found.expanded <= (reach[0] | reach[1]).sum()
            both, one = both + found.expanded, one + a_star(grid, start, goal).expanded
    assert both < 0.95 * one


def test_from_both_ends_it_is_soon_known_that_one_is_shut_in() -> None:
    """The side with fewer open cells comes first, whichever it is: the wide field outside is hardly looked at."""
    cells = np.zeros((60, 60), dtype=np.uint8)
    cells[8:13, 8:13] = 1
    cells[9:12, 9:12] = 0
    grid = make_grid(cells)
    inside, outside = node(grid, 10, 10), node(grid, 40, 45)
    for ends in ((inside, outside), (outside, inside)):
        found = bidirectional_a_star(grid, *ends)
        assert found.cost == FAR and found.expanded <= 2 * 9
    assert a_star(grid, outside, inside).expanded > 3000


def test_a_guess_that_says_too_much_may_make_a_star_longer_than_bfs() -> None:
    longer = 0
    for seed in range(30):
        grid = make_grid(random_cells(seed, 40, 40, 0.2))
        for start, goal in some_ends(grid, seed, 4):
            guessed, steps = a_star(grid, start, goal, guess=MANHATTAN), bfs(grid, start, goal)
            assert guessed.cost >= a_star(grid, start, goal).cost
            longer += FAR > guessed.cost > steps.cost
    assert longer > 0


def test_in_the_open_costs_are_octile() -> None:
    grid = make_grid(np.zeros((30, 30), dtype=np.uint8))
    for down, across in [(0, 0), (0, 7), (9, 9), (4, 20), (25, 3)]:
        found = a_star(grid, node(grid, 2, 4), node(grid, 2 + down, 4 + across))
        straight, diagonal = abs(down - across), min(down, across)
        assert found.cost == straight * STRAIGHT + diagonal * DIAGONAL
        assert found.length == pytest.approx(straight + diagonal * math.sqrt(2.0), abs=1e-8)


@pytest.mark.parametrize("kind", [DStar, DStarLite])
@pytest.mark.parametrize("seed", range(2))
def test_a_repaired_search_equals_one_begun_anew_after_each_change_and_expands_less(kind: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = random_cells(seed, 40, 50, 0.25)
    cells[1, 1] = cells[-2, -2] = 0
    grid = make_grid(cells)
    start, goal = node(grid, 1, 1), node(grid, 38, 48)
    search = kind(grid, goal)
    search.find(start)
    anew = repaired = ways = 0
    for number in range(CHANGES):
        row, column = (int(value) for value in rng.integers((40, 50)))
        cell = node(grid, row, column)
        if cell in (start, goal):
            continue
        cells[row, column] ^= 1
        grid = make_grid(cells)
        search.grid = grid
        search.change(np.array([cell], dtype=np.int32))
        if number % 10 == 9:  # the robot has gone on
            free = np.flatnonzero(distances(grid, goal) < FAR)
            start = int(rng.choice(free))
        found, expected = search.find(start), a_star(grid, start, goal)
        assert found.cost == expected.cost
        if found.cost < FAR:
            ways += 1
            assert is_way(grid, found) and cost_of_way(found.nodes, grid.lattice.columns) == found.cost
        anew, repaired = anew + expected.expanded, repaired + found.expanded
    assert ways > CHANGES / 2
    assert repaired < anew


CHANGES = 1000
"""Cells that are changed one after the other."""


def test_a_repair_among_a_million_cells_is_as_long_as_a_search_from_scratch() -> None:
    """Of random cells, ten of which change at a time; docs/compare_planners.py says how long that takes."""
    rng = np.random.default_rng(0)
    grid = make_grid(random_cells(0, 1000, 1000, 0.3))
    start, goal = far_apart(grid)
    search = DStarLite(grid, goal)
    assert search.find(start).cost == a_star(grid, start, goal).cost
    for _ in range(8):
        nodes = rng.integers(1, 1001, (10, 2)) @ (grid.lattice.columns, 1)
        nodes = np.unique(nodes[(nodes != start) & (nodes != goal)]).astype(np.int32)
        grid.blocked.ravel()[nodes] ^= 1
        relink_nodes(grid, nodes)
        search.change(nodes)
        assert search.find(start).cost == a_star(grid, start, goal).cost < FAR


def far_apart(grid: Grid) -> tuple[int, int]:
    """Two cells near opposite corners that a way joins."""
    for start in np.flatnonzero(grid.blocked.ravel() == 0).tolist():
        reached = np.flatnonzero(distances(grid, start) < FAR)
        if len(reached) > 0.3 * grid.blocked.size:
            return start, int(reached[-1])
    raise ValueError("no way across")


@pytest.mark.parametrize("seed", range(6))
def test_theta_star_lies_between_the_straight_line_and_a_star(seed: int) -> None:
    grid = make_grid(random_cells(seed, share=0.2))
    for start, goal in some_ends(grid, seed, 20):
        found, cells = theta_star(grid, start, goal), a_star(grid, start, goal)
        assert (found.cost == FAR) == (cells.cost == FAR)
        if found.cost == FAR:
            continue
        places = grid.lattice.places(found.nodes)
        length = float(np.hypot(*np.diff(places, axis=0).T).sum())
        assert found.length == pytest.approx(length, abs=1e-6)
        # Each step that A* takes it may take too, and what it takes in its place is straighter.
        assert math.dist(places[0], places[-1]) - 1e-6 <= length <= cells.length + 1e-6
        # A straight line touches cells side by side, whose straight steps are at most sqrt(2) times as long.
        assert cells.length <= math.sqrt(2.0) * length + 1e-6
        for a, b in itertools.pairwise(places):
            assert is_clear_of_squares(grid, a, b)


def is_clear_of_squares(grid: Grid, a: Any, b: Any) -> bool:
    """Whether many points of a straight line lie in free cells, tried a little to both sides."""
    normal = np.array([a[1] - b[1], b[0] - a[0]]) / max(math.dist(a, b), 1e-12)
    for share in np.linspace(0.0, 1.0, 200):
        for side in (-1e-9, 1e-9):
            place = a + share * (b - a) + side * normal
            if not grid.is_free(grid.lattice.node_at((float(place[0]), float(place[1])))):
                return False
    return True


@pytest.mark.parametrize("seed", range(4))
def test_in_sight_is_what_touches_no_blocked_cell_be_it_in_a_corner(seed: int) -> None:
    """Of all pairs of free cells, by the squares that the straight line meets, their rims with them."""
    blocked = np.pad(random_cells(seed, 7, 9, 0.15 + 0.05 * seed), 1, constant_values=1)
    free = np.argwhere(blocked == 0)
    squares = shapely.union_all([shapely.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5) for y, x in np.argwhere(blocked)])
    shapely.prepare(squares)
    columns, through_corners = blocked.shape[1], 0
    for one, other in itertools.combinations(free.tolist(), 2):
        line = shapely.LineString([one[::-1], other[::-1]])
        expected = not shapely.intersects(squares, line)
        nodes = [row * columns + column for row, column in (one, other)]
        assert sees(blocked, columns, *nodes) == sees(blocked, columns, *reversed(nodes)) == expected
        through_corners += not expected and shapely.intersection(squares, line).length == 0.0
    assert through_corners > 5


def test_where_cells_beside_them_stop_diagonal_steps_a_star_goes_a_third_farther_than_straight() -> None:
    grid = make_grid(np.array([[0, 0, 1], [1, 0, 0]], dtype=np.uint8))
    ends = node(grid, 0, 0), node(grid, 1, 2)
    a, b = grid.lattice.places(np.array(ends))
    assert is_clear_of_squares(grid, a, b) and math.dist(a, b) == pytest.approx(math.sqrt(5.0))
    assert a_star(grid, *ends).length == pytest.approx(3.0)
    # With corners cut the way is the one in the open again.
    cut = make_grid(np.array([[0, 0, 1], [1, 0, 0]], dtype=np.uint8), cut_corners=True)
    assert a_star(cut, *ends).length == pytest.approx(1.0 + math.sqrt(2.0))


def test_in_the_open_theta_star_goes_straight() -> None:
    grid = make_grid(np.zeros((30, 30), dtype=np.uint8))
    found = theta_star(grid, node(grid, 2, 4), node(grid, 20, 29))
    assert found.nodes.tolist() == [node(grid, 2, 4), node(grid, 20, 29)]
    assert found.expanded <= 2 * 25  # it takes 25 steps to the goal, and what leads elsewhere is longer


@pytest.mark.parametrize("seed", range(6))
def test_theta_star_leaves_no_cell_that_one_whose_turn_has_been_knows_a_shorter_way_to(seed: int) -> None:
    """Straight from where its own way begins, if that is in sight, else through itself; to cells that were done, too."""
    grid = make_grid(random_cells(seed, share=0.25))
    columns, (start, goal) = grid.lattice.columns, far_apart(grid)
    cost, parent = np.full(grid.blocked.size, FAR, dtype=np.int64), np.full(grid.blocked.size, -1, dtype=np.int32)
    heap = open_list(grid.blocked.size)
    search_any_angle(grid.blocked, grid.links, None, columns, start, goal, cost, parent, heap)
    places = np.stack(np.divmod(np.arange(grid.blocked.size), columns), axis=1)
    offsets = [1, columns + 1, columns, columns - 1, -1, -columns - 1, -columns, 1 - columns]
    done = np.flatnonzero((cost < FAR) & (heap.place == 0))
    assert len(done) > 50
    for one in done.tolist():
        for other in (one + offset for step, offset in enumerate(offsets) if grid.links[one] >> step & 1):
            through = int(parent[one]) if sees(grid.blocked, columns, int(parent[one]), other) else one
            assert cost[other] <= cost[through] + STRAIGHT * math.dist(places[through], places[other]) + 1


@pytest.mark.parametrize("name", [*SHORTEST, "bfs", "theta_star"])
def test_a_blocked_start_or_goal_is_refused(name: str) -> None:
    search = {**SHORTEST, "bfs": bfs, "theta_star": theta_star}[name]
    cells = np.zeros((5, 5), dtype=np.uint8)
    cells[2, 2] = 1
    grid = make_grid(cells)
    with pytest.raises(ValueError, match=r"the start \(2, 2\) lies in an obstacle"):
        search(grid, node(grid, 2, 2), node(grid, 0, 0))
    with pytest.raises(ValueError, match=r"the goal \(2, 2\) lies in an obstacle"):
        search(grid, node(grid, 0, 0), node(grid, 2, 2))
    with pytest.raises(ValueError, match="the goal is cell 900, expected one from 0 to 48"):
        search(grid, node(grid, 0, 0), 900)
