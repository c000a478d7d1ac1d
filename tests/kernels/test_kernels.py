"""Contacts, clearances and scans of the compiled core against shapely, closed forms and slow plain sampling."""

import json
import math
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from compiled import for_python
from measured import rings_of, slow_scan
from numpy.typing import NDArray
from scipy import stats

from bug_gym.kernels import chords, geometry
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout

F64 = NDArray[np.float64]

disc_contact: Any = for_python(chords.disc_contact)
nearest_on_chord: Any = for_python(chords.nearest_on_chord)
nearest_to_wall: Any = for_python(chords.nearest_to_wall)
sin_cos: Any = for_python(geometry.sin_cos)
wall_contact: Any = for_python(chords.wall_contact)

RADIUS = 0.2  # of the robots here [m]
FAST = {"kinematics": "holonomic", "radius": RADIUS, "max_speed": 20.0}  # 2 m in a step of 0.1 s


def explicit(robot: dict[str, Any] | None = None, lidar: dict[str, Any] | None = None, **world: Any) -> Simulation:
    """One world of the explicit family; start (0, 0, 0) and a goal out of the way unless given."""
    world = {"family": "explicit", "start": [0.0, 0.0, 0.0], "goal": [-9.0, -9.0], **world}
    return Simulation({"robot": robot or {}, "lidar": lidar or {"beams": 8}, "world": world})


def outcome(simulation: Simulation, robot: int = 0) -> str:
    """The present outcome of a robot, as the info names it."""
    return str(simulation.info()["outcome"][0, robot])


# ------------------------------------------------------------------------------------------------ sine and cosine


def test_sine_and_cosine_are_the_librarys_to_two_units_in_the_last_place() -> None:
    quarters = 0.5 * math.pi * np.arange(-9, 10)
    random = np.random.default_rng(1).uniform(-1.0, 1.0, 2000)
    for angle in [*quarters, *(math.pi * random), *(6000.0 * random)]:
        sin, cos = sin_cos(angle)
        assert abs(sin - math.sin(angle)) <= 3.0 * math.ulp(math.sin(angle))  # the library may be off by one
        assert abs(cos - math.cos(angle)) <= 3.0 * math.ulp(math.cos(angle))


# ------------------------------------------------------------------------------------------------ contact on chords


def random_chords(count: int) -> Iterator[tuple[F64, F64, F64, F64, float]]:
    """Chord's start and motion, both ends of a wall, and a distance of contact."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        yield (
            rng.uniform(-2, 2, 2),
            rng.uniform(-3, 3, 2),
            rng.uniform(-2, 2, 2),
            rng.uniform(-2, 2, 2),
            rng.uniform(0, 1),
        )


def test_a_chord_touches_a_wall_exactly_when_shapely_finds_it_within_the_distance() -> None:
    seen = {True: 0, False: 0}
    for start, motion, first, second, distance in random_chords(3000):
        wall = shapely.LineString([first, second])
        if wall.distance(shapely.Point(start)) <= distance:
            continue
        fraction = wall_contact(*start, *motion, *first, *second, distance)
        gap = shapely.LineString([start, start + motion]).distance(wall) - distance
        assert (fraction <= 1.0) == (gap < 0.0), (start, motion, first, second, distance)
        seen[gap < 0.0] += 1
        if fraction <= 1.0:
            assert wall.distance(shapely.Point(start + fraction * motion)) == pytest.approx(distance, abs=1e-9)
            before = shapely.LineString([start, start + (fraction - 1e-6) * motion])
            assert before.distance(wall) > distance
    assert min(seen.values()) > 300


def test_a_chord_touches_a_disc_exactly_when_its_nearest_point_is_within_the_distance() -> None:
    seen = {True: 0, False: 0}
    for start, motion, _first, _second, distance in random_chords(3000):
        if math.hypot(*start) <= distance:
            continue
        fraction = disc_contact(*start, *motion, distance)
        chord = shapely.LineString([start, start + motion])
        touches = chord.distance(shapely.Point(0, 0)) < distance
        assert (fraction <= 1.0) == touches
        seen[touches] += 1
        if touches:
            assert math.hypot(*(start + fraction * motion)) == pytest.approx(distance, abs=1e-9)
            before = shapely.LineString([start, start + (fraction - 1e-6) * motion])
            assert before.distance(shapely.Point(0, 0)) > distance
    assert min(seen.values()) > 300


def test_the_nearest_point_of_a_chord_to_a_disc_and_to_a_wall_is_shapelys() -> None:
    for start, motion, first, second, end in random_chords(2000):
        chord = shapely.LineString([start, start + end * motion])
        wall = shapely.LineString([first, second])
        nearest = nearest_on_chord(*(start - first), *motion, end)
        assert nearest == pytest.approx(chord.distance(shapely.Point(first)), abs=1e-12)
        if not chord.intersects(wall):
            nearest = nearest_to_wall(*start, *motion, *first, *second, end)
            assert nearest == pytest.approx(chord.distance(wall), abs=1e-12)


def test_a_body_that_touches_and_leaves_or_slides_along_has_no_contact() -> None:
    assert disc_contact(1.0, 0.0, 0.5, 0.0, 1.0) == chords.NEVER
    assert disc_contact(1.0, 0.0, 0.0, 5.0, 1.0) == chords.NEVER
    assert wall_contact(0.0, 0.5, 0.0, 1.0, -9.0, 0.0, 9.0, 0.0, 0.5) == chords.NEVER
    assert wall_contact(0.0, 0.5, 3.0, 0.0, -9.0, 0.0, 9.0, 0.0, 0.5) == chords.NEVER


def test_a_body_that_touches_and_approaches_has_contact_at_once() -> None:
    assert disc_contact(1.0, 0.0, -0.5, 0.1, 1.0) == 0.0
    assert wall_contact(0.0, 0.5, 1.0, -1e-9, -9.0, 0.0, 9.0, 0.0, 0.5) == 0.0


# ------------------------------------------------------------------------------------------------ nothing tunnels


def drive_until_done(simulation: Simulation, action: Any, most: int = 200) -> F64:
    """Hold one action until the episode ends; the true path (steps + 1, 2)."""
    path = [simulation.world.pose[0, 0, :2].copy()]
    for _ in range(most):
        simulation.step([[action]])
        path.append(simulation.world.pose[0, 0, :2].copy())
        if outcome(simulation) != "running":
            break
    return np.array(path)


@pytest.mark.parametrize("tilt", np.linspace(-1.2, 1.2, 9))
def test_a_robot_at_20_m_per_s_stops_at_a_wall_1_mm_thick(tilt: float) -> None:
    ends = np.array([[0.0, -3.0], [0.0, 3.0]])
    turn = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
    corners = np.vstack([ends, ends[::-1] + [0.001, 0.0]]) @ turn + [4.3, 0.0]
    wall = shapely.Polygon(corners)
    for back in np.linspace(0.0, 2.0, 7):  # so that steps end at all distances from the wall
        simulation = explicit(FAST, polygons=[corners.tolist()], start=[-back, 0.0, 0.0])
        simulation.reset(seeds=[0])
        path = drive_until_done(simulation, [1.0, 0.0])
        assert outcome(simulation) == "collision"
        assert wall.distance(shapely.Point(path[-1])) == pytest.approx(RADIUS, abs=1e-9)
        assert wall.distance(shapely.LineString(path)) == pytest.approx(RADIUS, abs=1e-9)


@pytest.mark.parametrize("tilt", np.linspace(-0.7, 0.7, 5))
def test_a_robot_at_20_m_per_s_never_slips_between_two_circles_that_touch(tilt: float) -> None:
    side = np.array([-math.sin(tilt), math.cos(tilt)])
    centres = np.array([5.0, 0.0]) + np.array([side, -side])
    simulation = explicit(FAST, circles=[[*centre, 1.0] for centre in centres.tolist()])
    simulation.reset(seeds=[0])
    path = drive_until_done(simulation, [1.0, 0.0])
    assert outcome(simulation) == "collision"
    assert np.hypot(*(centres - path[-1]).T).min() == pytest.approx(1.0 + RADIUS, abs=1e-9)


@pytest.mark.parametrize("margin", [1e-6, 1e-3])
def test_a_robot_at_20_m_per_s_passes_a_gap_that_is_a_little_wider_than_itself(margin: float) -> None:
    half = RADIUS + margin
    walls = [[[4, half], [4.001, half], [4.001, 6], [4, 6]], [[6, -half], [6.5, -half], [6.5, -6], [6, -6]]]
    circles = [[5.0, half + 1.0, 1.0], [5.0, -half - 1.0, 1.0]]
    simulation = explicit(FAST, circles=circles, polygons=walls, goal=[8.0, 0.0])
    simulation.reset(seeds=[0])
    drive_until_done(simulation, [1.0, 0.0])
    assert outcome(simulation) == "success"
    assert simulation.info()["min_clearance"][0, 0] == pytest.approx(margin, abs=1e-9)


SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])


@pytest.mark.parametrize("law", ["bounce", "waypoints"])
@pytest.mark.parametrize("shape", ["circle", "polygon"])
def test_a_mover_at_20_m_per_s_never_passes_through_a_standing_robot(shape: str, law: str) -> None:
    shapes: dict[str, Any] = {"circle": {"circle": 0.3}, "polygon": {"polygon": SQUARE.tolist()}}
    outline = shapely.Point(0, 0).buffer(0.3, 256) if shape == "circle" else shapely.Polygon(SQUARE)
    seen = {"collision": 0, "running": 0}
    for x in np.linspace(-0.9, 0.9, 20):
        motions: dict[str, Any] = {
            "bounce": {"law": "bounce", "velocity": [0.0, -20.0]},
            "waypoints": {"law": "waypoints", "points": [[x, -8.0]], "speed": 20.0, "stop": True},
        }
        mover = {"shape": shapes[shape], "at": [x, 3.1], "motion": motions[law]}
        simulation = explicit(FAST, movers=[mover])
        simulation.reset(seeds=[0])
        for _ in range(4):  # 8 m: from 3.1 past the robot at 0, away from the border
            simulation.step([[[0.0, 0.0]]])
        sweep = shapely.unary_union([shapely.affinity.translate(outline, x, y) for y in np.linspace(3.1, -4.9, 801)])
        gap = sweep.distance(shapely.Point(0, 0)) - RADIUS
        assert abs(gap) > 1e-3, "the case decides nothing"
        expected = "collision" if gap < 0.0 else "running"
        assert outcome(simulation) == expected
        seen[expected] += 1
    assert min(seen.values()) > 4


def test_a_robot_chasing_a_mover_of_its_own_speed_does_not_touch_it() -> None:
    mover = {"shape": {"circle": 0.3}, "at": [0.51, 0.0], "motion": {"law": "bounce", "velocity": [20.0, 0.0]}}
    simulation = explicit(FAST, movers=[mover])
    simulation.reset(seeds=[0])
    for _ in range(4):
        simulation.step([[[1.0, 0.0]]])
    assert outcome(simulation) == "running"
    assert simulation.info()["min_clearance"][0, 0] == pytest.approx(0.01, abs=1e-9)


def test_a_robot_stops_where_its_chord_first_touches() -> None:
    """A disc ahead, off the line by less than the sum of radii: where it touches follows from Pythagoras."""
    simulation = explicit(FAST, circles=[[3.0, 0.4, 0.5]])
    simulation.reset(seeds=[0])
    path = drive_until_done(simulation, [1.0, 0.0])
    assert path[-1] == pytest.approx([3.0 - math.sqrt(0.7**2 - 0.4**2), 0.0], abs=1e-12)


def test_a_body_of_several_circles_touches_with_the_one_that_is_nearest() -> None:
    robot = {"kinematics": "holonomic", "circles": [[-0.3, 0.0, 0.2], [0.3, 0.0, 0.25]], "max_speed": 20.0}
    simulation = explicit(robot, circles=[[5.0, 0.0, 0.5]], start=[0.0, 0.0, math.pi / 2.0])
    simulation.reset(seeds=[0])
    path = drive_until_done(simulation, [0.0, -1.0])  # to the robot's right, which is along +x
    # Both circles of the body lie on x = the robot's, at y = -0.3 and 0.3: the larger one touches first.
    assert path[-1] == pytest.approx([5.0 - math.sqrt(0.75**2 - 0.3**2), 0.0], abs=1e-9)


# ------------------------------------------------------------------------------------------------ clearance


def gaps_along(before: Layout, after: Layout, footprint: F64, samples: int) -> float:
    """Smallest distance from the robot's body to anything while all go straight from `before` to `after`, sampled."""
    smallest = math.inf
    for share in np.linspace(0.0, 1.0, samples):
        x, y = before.starts[0, :2] + share * (after.starts[0, :2] - before.starts[0, :2])
        assert before.starts[0, 2] == after.starts[0, 2], "the oracle is for robots that don't turn"
        cos, sin = math.cos(before.starts[0, 2]), math.sin(before.starts[0, 2])
        for ox, oy, radius in footprint:
            centre = np.array([x + cos * ox - sin * oy, y + sin * ox + cos * oy])
            for cx, cy, r in before.circles:
                smallest = min(smallest, math.dist(centre, (cx, cy)) - r - radius)
            for old, new in zip(before.movers, after.movers, strict=True):
                at = np.array(old.at) + share * (np.array(new.at) - old.at)
                if isinstance(old.outline, float):
                    smallest = min(smallest, math.dist(centre, at) - old.outline - radius)
                else:
                    gap = shapely.LinearRing(old.outline + at).distance(shapely.Point(centre))
                    smallest = min(smallest, gap - radius)
            for ring, moves in rings_of(before):
                if moves is None:
                    smallest = min(smallest, shapely.LinearRing(ring).distance(shapely.Point(centre)) - radius)
    return smallest


CLEARANCE_WORLDS: dict[str, dict[str, Any]] = {
    "field": {"family": "field", "moving": 0.5, "speeds": [0.5, 2.0], "solvable": 0.4},
    "explicit": {
        "family": "explicit",
        "circles": [[2.0, 1.0, 0.5]],
        "polygons": [{"shell": [[3, -1], [6, -1], [6, -4], [3, -4]], "holes": [[[4, -2], [5, -2], [5, -3]]]}],
        "movers": [
            {
                "shape": {"polygon": [[-1, 0], [1, 0], [0, 1]]},
                "at": [-2, 2],
                "motion": {"law": "bounce", "velocity": [1.5, -1]},
            },
            {"shape": {"circle": 0.3}, "at": [0, -3], "motion": {"law": "random_walk", "speed": 2.0}},
            {
                "shape": {"circle": 0.2},
                "at": [1, 4],
                "motion": {"law": "waypoints", "points": [[1, -4], [-4, -4]], "speed": 3.0},
            },
        ],
        "start": {"region": [-1.5, -1.5, 1.5, 1.0]},
        "goal": [8, 8],
    },
}


@pytest.mark.parametrize("family", CLEARANCE_WORLDS)
def test_the_smallest_clearance_is_that_of_all_chords_sampled_densely(family: str) -> None:
    robot = {"circles": [[0.0, 0.1, 0.2], [0.15, -0.1, 0.15]], "max_speed": 3.0}
    samples, ends = 101, {"running": 0, "collision": 0}
    for seed in range(12):
        simulation = Simulation({"robot": robot, "lidar": {"beams": 1}, "world": CLEARANCE_WORLDS[family]})
        simulation.reset(seeds=[seed])
        rng = np.random.default_rng(seed)
        before = simulation.world.layout(0)
        smallest = gaps_along(before, before, simulation.world.footprint, 1)
        for _ in range(8):
            simulation.step(rng.uniform(-1, 1, (1, 1, 2)))
            after = simulation.world.layout(0)
            smallest = min(smallest, gaps_along(before, after, simulation.world.footprint, samples))
            # Between two samples nothing comes nearer than half the fastest relative motion between them.
            slack = (3.0 + 3.0) * 0.1 / (samples - 1) / 2
            reached = simulation.info()["min_clearance"][0, 0]
            if outcome(simulation) == "running":
                assert smallest - slack <= reached <= smallest + 1e-9
            else:
                break
            before = after
        ends[outcome(simulation)] += 1
    assert ends["running"] > 2


def test_the_clearance_on_a_straight_run_past_a_polygon_is_shapelys() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        corners = rng.uniform(-1, 1, (3, 2)) + [0.0, 3.0]
        simulation = explicit(FAST, polygons=[corners.tolist()], start=[-8.0, 0.0, 0.0], goal=[9.0, 0.0])
        simulation.reset(seeds=[0])
        path = drive_until_done(simulation, [0.37, 0.0])
        assert outcome(simulation) == "success"
        border = shapely.box(-10, -10, 10, 10).exterior
        run = shapely.LineString(path)
        expected = min(run.distance(shapely.Polygon(corners)), run.distance(border)) - RADIUS
        assert simulation.info()["min_clearance"][0, 0] == pytest.approx(expected, abs=1e-9)


# ------------------------------------------------------------------------------------------------ robots


def robots_scenario(places: list[dict[str, Any]], **robot: Any) -> dict[str, Any]:
    """Several robots in an empty world."""
    world = {"family": "empty", "start": [0, 0, 0], "goal": [9, 9]}
    return {"robot": {**FAST, **robot}, "lidar": {"beams": 4}, "world": world, "robots": places}


def test_two_robots_that_meet_head_on_touch_in_the_middle_and_both_have_collided() -> None:
    places = [{"start": [-3.3, 0, 0]}, {"start": [3.3, 0.1, math.pi]}]
    simulation = Simulation(robots_scenario(places))
    simulation.reset(seeds=[0])
    for _ in range(3):
        simulation.step([[[1.0, 0.0], [1.0, 0.0]]])
    pose = simulation.world.pose[0]
    assert [outcome(simulation, robot) for robot in range(2)] == ["collision", "collision"]
    half = 0.5 * math.sqrt(0.4**2 - 0.1**2)
    assert pose[:, 0] == pytest.approx([-half, half], abs=1e-9)
    assert simulation.info()["min_clearance"][0] == pytest.approx([0.0, 0.0])


def test_robots_that_cross_within_a_step_touch_only_if_they_are_there_at_the_same_time() -> None:
    for delay, expected in ((0.0, "collision"), (1.0, "running")):
        places = [{"start": [-1.0, 0, 0]}, {"start": [0, -1.0 - delay, math.pi / 2]}]
        simulation = Simulation(robots_scenario(places))
        simulation.reset(seeds=[0])
        simulation.step([[[1.0, 0.0], [1.0, 0.0]]])
        assert [outcome(simulation, robot) for robot in range(2)] == [expected] * 2


def test_a_robot_at_its_goal_stands_and_is_an_obstacle_to_the_others() -> None:
    places = [{"start": [0, 0, 0], "goal": [1.0, 0]}, {"start": [-6, 0.1, 0], "goal": [8, 0]}]
    simulation = Simulation(robots_scenario(places))
    simulation.reset(seeds=[0])
    simulation.step([[[1.0, 0.0], [0.0, 0.0]]])
    assert outcome(simulation, 0) == "success"
    stands = simulation.world.pose[0, 0].copy()
    assert stands[0] == pytest.approx(0.7, abs=1e-9), "it stops where it comes within the goal radius of 0.3"
    for _ in range(5):
        result = simulation.step([[[1.0, 1.0], [1.0, 0.0]]])
    assert outcome(simulation, 0) == "success"
    assert (simulation.world.pose[0, 0] == stands).all()
    assert outcome(simulation, 1) == "collision"
    assert simulation.world.pose[0, 1, 0] == pytest.approx(0.7 - math.sqrt(0.4**2 - 0.1**2), abs=1e-9)
    assert result.reward[0, 0] == 0.0
    assert simulation.world.ranges[0, 1, 0] == pytest.approx(
        math.sqrt(0.4**2 - 0.1**2) - math.sqrt(0.2**2 - 0.1**2), abs=1e-6
    )


def gaps_between(places: F64) -> F64:
    """Distances (N, R, R) between the robots' centres, infinite to themselves [m]."""
    apart: F64 = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
    apart[:, np.eye(places.shape[1], dtype=bool)] = np.inf
    return apart


def settle_slowly(starts: F64, motions: F64, samples: int) -> tuple[F64, NDArray[np.bool_]]:
    """Where robots (N, R, 2) that go straight end when each stops at its first touch: time in small steps.

    Returns: places (N, R, 2) and whether each has touched (N, R).
    """
    places, touched = starts.copy(), np.zeros(starts.shape[:2], dtype=bool)
    for _ in range(samples):
        places = places + np.where(touched[..., None], 0.0, motions / samples)
        touched = touched | (gaps_between(places) < 2.0 * RADIUS).any(axis=2)
    return places, touched


@pytest.mark.parametrize("robots", [2, 4, 7])
def test_robots_in_one_step_stop_where_a_slow_simulation_in_small_steps_stops_them(robots: int) -> None:
    rng = np.random.default_rng(5)
    starts = rng.uniform(-1.2, 1.2, (2000, robots, 2))
    starts = starts[gaps_between(starts).min(axis=(1, 2)) > 2.0 * RADIUS + 0.01]
    count, samples = len(starts), 500
    apart = [{"start": [2.0 * robot - 8.0, 0.0, 0.0]} for robot in range(robots)]
    simulation = Simulation(robots_scenario(apart), count=count)
    simulation.reset(seeds=[0] * count)
    simulation.world.pose[:, :, :2] = starts
    actions = rng.uniform(-0.7, 0.7, (count, robots, 2))
    simulation.step(actions)
    poses, collided = simulation.world.pose[:, :, :2], simulation.info()["collision"]
    assert gaps_between(poses).min() > 2.0 * RADIUS - 1e-9
    assert count > 50 and collided.sum(axis=1).max() > min(robots, 3) - 1
    # The slow one lets two robots come 4 m / 500 too near, and misses a touch shorter than that: a few rows in a
    # thousand are so near to the edge that the two differ.
    places, touched = settle_slowly(starts, actions * 2.0, samples)
    same = (collided == touched).all(axis=1)
    assert same.mean() > 0.97
    assert np.quantile(np.abs(poses - places)[same], 0.99) < 0.03


# ------------------------------------------------------------------------------------------------ scan


@pytest.fixture(scope="module")
def barn_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small world in the form of the BARN benchmark."""
    rng = np.random.default_rng(0)
    cylinders = np.round(rng.uniform([-5, 4], [1, 12], (60, 2)), 3)
    world = {"world": 0, "start": [-2.0, 3.0, 1.57], "goal": [-2.0, 13.0], "cylinder_radius": 0.075}
    path = tmp_path_factory.mktemp("barn") / "worlds.jsonl"
    path.write_text(json.dumps(world | {"cylinders": cylinders.tolist()}) + "\n")
    return path


SCAN_WORLDS: dict[str, dict[str, Any]] = {
    "empty": {"family": "empty"},
    "circles": {"family": "field", "shapes": "circles", "moving": 0.5, "obstacles": 30},
    "polygons": {"family": "field", "shapes": "polygons", "moving": 0.5, "obstacles": 30},
    "squares": {"family": "field", "shapes": "squares", "moving": 0.3, "obstacles": 30},
    "mixed": {"family": "field", "shapes": "mixed", "obstacles": 40, "solvable": 0.3},
    "crowded": {"family": "field", "obstacles": 300, "sizes": [0.05, 0.2], "moving": 0.5},
    "explicit": CLEARANCE_WORLDS["explicit"],
    "u_trap": {"family": "u_trap", "rotation": "random"},
    "ring": {"family": "ring", "inside": "start"},
    "maze": {"family": "maze", "loops": 0.2},
    "oni_wang": {"family": "oni_wang"},
    "barn": {"family": "barn"},
}
BODY = {"circles": [[0.0, 0.05, 0.12], [0.1, -0.05, 0.1]], "max_speed": 3.0, "kinematics": "differential"}


@pytest.mark.parametrize("name", SCAN_WORLDS)
def test_the_scan_is_that_of_closed_forms_and_shapely_in_worlds_of_every_family(name: str, barn_file: Path) -> None:
    world = SCAN_WORLDS[name] | ({"path": str(barn_file)} if name == "barn" else {})
    beams, worst, returned = 91, 0.0, 0
    angles = 2.0 * np.pi * np.arange(beams) / beams
    simulation = Simulation({"robot": BODY, "lidar": {"beams": beams, "range": 10.0}, "world": world}, count=6)
    simulation.reset(seeds=list(range(6)))
    rng = np.random.default_rng(0)
    for _ in range(6):
        for row in range(6):
            layout = simulation.world.layout(row)
            expected = slow_scan(layout, np.zeros((0, 3)), simulation.world.pose[row, 0], angles, 10.0)
            worst = max(worst, float(np.abs(simulation.world.ranges[row, 0] - expected).max()))
            returned += int((expected < 10.0).sum())
        simulation.step(rng.uniform(-1, 1, (6, 1, 2)))
    assert worst < 1e-4
    assert returned > beams


@pytest.mark.parametrize("beams", [1, 2, 3, 5, 7, 8, 9, 64, 181])
@pytest.mark.parametrize("fov", [0.4, math.pi, 6.0, 2.0 * math.pi])
def test_beams_point_where_the_contract_says_for_any_number_and_field_of_view(beams: int, fov: float) -> None:
    world = {"family": "field", "obstacles": 40, "moving": 0.5}
    simulation = Simulation({"lidar": {"beams": beams, "fov": fov, "range": 7.0}, "world": world}, count=8)
    simulation.reset(seeds=list(range(8)))
    if fov == 2.0 * math.pi:
        angles = [2.0 * math.pi * i / beams for i in range(beams)]
    elif beams == 1:
        angles = [0.0]
    else:
        angles = [-0.5 * fov + i * fov / (beams - 1) for i in range(beams)]
    for row in range(8):
        layout = simulation.world.layout(row)
        expected = slow_scan(layout, np.zeros((0, 3)), simulation.world.pose[row, 0], np.array(angles), 7.0)
        assert np.abs(simulation.world.ranges[row, 0] - expected).max() < 1e-4


@pytest.mark.parametrize("heading", np.linspace(-np.pi, np.pi, 9))
def test_beams_along_walls_and_into_corners_are_exact(heading: float) -> None:
    """A square room: the distance along a bearing is the half side over the larger of |cos| and |sin|."""
    lidar = {"beams": 720, "range": 10.0}
    simulation = explicit({}, lidar, bounds=[-5, -5, 5, 5], start=[0.0, 0.0, heading], goal=[4, 4])
    simulation.reset(seeds=[0])
    angles = heading + 2.0 * np.pi * np.arange(720) / 720
    expected = 5.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    assert np.abs(simulation.world.ranges[0, 0] - expected).max() < 1e-5


@pytest.mark.parametrize("apart", [0.0, 1e-300, 1e-16, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("corner", [[3.0, 1.0], [0.5, 0.0], [3.0, 0.0], [-2.0, -2.0]])
def test_a_corner_that_is_given_twice_does_not_disturb_the_scan(corner: list[float], apart: float) -> None:
    x, y = corner
    square = [[x, y], [x + apart, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]]
    plain, doubled = (explicit({}, {"beams": 37}, polygons=[ring]) for ring in ([square[0], *square[2:]], square))
    for simulation in (plain, doubled):
        simulation.reset(seeds=[0])
    assert np.abs(plain.world.ranges - doubled.world.ranges).max() < 1e-5
    assert plain.world.ranges.min() > 0.0
    clearances = [simulation.info()["min_clearance"][0, 0] for simulation in (plain, doubled)]
    assert clearances[0] == pytest.approx(clearances[1], abs=1e-8)


SHELL = [[2.0, -2.0], [5.0, -1.5], [4.5, 2.5], [3.0, 0.5], [1.5, 2.0]]
HOLE = [[2.5, -1.0], [3.5, -1.0], [3.5, 0.0], [2.5, 0.0]]


@pytest.mark.parametrize("start", [[0.0, 0.0], [3.0, 1.2], [3.0, -0.5], [3.3, 4.0], [6.0, -3.0]])
def test_a_polygon_looks_the_same_whichever_way_its_corners_run(start: list[float]) -> None:
    """From afar, from its notch, from its hole: walls that face away are left out only where others hide them."""
    scans = []
    for shell, hole in product((SHELL, SHELL[::-1]), (HOLE, HOLE[::-1])):
        polygon = {"shell": shell, "holes": [hole]}
        simulation = explicit(
            {"radius": 0.05}, {"beams": 90, "range": 8.0}, polygons=[polygon], start=[*start, 0.3], goal=[-5.0, 5.0]
        )
        simulation.reset(seeds=[0])
        scans.append(simulation.world.ranges[0, 0].copy())
    outline = shapely.Polygon(SHELL, [HOLE]).boundary
    for beam, distance in enumerate(scans[0].tolist()):
        angle = 0.3 + 2.0 * math.pi * beam / 90
        ray = shapely.LineString([start, [start[0] + 8.0 * math.cos(angle), start[1] + 8.0 * math.sin(angle)]])
        seen = shapely.Point(start).distance(ray.intersection(outline)) if ray.intersects(outline) else 8.0
        assert distance <= seen + 1e-5  # the border may be nearer
        if distance < seen - 1e-5:
            end = np.array(start) + distance * np.array([math.cos(angle), math.sin(angle)])
            assert np.abs(end).max() == pytest.approx(10.0, abs=1e-5)
    assert all(np.array_equal(scan, scans[0]) for scan in scans)


def test_robots_see_the_bodies_of_one_another() -> None:
    world = {"family": "field", "obstacles": 10, "separation": 4.0}
    robots = {"count": 3}
    simulation = Simulation({"robot": BODY, "lidar": {"beams": 121}, "world": world, "robots": robots}, count=3)
    simulation.reset(seeds=[0, 1, 2])
    rng = np.random.default_rng(0)
    angles = 2.0 * np.pi * np.arange(121) / 121
    for _ in range(5):
        for row in range(3):
            poses = simulation.world.pose[row]
            bodies = [np.array(simulation.scenario.robot.body(tuple(pose))) for pose in poses.tolist()]
            for robot in range(3):
                peers = np.concatenate([body for other, body in enumerate(bodies) if other != robot])
                expected = slow_scan(simulation.world.layout(row), peers, poses[robot], angles, 10.0)
                assert np.abs(simulation.world.ranges[row, robot] - expected).max() < 1e-4
        simulation.step(rng.uniform(-1, 1, (3, 3, 2)))


def test_what_is_nearer_than_the_least_range_reads_the_least_range() -> None:
    lidar = {"beams": 36, "range": 3.0, "min_range": 0.5}
    simulation = explicit({}, lidar, circles=[[0.6, 0.0, 0.3]])
    simulation.reset(seeds=[0])
    scan = simulation.world.ranges[0, 0]
    assert scan[0] == np.float32(0.5)
    assert scan[18] == np.float32(3.0)
    assert scan.min() == np.float32(0.5)


# ------------------------------------------------------------------------------------------------ noise of the scan


def scans_of_a_standing_robot(lidar: dict[str, Any], steps: int, seed: int = 0) -> NDArray[np.float32]:
    """Scans (steps, B) from the middle of an empty square room of 4 m."""
    simulation = explicit({}, {"range": 10.0, **lidar}, bounds=[-2, -2, 2, 2], goal=[1.5, 1.5])
    simulation.reset(seeds=[seed])
    scans = []
    for _ in range(steps):
        simulation.step([[[0.0, 0.0]]])
        scans.append(simulation.world.ranges[0, 0].copy())
    return np.array(scans)


def test_range_noise_is_normal_with_the_mean_and_deviation_stated_and_without_memory() -> None:
    beams, steps, sigma = 360, 100, 0.05
    truth = scans_of_a_standing_robot({"beams": beams}, 1)[0]
    errors = (scans_of_a_standing_robot({"beams": beams, "noise": sigma}, steps) - truth) / sigma
    count = errors.size
    assert abs(errors.mean()) < 4.0 / math.sqrt(count)
    assert abs(errors.std() - 1.0) < 4.0 / math.sqrt(2.0 * count)
    assert stats.kstest(errors.ravel(), "norm").pvalue > 1e-3
    for one, other in ((errors[1:], errors[:-1]), (errors[:, 1:], errors[:, :-1]), (errors[:, 2:], errors[:, :-2])):
        assert abs((one * other).mean()) < 4.0 / math.sqrt(count)
    assert abs((errors[:, 1:] ** 2 * errors[:, :-1] ** 2).mean() - 1.0) < 0.06  # pairs share no scale either
    assert np.unique(errors).size > 0.9 * count


def test_seeds_episodes_and_robots_have_noise_of_their_own() -> None:
    lidar = {"beams": 90, "noise": 0.05}
    world = {"family": "empty", "bounds": [-3, -3, 3, 3], "start": [0, 0, 0], "goal": [2.5, 2.5]}
    robots = [{"start": [0, 1, 0.0]}, {"start": [0, -1, 0.0]}]
    simulation = Simulation({"lidar": lidar, "world": world, "robots": robots}, count=2)
    first = simulation.reset(seeds=[3, 4])[..., :90]
    again = simulation.reset()[..., :90]
    mirrored = first[0, 1][(-np.arange(90)) % 90]  # by symmetry the second robot's truth is the first one's mirrored
    assert not np.isclose(first[0], first[1], atol=1e-6).all(axis=1).any()
    assert not np.isclose(first[0], again[0], atol=1e-6).all(axis=1).any()
    assert not np.isclose(first[0, 0], mirrored, atol=1e-6).all()
    assert (simulation.reset(seeds=[3, 4])[..., :90] == first).all()


def test_noise_stays_within_the_ranges_and_leaves_beams_without_return_alone() -> None:
    lidar = {"beams": 360, "range": 2.2, "min_range": 1.95, "noise": 0.3}
    truth = scans_of_a_standing_robot(lidar | {"noise": 0.0}, 1)[0]
    scans = scans_of_a_standing_robot(lidar, 30)
    assert scans.min() == np.float32(1.95) and scans.max() == np.float32(2.2)
    silent = truth == np.float32(2.2)
    assert silent.sum() > 90
    assert (scans[:, silent] == np.float32(2.2)).all()


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_the_stated_share_of_beams_drops_out_and_reads_the_range(share: float) -> None:
    truth = scans_of_a_standing_robot({"beams": 360}, 1)[0]
    scans = scans_of_a_standing_robot({"beams": 360, "dropout": share}, 60)
    dropped = scans == np.float32(10.0)
    assert (scans[~dropped] == np.broadcast_to(truth, scans.shape)[~dropped]).all()
    deviation = math.sqrt(share * (1.0 - share) / dropped.size)
    assert abs(dropped.mean() - share) <= 4.0 * deviation
    if share < 1.0:
        both = (dropped[:, 1:] & dropped[:, :-1]).mean()
        assert abs(both - share**2) < 6.0 * deviation, "neighbours drop out together"


def test_dropout_does_not_depend_on_the_noise_of_the_beam() -> None:
    truth = scans_of_a_standing_robot({"beams": 360}, 1)[0]
    scans = scans_of_a_standing_robot({"beams": 360, "noise": 0.05, "dropout": 0.5}, 60)
    kept = scans < 10.0
    errors = ((scans - truth) / 0.05)[kept]
    assert abs(errors.mean()) < 4.0 / math.sqrt(errors.size)
    assert abs(errors.std() - 1.0) < 4.0 / math.sqrt(2.0 * errors.size)
