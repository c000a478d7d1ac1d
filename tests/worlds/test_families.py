"""Drawn families of worlds and polygonal borders: what each promises, over many seeds; and worlds written out."""

import math
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from measured import bodies_of, free_room, gap_to_mover, gaps, polygons_of

from bug_gym.config import (
    FAMILIES,
    BeachWorld,
    CorridorWorld,
    CrossingWorld,
    ForestWorld,
    HookWorld,
    RoomsWorld,
    ScenarioError,
    UrbanWorld,
    dump,
    load,
    scenario_names,
    to_yaml,
)
from bug_gym.scenarios import as_explicit, draw_layout
from bug_gym.shortest_path import reachable
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout

HEXAGON = [[10.0, 0.0], [5.0, 8.66], [-5.0, 8.66], [-10.0, 0.0], [-5.0, -8.66], [5.0, -8.66]]
# An L: its border is not convex, and narrow nowhere.
ELL = [[0.0, 0.0], [20.0, 0.0], [20.0, 8.0], [8.0, 8.0], [8.0, 20.0], [0.0, 20.0]]
# Two halls with a gap of 0.5 m between them.
HALLS = [[0, 0], [9, 0], [9, 4.75], [11, 4.75], [11, 0], [20, 0]]
HALLS += [[20, 10], [11, 10], [11, 5.25], [9, 5.25], [9, 10], [0, 10]]


def scenario_of(family: str, **world: Any) -> dict[str, Any]:
    return {"world": {"family": family, **world}}


def layouts_of(source: Any, seeds: int) -> list[Layout]:
    scenario = load(source)
    return [draw_layout(scenario, seed, 0) for seed in range(seeds)]


def is_solved(layout: Layout, radius: float) -> bool:
    """Whether a disc gets from start to goal."""
    start, goal = layout.starts[0, :2], layout.goals[0]
    return reachable(layout.circles, layout.polygons, layout.border, start, goal, radius=radius)


def solid(layout: Layout) -> Any:
    return shapely.union_all(polygons_of(layout))


def border_of(layout: Layout) -> Any:
    return shapely.Polygon(layout.border)


# ------------------------------------------------------------------------------------------------ all drawn families

DRAWN: dict[str, tuple[Any, int, float]] = {
    "corridor": (scenario_of("corridor"), 200, 0.98),
    "narrow corridor": (scenario_of("corridor", width=0.6, shifts=8, wall=0.2), 100, 0.29),
    "straight corridor": (scenario_of("corridor", shifts=0), 20, 0.98),
    "rooms": (scenario_of("rooms"), 200, 0.2),
    "many rooms": (scenario_of("rooms", columns=5, rows=6, door=0.8, loops=0.0, unevenness=0.3), 30, 0.2),
    "one room": (scenario_of("rooms", columns=1, rows=1), 10, 0.2),
    "crossing": (scenario_of("crossing"), 200, 0.2),
    "forest": (scenario_of("forest"), 200, 0.3),
    "thin forest": (scenario_of("forest", trees=40, sizes=[0.5, 0.5], solvable=0.4), 50, 0.4),
    "urban": (scenario_of("urban"), 200, 0.2),
    "all courtyards": (scenario_of("urban", courtyards=1.0, squares=0.0, street=1.0, gateways=1.0), 30, 0.2),
    "beach": (scenario_of("beach"), 200, 0.5),
    "hexagon": ("hexagon", 200, 0.3),
    "cellular_automaton": (scenario_of("cellular_automaton"), 100, 0.35),
    "beach in an L": (scenario_of("beach", bounds=ELL, obstacles=6, sizes=[0.5, 1.0], separation=10.0), 20, 0.5),
}
"""Scenario, seeds, and a radius of a robot that has to get through, by name."""


@pytest.mark.parametrize("name", DRAWN)
def test_there_is_a_way_from_start_to_goal(name: str) -> None:
    source, seeds, radius = DRAWN[name]
    assert all(is_solved(layout, radius) for layout in layouts_of(source, seeds))


@pytest.mark.parametrize("name", DRAWN)
def test_start_and_goal_are_free_inside_and_apart(name: str) -> None:
    source, seeds, _ = DRAWN[name]
    world = load(source).world
    at_start, at_goal = getattr(world, "start_clearance", 0.0), getattr(world, "goal_clearance", 0.0)
    for layout in layouts_of(source, min(seeds, 100)):
        start, goal = layout.starts[0, :2], layout.goals[0]
        assert free_room(layout, start) >= 0.2 + at_start - 1e-9
        assert free_room(layout, goal) >= max(at_goal, 0.2) - 1e-9
        assert all(gap_to_mover(start, mover) >= 0.2 + at_start - 1e-9 for mover in layout.movers)
        assert all(gap_to_mover(goal, mover) >= at_goal - 1e-9 for mover in layout.movers)
        assert math.dist(start, goal) >= getattr(world, "separation", 0.0)


def numbers(layout: Layout) -> tuple[Any, ...]:
    """All that a layout holds, to compare bit for bit."""
    movers = tuple((np.asarray(mover.outline).tolist(), mover.at, mover.motion) for mover in layout.movers)
    polygons = [[ring.tolist() for ring in rings] for rings in layout.polygons]
    arrays = (layout.border, layout.starts, layout.goals, layout.circles)
    room = layout.goal_room if layout.target else None  # a still goal keeps no distance
    return (*(array.tolist() for array in arrays), polygons, movers, layout.target, room)


@pytest.mark.parametrize("name", DRAWN)
def test_a_world_is_a_function_of_seed_and_episode(name: str) -> None:
    scenario = load(DRAWN[name][0])
    first, again, other, next_one = (
        numbers(draw_layout(scenario, seed, episode)) for seed, episode in ((3, 0), (3, 0), (4, 0), (3, 1))
    )
    assert first == again
    assert first != other and first != next_one and other != next_one


@pytest.mark.parametrize("name", DRAWN)
def test_a_batch_of_simulated_worlds_holds_the_worlds_of_its_seeds(name: str) -> None:
    source = DRAWN[name][0]
    simulation = Simulation(source, count=3)
    simulation.reset(seeds=[7, 8, 9])
    for row in range(3):
        drawn, held = draw_layout(simulation.scenario, 7 + row, 0), simulation.world.layout(row)
        assert numbers(held)[:5] == numbers(drawn)[:5]
        assert [mover.at for mover in held.movers] == [mover.at for mover in drawn.movers]


def test_the_border_lets_no_beam_out() -> None:
    for name in ("corridor", "rooms", "urban", "hexagon", "beach in an L"):
        source = load(DRAWN[name][0], {"lidar.beams": 180, "lidar.range": 200.0})
        simulation = Simulation(source, count=10)
        simulation.reset(seeds=list(range(10)))
        xmin, ymin, xmax, ymax = source.world.box
        assert simulation.world.ranges.max() < math.hypot(xmax - xmin, ymax - ymin), name


# ------------------------------------------------------------------------------------------------ corridor


def test_a_corridor_is_as_wide_as_stated_and_has_its_shifts() -> None:
    """Opened by a disc a little narrower it is the same, by one a little wider nothing is left of it."""
    for shifts in (0, 1, 4):
        scenario = load(scenario_of("corridor", shifts=shifts, width=1.6))
        assert isinstance(scenario.world, CorridorWorld)
        for seed in range(30):
            layout = draw_layout(scenario, seed, 0)
            free = border_of(layout).difference(solid(layout))
            assert free.geom_type == "Polygon" and not free.interiors
            assert len(free.simplify(1e-9).exterior.coords) - 1 == 4 + 4 * shifts
            assert free.buffer(-0.79, join_style="mitre").geom_type == "Polygon"
            # Corners are wider than legs, but by no more than the diagonal of a square.
            assert free.buffer(-0.8 * math.sqrt(2.0) - 1e-6, join_style="mitre").is_empty
            assert layout.starts[0].tolist()[2] == 0.0


def test_what_lies_between_the_legs_of_a_corridor_is_as_thick_as_stated() -> None:
    for layout in layouts_of(scenario_of("corridor", shifts=5, wall=0.7), 50):
        legs = border_of(layout).difference(solid(layout))
        # Closed by half the wall's thickness, the passage does not join up with itself or with the border.
        assert not legs.buffer(0.34, join_style="mitre").interiors
        xmin, ymin, xmax, ymax = legs.bounds
        assert ymin >= -8.0 + 0.7 - 1e-9 and ymax <= 8.0 - 0.7 + 1e-9 and (xmin, xmax) == (-15.0, 15.0)


# ------------------------------------------------------------------------------------------------ hook


def test_the_default_hook_is_the_box_with_a_slit_of_the_reference() -> None:
    corners = [(10, 6), (16, 6), (16, -6), (4, -6), (4, 6), (8, 6), (8, 5), (5, 5), (5, -5), (15, -5), (15, 5), (10, 5)]
    [layout] = layouts_of("hook", 1)
    assert [tuple(corner) for corner in layout.polygons[0][0].tolist()] == corners
    assert layout.starts.tolist() == [[7, 0, 0]] and layout.goals.tolist() == [[30, 0]]


def test_a_hook_turned_at_random_is_the_same_box_and_open_at_its_slit() -> None:
    straight = solid(layouts_of("hook", 1)[0])
    turned = layouts_of(load("hook", {"world.rotation": "random"}), 50)
    for layout in turned:
        assert solid(layout).area == pytest.approx(straight.area)
        assert solid(layout).centroid.distance(shapely.Point(10, 0)) == pytest.approx(
            straight.centroid.distance(shapely.Point(10, 0))
        )
        assert is_solved(layout, 0.99) and not is_solved(layout, 1.02)
    assert len({layout.polygons[0][0][0, 0] for layout in turned}) == 50


def test_the_slit_of_a_hook_is_where_it_is_said_to_be() -> None:
    scenario = load("hook", {"world.slit": 1.0, "world.slit_at": 3.5, "world.wall": 0.5})
    assert isinstance(scenario.world, HookWorld)
    wall = solid(draw_layout(scenario, 0, 0))
    gap = shapely.box(10 - 6, 5.5, 10 + 6, 6).difference(wall)
    assert gap.bounds == (13.0, 5.5, 14.0, 6.0)


# ------------------------------------------------------------------------------------------------ rooms


@pytest.mark.parametrize("loops", [0.0, 1.0])
def test_rooms_have_as_many_doors_as_stated(loops: float) -> None:
    """Each room by itself is a part of the free space once the doors are shut."""
    scenario = load(scenario_of("rooms", columns=4, rows=3, door=1.0, loops=loops))
    world = scenario.world
    assert isinstance(world, RoomsWorld)
    for seed in range(40):
        layout = draw_layout(scenario, seed, 0)
        free = border_of(layout).difference(solid(layout))
        rooms = free.buffer(-0.6, join_style="mitre").buffer(0.6, join_style="mitre")  # no door is wider than 1.2 m
        doors = free.difference(rooms.buffer(1e-9))
        openings = [part for part in shapely.get_parts(doors) if part.area > 1e-3]
        assert len(shapely.get_parts(rooms)) == 12
        assert len(openings) == (11 if loops == 0.0 else 4 * 2 + 3 * 3)
        for opening in openings:
            xmin, ymin, xmax, ymax = opening.bounds
            assert sorted([xmax - xmin, ymax - ymin]) == pytest.approx([0.2, 1.0])


def test_the_walls_of_even_rooms_stand_at_even_places() -> None:
    [layout] = layouts_of(scenario_of("rooms", columns=4, rows=2, unevenness=0.0, wall=0.1), 1)
    centres = [(-7.5 + 5.0 * column, -5.0 + 10.0 * row) for column in range(4) for row in range(2)]
    assert all(free_room(layout, centre) == pytest.approx(2.45) for centre in centres)


# ------------------------------------------------------------------------------------------------ crossing


def test_the_movers_of_a_crossing_keep_to_their_lanes_speeds_and_gaps() -> None:
    simulation = Simulation("crossing", count=10)
    world = simulation.scenario.world
    assert isinstance(world, CrossingWorld)
    simulation.reset(seeds=list(range(10)))
    movers = [simulation.world.layout(row).movers for row in range(10)]
    low, high = -8.0 + world.radius, 8.0 - world.radius
    for _ in range(300):
        before = simulation.world.disc_position.copy()
        simulation.step(np.zeros((10, 1, 2)))
        places = simulation.world.disc_position
        for row in range(10):
            count = len(movers[row])
            x, y = places[row, :count].T
            assert (np.abs(x) <= 10.0 - world.apron - world.radius).all()
            assert (y >= low).all() and (y <= high).all()
            moved = np.hypot(*(places[row, :count] - before[row, :count]).T)
            speeds = np.array([mover.motion.speed for mover in movers[row]])
            assert (moved <= 0.1 * speeds + 1e-9).all()
    for row in range(10):
        motions = [mover.motion for mover in movers[row]]
        speeds = np.array([motion.speed for motion in motions])
        assert len(set(speeds.round(9))) == world.streams
        assert (speeds >= world.speeds[0]).all() and (speeds <= world.speeds[1]).all()


def test_the_streams_of_a_crossing_are_evenly_spaced_and_as_dense_as_stated() -> None:
    scenario = load("crossing")
    world = scenario.world
    assert isinstance(world, CrossingWorld)
    length = 2.0 * (world.lane + 16.0 - 4.0 * world.radius)
    for seed in range(50):
        movers = draw_layout(scenario, seed, 0).movers
        assert len(movers) % world.streams == 0
        count = len(movers) // world.streams
        pitch = length / count
        assert 2.0 * world.radius + world.gap <= pitch < (2.0 * world.radius + world.gap) * (count + 1) / count
        # Neighbours that are on the same lane are as far apart as the way between them.
        for stream in range(world.streams):
            places = np.array([mover.at for mover in movers[stream * count : (stream + 1) * count]])
            steps = np.abs(np.roll(places, -1, axis=0) - places)
            same_lane = steps[:, 0] < 1e-9
            assert same_lane.any() and steps[same_lane, 1] == pytest.approx(pitch)


def test_streams_turn_either_way() -> None:
    upward = 0
    for layout in layouts_of("crossing", 40):
        motion = layout.movers[0].motion
        assert motion.law == "waypoints"
        corners = np.array(motion.points)
        upward += int(shapely.LinearRing(corners).is_ccw)
    assert 5 <= upward <= 35


# ------------------------------------------------------------------------------------------------ forest, beach


def test_a_forest_has_its_trees_sizes_and_gaps() -> None:
    scenario = load(scenario_of("forest", trees=80, sizes=[0.15, 0.45], solvable=0.35))
    for seed in range(30):
        layout = draw_layout(scenario, seed, 0)
        radii = layout.circles[:, 2]
        assert len(radii) == 80 and radii.min() >= 0.15 and radii.max() <= 0.45
        still, _ = bodies_of(layout)
        assert (gaps(still, still) + 99.0 * np.eye(80)).min() >= 0.7 - 1e-9
        assert gaps(still, [(border_of(layout).exterior, 0.0)]).min() >= 0.7 - 1e-9


def test_a_forest_without_a_promise_may_overlap_but_keeps_start_and_goal_clear() -> None:
    scenario = load(scenario_of("forest", trees=300, sizes=[0.4, 0.8], solvable=None))
    assert isinstance(scenario.world, ForestWorld)
    for seed in range(5):
        layout = draw_layout(scenario, seed, 0)
        still, _ = bodies_of(layout)
        assert len(still) == 300 and (gaps(still, still) + 99.0 * np.eye(300)).min() < 0.0
        assert free_room(layout, layout.starts[0, :2]) >= 1.2 - 1e-9


def test_a_forest_that_is_too_dense_says_how_many_trees_found_a_place_and_how_full_it_is() -> None:
    told = r"only \d+ of 60 obstacles found a free place; they cover \d+ % of the world, and keep gaps of 0\.6 m"
    with pytest.raises(ValueError, match=told):
        layouts_of(scenario_of("forest", trees=60, sizes=[1.0, 1.0], bounds=[-6, -6, 6, 6], separation=1.0), 1)


def test_a_forest_keeps_clear_of_every_robot() -> None:
    places = [{"start": [-5, -5, 0], "goal": [5, 5]}, {"start": [5, -5, 0], "goal": [-5, 5]}]
    for layout in layouts_of({"robots": places, **scenario_of("forest")}, 10):
        assert all(free_room(layout, start[:2]) >= 1.2 - 1e-9 for start in layout.starts)
        assert all(free_room(layout, goal) >= 0.5 - 1e-9 for goal in layout.goals)


def test_a_beach_is_as_large_and_as_full_as_stated() -> None:
    scenario = load("beach")
    world = scenario.world
    assert isinstance(world, BeachWorld)
    for seed in range(50):
        layout = draw_layout(scenario, seed, 0)
        assert border_of(layout).bounds == (0.0, 0.0, 50.0, 100.0)
        still, moving = bodies_of(layout)
        assert len(still) == 28 and len(moving) == 20
        for polygon, _ in still:
            assert polygon.is_valid and 5 <= len(polygon.exterior.coords) - 1 <= 10
            assert shapely.minimum_bounding_radius(polygon) <= 4.0 + 1e-9
        assert (gaps(still, still) + 99.0 * np.eye(28)).min() >= 1.0 - 1e-9
        assert gaps(still, [(border_of(layout).exterior, 0.0)]).min() >= 1.0 - 1e-9
        assert gaps(moving, still).min() >= 0.0
        for mover in layout.movers:
            assert mover.motion.law == "crowd" and 0.5 <= mover.motion.speed <= 1.3


@pytest.mark.parametrize("law", ["crowd", "random_walk"])
def test_pedestrians_never_leave_the_beach_whatever_its_border(law: str) -> None:
    scenario = load(scenario_of("beach", bounds=ELL, obstacles=5, sizes=[0.5, 1.0], separation=8.0, law=law))
    simulation = Simulation(scenario, count=5)
    simulation.reset(seeds=list(range(5)))
    border = shapely.Polygon(ELL)
    for _ in range(60):
        for _ in range(5):
            simulation.step(np.zeros((5, 1, 2)))
        for row in range(5):
            movers = simulation.world.layout(row).movers
            places = shapely.points([mover.at for mover in movers])
            assert shapely.covers(border, places).all()
            assert shapely.distance(border.exterior, places).min() >= 0.3 - 1e-6


# ------------------------------------------------------------------------------------------------ urban


def test_streets_are_as_wide_as_stated_and_buildings_have_their_courtyards() -> None:
    scenario = load(scenario_of("urban", columns=3, rows=4, squares=0.2, courtyards=0.5, gateways=0.5))
    world = scenario.world
    assert isinstance(world, UrbanWorld)
    buildings = courtyards = gateways = 0
    for seed in range(100):
        layout = draw_layout(scenario, seed, 0)
        still, _ = bodies_of(layout)
        assert len(still) <= 12
        assert (gaps(still, still) + 99.0 * np.eye(len(still))).min() >= world.street - 1e-9
        assert gaps(still, [(border_of(layout).exterior, 0.0)]).min() >= world.street - 1e-9
        buildings += len(still)
        for polygon, _ in still:
            corners = len(polygon.exterior.coords) - 1
            assert polygon.is_valid and (corners, len(polygon.interiors)) in ((4, 0), (4, 1), (12, 0))
            courtyards += corners == 12 or len(polygon.interiors)
            gateways += corners == 12
        # Nobody is shut into a courtyard.
        filled = shapely.union_all([shapely.Polygon(polygon.exterior) for polygon, _ in still])
        assert not filled.contains(shapely.Point(layout.goals[0]))
    for part, whole, share in ((buildings, 1200, 0.8), (courtyards, buildings, 0.5), (gateways, courtyards, 0.5)):
        assert abs(part - share * whole) <= 4.0 * math.sqrt(share * (1.0 - share) * whole)


def test_gateways_are_as_wide_as_stated() -> None:
    """A building with a gateway is a rectangle less a smaller one of the same middle, less the gateway."""
    for layout in layouts_of(scenario_of("urban", courtyards=1.0, gateways=1.0, squares=0.0), 20):
        for polygon in polygons_of(layout):
            xmin, ymin, xmax, ymax = polygon.bounds
            inner = (xmax - xmin - 2.0) * (ymax - ymin - 2.0)
            assert polygon.area == pytest.approx((xmax - xmin) * (ymax - ymin) - inner - 1.0 * 1.2)


# ------------------------------------------------------------------------------------------------ polygonal borders

ANY_BORDER: dict[str, dict[str, Any]] = {
    "empty": {"separation": 5.0},
    "explicit": {
        "circles": [[2, 2, 0.5]],
        "start": {"region": [0, 0, 20, 20]},
        "goal": {"region": [0, 0, 20, 20]},
    },
    "ring": {"centre": [4, 4], "outer": 3.0, "inner": 2.5},
    "u_trap": {
        "mouth_x": 1.0,
        "depth": 3.0,
        "half_width": 1.0,
        "start": {"region": [0, -4, 20, 15]},
        "goal": {"region": [0, -4, 20, 15]},
    },
    "hook": {
        "centre": [4, 4],
        "half_side": 2.0,
        "wall": 0.5,
        "slit": 1.0,
        "slit_at": 0.0,
        "start": [4, 4, 0],
        "goal": {"region": [0, 0, 20, 20]},
    },
    "forest": {"trees": 20},
    "beach": {"obstacles": 4, "sizes": [0.5, 1.0], "pedestrians": 3, "separation": 5.0},
}


@pytest.mark.parametrize("family", ANY_BORDER)
def test_a_polygon_is_the_wall_of_a_world_and_all_start_and_goal_inside(family: str) -> None:
    bounds = [[x, y - 4.5] for x, y in ELL] if family == "u_trap" else ELL
    scenario = load({"lidar": {"range": 50.0}, **scenario_of(family, bounds=bounds, **ANY_BORDER[family])})
    simulation = Simulation(scenario, count=20)
    simulation.reset(seeds=list(range(20)))
    border = shapely.Polygon(bounds)
    for row in range(20):
        layout = simulation.world.layout(row)
        assert layout.border.tolist() == bounds
        assert border.buffer(-0.2 + 1e-9).covers(shapely.Point(layout.starts[0, :2]))
        assert border.covers(shapely.Point(layout.goals[0]))
        x, y, heading = layout.starts[0]
        angles = heading + 2.0 * math.pi * np.arange(180) / 180
        ranges = simulation.world.ranges[row, 0].astype(np.float64)
        ends = shapely.points(x + ranges * np.cos(angles), y + ranges * np.sin(angles))
        assert shapely.distance(border, ends).max() <= 1e-4


def test_a_robot_stops_at_a_polygonal_border() -> None:
    world = {"bounds": HEXAGON, "start": [4.0, 5.0, 0.0], "goal": [-5, 0]}
    simulation = Simulation(scenario_of("empty", **world))
    simulation.reset(seeds=[0])
    for _ in range(200):
        transition = simulation.step([[[0.6, 0.8]]])
        if transition.terminated.any():
            break
    assert simulation.info()["collision"].all()
    place = shapely.Point(simulation.world.pose[0, 0, :2])
    assert shapely.Polygon(HEXAGON).exterior.distance(place) == pytest.approx(0.2, abs=1e-6)


def test_the_span_of_an_observation_is_that_of_the_box_round_a_polygon() -> None:
    boxed, polygonal = (
        Simulation(scenario_of("empty", bounds=bounds, start=[0, 0, 0], goal=[1, 0]))
        for bounds in ([-10.0, -8.66, 10.0, 8.66], HEXAGON)
    )
    for one, other in zip(boxed.fields, polygonal.fields, strict=True):
        assert (one.low == other.low).all() and (one.high == other.high).all()


def test_a_border_with_a_place_too_narrow_has_no_world_that_promises_a_way() -> None:
    world: dict[str, Any] = {"bounds": HALLS, "trees": 3, "start": {"region": [0, 0, 9, 10]}}
    world |= {"goal": {"region": [11, 0, 20, 10]}}
    with pytest.raises(ValueError, match="no path at a clearance of 0.3 m"):
        layouts_of(scenario_of("forest", **world), 1)
    assert all(is_solved(layout, 0.24) for layout in layouts_of(scenario_of("forest", **world, solvable=None), 3))


def message(source: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(source)
    return str(caught.value)


@pytest.mark.parametrize("family", ["field", "maze", "corridor", "rooms", "crossing", "urban"])
def test_families_that_need_a_box_say_so(family: str) -> None:
    told = message(scenario_of(family, bounds=HEXAGON))
    assert told.startswith("scenario: world.bounds: got a polygon, expected a box [xmin, ymin, xmax, ymax]")


REFUSED: list[tuple[str, dict[str, Any], str, str]] = [
    ("empty", {"bounds": [[0, 0], [5, 5], [5, 0], [0, 5]]}, "world.bounds", "the polygon crosses itself at (2.5, 2.5)"),
    ("empty", {"bounds": [[0, 0], [5, 5]]}, "world.bounds", "got 2 corners, expected at least 3"),
    ("empty", {"bounds": [[0, 0], [5, 5], [5]]}, "world.bounds.2", "got [5], expected [x, y]"),
    ("empty", {"bounds": []}, "world.bounds", "expected [xmin, ymin, xmax, ymax]"),
    ("empty", {"bounds": HEXAGON, "start": [9.5, 4, 0]}, "world.start", "in its way: the border"),
    ("empty", {"bounds": HEXAGON, "goal": [9, 8]}, "world.goal", "in its way: the border"),
    ("empty", {"bounds": HEXAGON, "goal": {"region": [0, 0, 9, 9]}}, "world.goal.region", "within bounds"),
    ("ring", {"bounds": ELL, "centre": [8, 8], "outer": 3.0, "inner": 2.0}, "world.outer", "a ring within bounds"),
    ("u_trap", {"bounds": HEXAGON}, "world.bounds", "expected bounds that hold the trap"),
    ("hook", {"bounds": HEXAGON}, "world.bounds", "expected bounds that hold the box"),
    ("hook", {"slit": 0.4}, "world.slit", "more than the robot's width (0.4)"),
    ("hook", {"slit": 4, "slit_at": 4}, "world.slit", "a slit between the inner corners, +-5"),
    ("corridor", {"width": 0.4}, "world.width", "more than the robot's width (0.4)"),
    ("corridor", {"shifts": 40}, "world.shifts", "expected fewer"),
    ("corridor", {"width": 7.0, "shifts": 1}, "world.width", "legs must fit beside one another"),
    ("corridor", {"shifts": -1}, "world.shifts", "at least 0"),
    ("rooms", {"columns": 0}, "world.columns", "at least 1"),
    ("rooms", {"door": 0.3}, "world.door", "more than the robot's width (0.4)"),
    ("rooms", {"columns": 9}, "world.door", "at most the smallest room's side"),
    ("crossing", {"streams": 7}, "world.streams", "expected fewer"),
    ("crossing", {"lane": 0.5}, "world.lane", "at least the width of a mover (0.6)"),
    ("crossing", {"gap": 0.3}, "world.gap", "more than the robot's width (0.4)"),
    ("crossing", {"apron": 0.3}, "world.apron", "more than the robot's width (0.4)"),
    ("crossing", {"radius": 4.0, "lane": 9.0, "streams": 1, "apron": 1.0}, "world.radius", "a quarter of the height"),
    ("forest", {"solvable": 0.1}, "world.solvable", "at least the robot's reach (0.2)"),
    ("forest", {"tres": 3}, "world.tres", "did you mean 'trees'?"),
    ("forest", {"separation": 40}, "world.separation", "expected at most 28.2"),
    ("urban", {"street": 0.4}, "world.street", "more than the robot's width (0.4)"),
    ("urban", {"gateway": 0.4}, "world.gateway", "more than the robot's width (0.4)"),
    ("urban", {"depth": 2.0}, "world.depth", "the smallest courtyard has a side of"),
    ("urban", {"squares": 1.5}, "world.squares", "at most 1"),
    ("circle_swap", {"radius": 9.9}, "world.radius", "expected a circle within bounds"),
    ("circle_swap", {"jitter": 4.0}, "world.jitter", "expected less than radius (4)"),
    ("warehouse", {"aisle": 0.4}, "world.aisle", "more than the robot's width (0.4)"),
    ("warehouse", {"rows": 9}, "world.aisle", "expected less than from rack to rack"),
    ("warehouse", {"spacing": 0.3}, "world.spacing", "more than the robot's width (0.4)"),
    ("warehouse", {"separation": 40}, "world.separation", "expected at most 30"),
    ("beach", {"corners_each": [2, 5]}, "world.corners_each.0", "at least 3"),
    ("beach", {"corners_each": [6, 5]}, "world.corners_each", "expected [least, most]"),
    ("beach", {"solvable": 0.1}, "world.solvable", "at least the robot's reach (0.2)"),
]


@pytest.mark.parametrize("family", ["field", "forest", "rooms", "urban", "beach"])
def test_two_points_may_lie_nearer_together_than_the_default_separation(family: str) -> None:
    points = {"bounds": [-50.0, -50.0, 50.0, 50.0], "start": [0.0, 0.0, 0.5], "goal": [3.0, 0.0]}
    scenario = load({"robots": {"count": 2}, **scenario_of(family, **points)})
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    layout = simulation.world.layout(0)
    assert layout.starts[:, :2].mean(axis=0) == pytest.approx([0.0, 0.0])
    assert layout.goals[0] == pytest.approx([3.0, 0.0])
    again = load(dump(scenario))
    assert again == scenario and again.digest == scenario.digest
    # Who asks for a separation is told, also where it is the default's.
    default = type(scenario.world).model_fields["separation"].default
    told = message(scenario_of(family, **points, separation=default))
    assert told == f"scenario: world.separation: got {default:g}, expected at most 3, all that there is"
    # Points that are far enough apart leave the default, and with it the scenario's digest, as they are.
    points |= {"start": [-35.0, 0.0, 0.0], "goal": [35.0, 0.0]}
    far, same = (load(scenario_of(family, **points, **more)) for more in ({}, {"separation": default}))
    assert far.world.separation == default and far.digest == same.digest  # type: ignore[union-attr]


@pytest.mark.parametrize(("family", "world", "key", "allowed"), REFUSED)
def test_what_a_family_cannot_have_is_told_by_its_key(
    family: str, world: dict[str, Any], key: str, allowed: str
) -> None:
    told = message(scenario_of(family, **world))
    assert told.startswith(f"scenario: {key}: ")
    assert allowed in told


# ------------------------------------------------------------------------------------------------ writing worlds out

SAVED: dict[str, Any] = {name: name for name in scenario_names()}
SAVED |= {
    "two robots": load("static", {"robots.count": 2}),
    "robots with goals of their own": load("crossing_robots", {"robots.count": 3}),
    "moving goal": scenario_of(
        "empty", bounds=ELL, target={"region": [1, 1, 7, 7], "motion": {"law": "bounce", "speed": 0.3}, "room": 0.7}
    ),
    "goal on its way": scenario_of(
        "empty", start=[0, 0, 0], target={"at": [3, 3], "motion": {"law": "waypoints", "points": [[5, 5]], "speed": 1}}
    ),
    "turned trap": load("u_trap", {"world.rotation": "random"}),
}


def test_every_family_but_those_from_files_is_written_out_below() -> None:
    families = {load(source).world.family for source in SAVED.values()}
    assert families == set(FAMILIES) - {"barn", "dynabarn", "ros_map", "replay"}


@pytest.mark.parametrize("name", SAVED)
def test_a_world_that_is_saved_and_loaded_is_the_same_bit_for_bit(name: str, tmp_path: Path) -> None:
    for seed in (0, 5):
        drawn = Simulation(SAVED[name])
        drawn.reset(seeds=[seed])
        layout = drawn.world.layout(0)
        path = tmp_path / "saved.yaml"
        path.write_text(to_yaml(as_explicit(drawn.scenario, layout)), encoding="utf-8")
        loaded = Simulation(path)
        observation = loaded.reset(seeds=[seed])
        assert numbers(loaded.world.layout(0)) == numbers(layout)
        assert (observation == drawn.observations()).all()


GOING_ON = ("rush", "crossing", "beach", "maze", "forest", "hexagon", "two_boxes", "moving goal")


@pytest.mark.parametrize("name", [*GOING_ON, "crowd", "evading_target", "replay"])
def test_a_saved_world_goes_on_as_the_drawn_one_does(name: str) -> None:
    """Round movers: a drawn polygon's bounding circle may differ from the one of its corners in the last bit."""
    drawn = Simulation(SAVED[name])
    drawn.reset(seeds=[3])
    loaded = Simulation(as_explicit(drawn.scenario, drawn.world.layout(0)))
    loaded.reset(seeds=[3])
    rng = np.random.default_rng(0)
    for _ in range(100):
        action = rng.uniform(-0.3, 0.3, (1, 1, 2))
        one, other = drawn.step(action), loaded.step(action)
        assert (one.observation == other.observation).all()
        if one.terminated.any():
            break


def test_a_saved_world_keeps_all_of_the_scenario_but_its_world() -> None:
    scenario = load("rush", {"odometry.rotation_bias": 0.01, "reward.progress": 2.0})
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    saved = as_explicit(scenario, simulation.world.layout(0))
    assert {**dump(saved), "world": None} == {**dump(scenario), "world": None}


def test_movers_are_saved_with_the_velocity_that_they_have_at_that_moment() -> None:
    simulation = Simulation("two_boxes")
    simulation.reset(seeds=[0])
    for _ in range(250):  # the mover has turned back at the border by then
        simulation.step([[[0.0, 0.0]]])
    [mover] = simulation.world.layout(0).movers
    assert mover.motion.law == "bounce" and mover.motion.velocity == (-0.5, 0.0)
    again = as_explicit(simulation.scenario, simulation.world.layout(0))
    assert numbers(draw_layout(again, 0, 0))[5] == numbers(simulation.world.layout(0))[5]


# ------------------------------------------------------------------------------------------------ the page of worlds

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_of_worlds_is_what_the_docstrings_say_and_its_pictures_are_there() -> None:
    """Where not: `python docs/make_worlds.py`."""
    make_worlds = runpy.run_path(str(ROOT / "docs" / "make_worlds.py"))
    assert (ROOT / "docs" / "worlds.md").read_text(encoding="utf-8") == make_worlds["page"]()
    pictures = {path.stem for path in (ROOT / "docs" / "worlds").glob("*.png")}
    assert pictures == {*make_worlds["PICTURES"], *make_worlds["EXTRAS"]}
    assert set(make_worlds["PICTURES"]) >= set(FAMILIES) - {"barn", "dynabarn", "replay"}
