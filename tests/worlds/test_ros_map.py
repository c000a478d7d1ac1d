"""Maps of ROS's map_server: cells, outlines, worlds and scans against pictures that the tests draw, and bad files."""

import math
import re
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from ros_maps import picture_of, write_map, write_pgm, write_yaml

from bug_gym.checks import install_command
from bug_gym.config import ScenarioError, load
from bug_gym.evaluation import evaluate
from bug_gym.scenarios import draw_layout
from bug_gym.shortest_path import reachable
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.ros_files import FREE, MAX_CELLS, OCCUPIED, UNKNOWN, RosMap, load_ros_map
from bug_gym.worlds.ros_outlines import load_outlines, outline

Bools = NDArray[np.bool_]
F64 = NDArray[np.float64]


def random_cells(seed: int, shape: tuple[int, int] = (25, 30), share: float = 0.35) -> Bools:
    return np.random.default_rng(seed).random(shape) < share


def slanting_cells(seed: int, shape: tuple[int, int] = (120, 160)) -> Bools:
    """Discs and turned bars, as a robot's own maps have them, and some specks."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: shape[0], : shape[1]]
    cells = rng.random(shape) < 0.003
    for _ in range(6):
        (cx, cy), angle = rng.uniform(0, shape[::-1]), rng.uniform(0.0, math.pi)
        along = (x - cx) * math.cos(angle) + (y - cy) * math.sin(angle)
        across = (y - cy) * math.cos(angle) - (x - cx) * math.sin(angle)
        cells |= (abs(along) < rng.uniform(5, 40)) & (abs(across) < rng.uniform(0.6, 4))
        cells |= np.hypot(x - rng.uniform(0, shape[1]), y - rng.uniform(0, shape[0])) < rng.uniform(1, 12)
    return cells


GRIDS = {f"random {share}": random_cells(1, share=share) for share in (0.05, 0.35, 0.5, 0.8)}
GRIDS |= {f"slanting {seed}": slanting_cells(seed) for seed in range(3)}
GRIDS |= {
    "one cell": np.ones((1, 1), dtype=bool),
    "all": np.ones((4, 5), dtype=bool),
    "chequered": np.indices((6, 7)).sum(axis=0) % 2 == 0,
    "rings in rings": np.max(np.abs(np.indices((15, 15)) - 7), axis=0) % 2 == 1,
    "diagonal": np.eye(9, dtype=bool),
}


def polygons_in(rings: list[Any]) -> Any:
    return np.array([shapely.Polygon(shell, holes) for shell, *holes in rings])


def cell_centres(cells: Any) -> tuple[F64, F64]:
    rows, columns = np.indices(np.shape(cells))
    return columns + 0.5, rows + 0.5


# ------------------------------------------------------------------------------------------------ outlines


@pytest.mark.parametrize("name", GRIDS)
def test_the_middle_of_a_cell_lies_in_an_outline_where_the_cell_is_occupied_and_only_there(name: str) -> None:
    """Dents and bumps of one cell may be drawn half as deep: then the middle lies on the outline."""
    cells = GRIDS[name]
    together = shapely.union_all(polygons_in(outline(cells)))
    x, y = cell_centres(cells)
    assert shapely.intersects_xy(together, x, y)[cells].all()
    assert not shapely.contains_xy(together, x, y)[~cells].any()


@pytest.mark.parametrize("name", GRIDS)
def test_outlines_are_simple_polygons_that_do_not_overlap(name: str) -> None:
    polygons = polygons_in(outline(GRIDS[name]))
    assert shapely.is_valid(polygons).all()
    assert shapely.union_all(polygons).area == pytest.approx(shapely.area(polygons).sum())


@pytest.mark.parametrize("name", GRIDS)
def test_no_outline_is_farther_than_half_a_cell_from_the_borders_of_cells(name: str) -> None:
    cells = GRIDS[name]
    rows, columns = np.nonzero(cells)
    exact = shapely.union_all(shapely.box(columns, rows, columns + 1.0, rows + 1.0)).boundary
    drawn = shapely.union_all(shapely.boundary(polygons_in(outline(cells))))
    assert shapely.hausdorff_distance(exact, drawn, densify=0.02) <= 0.5 + 1e-9


def groups(cells: Bools) -> int:
    """How many groups of cells hang together by sides or corners, by flooding."""
    left = {(int(row), int(column)) for row, column in np.argwhere(cells)}
    count = 0
    while left:
        count += 1
        edge = [left.pop()]
        while edge:
            row, column = edge.pop()
            around = {(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)} & left
            left -= around
            edge.extend(around)
    return count


@pytest.mark.parametrize("name", GRIDS)
def test_cells_that_touch_belong_to_one_polygon(name: str) -> None:
    assert len(outline(GRIDS[name])) == groups(GRIDS[name])


def test_a_rectangle_has_four_corners_and_a_frame_a_hole() -> None:
    cells = np.zeros((8, 10), dtype=bool)
    cells[2:6, 3:9] = True
    [[shell]] = outline(cells)
    assert sorted(shell.tolist()) == [[3, 2], [3, 6], [9, 2], [9, 6]]
    cells[3:5, 4:7] = False
    [[shell, hole]] = outline(cells)
    assert sorted(hole.tolist()) == [[4, 3], [4, 5], [7, 3], [7, 5]]


def test_a_stair_of_single_cells_is_one_straight_line() -> None:
    """Half of a square above its diagonal: two sides along cells, and the diagonal with a little bend at its ends."""
    [[shell]] = outline(np.triu(np.ones((40, 40), dtype=bool)))
    assert len(shell) <= 6


def test_slanting_walls_come_out_with_far_fewer_corners() -> None:
    for seed in range(5):
        cells = slanting_cells(seed)
        rows, columns = np.nonzero(cells)
        exact = shapely.union_all(shapely.box(columns, rows, columns + 1.0, rows + 1.0)).simplify(0.0)
        corners = sum(len(ring) for rings in outline(cells) for ring in rings)
        assert corners <= 0.6 * shapely.get_num_coordinates(exact)


def test_a_map_without_walls_has_no_outlines() -> None:
    assert outline(np.zeros((3, 4), dtype=bool)) == []


# ------------------------------------------------------------------------------------------------ reading

CELLS = np.array([[OCCUPIED, FREE, UNKNOWN], [FREE, FREE, OCCUPIED]])
"""Lowest row first."""


def test_the_first_row_of_the_picture_is_the_highest(tmp_path: Path) -> None:
    path = write_map(tmp_path, CELLS, resolution=0.5, origin=[-1.0, 2.0, 0.0])
    plan = load_ros_map(path)
    assert plan.cells.tolist() == CELLS.tolist()
    assert (plan.resolution, plan.origin, plan.bounds) == (0.5, (-1.0, 2.0, 0.0), [-1.0, 2.0, 0.5, 3.0])


@pytest.mark.parametrize(("greatest", "kind"), [(255, "P2"), (15, "P2"), (15, "P5"), (65535, "P5"), (1, "P2")])
def test_every_portable_graymap_gives_the_same_cells(tmp_path: Path, greatest: int, kind: str) -> None:
    shades = {OCCUPIED: 0.0, UNKNOWN: 0.5, FREE: 1.0}
    pixels = np.round(np.vectorize(shades.__getitem__)(CELLS[::-1]) * greatest).astype(int)
    write_pgm(tmp_path / "plan.pgm", pixels, greatest, kind)
    known = CELLS != UNKNOWN if greatest == 1 else np.ones(CELLS.shape, dtype=bool)  # no grey in black and white
    assert (load_ros_map(write_yaml(tmp_path)).cells == CELLS)[known].all()


def test_comments_may_stand_anywhere_in_the_head_of_a_graymap(tmp_path: Path) -> None:
    text = b"P2 # plain\n# a map\n3 # width\n2\n# greatest\n255\n0 254 205 # low\n254 254 0\n"
    (tmp_path / "plan.pgm").write_bytes(text)
    assert load_ros_map(write_yaml(tmp_path)).cells[::-1].tolist() == [[2, 0, 1], [0, 0, 2]]


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "LA", "I;16"])
def test_a_png_gives_the_same_cells_as_a_graymap(tmp_path: Path, mode: str) -> None:
    pillow = pytest.importorskip("PIL.Image")
    pixels = picture_of(CELLS).astype(np.uint8)
    image = pillow.fromarray(pixels)
    if mode == "I;16":
        image = pillow.fromarray(pixels.astype(np.uint16) * 257)
    elif mode != "L":
        image = image.convert(mode)
    image.save(tmp_path / "plan.png")
    # An opaque picture with transparency counts as lighter, as map_server has it: unknown shades become free ones.
    cells = np.where(CELLS == UNKNOWN, FREE, CELLS) if "A" in mode else CELLS
    assert load_ros_map(write_yaml(tmp_path, image="plan.png")).cells.tolist() == cells.tolist()


def test_thresholds_are_exclusive_and_negate_swaps_dark_and_light(tmp_path: Path) -> None:
    write_pgm(tmp_path / "plan.pgm", [[0, 25, 50, 75, 100]], greatest=100, kind="P2")
    limits: dict[str, Any] = {"occupied_thresh": 0.75, "free_thresh": 0.25}
    upright = load_ros_map(write_yaml(tmp_path, **limits)).cells
    assert upright.tolist() == [[OCCUPIED, UNKNOWN, UNKNOWN, UNKNOWN, FREE]]
    negated = load_ros_map(write_yaml(tmp_path, "negated", negate=1, **limits)).cells
    assert negated.tolist() == upright[:, ::-1].tolist()


def test_a_turned_map_is_the_straight_one_turned_about_its_origin(tmp_path: Path) -> None:
    cells = np.where(slanting_cells(3), OCCUPIED, FREE)
    straight = load_outlines(write_map(tmp_path, cells), unknown_is_wall=False)
    origin = [3.0, -2.0, 0.7]
    turned = load_outlines(write_map(tmp_path, cells, "turned", origin=origin), unknown_is_wall=False)
    turn = np.array([[math.cos(0.7), -math.sin(0.7)], [math.sin(0.7), math.cos(0.7)]])
    for mine, yours in zip(straight, turned, strict=True):
        for ring, other in zip(mine, yours, strict=True):
            assert ring @ turn.T + origin[:2] == pytest.approx(other)
    scenario = load(map_scenario(str(tmp_path / "turned.yaml")))
    border = shapely.Polygon(scenario.world.corners)
    assert all(border.buffer(1e-9).covers(shapely.Polygon(rings[0])) for rings in turned)


def test_unknown_cells_are_walls_on_request(tmp_path: Path) -> None:
    path = write_map(tmp_path, CELLS, resolution=1.0)
    known, all_of_them = (
        sum(shapely.area(polygons_in(list(load_outlines(path, unknown_is_wall=flag))))) for flag in (False, True)
    )
    assert known == pytest.approx(2.0)
    assert all_of_them > 2.9


# ------------------------------------------------------------------------------------------------ worlds


def map_scenario(path: str, **world: Any) -> dict[str, Any]:
    return {
        "robot": {"radius": 0.15},
        "lidar": {"beams": 120, "range": 5.0},
        "world": {"family": "ros_map", "path": path, "separation": 1.0, "solvable": 0.2, **world},
    }


def two_rooms() -> NDArray[np.int64]:
    """5 m x 4 m: two rooms that a wall parts, unknown outside of them."""
    cells = np.full((80, 100), UNKNOWN)
    cells[5:75, 5:95] = OCCUPIED
    cells[7:73, 7:60] = FREE
    cells[7:73, 62:93] = FREE
    cells[30:40, 20:24] = OCCUPIED
    return cells


def layouts_on(path: str, seeds: int, **world: Any) -> list[Layout]:
    scenario = load(map_scenario(path, **world))
    return [draw_layout(scenario, seed, 0) for seed in range(seeds)]


def cell_at(plan: RosMap, point: Any) -> int:
    """The cell of a map that isn't turned, by counting."""
    column, row = ((np.asarray(point) - plan.origin[:2]) / plan.resolution).astype(int)
    return int(plan.cells[row, column])


def test_start_and_goal_lie_in_free_cells_of_one_room_and_apart(tmp_path: Path) -> None:
    path = write_map(tmp_path, two_rooms(), origin=[-1.0, -2.0, 0.0])
    plan = load_ros_map(path)
    sides = set()
    for layout in layouts_on(path, 50):
        start, goal = layout.starts[0, :2], layout.goals[0]
        assert cell_at(plan, start) == cell_at(plan, goal) == FREE
        assert math.dist(start, goal) >= 1.0
        assert reachable(layout.circles, layout.polygons, layout.border, start, goal, radius=0.2)
        sides.add(bool(start[0] > 2.05))
    assert sides == {False, True}


def test_regions_and_places_on_a_map_are_kept(tmp_path: Path) -> None:
    path = write_map(tmp_path, two_rooms())
    for layout in layouts_on(path, 20, start=[0.7, 0.7, 0.5], goal={"region": [2.0, 2.0, 4.0, 3.5]}):
        assert layout.starts.tolist() == [[0.7, 0.7, 0.5]]
        assert (layout.goals[0] >= 2.0).all() and layout.goals[0, 0] <= 3.0


def test_a_map_whose_rooms_are_apart_says_that_there_is_no_path(tmp_path: Path) -> None:
    path = write_map(tmp_path, two_rooms())
    with pytest.raises(ValueError, match=r"no start and goal with a path at a clearance of 0.2 m"):
        layouts_on(path, 1, start=[0.7, 0.7, 0.0], goal=[4.0, 2.0])
    [layout] = layouts_on(path, 1, start=[0.7, 0.7, 0.0], goal=[4.0, 2.0], solvable=None)
    assert layout.goals.tolist() == [[4.0, 2.0]]


def test_bounds_cut_a_piece_out_of_a_map(tmp_path: Path) -> None:
    path = write_map(tmp_path, two_rooms())
    for layout in layouts_on(path, 10, bounds=[0.4, 0.4, 2.0, 3.6], separation=0.5):
        assert layout.border.tolist() == [[0.4, 0.4], [2.0, 0.4], [2.0, 3.6], [0.4, 3.6]]
        assert (layout.starts[0, :2] <= [2.0, 3.6]).all() and (layout.goals <= [2.0, 3.6]).all()


def test_a_scenario_with_another_map_has_the_outline_of_that_one(tmp_path: Path) -> None:
    path = write_map(tmp_path, two_rooms())
    other = write_map(tmp_path, two_rooms()[:60], "other", origin=[3.0, 0.0, 0.0])
    given, expected = load(map_scenario(path)), load(map_scenario(other))
    assert load(given, {"world.path": other}).world == expected.world != given.world
    said = load(map_scenario(path, bounds=[0.4, 0.4, 2.0, 3.6]))
    assert load(said, {"world.path": other}).world.bounds == (0.4, 0.4, 2.0, 3.6)


def marched(occupied: Bools, place: Any, angle: float, most: float) -> float:
    """Way from a place along a ray to the first occupied cell, or to the picture's end, by small steps [cells]."""
    ways = np.arange(0.0, most, 0.02)
    columns = np.floor(place[0] + ways * math.cos(angle)).astype(int)
    rows = np.floor(place[1] + ways * math.sin(angle)).astype(int)
    height, width = occupied.shape
    outside = (columns < 0) | (rows < 0) | (columns >= width) | (rows >= height)
    hits = np.flatnonzero(outside | occupied[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)])
    return float(ways[hits[0]]) if len(hits) else most


def scan_errors(path: str, seeds: int, **world: Any) -> tuple[F64, F64]:
    """Ranges by the LIDAR and by marching over the picture's cells (n,) [cells]."""
    simulation = Simulation(map_scenario(path, **world), count=seeds)
    simulation.reset(seeds=list(range(seeds)))
    plan = load_ros_map(path)
    occupied = plan.cells == OCCUPIED
    most = 5.0 / plan.resolution
    scans, marches = [], []
    for row in range(seeds):
        x, y, heading = simulation.world.pose[row, 0]
        place = ((x - plan.origin[0]) / plan.resolution, (y - plan.origin[1]) / plan.resolution)
        angles = heading + 2.0 * math.pi * np.arange(120) / 120
        scans.append(simulation.world.ranges[row, 0] / plan.resolution)
        marches.append([marched(occupied, place, angle, most) for angle in angles])
    return np.concatenate(scans).astype(np.float64), np.concatenate(marches)


def test_a_scan_among_upright_walls_is_that_of_the_pictures_cells(tmp_path: Path) -> None:
    scans, marches = scan_errors(write_map(tmp_path, two_rooms()), 20)
    assert np.abs(scans - marches).max() <= 0.03


def test_a_scan_among_slanting_walls_agrees_with_the_pictures_cells_to_one_cell(tmp_path: Path) -> None:
    """But for the few beams that graze a wall: there half a cell sideways may be any way along the beam."""
    for seed in range(2):
        path = write_map(tmp_path, np.where(slanting_cells(seed), OCCUPIED, FREE), f"slanting{seed}")
        scans, marches = scan_errors(path, 10, separation=0.5)
        assert (np.abs(scans - marches) <= 1.0).mean() > 0.93


def test_nothing_but_cells_stops_a_beam_and_no_beam_passes_the_middle_of_a_cell(tmp_path: Path) -> None:
    cells = slanting_cells(4)
    path = write_map(tmp_path, np.where(cells, OCCUPIED, FREE))
    simulation = Simulation(map_scenario(path, separation=0.5), count=10)
    simulation.reset(seeds=list(range(10)))
    rows, columns = np.nonzero(np.pad(cells, 1, constant_values=True))  # the border is a wall too
    centres = shapely.multipoints(np.column_stack([columns, rows]) * 0.05 - 0.025)
    squares = shapely.union_all(shapely.box(columns - 1.0, rows - 1.0, columns + 0.0, rows + 0.0))
    for row in range(10):
        x, y, heading = simulation.world.pose[row, 0]
        for beam, reach in enumerate(simulation.world.ranges[row, 0].tolist()):
            angle = heading + 2.0 * math.pi * beam / 120
            end = (x + reach * math.cos(angle), y + reach * math.sin(angle))
            if reach < 5.0:
                assert squares.distance(shapely.Point(end[0] / 0.05, end[1] / 0.05)) <= 0.5 + 1e-4
            # A line that meets a cell's inner diamond has passed its outline, wherever that was drawn.
            assert shapely.LineString([(x, y), end]).distance(centres) > 1e-6


def test_a_map_of_a_million_cells_is_read_in_five_seconds_and_few_corners(tmp_path: Path) -> None:
    """50 m x 50 m: rooms of 5 m behind walls of 0.15 m, a slanting wall in each, and boxes about."""
    cells = np.full((1000, 1000), FREE)
    for start in range(0, 1000, 100):
        cells[start : start + 3] = cells[:, start : start + 3] = OCCUPIED
    cells[-3:] = cells[:, -3:] = OCCUPIED
    rows, columns = np.mgrid[:1000, :1000] % 100
    cells[(rows >= 40) & (rows < 56) | (columns >= 40) & (columns < 56)] = FREE  # doors
    cells[(abs(3 * rows - columns) < 4) & (rows > 8) & (rows < 30)] = OCCUPIED
    rng = np.random.default_rng(0)
    for row, column in rng.integers(0, 995, (500, 2)):
        cells[row : row + 5, column : column + 5] = OCCUPIED
    path = write_map(tmp_path, cells)
    begin = time.process_time()
    [layout] = layouts_on(path, 1)
    assert time.process_time() - begin < 5.0
    solid = np.pad(cells == OCCUPIED, 1).astype(int)
    # Where four cells meet there is a corner if one or three of them are walls.
    corners = (solid[1:, 1:] + solid[1:, :-1] + solid[:-1, 1:] + solid[:-1, :-1]) % 2 == 1
    assert sum(len(ring) for rings in layout.polygons for ring in rings) < 0.5 * corners.sum()


def test_bug2_drives_across_a_drawn_map(tmp_path: Path) -> None:
    cells = two_rooms()
    cells[10:24, 60:62] = FREE  # a door of 0.7 m
    scenario = map_scenario(write_map(tmp_path, cells), start=[0.8, 3.0, 0.0], goal=[4.2, 3.0])
    rows = evaluate(["bug2"], scenario, episodes=1)
    assert [row.outcome for row in rows] == ["success"]


# ------------------------------------------------------------------------------------------------ real maps

REAL = {"depot": 12.0, "tb3_sandbox": 3.0}
"""Least distance from start to goal [m], by map."""


@pytest.mark.parametrize("name", REAL)
def test_outlines_of_a_real_map_hold_the_middles_of_its_occupied_cells_and_no_others(
    name: str, shared_data: Path
) -> None:
    path = str(shared_data / "ros_maps" / f"{name}.yaml")
    plan, polygons = load_ros_map(path), load_outlines(path, unknown_is_wall=False)
    x, y = cell_centres(plan.cells)
    places = plan.to_world(np.column_stack([x.ravel(), y.ravel()]))
    together = shapely.union_all(polygons_in(list(polygons)))
    occupied = plan.cells.ravel() == OCCUPIED
    assert shapely.dwithin(together, shapely.points(places[occupied]), 1e-9).all()
    assert not shapely.contains_xy(together.buffer(-1e-9), places[~occupied]).any()


@pytest.mark.parametrize("name", REAL)
def test_a_scan_on_a_real_map_agrees_with_its_cells_to_one_cell(name: str, shared_data: Path) -> None:
    scans, marches = scan_errors(str(shared_data / "ros_maps" / f"{name}.yaml"), 8)
    assert (np.abs(scans - marches) <= 1.0).mean() > 0.93


@pytest.mark.parametrize("policy", ["bug2", "tangent_bug"])
@pytest.mark.parametrize("name", REAL)
def test_bugs_drive_across_a_real_map(name: str, policy: str, shared_data: Path) -> None:
    world = {"family": "ros_map", "path": str(shared_data / "ros_maps" / f"{name}.yaml"), "separation": REAL[name]}
    scenario = {"lidar": {"beams": 360, "range": 5.0}, "time": {"limit": 300.0}, "world": world}
    rows = evaluate([policy], scenario, episodes=4)
    assert [row.outcome for row in rows] == ["success"] * 4


# ------------------------------------------------------------------------------------------------ what can't be read


def message(path: str, **world: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(map_scenario(path, **world))
    return str(caught.value)


YAML_FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "no image": ({"image": ...}, "lacks the key 'image'"),
    "no resolution": ({"resolution": ...}, "lacks the key 'resolution'"),
    "no origin": ({"origin": ...}, "lacks the key 'origin'"),
    "resolution of 0": ({"resolution": 0}, "resolution: got 0, expected a number above 0"),
    "resolution in words": ({"resolution": "fine"}, "resolution: got 'fine', expected a number"),
    "infinite resolution": ({"resolution": ".inf"}, "resolution: got inf, expected a number"),
    "short origin": ({"origin": [0, 0]}, r"origin: got [0, 0], expected [x, y, yaw]"),
    "origin in words": ({"origin": "[a, b, c]"}, "expected [x, y, yaw]"),
    "another mode": ({"mode": "scale"}, "mode: got 'scale', expected 'trinary'"),
    "negate in words": ({"negate": "perhaps"}, "negate: got 'perhaps', expected 0 or 1"),
    "threshold in words": ({"free_thresh": "low"}, "free_thresh: got 'low', expected a number"),
    "thresholds the wrong way round": (
        {"free_thresh": 0.7},
        "free_thresh: got 0.7, expected at most occupied_thresh (0.65)",
    ),
    "unknown key": ({"occupied_tresh": 0.5}, "unknown key 'occupied_tresh'"),
    "missing picture": ({"image": "other.pgm"}, "other.pgm: no such picture"),
}


@pytest.mark.parametrize("name", YAML_FAULTS)
def test_a_fault_in_a_maps_yaml_is_told_with_file_and_key(name: str, tmp_path: Path) -> None:
    changes, expected = YAML_FAULTS[name]
    told = message(write_map(tmp_path, CELLS, **changes))
    assert told.startswith("scenario: world.path: ")
    assert expected in told


@pytest.mark.parametrize("text", ["", "- 1\n- 2\n", "hello", "image: [\n"])
def test_a_yaml_that_is_no_map_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(text)
    assert "world.path: " in message(str(path)) and "plan.yaml: " in message(str(path))


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", b"P5\n3 3\n255\n"])
def test_a_file_of_another_kind_is_no_map(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "plan.yaml"
    path.write_bytes(content)
    assert "plan.yaml: " in message(str(path))


PICTURE_FAULTS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "not a .pgm picture"),
    "another kind": (b"P6\n2 1\n255\n" + bytes(6), "not a .pgm picture"),
    "no size": (b"P5\n255\n", "not a .pgm picture"),
    "cut off": (b"P5\n4 4\n255\n" + bytes(15), "got 15 pixels, expected 4 x 4"),
    "cut off in words": (b"P2\n2 2\n255\n1 2 3", "got 3 pixels, expected 2 x 2"),
    "not numbers": (b"P2\n2 1\n255\n1 x", "a pixel is not a whole number"),
    "too light": (b"P2\n2 1\n9\n1 10", "got a pixel of 10, expected at most 9"),
    "no shades": (b"P5\n1 1\n0\n\x00", "got the greatest value 0, expected 1 to 65535"),
    "no pixels": (b"P5\n0 3\n255\n", "got 0 x 3 pixels, expected at least one"),
    "too large": (b"P5\n5000 5000\n255\n", f"got 5000 x 5000 pixels, expected at most {MAX_CELLS:,} in all"),
}


@pytest.mark.parametrize("name", PICTURE_FAULTS)
def test_a_fault_in_a_graymap_is_told_with_its_file(name: str, tmp_path: Path) -> None:
    content, expected = PICTURE_FAULTS[name]
    (tmp_path / "plan.pgm").write_bytes(content)
    told = message(write_yaml(tmp_path))
    assert "plan.pgm: " in told and expected in told


def test_a_png_that_is_none_or_too_large_is_told_with_its_file(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    (tmp_path / "plan.png").write_bytes(b"no picture at all")
    assert "plan.png: not a picture" in message(write_yaml(tmp_path, image="plan.png"))
    pillow.new("1", (4001, 4000)).save(tmp_path / "large.png")
    assert "large.png: got 4001 x 4000 pixels" in message(write_yaml(tmp_path, "large", image="large.png"))


def test_without_pillow_another_picture_than_a_graymap_names_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "plan.png").write_bytes(b"")
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(ImportError, match=re.escape(install_command("maps"))):
        load(map_scenario(write_yaml(tmp_path, image="plan.png")))


def test_a_missing_map_is_told_by_its_key(tmp_path: Path) -> None:
    assert "world.path: got" in message(str(tmp_path / "none.yaml"))


def test_a_map_without_free_cells_says_so(tmp_path: Path) -> None:
    path = write_map(tmp_path, np.full((30, 30), OCCUPIED))
    (picture,) = (other for other in tmp_path.iterdir() if other != Path(path))
    with pytest.raises(ValueError, match=f"^{re.escape(str(picture))}: the map has no free cell, expected some"):
        layouts_on(path, 1)


def test_the_yaml_of_a_map_is_a_world_with_that_map(tmp_path: Path) -> None:
    path = write_map(tmp_path, np.zeros((240, 320), dtype=int), name="floor")
    scenario = load(path)
    assert (scenario.name, scenario.world.family) == ("floor", "ros_map")
    assert scenario == load({"name": "floor", "world": {"family": "ros_map", "path": path}})
    assert load(path, {"lidar.beams": 90}).lidar.beams == 90
