"""Families of worlds: what each promises about its obstacles, starts and goals, over many seeds."""

import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from measured import bodies_of, free_room, gap_to_mover, gaps, polygons_of

from bug_gym import kernels
from bug_gym.config import MazeWorld, load
from bug_gym.scenarios import draw_layout, field_record
from bug_gym.shortest_path import reachable
from bug_gym.simulation import Simulation
from bug_gym.worlds.grid import carve
from bug_gym.worlds.layout import Layout

# ------------------------------------------------------------------------------------------------ field


def field(seeds: int = 1, first: int = 0, **world: Any) -> tuple[Simulation, list[Layout]]:
    """Worlds of a field at the start of their first episodes."""
    robot = world.pop("robot", {})
    robots = world.pop("robots", {"count": 1})
    scenario = {"robot": robot, "robots": robots, "lidar": {"beams": 1}, "world": {"family": "field", **world}}
    simulation = Simulation(scenario, count=seeds)
    simulation.reset(seeds=list(range(first, first + seeds)))
    return simulation, [simulation.world.layout(row) for row in range(seeds)]


FIELDS: dict[str, dict[str, Any]] = {
    "mixed": {"solvable": 0.3},
    "half of them moving": {"solvable": 0.3, "moving": 0.5},
    "circles": {"shapes": "circles", "obstacles": 40, "solvable": 0.25, "moving": 0.25},
    "squares": {"shapes": "squares", "obstacles": 15, "solvable": 0.4, "moving": 0.4, "sizes": [0.5, 0.5]},
    "polygons": {"shapes": "polygons", "obstacles": 25, "solvable": 0.3, "moving": 0.2, "sizes": [0.2, 0.9]},
    "no promise": {"obstacles": 60, "moving": 0.3, "start_clearance": 0.4, "goal_clearance": 0.1},
    "elsewhere": {
        "bounds": [100.0, -50.0, 130.0, -38.0],
        "solvable": 0.5,
        "separation": 20.0,
        "start": {"region": [100, -50, 110, -38], "heading": 0.5},
        "goal": {"region": [120, -50, 130, -38]},
    },
}
SEEDS = 200


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_keeps_its_promises_on_200_seeds(name: str) -> None:
    simulation, layouts = field(SEEDS, **FIELDS[name])
    world = simulation.scenario.world
    assert world.family == "field"
    wanted = round(world.moving * world.obstacles)
    low, high = world.sizes
    xmin, ymin, xmax, ymax = world.bounds
    gap = 2.0 * world.solvable if world.solvable is not None else None
    border = [(shapely.box(xmin, ymin, xmax, ymax).exterior, 0.0)]
    for layout in layouts:
        still, moving = bodies_of(layout)
        radii = [*layout.circles[:, 2], *(float(mover.outline) for mover in layout.movers if mover.is_circle)]
        # Counts and sizes.
        assert len(moving) == wanted and len(still) + wanted == world.obstacles
        assert all(low <= radius <= high for radius in radii)
        for body, _ in [*still, *moving]:
            assert shapely.box(xmin, ymin, xmax, ymax).contains(body)
            if body.geom_type == "Polygon":
                assert body.is_valid
                assert shapely.minimum_bounding_radius(body) <= high + 1e-9
        # Gaps, to the border too.
        if gap is not None:
            assert (gaps(still, still) + np.where(np.eye(len(still)), 99.0, 0.0)).min() >= gap - 1e-9
        assert gaps(still, border).min() >= (0.0 if gap is None else gap) - 1e-9
        # Movers start in no still obstacle.
        if moving:
            assert gaps(moving, border).min() >= -1e-9
            assert gaps(moving, still).min() > 0.0
        # Start and goal.
        start, goal = layout.starts[0, :2], layout.goals[0]
        for point, room in ((start, world.start_clearance), (goal, world.goal_clearance)):
            assert free_room(layout, point) >= room - 1e-9
            assert all(gap_to_mover(point, mover) >= room - 1e-9 for mover in layout.movers)
        assert math.dist(start, goal) >= world.separation
    starts = np.array([layout.starts[0] for layout in layouts])
    assert len(np.unique(starts.round(9), axis=0)) == SEEDS


def test_the_movers_of_a_field_have_the_stated_speeds_and_laws_in_equal_parts() -> None:
    _, layouts = field(100, moving=0.5, speeds=[0.2, 0.9])
    speeds: list[float] = []
    laws = Counter[str]()
    for layout in layouts:
        for mover in layout.movers:
            motion: Any = mover.motion
            laws[motion.law] += 1
            speeds.append(math.hypot(*motion.velocity) if motion.law == "bounce" else motion.speed)
        assert laws["bounce"] == laws["random_walk"]
    assert 0.2 <= min(speeds) < 0.22 and 0.88 < max(speeds) <= 0.9
    assert abs(np.mean(speeds) - 0.55) < 4.0 * (0.7 / math.sqrt(12.0)) / math.sqrt(len(speeds))


@pytest.mark.parametrize("law", ["bounce", "random_walk"])
def test_a_field_with_one_law_has_no_other(law: str) -> None:
    _, layouts = field(5, moving=1.0, laws=[law])
    assert {mover.motion.law for layout in layouts for mover in layout.movers} == {law}


def test_circles_and_polygons_of_a_mixed_field_are_in_equal_parts_among_still_and_moving() -> None:
    _, [layout] = field(1, obstacles=40, moving=0.5, sizes=[0.1, 0.3])
    assert len(layout.circles) == len(layout.polygons) == 10
    assert sum(mover.is_circle for mover in layout.movers) == 10


def test_sizes_headings_and_directions_of_a_field_are_spread_evenly() -> None:
    _, layouts = field(150, moving=0.5, sizes=[0.3, 1.0], shapes="circles", laws=["bounce"], speeds=[1.0, 1.0])
    radii = np.concatenate([layout.circles[:, 2] for layout in layouts])
    # Still obstacles may overlap here, so each size finds a place as easily as any other, but for the border.
    assert abs(radii.mean() - 0.65) < 0.02
    headings = np.array([layout.starts[0, 2] for layout in layouts])
    assert abs(np.exp(1j * headings).mean()) < 4.0 / math.sqrt(len(headings))
    velocities = np.array([mover.motion.velocity for layout in layouts for mover in layout.movers])  # type: ignore[union-attr]
    assert np.abs(velocities.mean(axis=0)).max() < 4.0 / math.sqrt(2.0 * len(velocities))


def test_a_field_of_600_obstacles_is_placed() -> None:
    _, [layout] = field(1, obstacles=600, bounds=[-30, -30, 30, 30], sizes=[0.2, 0.5], solvable=0.3)
    assert len(layout.circles) + len(layout.polygons) == 600


@pytest.mark.parametrize("gap", [0.3, None])
def test_a_field_that_is_too_full_says_how_full_it_is(gap: float | None) -> None:
    crowd: dict[str, Any] = {"obstacles": 400, "sizes": [0.9, 1.0], "solvable": gap}
    if gap is None:  # still obstacles may overlap, but a mover starts in none
        crowd |= {"moving": 0.1}
    with pytest.raises(
        ValueError, match=r"only \d+ of 400 obstacles found a free place .* cover \d+ % of the world"
    ) as error:
        field(2, **crowd)
    assert ("keep gaps of 0.6 m (world.solvable: 0.3)" in str(error.value)) == (gap is not None)
    words = str(error.value).split()
    placed = int(words[words.index("only") + 1])
    assert 20 < placed < 400
    share = float(words[words.index("cover") + 1])  # of 20 m x 20 m, overlaps counted twice
    assert 100 * placed * math.pi * 0.9**2 / 400 - 1 <= share <= 100 * placed * math.pi / 400 + 1


@pytest.mark.parametrize("name", ["circles", "no promise"])
@pytest.mark.parametrize("extra", [{}, {"laws": ["crowd"], "obstacles": 30}, {"obstacles": 400, "sizes": [0.1, 0.2]}])
def test_worlds_that_found_no_place_leave_the_rows_as_they_were(name: str, extra: dict[str, Any]) -> None:
    simulation, _ = field(3, **FIELDS[name] | {"moving": 0.5} | extra)
    world, record = simulation.world, simulation._field_record
    simulation.step(np.zeros((3, 1, 2)))
    before = world.floats.copy(), world.ints.copy()
    assert record is not None
    record["gap"], record["size_min"], record["size_max"] = 2.0, 2.0, 6.0
    with pytest.raises(ValueError, match="found a free place|no start and goal"):
        simulation.reset(np.array([2, 0]))
    assert (world.floats == before[0]).all() and (world.ints == before[1]).all()


def test_a_field_without_room_for_start_and_goal_says_so() -> None:
    with pytest.raises(ValueError, match="no start and goal with their clearance and separation fit"):
        field(1, separation=27.9)


def test_a_field_has_a_way_at_a_clearance_above_the_free_space_asked_for() -> None:
    world: dict[str, Any] = {"bounds": [-15, -15, 15, 15], "obstacles": 12, "solvable": 1.5, "start_clearance": 0.1}
    _, layouts = field(100, robot={"radius": 1.0}, **world)
    for layout in layouts:
        start, goal = layout.starts[0, :2], layout.goals[0]
        assert min(free_room(layout, start), free_room(layout, goal)) >= 1.5 - 1e-9
        assert reachable(layout.circles, layout.polygons, layout.border, start, goal, radius=1.5 - 1e-6)


@pytest.mark.parametrize("robots", [1, 3])
def test_a_start_and_a_goal_that_are_said_may_lie_at_the_border_of_a_field(robots: int) -> None:
    simulation, layouts = field(20, start=[-9.8, 0.0, 0.0], goal=[9.9, 1.0], solvable=0.3, robots={"count": robots})
    assert (simulation.world.array("outcome") == kernels.RUNNING).all()
    for layout in layouts:
        assert layout.goals.tolist() == [[9.9, 1.0]]
        for x, y, _ in layout.starts.tolist():
            assert x == -9.8
            assert all(math.dist((x, y), (a, b)) - radius >= 1.2 - 1e-9 for a, b, radius in layout.circles)


def test_robots_of_a_field_that_would_start_beyond_its_border_are_an_error_that_says_so() -> None:
    with pytest.raises(ValueError, match=r"robot 0 cannot start at \[-8.0, -10.0, 0.0\]: the border is in its way"):
        field(1, start=[-8.0, 0.0, 0.0], robots={"count": 11})


def test_a_field_with_fixed_start_and_goal_leaves_them_clear() -> None:
    _, layouts = field(20, start=[-8.0, 0.0, 0.7], goal=[8.0, 1.0], solvable=0.3)
    for layout in layouts:
        assert layout.starts[0].tolist() == [-8.0, 0.0, 0.7] and layout.goals[0].tolist() == [8.0, 1.0]
        assert free_room(layout, (-8.0, 0.0)) >= 1.0 and free_room(layout, (8.0, 1.0)) >= 0.5


@pytest.mark.parametrize("robots", [2, 5])
def test_robots_of_a_field_start_side_by_side_each_clear_and_away_from_the_goal(robots: int) -> None:
    _, layouts = field(50, robots={"count": robots}, moving=0.5)
    for layout in layouts:
        starts, goal = layout.starts, layout.goals[0]
        assert len(starts) == robots
        for one, other in zip(starts[:-1], starts[1:], strict=True):
            assert math.dist(one[:2], other[:2]) == pytest.approx(2.0) and one[2] == other[2]
        for start in starts:
            assert free_room(layout, start[:2]) >= 1.0 - 1e-9
            assert all(gap_to_mover(start[:2], mover) >= 1.0 - 1e-9 for mover in layout.movers)
            assert math.dist(start[:2], goal) >= 8.0


@pytest.mark.parametrize("motion", [{"law": "bounce", "speed": 0.7}, {"law": "random_walk", "speed": 0.7}])
@pytest.mark.parametrize("goal_clearance", [0.0, 0.5])
def test_the_moving_goal_of_a_field_stays_clear_of_border_and_obstacles(motion: Any, goal_clearance: float) -> None:
    simulation, layouts = field(10, target_motion=motion, goal_clearance=goal_clearance, moving=0.3)
    before = [layout.goals[0].copy() for layout in layouts]
    began = np.array([free_room(layout, goal) for layout, goal in zip(layouts, before, strict=True)])
    for step in range(300):
        simulation.step(np.zeros((10, 1, 2)))
        if step % 10 == 0:
            goals = simulation.world.goal[:, 0]
            rooms = np.array([free_room(layout, goal) for layout, goal in zip(layouts, goals.tolist(), strict=True)])
            # It keeps the room of a goal, 0.3 m here, or what it began with.
            assert (rooms >= np.minimum(began, 0.3) - 1e-6).all()
    assert (np.hypot(*(simulation.world.goal[:, 0] - before).T) > 0.1).all()


def test_the_same_seed_and_episode_give_the_same_field_and_others_do_not() -> None:
    simulation, [one, two] = field(2, moving=0.5)
    simulation.reset(seeds=[1, 0])
    assert simulation.world.layout(0).circles.tolist() == two.circles.tolist()
    assert simulation.world.layout(1).circles.tolist() == one.circles.tolist()
    simulation.reset()
    assert simulation.world.layout(1).circles.tolist() != one.circles.tolist()


@pytest.mark.parametrize(
    "overrides", [{"obstacles": 0}, {"obstacles": 1, "moving": 1.0}, {"obstacles": 3, "shapes": "squares"}]
)
def test_a_field_of_few_obstacles_is_a_world_too(overrides: dict[str, Any]) -> None:
    simulation, layouts = field(3, **overrides)
    simulation.step(np.zeros((3, 1, 2)))
    assert all(len(x.circles) + len(x.polygons) + len(x.movers) == overrides["obstacles"] for x in layouts)


def test_a_field_refuses_what_it_cannot_have() -> None:
    way_points = {"law": "waypoints", "points": [[0, 0]], "speed": 1.0}
    with pytest.raises(ValueError, match="crowd or evade, not waypoints"):
        field(1, target_motion=way_points)
    with pytest.raises(ValueError, match=r"give robots.count instead"):
        field(1, robots=[{"start": [0, 0, 0]}])


def test_the_record_of_a_field_counts_as_the_scenario_says() -> None:
    scenario = load({"world": {"family": "field", "obstacles": 21, "moving": 1 / 3}})
    assert scenario.world.family == "field"
    record = field_record(scenario, scenario.world)
    assert record["discs"][0] + record["polygons"][0] == 21 and record["discs"][0] == 11
    assert record["moving_discs"][0] + record["moving_polygons"][0] == 7


# ------------------------------------------------------------------------------------------------ explicit, empty


def layouts_of(scenario: Any, seeds: int = 1, **overrides: Any) -> list[Layout]:
    """Layouts of the first episodes of some seeds."""
    loaded = load(scenario, {key.replace("__", "."): value for key, value in overrides.items()})
    return [draw_layout(loaded, seed, 0) for seed in range(seeds)]


def test_an_empty_world_draws_start_and_goal_inside_and_apart() -> None:
    for layout in layouts_of({"world": {"family": "empty", "separation": 15.0}}, 50):
        assert np.abs(layout.starts[0, :2]).max() <= 9.8 and np.abs(layout.goals).max() <= 10.0
        assert math.dist(layout.starts[0, :2], layout.goals[0]) >= 15.0


def test_an_explicit_world_is_what_is_written() -> None:
    world = {
        "family": "explicit",
        "circles": [[1, 2, 0.5]],
        "polygons": [{"shell": [[3, 3], [6, 3], [6, 6], [3, 6]], "holes": [[[4, 4], [5, 4], [5, 5]]]}],
        "movers": [{"shape": {"circle": 0.3}, "at": [0, 3], "motion": {"law": "bounce", "velocity": [0.5, 0]}}],
        "start": [0, 0, 1.0],
        "goal": [8, 0],
    }
    [layout] = layouts_of({"world": world})
    assert layout.circles.tolist() == [[1, 2, 0.5]]
    assert [ring.tolist() for ring in layout.polygons[0]] == [
        [[3, 3], [6, 3], [6, 6], [3, 6]],
        [[4, 4], [5, 4], [5, 5]],
    ]
    assert layout.movers[0].at == (0, 3) and layout.movers[0].outline == 0.3
    assert layout.starts.tolist() == [[0, 0, 1.0]] and layout.goals.tolist() == [[8, 0]]
    assert layout.border.tolist() == [[-10, -10], [10, -10], [10, 10], [-10, 10]]


def test_regions_of_an_explicit_world_draw_free_places_only() -> None:
    """Most of the region is covered: by a circle, a polygon, a mover of each shape."""
    movers = [
        {"shape": {"circle": 0.9}, "at": [-1, 1], "motion": {"law": "bounce", "velocity": [0.5, 0]}},
        {
            "shape": {"polygon": [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]]},
            "at": [1, 1],
            "motion": {"law": "bounce", "velocity": [0.5, 0]},
        },
    ]
    world = {
        "family": "explicit",
        "circles": [[-1, -1, 0.9]],
        "polygons": [[[0.1, -1.9], [1.9, -1.9], [1.9, -0.1], [0.1, -0.1]]],
        "movers": movers,
        "start": {"region": [-2, -2, 2, 2]},
        "goal": {"region": [-2, -2, 2, 2]},
    }
    for layout in layouts_of({"robot": {"radius": 0.1}, "world": world}, 100):
        start, goal = layout.starts[0, :2], layout.goals[0]
        assert free_room(layout, start) >= 0.1 and free_room(layout, goal) >= 0.0
        assert all(gap_to_mover(start, mover) >= 0.1 - 1e-9 for mover in layout.movers)
        assert all(gap_to_mover(goal, mover) > 0.0 for mover in layout.movers)


def test_a_region_without_a_free_place_is_an_error_that_names_it() -> None:
    world = {"family": "explicit", "circles": [[0, 0, 3]], "start": {"region": [-1, -1, 1, 1]}, "goal": [8, 0]}
    with pytest.raises(ValueError, match=r"no free place for the start in \[-1.0, -1.0, 1.0, 1.0\] after 1000 tries"):
        layouts_of({"world": world})


def test_a_direction_that_is_drawn_has_the_stated_speed() -> None:
    movers = [{"shape": {"circle": 0.3}, "at": [3, 3], "motion": {"law": "bounce", "speed": 0.5}}]
    world = {"family": "explicit", "movers": movers, "start": [0, 0, 0], "goal": [8, 0]}
    velocities = [layout.movers[0].motion.velocity for layout in layouts_of({"world": world}, 200)]  # type: ignore[union-attr]
    drawn = np.array(velocities)
    assert np.hypot(*drawn.T) == pytest.approx(0.5)
    assert np.abs(drawn.mean(axis=0)).max() < 4.0 * 0.5 / math.sqrt(2.0 * 200)


def test_a_moving_goal_that_is_drawn_keeps_the_room_of_a_goal_from_the_start() -> None:
    motion = {"law": "bounce", "speed": 1.0}
    world = {
        "family": "explicit",
        "circles": [[5, 5, 2]],
        "start": [0, 0, 0],
        "target": {"region": [1, 1, 10, 10], "motion": motion},
    }
    for layout in layouts_of({"robot": {"radius": 0.1}, "goal": {"radius": 0.5}, "world": world}, 50):
        assert free_room(layout, layout.goals[0]) >= 0.5


# ------------------------------------------------------------------------------------------------ several robots

TWO_ROBOT_WORLDS: dict[str, dict[str, Any]] = {
    "empty": {"family": "empty", "bounds": [-3, -3, 3, 3]},
    "explicit": {
        "family": "explicit",
        "circles": [[0, 0, 2]],
        "bounds": [-5, -5, 5, 5],
        "start": {"region": [-5, -5, 5, 5]},
        "goal": [4, 4],
    },
    "u_trap": {"family": "u_trap", "start": {"region": [-5, -10, 25, 10]}},
    "ring": {"family": "ring", "inside": "start"},
    "maze": {"family": "maze", "passage": 2.0},
}


@pytest.mark.parametrize("family", TWO_ROBOT_WORLDS)
def test_robots_side_by_side_are_all_placed_where_they_are_free(family: str) -> None:
    scenario = {"robots": {"count": 2}, "world": TWO_ROBOT_WORLDS[family]}
    for layout in layouts_of(scenario, 40):
        assert math.dist(layout.starts[0, :2], layout.starts[1, :2]) == pytest.approx(2.0)
        assert min(free_room(layout, start[:2]) for start in layout.starts) >= 0.2 - 1e-9


def test_a_robot_that_would_start_in_an_obstacle_is_an_error() -> None:
    world = {"family": "explicit", "circles": [[0, 1, 0.5]], "start": [0, 0, 0], "goal": [8, 0]}
    with pytest.raises(ValueError, match=r"robot 1 .*\[0.0, 1.0, 0.0\]"):
        layouts_of({"robots": {"count": 2}, "world": world})
    with pytest.raises(ValueError, match="robot 0"):
        layouts_of({"world": {"family": "u_trap", "start": [11.5, 0.0, 0.0]}})


def test_robots_too_wide_to_stand_2_m_apart_are_an_error() -> None:
    with pytest.raises(ValueError, match="2 m apart"):
        layouts_of({"robot": {"radius": 1.1}, "robots": {"count": 2}, "world": {"family": "empty", "start": [0, 0, 0]}})
    with pytest.raises(ValueError, match="2 m apart"):
        field(1, robot={"radius": 1.1}, robots={"count": 2}, start_clearance=1.1, obstacles=2)


def test_robots_with_places_of_their_own_start_there_with_goals_of_their_own() -> None:
    [layout] = layouts_of("crossing_robots", robots__count=4)
    assert layout.starts[:, :2].tolist() == [[-5, 0], [0, -5], [5, 1], [1, 5]]
    assert layout.goals.tolist() == [[5, 0], [0, 5], [-5, 1], [1, -5]]


# ------------------------------------------------------------------------------------------------ u_trap, ring


def test_a_u_trap_has_the_measures_stated() -> None:
    [layout] = layouts_of("u_trap")
    [trap] = polygons_of(layout)
    assert trap.is_valid and trap.bounds == (5.0, -4.0, 12.0, 4.0)
    pocket = shapely.box(5.0, -3.0, 11.0, 3.0)
    assert trap.equals(shapely.box(5.0, -4.0, 12.0, 4.0).difference(pocket))


@pytest.mark.parametrize("angle", [0.5, math.pi / 2, -2.0])
def test_a_turned_u_trap_is_the_same_trap_turned_about_its_middle(angle: float) -> None:
    [straight], [turned] = layouts_of("u_trap"), layouts_of("u_trap", world__rotation=angle)
    expected = shapely.affinity.rotate(polygons_of(straight)[0], angle, origin=(8.5, 0.0), use_radians=True)
    assert polygons_of(turned)[0].symmetric_difference(expected).area < 1e-9


def test_a_u_trap_turned_at_random_is_turned_differently_by_each_seed() -> None:
    layouts = layouts_of("u_trap", 8, world__rotation="random")
    assert len({tuple(layout.polygons[0][0][0].round(6)) for layout in layouts}) == 8
    areas = [polygons_of(layout)[0].area for layout in layouts]
    assert areas == pytest.approx([7.0 * 8.0 - 6.0 * 6.0] * 8)


@pytest.mark.parametrize("inside", ["goal", "start"])
def test_a_ring_is_closed_and_start_and_goal_are_on_their_sides(inside: str) -> None:
    world = {"family": "ring", "inside": inside, "centre": [1.0, -2.0], "outer": 3.0, "inner": 2.6}
    for layout in layouts_of({"world": world}, 30):
        [ring] = polygons_of(layout)
        assert ring.is_valid and ring.area == pytest.approx(36.0 - 5.2**2)
        free = shapely.get_parts(shapely.box(-10, -10, 10, 10).difference(ring.buffer(1e-9)))
        assert len(free) == 2, "the free space falls into an inner and an outer part"
        [shut_in] = [part for part in free if part.contains(shapely.Point(1.0, -2.0))]
        start, goal = shapely.Point(layout.starts[0, :2]), shapely.Point(layout.goals[0])
        assert shut_in.contains(start) == (inside == "start")
        assert shut_in.contains(goal) == (inside == "goal")
        assert free_room(layout, layout.starts[0, :2]) >= 0.2
        assert free_room(layout, layout.goals[0]) > 0.0


# ------------------------------------------------------------------------------------------------ oni_wang


def test_the_map_of_oni_and_wang_is_that_of_the_shared_data(shared_data: Path) -> None:
    facts = yaml.safe_load((shared_data / "oni_wang_fig1.yaml").read_text())
    for start, goal in (("A", "D"), ("B", "C"), ("D", "A")):
        [layout] = layouts_of("oni_wang", world__start=start, world__goal=goal)
        assert layout.polygons[0][0].tolist() == facts["polygon"]
        assert layout.starts[0, :2].tolist() == facts["points"][start]
        assert layout.goals[0].tolist() == facts["points"][goal]


# ------------------------------------------------------------------------------------------------ maze


def maze_scenario(**world: Any) -> dict[str, Any]:
    """A maze for a small robot."""
    return {"world": {"family": "maze", "separation": 4.0, **world}}


MAZES: dict[str, dict[str, Any]] = {
    "default": {},
    "thin walls": {"wall": 0.01, "passage": 1.0},
    "oblong": {"bounds": [3.0, -8.0, 14.0, 5.0], "passage": 1.7, "wall": 0.35},
    "loops": {"loops": 0.3},
    "one row": {"bounds": [0.0, 0.0, 12.0, 1.5]},
    "no walls left": {"loops": 1.0},
}


def free_space(layout: Layout) -> Any:
    """The bounds without the walls, as shapely's."""
    return shapely.Polygon(layout.border).difference(shapely.union_all(polygons_of(layout)))


@pytest.mark.parametrize("name", MAZES)
def test_the_walls_of_a_maze_are_simple_polygons_and_all_free_space_hangs_together(name: str) -> None:
    for layout in layouts_of(maze_scenario(**MAZES[name]), 20):
        assert all(polygon.is_valid for polygon in polygons_of(layout))
        assert free_space(layout).geom_type == "Polygon"


@pytest.mark.parametrize("name", MAZES)
def test_the_passages_of_a_maze_are_as_wide_as_promised(name: str) -> None:
    """A disc of that width still gets everywhere: the shrunk free space hangs together and reaches each cell."""
    scenario = load(maze_scenario(**MAZES[name]))
    world = scenario.world
    assert isinstance(world, MazeWorld)
    columns, rows = world.cells
    (width, height), (xmin, ymin, xmax, _) = world.passages, world.bounds
    assert min(width, height) >= world.passage - 1e-9
    assert columns * width + (columns - 1) * world.wall == pytest.approx(xmax - xmin)
    assert (columns + 1) * (world.passage + world.wall) - world.wall > xmax - xmin, "another cell would fit"
    half = 0.5 * world.passage - 1e-6
    for layout in [draw_layout(scenario, seed, 0) for seed in range(10)]:
        shrunk = free_space(layout).buffer(-half, join_style="mitre")
        assert shrunk.geom_type == "Polygon"
        centres = [
            (xmin + width / 2 + x * (width + world.wall), ymin + height / 2 + y * (height + world.wall))
            for x in range(columns)
            for y in range(rows)
        ]
        assert shapely.contains(shrunk, shapely.points(centres)).all()


@pytest.mark.parametrize("name", ["default", "thin walls", "oblong", "one row"])
def test_a_maze_without_loops_is_perfect_there_is_one_way_between_any_two_cells(name: str) -> None:
    """The free space then has no island in it: each wall hangs on the border."""
    for layout in layouts_of(maze_scenario(**MAZES[name]), 20):
        assert len(free_space(layout).interiors) == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (6, 5), (14, 14)])
def test_the_open_sides_of_cells_form_a_tree_and_loops_open_the_stated_share_of_the_rest(
    shape: tuple[int, int],
) -> None:
    columns, rows = shape
    walls = (columns - 1) * rows + columns * (rows - 1)
    left = walls - (columns * rows - 1)
    opened = 0
    for seed in range(60):
        right, up = carve(columns, rows, 0.0, np.random.default_rng(seed))
        parent = {(x, y): (x, y) for x in range(columns) for y in range(rows)}

        def root(cell: tuple[int, int], parent: dict[tuple[int, int], tuple[int, int]] = parent) -> tuple[int, int]:
            while parent[cell] != cell:
                cell = parent[cell]
            return cell

        pairs = [((x, y), (x + 1, y)) for x, y in np.argwhere(right).tolist()]
        pairs += [((x, y), (x, y + 1)) for x, y in np.argwhere(up).tolist()]
        for one, other in pairs:
            assert root(one) != root(other), "this opening closes a loop"
            parent[root(one)] = root(other)
        assert len(pairs) == columns * rows - 1
        right, up = carve(columns, rows, 0.25, np.random.default_rng(seed))
        opened += int(right.sum() + up.sum()) - len(pairs)
    deviation = math.sqrt(60 * left * 0.25 * 0.75)
    assert abs(opened - 60 * left * 0.25) <= 4.0 * deviation


def test_the_border_of_a_maze_lets_no_beam_out() -> None:
    simulation = Simulation(maze_scenario() | {"lidar": {"beams": 360, "range": 60.0}}, count=10)
    simulation.reset(seeds=list(range(10)))
    assert (simulation.world.ranges < 29.0).all(), "the diagonal of the bounds is 28.3 m"


def test_start_and_goal_of_a_maze_are_middles_of_cells_and_apart() -> None:
    for layout in layouts_of(maze_scenario(separation=10.0), 30):
        assert math.dist(layout.starts[0, :2], layout.goals[0]) >= 10.0
        for point in (layout.starts[0, :2], layout.goals[0]):
            assert free_room(layout, point) >= 0.6 - 1e-9
    assert len({tuple(layout.starts[0]) for layout in layouts_of(maze_scenario(), 30)}) > 25


# ------------------------------------------------------------------------------------------------ all families

FAMILY_SCENARIOS: dict[str, Any] = {
    "empty": {"world": {"family": "empty"}},
    "explicit": {
        "world": {"family": "explicit", "start": {"region": [-9, -9, 9, 9]}, "goal": {"region": [-9, -9, 9, 9]}}
    },
    "field": "dynamic",
    "u_trap": {"world": {"family": "u_trap", "rotation": "random"}},
    "ring": {"world": {"family": "ring"}},
    "maze": "maze",
}


@pytest.mark.parametrize("family", FAMILY_SCENARIOS)
def test_a_world_is_a_function_of_seed_and_episode(family: str) -> None:
    def numbers(simulation: Simulation, row: int) -> tuple[float, ...]:
        layout = simulation.world.layout(row)
        arrays = [layout.starts, layout.goals, layout.circles, *(ring for rings in layout.polygons for ring in rings)]
        return tuple(np.concatenate([array.ravel() for array in arrays]).tolist())

    many, one = Simulation(FAMILY_SCENARIOS[family], count=4), Simulation(FAMILY_SCENARIOS[family])
    many.reset(seeds=[3, 4, 5, 6])
    one.reset(seeds=[5])
    first = [numbers(many, row) for row in range(4)]
    assert numbers(one, 0) == first[2]
    assert len(set(first)) == 4
    many.reset()
    one.reset()
    second = [numbers(many, row) for row in range(4)]
    assert numbers(one, 0) == second[2]
    assert len({*first, *second}) == 8
    many.reset(seeds=[3, 4, 5, 6])
    assert [numbers(many, row) for row in range(4)] == first


def test_large_seeds_are_seeds_too() -> None:
    simulation = Simulation("dynamic", count=3)
    simulation.reset(seeds=[2**63 - 1, 2**32, 0])
    assert len({tuple(simulation.world.layout(row).starts[0]) for row in range(3)}) == 3
    assert kernels.RUNNING == 0 and (simulation.world.outcome == kernels.RUNNING).all()
