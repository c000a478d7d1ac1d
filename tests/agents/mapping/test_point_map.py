"""The map of remembered points: its ways against exact ones, what it forgets, terrain."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import minimize_scalar
from scipy.spatial import cKDTree

from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.mapping.way import Way
from bug_gym.shortest_path import shortest_path

F64 = NDArray[np.float64]

CELL, CLEARANCE = 0.1, 0.25
HALF_DIAGONAL = CELL / math.sqrt(2.0)
BEAMS = np.linspace(0.0, 2.0 * math.pi, 180, endpoint=False)


def empty_map(*, span: float = 8.0, clearance: float = CLEARANCE, is_weighted: bool = False) -> PointMap:
    return PointMap((0.0, 0.0), span, CELL, clearance, Search(), is_weighted=is_weighted)


def remember(grid: PointMap, points: F64, position: tuple[float, float] = (0.0, 0.0)) -> int:
    """Show points (k, 2) to an empty map as one scan; how many came new."""
    away = points - np.array(position)
    angles, ranges = np.arctan2(away[:, 1], away[:, 0]), np.hypot(*away.T)
    order = np.argsort(angles)
    reach = float(ranges.max()) + 1e-6
    return grid.add_scan(position, 0.0, angles[order], ranges[order], reach, 0.0, np.ones(len(points), dtype=np.bool_))


def round_discs(discs: F64, spacing: float = 0.04) -> F64:
    """Points (k, 2) along the rims of discs (n, 3)."""
    rims = []
    for x, y, radius in discs:
        turn = np.arange(0.0, 2.0 * math.pi, spacing / radius)
        rims.append(np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)]))
    return np.concatenate(rims)


def wall(x: float, low: float, high: float) -> F64:
    """Points (k, 2) of a wall along y."""
    y = np.arange(low, high, 0.04)
    return np.column_stack([np.full(len(y), x), y])


def random_field(seed: int, count: int = 25) -> PointMap:
    """A map of discs in [-5, 5] x [-5, 5] with the ends (-6, -6) and (6, 6) clear."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-5.0, 5.0, (count, 2)), rng.uniform(0.2, 0.9, count)])
    grid = empty_map()
    remember(grid, round_discs(discs))
    return grid


def cost(way: Way | None) -> float:
    return math.inf if way is None else float(way.rest[0])


def exact_length(grid: PointMap, start: tuple[float, float], goal: tuple[float, float], clearance: float) -> float:
    """The shortest path that keeps a clearance from the remembered points."""
    points = grid.points()
    border = [[-20, -20], [20, -20], [20, 20], [-20, 20]]
    discs = np.column_stack([points, np.zeros(len(points))])
    return shortest_path(discs, [], border, start, goal, radius=clearance).length


def cell_centres(grid: PointMap) -> tuple[F64, F64]:
    """x and y (rows, columns) of the cells' centres."""
    cells = grid.cells
    rows, columns = cells.holds.shape
    x, y = cells.x + (np.arange(columns) + 0.5) * cells.size, cells.y + (np.arange(rows) + 0.5) * cells.size
    return np.meshgrid(x, y)


def near_points(grid: PointMap) -> NDArray[np.int64]:
    """How many remembered points are nearer to each cell's centre than the clearance, by a tree of them."""
    x, y = cell_centres(grid)
    near = cKDTree(grid.points()).query_ball_point(np.stack([x, y], axis=-1), grid.cells.clearance, return_length=True)
    return np.asarray(near, dtype=np.int64)


def check_counts(grid: PointMap) -> None:
    """The counts of cells and blocks are those of the remembered points."""
    expected = near_points(grid)
    np.testing.assert_array_equal(grid.cells.blocked, expected)
    rows, columns = expected.shape
    blocks = (expected > 0).reshape(rows // 8, 8, columns // 8, 8).sum(axis=(1, 3))
    np.testing.assert_array_equal(grid.cells.blocked_in_block, blocks)
    held = (grid.cells.holds > 0).reshape(rows // 8, 8, columns // 8, 8).sum(axis=(1, 3))
    np.testing.assert_array_equal(grid.cells.points_in_block, held)


def sorted_rows(points: F64) -> F64:
    result: F64 = points[np.lexsort(points.T)]
    return result


# ------------------------------------------------------------------------------------------------------------- ways


@pytest.mark.parametrize("seed", range(12))
def test_a_way_is_hardly_longer_than_the_shortest_and_never_cuts_corners(seed: int) -> None:
    grid, start, goal = random_field(seed), (-6.0, -6.0), (6.0, 6.0)
    found = cost(grid.find_way(start, goal, 0.05))
    assert found >= exact_length(grid, start, goal, CLEARANCE - HALF_DIAGONAL) - 1e-9
    # Where cells are open as far as the neighbours of the exact way, the grid bends it a little.
    assert found <= 1.02 * exact_length(grid, start, goal, CLEARANCE + 2.0 * HALF_DIAGONAL)


def test_in_the_mean_a_way_is_within_two_percent_of_the_shortest() -> None:
    shares = []
    for seed in range(8):
        grid, start, goal = random_field(seed), (-6.0, -6.0), (6.0, 6.0)
        exact = exact_length(grid, start, goal, CLEARANCE)
        if math.isfinite(exact):
            shares.append(cost(grid.find_way(start, goal, 0.05)) / exact)
    assert len(shares) >= 5 and float(np.mean(shares)) <= 1.02


@pytest.mark.parametrize("seed", range(6))
def test_every_place_of_a_way_keeps_the_clearance_up_to_half_a_diagonal(seed: int) -> None:
    grid = random_field(seed)
    way = grid.find_way((-6.0, -6.0), (6.0, 6.0), 0.05)
    assert way is not None
    along = np.linspace(0.0, 1.0, 200)[:, None]
    places = np.concatenate([a + along * (b - a) for a, b in zip(way.places, way.places[1:], strict=False)])
    points = grid.points()
    gaps = [np.hypot(*(points - place).T).min() for place in places]
    assert min(gaps) >= CLEARANCE - HALF_DIAGONAL - 1e-6


def test_what_is_left_to_go_is_the_length_of_the_way() -> None:
    way = random_field(3).find_way((-6.0, -6.0), (6.0, 6.0), 0.05)
    assert way is not None and len(way.places) > 2
    lengths = np.hypot(*np.diff(way.places, axis=0).T)
    np.testing.assert_allclose(way.rest, [*np.cumsum(lengths[::-1])[::-1], 0.0], atol=1e-9)


def test_where_nothing_is_remembered_the_way_is_straight() -> None:
    way = empty_map().find_way((-3.0, 1.0), (25.0, -4.0), 0.1)
    assert way is not None
    np.testing.assert_array_equal(way.places, [[-3.0, 1.0], [25.0, -4.0]])
    assert cost(way) == pytest.approx(math.hypot(28.0, 5.0))


def random_ring(seed: int) -> PointMap:
    """A map of a ragged ring about the origin, open or closed by chance."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0.0, 2.0 * math.pi, 150)
    away = rng.uniform(2.0, 2.4, 150)
    grid = empty_map()
    remember(grid, np.column_stack([away * np.cos(turn), away * np.sin(turn)]))
    return grid


@pytest.mark.parametrize("seed", range(40))
def test_there_is_no_way_only_where_a_flood_does_not_arrive(seed: int) -> None:
    grid = random_ring(seed)
    labels, _ = ndimage.label(near_points(grid) == 0, structure=np.ones((3, 3)))
    inside, outside = (labels[int((0.0 - grid.cells.y) / CELL), int((x - grid.cells.x) / CELL)] for x in (0.0, 6.0))
    assert inside > 0 and outside > 0
    assert (grid.find_way((0.0, 0.0), (6.0, 0.0), 0.05) is not None) == (inside == outside)


def test_the_random_rings_are_neither_all_open_nor_all_closed() -> None:
    """Guards the test above."""
    ways = [random_ring(seed).find_way((0.0, 0.0), (6.0, 0.0), 0.05) for seed in range(40)]
    assert 8 <= sum(way is None for way in ways) <= 32


def test_a_start_nearer_to_a_wall_than_the_clearance_gets_out() -> None:
    grid = empty_map()
    remember(grid, wall(0.15, -3.0, 3.0))
    way = grid.find_way((0.0, 0.0), (-4.0, 0.0), 0.05)
    assert cost(way) == pytest.approx(4.0)


@pytest.mark.parametrize("clearance", [0.25, 0.4, 0.8])
@pytest.mark.parametrize("gap", [0.22, 0.3])
def test_a_start_near_a_thin_wall_does_not_get_out_through_it(clearance: float, gap: float) -> None:
    grid = empty_map(clearance=clearance)
    remember(grid, wall(gap, -3.0, 3.0))
    found = cost(grid.find_way((0.0, 0.0), (4.0, 0.0), 0.05))
    # Round an end of the wall, at the clearance less half a diagonal.
    assert found >= math.hypot(gap, 2.95) + math.hypot(4.0 - gap, 2.95)
    assert math.isfinite(found)


@pytest.mark.parametrize(("goal_radius", "is_found"), [(0.3, True), (0.05, False)])
def test_near_a_wall_the_goal_is_found_within_its_radius_alone(goal_radius: float, is_found: bool) -> None:
    grid = empty_map()
    remember(grid, wall(2.1, -3.0, 3.0))
    assert (grid.find_way((-2.0, 0.0), (2.0, 0.0), goal_radius) is not None) == is_found


def test_a_straight_way_is_open_where_all_its_cells_are() -> None:
    grid = random_field(5)
    blocked = near_points(grid) > 0
    rng = np.random.default_rng(0)
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    disagreements = 0
    for a, b in zip(rng.uniform(-6.0, 6.0, (200, 2)), rng.uniform(-6.0, 6.0, (200, 2)), strict=True):
        places = a + share * (b - a)
        columns, rows = ((places - [grid.cells.x, grid.cells.y]) / CELL).astype(int).T
        if blocked[rows[0], columns[0]]:
            continue  # it leads out of a blocked cell, see above
        disagreements += grid.is_open(tuple(a), tuple(b)) == blocked[rows, columns].any()
    assert disagreements <= 1  # samples may step over a corner of a cell


@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
@pytest.mark.parametrize("cuts", [True, False])
def test_where_a_way_is_gone_on_the_rest_is_what_is_left_from_there(share: float, cuts: bool) -> None:
    grid = empty_map()
    remember(grid, np.column_stack([np.full(81, 1.0), np.arange(-2.0, 2.01, 0.05)]))
    way = grid.find_way((-3.0, 0.1), (5.0, 0.1), 0.1)
    assert way is not None and len(way.places) > 2
    way.places = np.insert(way.places, 1, 0.5 * (way.places[0] + way.places[1]), axis=0)
    way.rest = np.insert(way.rest, 1, 0.5 * (way.rest[0] + way.rest[1]))
    place = way.places[0] + share * (way.places[2] - way.places[0])
    grid.pass_nodes(way, tuple(place.tolist()), 0.01, cuts=cuts)
    np.testing.assert_array_equal(way.places[0], place)
    left = np.hypot(*np.diff(way.places, axis=0).T)
    np.testing.assert_allclose(way.rest, np.append(np.cumsum(left[::-1])[::-1], 0.0))
    assert not cuts or grid.is_way_open(way, 0.1)
    rest = float(grid.rest_distances(place[None], way)[0])
    assert math.dist(place, way.places[-1]) <= rest <= way.rest[0] + 1e-9


@pytest.mark.parametrize("tilt", [0.0, 1e-17, -1e-17, 1e-16, -1e-16, 1e-13, -1e-13, 1e-9, -1e-9])
@pytest.mark.parametrize("along_x", [True, False])
def test_looking_along_a_line_of_cells_takes_no_longer_than_across(tilt: float, along_x: bool) -> None:
    grid = empty_map()
    remember(grid, np.column_stack([np.arange(-6.0, 6.0, 0.05), np.full(240, 0.4)]))
    ends = [((0.0, 0.0), (6.0, tilt)), ((6.0, tilt), (0.0, 0.0)), ((0.3, -0.3), (5.0, 3.0))]
    if not along_x:
        ends = [((a[1], a[0]), (b[1], b[0])) for a, b in ends]
    assert grid.is_open((0.0, -3.0), (6.0, -3.0))  # compiled
    times = []
    for a, b in ends:
        begin = time.perf_counter()
        for _ in range(50):
            grid.is_open(a, b)
        times.append(time.perf_counter() - begin)
    # A way in steps of rounding errors took a thousand times as long.
    assert max(times[:2]) < 50.0 * times[2] + 0.05


def test_rest_distances_are_those_by_the_best_place_in_sight() -> None:
    grid = random_field(7)
    way = grid.find_way((-6.0, -6.0), (6.0, 6.0), 0.05)
    assert way is not None
    places = np.random.default_rng(1).uniform(-5.0, 5.0, (100, 2))
    blocked = near_points(grid) > 0
    columns, rows = ((places - [grid.cells.x, grid.cells.y]) / CELL).astype(int).T
    places = places[~blocked[rows, columns]]
    expected = [
        min(
            math.dist(p, q) + rest if grid.is_open(tuple(p), tuple(q), CELL) else math.inf
            for q, rest in zip(way.places, way.rest, strict=True)
        )
        for p in places
    ]
    np.testing.assert_allclose(grid.rest_distances(places, way), expected)


# ------------------------------------------------------------------------------------------- remembering, forgetting


def test_a_map_remembers_the_points_where_they_are() -> None:
    points = round_discs(np.array([[1.013, 0.526, 0.71], [-2.037, 3.009, 0.43]]))
    grid = empty_map()
    added = remember(grid, points)
    kept = grid.points()
    assert len(kept) == added
    cells = {tuple(cell) for cell in np.floor((points - [grid.cells.x, grid.cells.y]) / CELL).astype(int).tolist()}
    assert added == len(cells)
    gaps = np.hypot(*(kept[:, None] - points[None]).transpose(2, 0, 1)).min(axis=1)
    assert gaps.max() <= CELL / 256.0
    check_counts(grid)


def test_growing_keeps_all_points_and_what_they_block() -> None:
    grid = random_field(2)
    before = sorted_rows(grid.points())
    size = grid.cells.holds.size
    for place in ((15.0, 2.0), (-5.0, -17.0)):
        grid.cover(*place, 1.0)
    assert grid.cells.holds.size > size
    np.testing.assert_allclose(sorted_rows(grid.points()), before, atol=1e-9)
    check_counts(grid)


def test_a_grown_map_finds_the_same_way() -> None:
    before = cost(random_field(4).find_way((-6.0, -6.0), (6.0, 6.0), 0.05))
    grid = random_field(4)
    grid.cover(50.0, -30.0, 3.0)
    assert cost(grid.find_way((-6.0, -6.0), (6.0, 6.0), 0.05)) == pytest.approx(before, rel=1e-3)


@pytest.mark.parametrize("clearance", [0.21, 0.5])
def test_another_clearance_is_that_of_a_map_made_with_it(clearance: float) -> None:
    grid = random_field(6)
    grid.set_clearance(clearance)
    check_counts(grid)
    fresh = empty_map(clearance=clearance)
    remember(fresh, grid.points())
    ways = [cost(each.find_way((-6.0, -6.0), (6.0, 6.0), 0.05)) for each in (grid, fresh)]
    assert ways[0] == pytest.approx(ways[1])


def test_points_in_a_disc_are_forgotten_and_no_others() -> None:
    grid = random_field(8)
    before = grid.points()
    grid.forget(1.0, -0.5, 2.0)
    left = np.hypot(before[:, 0] - 1.0, before[:, 1] + 0.5) > 2.0
    np.testing.assert_allclose(sorted_rows(grid.points()), sorted_rows(before[left]))
    check_counts(grid)


def test_when_all_is_forgotten_the_way_is_straight() -> None:
    grid = random_field(8)
    grid.forget_all()
    assert len(grid.points()) == 0
    check_counts(grid)
    assert cost(grid.find_way((-6.0, -6.0), (6.0, 6.0), 0.05)) == pytest.approx(12.0 * math.sqrt(2.0))


def look(grid: PointMap, ranges: F64, position: tuple[float, float] = (0.0, 0.0), *, noise: float = 0.0) -> None:
    """A scan of BEAMS from a place, ahead along x."""
    grid.add_scan(position, 0.0, BEAMS, ranges, 5.0, noise, np.ones(len(BEAMS), dtype=np.bool_))


def one_hit(beam: int, away: float) -> F64:
    ranges = np.full(len(BEAMS), 5.0)
    ranges[beam] = away
    return ranges


@pytest.mark.parametrize("beam", [0, 37, 90, 179])
def test_a_point_that_two_scans_pass_is_taken_away_and_one_that_one_passes_is_not(beam: int) -> None:
    grid = empty_map()
    look(grid, one_hit(beam, 2.0))
    left = []
    for _ in range(2):
        look(grid, one_hit(beam, 4.0))
        left.append(len(grid.points()))
    # What stands behind comes new; then what stood before is gone.
    assert left == [2, 1] and grid.removed == 1
    np.testing.assert_allclose(np.hypot(*grid.points().T), [4.0], atol=0.01)


@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_a_view_of_270_degrees_forgets_nothing_behind_it_nor_at_its_ends(heading: float) -> None:
    """The first and the last beam are no neighbours there: beside each there is none that could tell of a rim."""
    beams = np.radians(np.linspace(-135.0, 135.0, 181))
    inside, ends, behind = beams[[1, 30, 90, 150, 179]], beams[[0, -1]], np.radians([145.0, 165.0, 180.0, 195.0, 215.0])
    for bearings, is_forgotten in ((inside, True), (ends, False), (behind, False)):
        for bearing in bearings:
            grid, hit = empty_map(), np.array([[math.cos(heading + bearing), math.sin(heading + bearing)]])
            remember(grid, 2.0 * hit)
            for _ in range(3):
                grid.add_scan((0.0, 0.0), heading, beams, np.full(181, 5.0), 5.0, 0.0, np.ones(181, dtype=np.bool_))
            assert grid.removed == is_forgotten, math.degrees(bearing)


def test_a_point_seen_again_in_between_stays() -> None:
    grid = empty_map()
    for away in (2.0, 5.0, 2.0, 5.0, 2.0):
        look(grid, one_hit(20, away))
    assert grid.removed == 0


def test_a_point_behind_what_is_seen_stays() -> None:
    grid = empty_map()
    look(grid, one_hit(20, 4.0))
    for _ in range(5):
        look(grid, one_hit(20, 2.0))
    assert grid.removed == 0 and len(grid.points()) == 2


def test_what_moves_is_not_remembered() -> None:
    grid = empty_map()
    ranges = np.full(len(BEAMS), 2.0)
    is_still = np.arange(len(BEAMS)) >= 90
    grid.add_scan((0.0, 0.0), 0.0, BEAMS, ranges, 5.0, 0.0, is_still)
    assert len(grid.points()) > 0 and grid.points()[:, 1].max() <= CELL / 256.0


def test_a_heading_turns_what_is_seen() -> None:
    grid = empty_map()
    grid.add_scan((1.0, 2.0), 0.5 * math.pi, BEAMS, one_hit(0, 3.0), 5.0, 0.0, np.ones(180, dtype=np.bool_))
    np.testing.assert_allclose(grid.points(), [[1.0, 5.0]], atol=CELL / 256.0)


def disc_ranges(position: F64, radius: float) -> F64:
    """Ranges of BEAMS from a place outside a disc about the origin, 5 m where they miss it."""
    along = -(position[0] * np.cos(BEAMS) + position[1] * np.sin(BEAMS))
    square = radius**2 - (position @ position - along**2)
    hits = (square > 0.0) & (along > 0.0)
    return np.where(hits, np.minimum(along - np.sqrt(np.maximum(square, 0.0)), 5.0), 5.0)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("gap", [0.1, 0.7, 1.5])
def test_points_of_a_still_disc_stay_on_the_way_round_it(noise: float, gap: float) -> None:
    rng = np.random.default_rng(0)
    grid = empty_map()
    removed = []
    for turn in np.arange(0.0, 4.0 * math.pi, 0.1 / (1.0 + gap)):
        position = (1.0 + gap) * np.array([math.cos(turn), math.sin(turn)])
        ranges = disc_ranges(position, 1.0)
        ranges = np.clip(ranges + noise * rng.standard_normal(len(BEAMS)) * (ranges < 5.0), 0.0, 5.0)
        look(grid, ranges, (float(position[0]), float(position[1])), noise=noise)
        removed.append(grid.removed)
    # Noise alone may take away single points; three in one scan would look like something that moved away.
    assert np.diff(removed).max() <= 2
    assert removed[-1] == 0 if noise == 0.0 else removed[-1] <= 0.5 * len(removed)
    # And the rim stays closed: neighbours along it are hardly more than two cells apart.
    turns = np.sort(np.arctan2(*grid.points().T))
    assert np.diff(turns, append=turns[0] + 2.0 * math.pi).max() <= 2.5 * CELL


# ---------------------------------------------------------------------------------------------------------- terrain


def weighted_map(low: tuple[float, float], high: tuple[float, float], factor: float) -> PointMap:
    """A map of a rectangle of dear ground."""
    grid = empty_map(is_weighted=True)
    x, y = cell_centres(grid)
    inside = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])
    grid.cells.weight[inside] = factor
    grid.extent[:] = -5.0, -6.0, 6.0, 6.0  # as if it had been seen
    return grid


@pytest.mark.parametrize("factor", [1.5, 3.0, 10.0])
def test_across_a_slab_the_way_costs_the_distance_and_what_the_slab_adds(factor: float) -> None:
    grid = weighted_map((1.0, -99.0), (3.0, 99.0), factor)
    found = cost(grid.find_way((-4.0, 0.02), (5.0, 0.02), 0.1))
    assert found == pytest.approx(9.0 + (factor - 1.0) * 2.0, rel=0.01)


WIDTH, HALF, BEFORE, AFTER = 2.0, 1.5, 3.0, 4.0
ROUND = math.hypot(BEFORE, HALF) + WIDTH + math.hypot(AFTER, HALF)
EVEN = (ROUND - BEFORE - AFTER) / WIDTH
"""Factor at which crossing a patch costs as much as going round it."""


@pytest.mark.parametrize(("share", "is_crossed"), [(0.8, True), (0.9, True), (1.1, False), (2.0, False)])
def test_dear_ground_is_gone_round_where_that_is_cheaper(share: float, is_crossed: bool) -> None:
    grid = weighted_map((0.0, -HALF), (WIDTH, HALF), share * EVEN)
    way = grid.find_way((-BEFORE, 0.02), (WIDTH + AFTER, 0.02), 0.1)
    assert way is not None
    expected = BEFORE + share * EVEN * WIDTH + AFTER if is_crossed else ROUND
    assert cost(way) == pytest.approx(expected, rel=0.02)
    assert (np.abs(way.places[:, 1]).max() < 0.5 * HALF) == is_crossed


@pytest.mark.parametrize("factor", [1.5, 3.0])
@pytest.mark.parametrize("aside", [2.0, 5.0])
def test_at_a_straight_border_the_way_is_refracted(factor: float, aside: float) -> None:
    grid = weighted_map((0.0, -99.0), (99.0, 99.0), factor)
    best = minimize_scalar(
        lambda y: math.hypot(4.0, y) + factor * math.hypot(4.0, aside - y), bounds=(0.0, aside), method="bounded"
    ).fun
    found = cost(grid.find_way((-4.0, 0.02), (4.0, aside + 0.02), 0.1))
    assert 0.99 * best <= found <= 1.02 * best


def test_the_cost_of_a_way_is_the_integral_of_the_factor_along_it() -> None:
    grid = weighted_map((0.0, -2.0), (2.0, 2.0), 1.4)
    way = grid.find_way((-4.0, 0.5), (5.0, -1.5), 0.1)
    assert way is not None
    total = 0.0
    for a, b in zip(way.places, way.places[1:], strict=False):
        share = (np.arange(20_000)[:, None] + 0.5) / 20_000
        x, y = (a + share * (b - a)).T
        factors = np.where((x > 0.0) & (x < 2.0) & (np.abs(y) < 2.0), 1.4, 1.0)
        total += float(factors.mean()) * math.dist(a, b)
    assert cost(way) == pytest.approx(total, rel=0.01)


def test_a_uniform_factor_only_scales_the_cost() -> None:
    plain = random_field(9)
    dear = PointMap((0.0, 0.0), 8.0, CELL, CLEARANCE, Search(), is_weighted=True)
    remember(dear, plain.points())
    dear.cells.weight[:] = 2.0
    lengths = [cost(grid.find_way((-6.0, -6.0), (6.0, 6.0), 0.05)) for grid in (plain, dear)]
    assert lengths[1] == pytest.approx(2.0 * lengths[0], rel=0.02)


@pytest.mark.parametrize("heading", [0.0, 1.0])
def test_seen_terrain_is_remembered_where_it_lies(heading: float) -> None:
    grid = empty_map(is_weighted=True)
    bearings = heading + np.arange(32) * (2.0 * math.pi / 32)
    away = 0.25 * np.arange(1, 17)
    factors = np.where(1.0 + away[None, :] * np.cos(bearings)[:, None] > 1.5, 4.0, 1.0).astype(np.float32)
    grid.add_terrain((1.0, -0.5), heading, factors, 0.25)
    x, y = cell_centres(grid)
    seen = np.hypot(x - 1.0, y + 0.5) <= 4.0
    # Half the angle between two headings at 4 m, and half a ring.
    unsure = np.abs(x - 1.5) <= 4.0 * math.pi / 32.0 + 0.125
    np.testing.assert_array_equal(grid.cells.weight[seen & ~unsure], np.where(x > 1.5, 4.0, 1.0)[seen & ~unsure])
    assert (np.abs(grid.cells.weight[np.hypot(x - 1.0, y + 0.5) > 8.0]) == 1.0).all()


def test_ground_not_seen_yet_is_supposed_to_go_on_until_it_is_seen() -> None:
    grid = empty_map(is_weighted=True)
    dear, plain = np.full((32, 16), 3.0, dtype=np.float32), np.full((32, 16), 1.5, dtype=np.float32)
    grid.add_terrain((0.0, 0.0), 0.0, dear, 0.25)
    beyond = cost(grid.find_way((4.5, 0.0), (6.5, 0.0), 0.1))
    grid.add_terrain((3.0, 0.0), 0.0, plain, 0.25)
    seen = cost(grid.find_way((4.5, 0.0), (6.5, 0.0), 0.1))
    behind = cost(grid.find_way((-3.5, 0.0), (-2.0, 0.0), 0.1))
    assert (beyond, seen, behind) == pytest.approx((2.0 * 3.0, 2.0 * 1.5, 1.5 * 3.0))


def bog_about(x: float, y: float, heading: float) -> NDArray[np.float32]:
    """What a robot sees of a bog x > 2, as the field gives it: samples (32, 16) about the heading."""
    bearings = heading + np.arange(32) * (2.0 * math.pi / 32)
    away = 0.25 * np.arange(1, 17)
    return np.where(x + away[None, :] * np.cos(bearings)[:, None] > 2.0, 4.0, 1.0).astype(np.float32)


def test_turning_on_the_spot_revises_nothing() -> None:
    grid = empty_map(is_weighted=True)
    grid.add_terrain((0.0, 0.0), 0.0, bog_about(0.0, 0.0, 0.0), 0.25)
    weight, revised = grid.cells.weight.copy(), grid.revised
    assert revised > 0
    for heading in np.linspace(0.05, 6.0, 40):
        grid.add_terrain((0.0, 0.0), float(heading), bog_about(0.0, 0.0, float(heading)), 0.25)
    np.testing.assert_array_equal(grid.cells.weight, weight)
    assert grid.revised == revised


def test_a_look_from_nearer_counts() -> None:
    grid = empty_map(is_weighted=True)
    for x in np.arange(0.0, 2.0, 0.1):
        grid.add_terrain((float(x), 0.0), 0.0, bog_about(float(x), 0.0, 0.0), 0.25)
    x, y = cell_centres(grid)
    near = np.hypot(x - 1.9, y) <= 1.0
    # Half a ring, and what nearer by less than one doesn't correct.
    unsure = np.abs(x - 2.0) <= 0.25 + CELL
    np.testing.assert_array_equal(grid.cells.weight[near & ~unsure], np.where(x > 2.0, 4.0, 1.0)[near & ~unsure])


def test_growing_keeps_the_terrain() -> None:
    grid = weighted_map((1.0, -99.0), (3.0, 5.0), 3.0)
    before = cost(grid.find_way((-4.0, 0.02), (5.0, 0.02), 0.1))
    grid.cover(-30.0, 40.0, 3.0)
    assert cost(grid.find_way((-4.0, 0.02), (5.0, 0.02), 0.1)) == pytest.approx(before, rel=0.002)


def test_a_barred_cell_is_blocked_until_the_clearance_is_set_or_all_is_forgotten() -> None:
    for undo in (lambda grid: grid.set_clearance(CLEARANCE), PointMap.forget_all):
        grid = random_field(3)
        before = grid.cells.blocked.copy()
        rows, columns = np.nonzero(before == 0)
        for row, column in zip(rows[::97].tolist(), columns[::97].tolist(), strict=True):
            place = grid.cells.x + (column + 0.5) * CELL, grid.cells.y + (row + 0.5) * CELL
            grid.bar(place)
            grid.bar(place)  # no more than once
            assert grid.is_blocked(place)
        for beside in ((1e3, 0.0), (-1e3, 0.0), (0.0, 1e3), (0.0, -1e3)):
            grid.bar(beside)
        blocked = grid.cells.blocked > 0
        assert int(blocked.sum()) == int((before > 0).sum()) + len(rows[::97])
        assert grid.cells.blocked_in_block.sum() == blocked.sum()
        undo(grid)
        assert not grid.is_blocked(place) and grid.cells.blocked_in_block.sum() == (grid.cells.blocked > 0).sum()
