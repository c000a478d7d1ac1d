"""Scenarios: what the schema accepts, what it refuses and in which words, and that nothing is lost on the way."""

from __future__ import annotations

import copy
import json
import math
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import shapely
import yaml
from pydantic import ValidationError

from bug_gym.config import (
    FAMILIES,
    LAWS,
    ONI_WANG_PLACES,
    ONI_WANG_POLYGON,
    SCENARIO_FOLDER,
    Bounce,
    ExplicitWorld,
    FieldWorld,
    Lidar,
    MazeWorld,
    Part,
    Polygon,
    Robot,
    Scenario,
    ScenarioError,
    StartRegion,
    UTrapWorld,
    checked,
    dump,
    from_folder,
    load,
    scenario_names,
    to_yaml,
)
from bug_gym.schema.own import ObservationField, RewardTerm
from bug_gym.simulation import Simulation

BARN_FILE = "worlds.jsonl"
MAP_FILE = "plan.yaml"
RECORDING_FILE = "walk.csv"

SQUARE = [[4, -2], [5, -2], [5, 2], [4, 2]]
BOX = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
CRATE = {"shape": {"polygon": BOX}, "motion": {"law": "bounce", "speed": 1}}

# One scenario of each family, every key of the family set to something else than its default.
FAMILY_EXAMPLES: dict[str, dict[str, Any]] = {
    "empty": {
        "bounds": [-5, -5, 5, 5],
        "start": {"region": [-4, -4, -3, 4], "heading": 0.5},
        "target": {"region": [2, -4, 4, 4], "motion": {"law": "waypoints", "points": [[0, 1], [1, 0]], "speed": 0.3}},
        "separation": 5.5,
    },
    "explicit": {
        "bounds": [-9, -8, 9, 8],
        "circles": [[2.0, 0.0, 0.5], [-3, 3, 1e-3]],
        "polygons": [
            SQUARE,
            {"shell": [[-8, -8], [0, -8], [0, -4], [-8, -4]], "holes": [[[-2, -7], [-1, -7], [-1, -6]]]},
        ],
        "movers": [
            {"shape": {"circle": 0.3}, "at": [0, 3], "motion": {"law": "bounce", "velocity": [0.5, 0]}},
            {"shape": {"circle": 0.3}, "at": [1, 3], "motion": {"law": "bounce", "speed": 0.1}},
            {
                "shape": {"polygon": [[-1, 0], [1, 0], [0, 1]]},
                "at": [0, 5],
                "motion": {"law": "waypoints", "points": [[3, 5], [0, 5]], "speed": 0.4, "stop": True},
            },
            {
                "shape": {"circle": 0.2},
                "at": [7, 7],
                "motion": {"law": "random_walk", "speed": 0.2, "min_leg": 0.5, "max_leg": 0.7},
            },
            {
                "shape": {"circle": 0.2},
                "at": [-7, 7],
                "motion": {"law": "crowd", "speed": 1.1, "horizon": 1.5, "goals": [[7, -7], [0, 7]]},
            },
            {
                "shape": {"circle": 0.2},
                "at": [-7, 5],
                "motion": {"law": "evade", "speed": 0.9, "sight": 2.5, "wander": 0.1},
            },
            {
                "shape": {"circle": 0.2},
                "at": [-7, 3],
                "motion": {"law": "replay", "points": [[0.5, -7, 3], [1.5, -6.5, 4]]},
            },
        ],
        "start": [0, 0, 0.1],
        "goal": [8, 0],
    },
    "field": {
        "bounds": [0, 0, 30, 30],
        "obstacles": 7,
        "shapes": "squares",
        "sizes": [0.2, 0.4],
        "moving": 0.25,
        "speeds": [0.0, 0.2],
        "laws": ["random_walk"],
        "pedestrians": 3,
        "pedestrian_radius": 0.25,
        "pedestrian_speeds": [0.5, 0.6],
        "solvable": 0.5,
        "separation": 3.0,
        "start_clearance": 0.7,
        "goal_clearance": 0.0,
        "start": [1, 1, 0],
        "goal": {"region": [20, 20, 30, 30]},
        "target_motion": {"law": "random_walk", "speed": 0.4},
    },
    "u_trap": {
        "bounds": [-20, -20, 40, 20],
        "half_width": 2.0,
        "depth": 5.0,
        "wall": 0.5,
        "mouth_x": 4.0,
        "rotation": "random",
        "start": {"region": [-1, -1, 1, 1]},
        "goal": [19, 1],
    },
    "hook": {
        "bounds": [[-20, -20], [40, -20], [45, 0], [40, 20], [-20, 20]],
        "centre": [9, 1],
        "half_side": 5.0,
        "wall": 0.5,
        "slit": 1.5,
        "slit_at": 1.0,
        "rotation": 0.3,
        "start": [8, 0, 1],
        "goal": {"region": [25, -5, 30, 5]},
    },
    "ring": {
        "bounds": [-20, -20, 20, 20],
        "centre": [10, 0],
        "outer": 3.0,
        "inner": 2.0,
        "inside": "start",
        "start": [10, 0, 1],
        "goal": [0, 0],
    },
    "maze": {"bounds": [0, 0, 12, 9], "passage": 1.5, "wall": 0.1, "loops": 0.2, "separation": 4.0},
    "corridor": {"bounds": [0, 0, 40, 20], "width": 1.5, "shifts": 5, "wall": 0.4},
    "rooms": {
        "bounds": [0, 0, 16, 20],
        "columns": 2,
        "rows": 4,
        "door": 1.0,
        "wall": 0.1,
        "loops": 0.5,
        "unevenness": 0.2,
        "start": {"region": [0, 0, 8, 8]},
        "goal": {"region": [8, 8, 16, 20]},
        "separation": 5.0,
    },
    "crossing": {
        "bounds": [0, 0, 16, 12],
        "streams": 2,
        "lane": 1.0,
        "radius": 0.25,
        "gap": 2.0,
        "speeds": [0.1, 0.2],
        "apron": 2.5,
        "start": [1, 6, 0],
        "goal": [15, 6],
        "separation": 3.0,
    },
    "forest": {
        "bounds": [[0, 0], [20, 0], [20, 12], [0, 20]],
        "trees": 30,
        "sizes": [0.2, 0.4],
        "solvable": 0.4,
        "start_clearance": 0.5,
        "goal_clearance": 0.25,
        "start": [2, 2, 0],
        "goal": {"region": [10, 5, 20, 10]},
        "separation": 4.0,
    },
    "urban": {
        "bounds": [0, 0, 20, 30],
        "columns": 2,
        "rows": 3,
        "street": 1.0,
        "unevenness": 0.1,
        "squares": 0.25,
        "courtyards": 1.0,
        "gateways": 0.5,
        "gateway": 1.1,
        "depth": 0.5,
        "start": [0.5, 0.5, 0],
        "goal": [19.5, 29.5],
        "separation": 9.0,
    },
    "beach": {
        "bounds": [0, 0, 30, 40],
        "obstacles": 9,
        "sizes": [0.5, 1.5],
        "corners_each": [3, 4],
        "pedestrians": 6,
        "radius": 0.25,
        "speeds": [0.2, 0.3],
        "law": "random_walk",
        "solvable": 0.4,
        "start_clearance": 1.0,
        "goal_clearance": 0.5,
        "start": {"region": [0, 0, 30, 5]},
        "goal": {"region": [0, 35, 30, 40]},
        "separation": 20.0,
    },
    "circle_swap": {"bounds": [0, 0, 20, 16], "radius": 5.0, "jitter": 0.2, "rotation": "random"},
    "warehouse": {
        "bounds": [0, 0, 20, 16],
        "columns": 2,
        "rows": 3,
        "aisle": 1.5,
        "spacing": 1.0,
        "separation": 5.0,
    },
    "oni_wang": {"bounds": [-20, -30, 50, 30], "start": "C", "goal": "B"},
    "barn": {"bounds": [-7, -1, 3, 15], "path": BARN_FILE, "world": 3},
    "cellular_automaton": {
        "bounds": [-1, -1, 12, 14],
        "corner": [0, 0],
        "columns": 20,
        "rows": 10,
        "alley": 12,
        "cell": 0.25,
        "radius": 0.125,
        "fill": [0.1, 0.2],
        "rounds": [1, 2],
        "fill_from": 6,
        "clear_to": 2,
        "solvable": 0.3,
        "is_shut": True,
        "start": [2, 1.5, 0],
        "goal": [2, 9],
    },
    "dynabarn": {"bounds": [-11, -11, 12, 11], "path": BARN_FILE, "world": 3, "since": 2.5},
    "replay": {
        "bounds": [-6, -5, 6, 5],
        "path": RECORDING_FILE,
        "margin": 0.5,
        "radius": 0.2,
        "window": [0.1, 0.9],
        "start": [-5, -4, 0],
        "goal": [5, 4],
    },
    "ros_map": {
        "bounds": [0, 0, 3, 2],
        "path": MAP_FILE,
        "unknown_is_wall": True,
        "solvable": 0.25,
        "start": [1, 1, 0],
        "goal": [2, 1],
        "separation": 0.5,
    },
}
RING_OF_MUD = {"shell": [[-3, -3], [3, -3], [3, 3], [-3, 3]], "holes": [[[-1, -1], [1, -1], [1, 1], [-1, 1]]]}
for example in FAMILY_EXAMPLES.values():
    example["regions"] = [{"polygon": RING_OF_MUD, "factor": 1.5}, {"circle": [1, 1, 0.5], "factor": 3}]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with a file of worlds, a map and a recording in it."""
    (tmp_path / BARN_FILE).write_text("{}\n")
    (tmp_path / RECORDING_FILE).write_text("time_s,pedestrian,x_m,y_m\n0,1,0,0\n1,1,2,3\n")
    (tmp_path / MAP_FILE).write_text("image: plan.pgm\nresolution: 1.0\norigin: [0, 0, 0]\n")
    (tmp_path / "plan.pgm").write_text("P2 3 2 255 255 255 255 255 255 255\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def explicit(**changes: Any) -> dict[str, Any]:
    return {"world": {"family": "explicit", "start": [0, 0, 0], "goal": [8, 0], **changes}}


def mover(motion: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    return explicit(movers=[{"shape": {"circle": 0.3}, "at": [0, 3], "motion": motion, **changes}])


def walled_in(motion: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    """A mover inside a still polygon."""
    return explicit(
        polygons=[[[-1, 2], [1, 2], [1, 4], [-1, 4]]],
        movers=[{"shape": {"circle": 0.3}, "at": [0, 3], "motion": motion, **changes}],
    )


def message(source: Any, overrides: Mapping[str, Any] | None = None) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(source, overrides)
    return str(caught.value)


# -- What comes with the package ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", scenario_names())
def test_a_file_that_ships_holds_only_what_differs_from_the_defaults(name: str) -> None:
    text = (SCENARIO_FOLDER / f"{name}.yaml").read_text()
    assert text.startswith("# ")
    assert {"name": name, **yaml.safe_load(text)} == dump(load(name))


NAMED = {
    "static": (20, "mixed", 0.0, None, 60.0),
    "dynamic": (20, "mixed", 0.5, None, 60.0),
    "moving_target": (20, "mixed", 0.0, 0.4, 60.0),
    "rush": (40, "circles", 0.5, 0.4, 60.0),
}


@pytest.mark.parametrize("name", NAMED)
def test_named_fields_are_as_promised(name: str) -> None:
    world = load(name).world
    assert isinstance(world, FieldWorld)
    target = world.target_motion
    speed = None if target is None else getattr(target, "speed", None)
    assert (world.obstacles, world.shapes, world.moving, speed, load(name).time.limit) == NAMED[name]
    assert (world.sizes, world.separation, world.solvable) == ((0.3, 1.0), 8.0, 0.3)
    assert (world.start_clearance, world.goal_clearance, world.bounds) == (1.0, 0.5, (-10, -10, 10, 10))
    assert world.speeds == ((0.1, 1.0) if name == "rush" else (0.1, 0.5))
    assert set(world.laws) == {"bounce", "random_walk"}


def test_the_named_maze_has_the_promised_passages() -> None:
    scenario = load("maze")
    assert isinstance(scenario.world, MazeWorld)
    assert min(scenario.world.passages) >= 1.2
    assert (scenario.world.separation, scenario.time.limit) == (8.0, 180.0)


@pytest.mark.parametrize("name", [*NAMED, "maze"])
def test_named_scenarios_have_the_promised_robot(name: str) -> None:
    scenario = load(name)
    robot, lidar = scenario.robot, scenario.lidar
    assert (robot.kinematics, robot.footprint, robot.max_acceleration) == ("differential", ((0, 0, 0.2),), None)
    assert (robot.max_speed, robot.max_reverse, robot.max_turn_rate) == (1.0, 0.3, 1.5)
    assert (lidar.beams, lidar.range, lidar.noise, lidar.is_full_circle) == (64, 5.0, 0.01, True)
    assert (scenario.time.step, scenario.goal.radius, scenario.robots.count) == (0.1, 0.3, 1)


def test_the_map_of_the_paper_has_its_perimeter_at_1_m_and_its_crossings_of_the_line() -> None:
    contour = shapely.Polygon(ONI_WANG_POLYGON).buffer(1.0, join_style="mitre").exterior
    assert contour.length == pytest.approx(142.0)
    crossings = contour.intersection(shapely.LineString([ONI_WANG_PLACES["A"], ONI_WANG_PLACES["D"]]))
    assert sorted(round(point.x, 9) for point in crossings.geoms) == [4, 7, 12, 15, 21, 24]


def test_the_map_of_the_paper_is_the_recovered_one(shared_data: Path) -> None:
    recovered = yaml.safe_load((shared_data / "oni_wang_fig1.yaml").read_text())
    assert [list(corner) for corner in ONI_WANG_POLYGON] == recovered["polygon"]
    assert {letter: list(place) for letter, place in ONI_WANG_PLACES.items()} == recovered["points"]


# -- Round trips -------------------------------------------------------------------------------------------------------


def test_there_is_an_example_of_each_family_and_law() -> None:
    assert set(FAMILY_EXAMPLES) == set(FAMILIES)
    laws = {mover["motion"]["law"] for mover in FAMILY_EXAMPLES["explicit"]["movers"]}
    assert laws == set(LAWS)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.usefixtures("folder")
def test_every_family_comes_back_exactly_from_dict_json_and_yaml(family: str) -> None:
    data = {
        "name": "zürich",
        "robot": {"circles": [[0.1, 0, 0.1], [-0.1, 0, 0.1]], "max_acceleration": 1 / 3},
        "lidar": {"noise": 1e-7, "fov": 3.0},
        "world": {"family": family, **FAMILY_EXAMPLES[family]},
    }
    scenario = load(data)
    assert load(dump(scenario)) == scenario
    assert load(scenario.model_dump(mode="json")) == scenario
    assert load(json.loads(json.dumps(dump(scenario)))) == scenario
    Path("again.yaml").write_text(to_yaml(scenario), encoding="utf-8")
    assert load("again.yaml") == scenario
    assert hash(load("again.yaml")) == hash(scenario)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.usefixtures("folder")
def test_a_dump_keeps_each_key_that_was_set(family: str) -> None:
    example = {"family": family, **FAMILY_EXAMPLES[family]}
    assert set(dump(load({"world": example}))["world"]) == set(example)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_robots_come_back_with_their_places(count: int) -> None:
    places = [{"start": [x, 0.0, 0.0]} for x in range(3)]
    scenario = load({"robots": {"count": count, "places": places}})
    again = load(dump(scenario)).robots
    assert (again.count, len(again.places)) == (count, 3)


def test_a_scenario_of_defaults_dumps_to_nothing() -> None:
    assert dump(Scenario()) == {}
    assert load({}) == Scenario()


def test_loading_a_scenario_gives_the_same_one() -> None:
    scenario = load("two_boxes")
    assert load(scenario) is scenario


# -- The schema --------------------------------------------------------------------------------------------------------


def parts(annotation: Any) -> Iterator[type[Part]]:
    if isinstance(annotation, type) and issubclass(annotation, Part):
        yield annotation
        for field in annotation.model_fields.values():
            yield from parts(field.annotation)
    for argument in get_args(annotation):
        yield from parts(argument)


def holds_floats(annotation: Any) -> bool:
    return annotation is float or any(holds_floats(argument) for argument in get_args(annotation))


@pytest.mark.parametrize("part", sorted(set(parts(Scenario)), key=str))
def test_every_field_says_what_it_is_and_in_which_unit(part: type[Part]) -> None:
    for name, field in part.model_fields.items():
        if name in ("family", "law"):
            continue
        meaning = part.meanings()[name]
        assert meaning.endswith("."), name
        if holds_floats(field.annotation) and "0 to 1" not in meaning:
            assert "[" in meaning, f"{name} has no unit"


@pytest.mark.parametrize(
    ("part", "data"),
    [
        (Scenario, {"wrold": {}}),
        (Scenario, {"world": {"family": "nonesuch"}}),
        (Scenario, {"world": {}}),
        (Scenario, {"lidar": {"beams": 0}}),  # a part of a part: its key is told from the whole's on
        (Scenario, {"robot": {"max_speed": -1, "radius": "x"}}),
        (Lidar, {"range": 0}),
        (Bounce, {"law": "bounce"}),
        (RewardTerm, {"function": 3}),
        (ObservationField, {"function": len, "low": 0}),
        (ObservationField, {"function": len, "low": 1, "high": 0}),
        (UTrapWorld, {"family": "u_trap", "depth": "deep"}),
        (UTrapWorld, {"family": "u_trap", "dept": 1}),
    ],
)
def test_a_part_that_is_made_in_python_is_refused_in_the_words_of_a_file(
    part: type[Part], data: dict[str, Any]
) -> None:
    with pytest.raises(ScenarioError) as read:
        checked(part, data, part.__name__)
    with pytest.raises(ScenarioError) as made:
        part(**data)
    assert str(made.value) == str(read.value)
    for line in str(made.value).splitlines():
        assert line.startswith(f"{part.__name__}: ") and "pydantic" not in line and "input_value" not in line


def test_a_scenario_does_not_change() -> None:
    with pytest.raises(ValidationError):
        load("static").lidar.beams = 3  # type: ignore[misc]


def test_importing_the_schema_loads_no_geometry() -> None:
    code = "import bug_gym.config, sys; bug_gym.config.load('static'); print({'shapely', 'numba'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_steps_are_whole_where_the_division_is_not() -> None:
    assert 0.3 / 0.1 < 3
    assert load({"time": {"step": 0.1, "limit": 60.0}}).time.steps == 600
    assert load({"time": {"step": 0.1, "limit": 0.3}}).time.steps == 3


@pytest.mark.parametrize("fov", [6.28, 6.283, 6.2832, 2 * math.pi])
def test_a_rounded_full_turn_is_a_full_turn(fov: float) -> None:
    lidar = load({"lidar": {"fov": fov}}).lidar
    assert lidar.is_full_circle
    assert lidar.fov == 2 * math.pi


def test_less_than_a_full_turn_stays_what_it_is() -> None:
    lidar = load({"lidar": {"fov": 4.7}}).lidar
    assert (lidar.fov, lidar.is_full_circle) == (4.7, False)


def test_a_robot_without_circles_is_a_disc() -> None:
    robot = Robot(radius=0.35)
    assert robot.footprint == ((0.0, 0.0, 0.35),)
    assert robot.reach == 0.35


def test_the_reach_of_a_long_robot_ends_at_its_farthest_circle() -> None:
    assert Robot(circles=((0.3, 0.4, 0.1), (-0.1, 0.0, 0.2))).reach == pytest.approx(0.6)


def test_the_body_turns_with_the_heading() -> None:
    body = Robot(circles=((1.0, 0.0, 0.1),)).body((5.0, 2.0, math.pi / 2))
    assert body[0] == pytest.approx((5.0, 3.0, 0.1))


@pytest.mark.parametrize("side", [2.8, 5.0, 12.0, 20.0])
@pytest.mark.parametrize("passage", [0.6, 1.2, 1.3])
def test_maze_cells_fill_the_bounds_and_one_more_would_be_too_narrow(side: float, passage: float) -> None:
    world = load({"world": {"family": "maze", "bounds": [0, 0, side, 20], "passage": passage, "separation": 0}}).world
    assert isinstance(world, MazeWorld)
    columns, width = world.cells[0], world.passages[0]
    assert columns * width + (columns - 1) * world.wall == pytest.approx(side)
    assert width >= passage - 1e-9
    assert (side - columns * world.wall) / (columns + 1) < passage


def test_the_default_u_trap_is_centred_between_mouth_and_back() -> None:
    world = load("u_trap").world
    assert isinstance(world, UTrapWorld)
    assert world.centre == (8.5, 0.0)  # mouth at 5, back at 5 + 6 + 1


def test_a_region_may_leave_the_heading_open() -> None:
    world = load({"world": {"family": "explicit", "start": {"region": [0, 0, 1, 1]}, "goal": [8, 0]}}).world
    assert isinstance(world, ExplicitWorld)
    assert isinstance(world.start, StartRegion)
    assert world.start.heading is None


def test_a_closed_ring_is_the_open_one() -> None:
    assert load(explicit(polygons=[[*SQUARE, SQUARE[0]]])) == load(explicit(polygons=[SQUARE]))


def test_corners_may_run_either_way() -> None:
    world = load(explicit(polygons=[SQUARE, SQUARE[::-1]])).world
    assert isinstance(world, ExplicitWorld)
    assert world.polygons[0].shell == world.polygons[1].shell[::-1]


def test_a_polygon_with_a_hole_holds_a_goal_in_the_hole() -> None:
    frame = {"shell": [[6, -2], [10, -2], [10, 2], [6, 2]], "holes": [[[7, -1], [9, -1], [9, 1], [7, 1]]]}
    load(explicit(polygons=[frame]))
    assert "world.goal: " in message(explicit(polygons=[frame], goal=[6.5, 0]))


def test_the_geometry_of_a_polygon_is_moved_to_its_place() -> None:
    polygon = Polygon.model_validate([[0, 0], [2, 0], [2, 1], [0, 1]])
    assert polygon.geometry((3.0, 4.0)).bounds == (3.0, 4.0, 5.0, 5.0)


def test_a_list_of_robots_counts_itself() -> None:
    robots = load({"robots": [{"start": [0, 0, 0]}, {"start": [1, 0, 0], "goal": [3, 3]}]}).robots
    assert robots.count == 2
    assert robots.places[0].goal is None
    assert robots.places[1].goal == (3.0, 3.0)


# -- Overrides ---------------------------------------------------------------------------------------------------------


def test_overrides_reach_parts_lists_and_what_the_file_leaves_out() -> None:
    overrides = {
        "lidar.beams": 360,
        "world.circles.0": [3, 0, 0.4],
        "world.movers.0.motion.velocity.1": 0.25,
        "name": "x",
    }
    scenario = load("two_boxes", overrides)
    assert isinstance(scenario.world, ExplicitWorld)
    assert (scenario.name, scenario.lidar.beams, scenario.world.circles) == ("x", 360, ((3.0, 0.0, 0.4),))
    assert dump(scenario)["world"]["movers"][0]["motion"]["velocity"] == [0.5, 0.25]


def test_an_override_replaces_all_that_stood_there() -> None:
    assert load("two_boxes", {"world": {"family": "empty"}}).world == Scenario().world


def test_overrides_work_on_each_kind_of_source(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("lidar: {range: 4}\n")
    for source in ("static", path, str(path), {"lidar": {"range": 4}}, load("static")):
        assert load(source, {"lidar.beams": 7}).lidar.beams == 7


def test_overrides_leave_the_source_as_it_was() -> None:
    source = explicit(circles=[[2, 0, 0.5]])
    before = copy.deepcopy(source)
    load(source, {"world.circles.0": [3, 0, 0.4], "lidar.beams": 3})
    assert source == before


def test_numpy_values_are_taken() -> None:
    overrides = {"lidar.beams": np.int64(9), "robot.radius": np.float64(0.25), "world.goal": np.array([7.0, 1.0])}
    scenario = load("two_boxes", overrides)
    assert scenario == load("two_boxes", {"lidar.beams": 9, "robot.radius": 0.25, "world.goal": [7.0, 1.0]})


def test_parts_may_be_given_as_objects() -> None:
    assert load({"robot": Robot(radius=0.25)}) == load({"robot": {"radius": 0.25}})


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_number_of_crossing_robots_may_change(count: int) -> None:
    assert load("crossing_robots", {"robots.count": count}).robots.count == count


def test_the_number_may_shrink_below_a_list() -> None:
    places = [{"start": [0, 0, 0]}, {"start": [1, 0, 0]}]
    assert load({"robots": places}, {"robots.count": 1}).robots.count == 1


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("lidar.beams.x", "no key below 64"),
        ("world.laws.9", "an index below 1"),
        ("world.laws.first", "an index below 1"),
    ],
)
def test_an_override_that_leads_nowhere_says_so(key: str, expected: str) -> None:
    source = {"lidar": {"beams": 64}, "world": {"family": "field", "laws": ["bounce"]}}
    text = message(source, {key: 1})
    assert key in text
    assert expected in text


@pytest.mark.parametrize("source", ["u_trap", load("u_trap")], ids=["name", "scenario"])
def test_an_override_of_one_item_of_a_list_that_is_not_said_asks_for_the_whole_list(source: Any) -> None:
    told = message(source, {"world.start.0": 1.0})
    assert told.endswith(
        "override 'world.start.0': 'world.start' is at its default, expected all of it, as an override of 'world.start'"
    )


WALK = "time_s,pedestrian,x_m,y_m\n0,1,0,0\n20,1,8,3\n"
"""A pedestrian from (0, 0) to (8, 3)."""


@pytest.mark.parametrize(
    ("source", "overrides"),
    [
        ({"world": {"family": "replay", "path": RECORDING_FILE}}, {"world.margin": 3.0, "world.radius": 0.5}),
        ({"world": {"family": "replay", "path": RECORDING_FILE, "bounds": [-3, -3, 9, 9]}}, {"world.margin": 3.0}),
        ({"world": {"family": "forest", "start": [0, 0, 0], "goal": [3, 0]}}, {"world.goal": [9, 0]}),
        ({"world": {"family": "forest", "start": [0, 0, 0], "goal": [3, 0]}}, {"lidar.beams": 9}),
        ({"robot": {"max_speed": 0.2}}, {"robot.max_speed": 1.0}),
        ({"robot": {"max_speed": 0.2, "max_reverse": 0.1}}, {"robot.max_speed": 1.0}),
    ],
)
def test_overrides_of_a_scenario_give_what_they_give_of_its_file(
    source: dict[str, Any], overrides: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What follows from other values follows from the new ones."""
    (tmp_path / RECORDING_FILE).write_text(WALK)
    monkeypatch.chdir(tmp_path)
    scenario = load(source)
    assert load(scenario, overrides) == load(source, overrides)
    assert load(dump(scenario)) == scenario and load(dump(scenario)).digest == scenario.digest


@pytest.mark.parametrize("kinematics", ["holonomic", "differential", "ackermann"])
@pytest.mark.parametrize(("max_speed", "least"), [(0.2, 0.2), ({"uniform": [0.2, 1.0]}, 0.2), (0.5, 0.3)])
def test_the_default_of_the_reverse_speed_gives_way_to_a_low_top_speed(
    kinematics: str, max_speed: Any, least: float
) -> None:
    scenario = load({"robot": {"kinematics": kinematics, "max_speed": max_speed}})
    assert scenario.robot.max_reverse == least
    assert load(dump(scenario)) == scenario


def test_a_holonomic_robot_may_say_any_reverse_speed() -> None:
    assert load({"robot": {"max_speed": 0.2, "max_reverse": 0.3}}).robot.max_reverse == 0.3


def test_an_error_after_overrides_says_that_there_were_some() -> None:
    assert message("static", {"lidar.beams": 0}).startswith("static.yaml with overrides: lidar.beams: got 0")


# -- Files -------------------------------------------------------------------------------------------------------------


def test_a_file_without_a_name_is_called_by_its_stem(tmp_path: Path) -> None:
    (tmp_path / "yard.yaml").write_text("world: {family: empty}\n")
    (tmp_path / "named.yml").write_text("name: garden\n")
    assert load(tmp_path / "yard.yaml").name == "yard"
    assert load(tmp_path / "named.yml").name == "garden"


def test_a_path_in_a_file_starts_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / BARN_FILE).write_text("{}\n")
    (tmp_path / "scenarios" / "mine.yaml").write_text(f"world: {{family: barn, path: {BARN_FILE}}}\n")
    monkeypatch.chdir(tmp_path)
    path = dump(load("scenarios/mine.yaml"))["world"]["path"]
    assert Path(path) == tmp_path / "scenarios" / BARN_FILE


def test_nobodys_home_in_a_file_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("world: {family: barn, path: ~nobody-at-all/worlds.jsonl}\n")
    with pytest.raises(ScenarioError, match="~nobody-at-all/worlds.jsonl: "):
        load(tmp_path / "mine.yaml")
    with pytest.raises(ScenarioError, match="~nobody-at-all/mine.yaml: "):
        from_folder("~nobody-at-all/mine.yaml", tmp_path)


def test_a_path_in_a_mapping_starts_in_the_working_directory(folder: Path) -> None:
    path = dump(load({"world": {"family": "barn", "path": BARN_FILE}}))["world"]["path"]
    assert Path(path) == folder / BARN_FILE


def test_exponents_without_a_point_are_numbers(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text("lidar: {noise: 1e-3}\nrobot: {radius: 2E-1}\n")
    scenario = load(tmp_path / "small.yaml")
    assert (scenario.lidar.noise, scenario.robot.radius) == (0.001, 0.2)


def test_an_override_of_one_alias_leaves_the_other(tmp_path: Path) -> None:
    one = "{shape: {circle: 0.3}, at: [0, 3], motion: {law: bounce, velocity: &v [0.5, 0]}}"
    two = "{shape: {circle: 0.3}, at: [0, 5], motion: {law: bounce, velocity: *v}}"
    text = f"world: {{family: explicit, movers: [{one}, {two}], start: [0, 0, 0], goal: [8, 0]}}"
    (tmp_path / "twins.yaml").write_text(text)
    movers = dump(load(tmp_path / "twins.yaml", {"world.movers.0.motion.velocity.0": 0.9}))["world"]["movers"]
    assert [mover["motion"]["velocity"][0] for mover in movers] == [0.9, 0.5]


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("name: x\nlidar: {beams: 3\nrobot: {}\n", 3, "expected ',' or '}'"),
        ("lidar:\n  beams: 3\n  range: 4\n  beams: 5\n", 4, "key 'beams' twice"),
        ("lidar:\n\tbeams: 3\n", 2, "cannot start any token"),
    ],
)
def test_a_fault_in_the_yaml_is_told_with_its_line(tmp_path: Path, text: str, line: int, reason: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    told = message(path)
    assert told.startswith(f"{path}: line {line}, column ")
    assert reason in told


@pytest.mark.parametrize("text", ["", "- 1\n- 2\n", "hello\n"])
def test_a_file_that_is_no_mapping_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    assert f"{path}: got " in message(path)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_bytes(b"\xff\xfe\x00\x81")
    assert f"{path}: not a YAML file" in message(path)


def test_a_missing_file_names_the_nearest_beside_it(tmp_path: Path) -> None:
    (tmp_path / "garden.yaml").write_text("{}\n")
    told = message(tmp_path / "gardn.yaml")
    assert "gardn.yaml: No such file" in told
    assert "did you mean 'garden.yaml'?" in told


def test_a_name_with_the_ending_of_a_file_is_told_the_name() -> None:
    assert "did you mean 'static'?" in message("static.yaml")


def test_a_folder_is_no_scenario(tmp_path: Path) -> None:
    assert str(tmp_path) in message(tmp_path)


def test_an_unknown_name_gives_the_nearest_and_all_known_ones() -> None:
    told = message("two_boxs")
    assert "did you mean 'two_boxes'?" in told
    assert all(name in told for name in scenario_names())


def test_a_source_of_another_kind_is_refused() -> None:
    assert "got 3, expected a name" in message(3)


# -- What is refused, and in which words -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("source", "key", "nearest"),
    [
        ({"lider": {}}, "lider", "lidar"),
        ({"lidar": {"beens": 3}}, "lidar.beens", "beams"),
        ({"time": {"limits": 3}}, "time.limits", "limit"),
        ({"world": {"family": "feild"}}, "world.family", "field"),
        ({"world": {"family": "field", "obstacle": 3}}, "world.obstacle", "obstacles"),
        ({"robot": {"kinematics": "diferential"}}, "robot.kinematics", "differential"),
        (explicit(goal={"regon": [0, 0, 1, 1]}), "world.goal.regon", "region"),
        (mover({"law": "bounc"}), "world.movers.0.motion.law", "bounce"),
        (mover({"law": "bounce", "velocty": [1, 0]}), "world.movers.0.motion.velocty", "velocity"),
        (explicit(movers=[{"shap": {}}]), "world.movers.0.shap", "shape"),
        ({"robots": [{"starts": [0, 0, 0]}]}, "robots.places.0.starts", "start"),
    ],
)
def test_an_unknown_word_names_the_nearest_known_one(source: dict[str, Any], key: str, nearest: str) -> None:
    told = message(source)
    assert told.startswith(f"scenario: {key}: ")
    assert f"did you mean '{nearest}'?" in told


@pytest.mark.parametrize(
    ("source", "key", "allowed"),
    [
        ({"robot": {"radius": 0}}, "robot.radius", "got 0, expected a number above 0"),
        ({"robot": {"radius": math.nan}}, "robot.radius", "expected a finite number"),
        ({"robot": {"radius": "0.2"}}, "robot.radius", "got '0.2', expected a number"),
        ({"robot": {"radius": True}}, "robot.radius", "got True, expected a number"),
        ({"robot": {"circles": []}}, "robot.circles", "expected a list of at least 1"),
        ({"robot": {"circles": [[0, 0, 0]]}}, "robot.circles.0.2", "expected a number above 0"),
        ({"robot": {"max_speed": math.inf}}, "robot.max_speed", "expected a finite number"),
        (
            {"robot": {"kinematics": "differential", "max_speed": 0.2, "max_reverse": 0.3}},
            "robot.max_reverse",
            "got 0.3, expected at most max_speed (0.2)",
        ),
        ({"robot": {"max_reverse": -0.1}}, "robot.max_reverse", "expected at least 0"),
        ({"robot": {"max_acceleration": 0}}, "robot.max_acceleration", "expected a number above 0"),
        ({"lidar": {"beams": 0}}, "lidar.beams", "got 0, expected at least 1"),
        ({"lidar": {"beams": 64.0}}, "lidar.beams", "got 64.0, expected a whole number"),
        ({"lidar": {"fov": 0}}, "lidar.fov", "expected a number above 0"),
        ({"lidar": {"fov": 6.3}}, "lidar.fov", "got 6.3, expected at most 6.28"),
        ({"lidar": {"min_range": 10}}, "lidar.min_range", "got 10.0, expected less than range (10.0)"),
        ({"lidar": {"dropout": 1.5}}, "lidar.dropout", "expected at most 1"),
        ({"lidar": [1]}, "lidar", "got [1], expected a mapping"),
        ({"time": {"step": 0}}, "time.step", "expected a number above 0"),
        ({"time": {"limit": 0.05}}, "time.limit", "got 0.05, expected at least step (0.1)"),
        ({"reward": {"progress": math.inf}}, "reward.progress", "expected a finite number"),
        ({"goal": {"sensing": "gps"}}, "goal.sensing", "expected 'beacon' or 'odometry'"),
        ({"name": ""}, "name", "expected text"),
        ({"name": 3}, "name", "got 3, expected text"),
        ({"world": 3}, "world", "got 3, expected a mapping"),
        ({"world": {}}, "world.family", "missing, expected one of empty, explicit"),
        ({"world": {"family": "empty", "bounds": [1, 0, 0, 1]}}, "world.bounds", "with xmin < xmax"),
        ({"world": {"family": "empty", "bounds": [0, 0, 1]}}, "world.bounds", "expected [xmin, ymin, xmax, ymax]"),
        ({"world": {"family": "empty", "separation": 29}}, "world.separation", "got 29, expected at most 28.28"),
        ({"world": {"family": "empty", "start": [9.9, 0, 0]}}, "world.start", "in its way: the border"),
        (
            {"world": {"family": "field", "start": {"region": [-10, -5, -8.9, 5]}}},
            "world.start.region",
            "expected one that reaches places 1.2 m from the border (world.start_clearance)",
        ),
        (
            {"world": {"family": "field", "goal": {"region": [0, 9.6, 5, 10]}}},
            "world.goal.region",
            "expected one that reaches places 0.5 m from the border (world.goal_clearance)",
        ),
        ({"world": {"family": "circle_swap", "evenly": "no"}}, "world.evenly", "got 'no', expected true or false"),
        ({"world": {"family": "circle_swap", "evenly": 1}}, "world.evenly", "got 1, expected true or false"),
        ({"world": {"family": "field", "sizes": [2, 1]}}, "world.sizes", "expected [least, most]"),
        ({"world": {"family": "field", "laws": ["fly"]}}, "world.laws.0", "'random_walk' or 'crowd'"),
        ({"world": {"family": "field", "moving": 0.5, "laws": []}}, "world.laws", "at least one of"),
        ({"world": {"family": "field", "solvable": 0.1}}, "world.solvable", "at least the robot's reach (0.2)"),
        (
            {"world": {"family": "field", "start": [0, 0, 0], "goal": [3, 4], "separation": 8}},
            "world.separation",
            "got 8, expected at most 5,",
        ),
        ({"world": {"family": "u_trap", "rotation": "left"}}, "world.rotation", "expected 'random'"),
        ({"world": {"family": "u_trap", "rotation": [1]}}, "world.rotation", "expected a number"),
        ({"world": {"family": "u_trap", "depth": 30}}, "world.bounds", "expected bounds that hold the trap"),
        ({"world": {"family": "ring", "inner": 5}}, "world.inner", "got 5, expected less than outer (4)"),
        ({"world": {"family": "ring", "centre": [7, 0]}}, "world.outer", "expected a ring within bounds"),
        ({"world": {"family": "ring", "goal": [6, 0]}}, "world.goal", "expected a place inside the ring"),
        ({"world": {"family": "ring", "start": [0, 0, 0]}}, "world.start", "expected a place outside the ring"),
        ({"world": {"family": "maze", "passage": 0.4}}, "world.passage", "more than the robot's width (0.4)"),
        ({"world": {"family": "maze", "passage": 15}}, "world.passage", "expected at most what lets two cells"),
        ({"world": {"family": "maze", "separation": 28}}, "world.separation", "got 28, expected at most 26.5"),
        (
            {"world": {"family": "maze", "bounds": [0, 0, 4, 4]}},
            "world.separation",
            "got 8, the default, expected at most 3.9598, all that there is: set world.separation",
        ),
        (
            {"world": {"family": "field", "bounds": [0, 0, 3, 4], "start": [1, 1, 0]}},
            "world.separation",
            "got 8, the default, expected at most 5, all that there is: set world.separation",
        ),
        ({"world": {"family": "oni_wang", "start": "D"}}, "world.goal", "expected another place than start"),
        ({"world": {"family": "oni_wang", "bounds": [-1, -9, 30, 9]}}, "world.bounds", "that hold the map"),
        ({"world": {"family": "barn", "path": "no.jsonl"}}, "world.path", "got 'no.jsonl', expected a file"),
        (explicit(start=[0, 0]), "world.start", "got [0, 0], expected [x, y, heading]"),
        (explicit(circles=[[1, 2]]), "world.circles.0", "got [1, 2], expected [x, y, radius]"),
        (explicit(circles=[[1, 2, -1]]), "world.circles.0.2", "expected a number above 0"),
        (explicit(circles=[[0.6, 0, 0.5]]), "world.start", "in its way: circles.0"),
        (explicit(circles=[[8, 0.4, 0.5]]), "world.goal", "in its way: circles.0"),
        (
            explicit(polygons=[shapely.box(1, 1, 2, 2)]),
            "world.polygons.0",
            "expected its corners [[x, y], ...], or {shell",
        ),
        (explicit(polygons=[[[0, 0], [1, 1]]]), "world.polygons.0.shell", "got 2 corners, expected at least 3"),
        (explicit(polygons=[[[0.1, -1], [1, -1], [1, 1], [0.1, 1]]]), "world.start", "in its way: polygons.0"),
        (explicit(goal=[4.5, 0], polygons=[SQUARE]), "world.goal", "in its way: polygons.0"),
        (explicit(goal=[12, 0]), "world.goal", "in its way: the border"),
        (explicit(goal={"region": [0, 0, 1, 20]}), "world.goal.region", "expected a rectangle within bounds"),
        ({"world": {"family": "explicit", "goal": [1, 1]}}, "world.start", "missing: x [m], y [m], heading [rad]"),
        ({"world": {"family": "explicit", "start": [0, 0, 0]}}, "world.goal", "expected one of goal and target"),
        (explicit(target={"at": [1, 1], "motion": {"law": "bounce", "speed": 1}}), "world.goal", "got both"),
        (mover({"law": "bounce"}), "world.movers.0.motion.velocity", "either velocity: [vx, vy] or speed"),
        (mover({"law": "bounce", "speed": -1}), "world.movers.0.motion.speed", "expected at least 0"),
        (mover({"law": "waypoints", "speed": 1}), "world.movers.0.motion.points", "missing: Places x, y [m]"),
        (
            mover({"law": "waypoints", "speed": 1, "points": [[1, 1], [11, 1]]}),
            "world.movers.0.motion.points.1",
            "expected a point in [-10.0, -10.0, 10.0, 10.0]",
        ),
        (mover({"law": "random_walk", "speed": 1, "min_leg": 4}), "world.movers.0.motion.min_leg", "(3.0)"),
        (mover({"law": "bounce", "speed": 1}, shape={}), "world.movers.0.shape.circle", "either circle: radius or"),
        (
            mover(
                {"law": "bounce", "speed": 1},
                shape={"polygon": {"shell": SQUARE, "holes": [[[4.4, 0], [4.6, 0], [4.5, 1]]]}},
            ),
            "world.movers.0.shape.polygon.holes",
            "expected none: a polygon that moves is solid",
        ),
        (mover({"law": "bounce", "speed": 1}, at=[0, 9.8]), "world.movers.0.at", "expected a place in"),
        (
            mover({"law": "waypoints", "points": [[0, 3]], "speed": 1}, at=[0, 9.5], shape={"polygon": BOX}),
            "world.movers.0.at",
            "reaches over no border",
        ),
        (
            explicit(bounds=[[-10, -10], [10, -10], [0, 10]], movers=[{**CRATE, "at": [4, 0]}]),
            "world.movers.0.at",
            "reaches over no border",
        ),
        (mover({"law": "bounce", "speed": 1}, at=[0, 0.4]), "world.start", "in its way: movers.0"),
        (walled_in({"law": "bounce", "speed": 1}), "world.movers.0.at", "expected a place outside of polygons.0"),
        (walled_in({"law": "random_walk", "speed": 1}), "world.movers.0.at", "expected a place outside of polygons.0"),
        (walled_in({"law": "crowd", "speed": 1}), "world.movers.0.at", "expected a place outside of polygons.0"),
        (walled_in({"law": "evade", "speed": 1}), "world.movers.0.at", "expected a place outside of polygons.0"),
        ({"robots": {"count": 0}}, "robots.count", "got 0, expected at least 1"),
        (
            {"robots": [{"start": [0, 0, 0]}, {"start": [0.3, 0, 0]}]},
            "robots.places.1.start",
            "in its way: robots.places.0",
        ),
        (
            {
                "world": {"family": "empty", "target": {"at": [1, 1], "motion": {"law": "bounce", "speed": 1}}},
                "robots": [{"start": [0, 0, 0]}, {"start": [0, 2, 0], "goal": [3, 0]}],
            },
            "robots.places.1.goal",
            "expected none beside world.target: it moves the goals of all robots",
        ),
        ({"robots": [{"start": [0, 0, 0], "goal": [11, 0]}]}, "robots.places.0.goal", "in its way: the border"),
        (
            {"robots": {"count": 3, "places": [{"start": [0, 0, 0]}]}},
            "robots.count",
            "got 3, expected at most 1",
        ),
    ],
)
def test_a_fault_names_its_key_what_came_and_what_is_allowed(source: dict[str, Any], key: str, allowed: str) -> None:
    told = message(source)
    assert told.startswith(f"scenario: {key}: ")
    assert allowed in told


def test_a_polygon_that_moves_may_begin_along_the_border() -> None:
    load(explicit(bounds=[-10, -0.3, 10, 9], start=[0, 5, 0], goal=[3, 5], movers=[{**CRATE, "at": [0, 0.7]}]))
    load(
        explicit(
            bounds=[[-10, -10], [10, -10], [0, 10]], start=[0, 0, 0], goal=[1, 0], movers=[{**CRATE, "at": [3, -9]}]
        )
    )
    thirds = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]
    crate = {**CRATE, "shape": {"polygon": thirds}, "at": [0, 0.1]}  # 0.1 + 0.2 > 0.3 in binary fractions
    load(explicit(bounds=[-10, -9, 10, 0.3], start=[0, -5, 0], goal=[3, -5], movers=[crate]))


def test_a_mover_may_begin_in_a_polygon_that_lets_it_out_again() -> None:
    """Way-points lead through walls; a courtyard is no wall; who lies over an edge goes off it."""
    load(walled_in({"law": "waypoints", "points": [[0, 6]], "speed": 1.0}))
    court = {"shell": [[-3, 1], [3, 1], [3, 6], [-3, 6]], "holes": [[[-1, 2], [1, 2], [1, 4], [-1, 4]]]}
    load({"world": {**walled_in({"law": "bounce", "speed": 1})["world"], "polygons": [court]}})
    simulation = Simulation(walled_in({"law": "bounce", "velocity": [0.0, -0.5]}, at=[0, 4.1]))
    simulation.reset(seeds=[0])
    assert simulation.world.disc_position[0, 0].tolist() == [0.0, 4.1]
    for _ in range(10):
        simulation.step([[[0.0, 0.0]]])
    assert simulation.world.disc_position[0, 0, 1] > 4.3, "it would have gone on into the polygon"


def test_a_polygon_that_crosses_itself_is_refused_with_the_place() -> None:
    bow_tie = [[1, 1], [3, 3], [3, 1], [1, 3]]  # the diagonals of the square from (1, 1) to (3, 3)
    told = message(explicit(polygons=[SQUARE, bow_tie]))
    assert "world.polygons.1: the polygon crosses itself at (2, 2)" in told


def test_a_hole_outside_its_shell_is_refused() -> None:
    outside = {"shell": SQUARE, "holes": [[[7, 7], [8, 7], [8, 8]]]}
    assert "world.polygons.0: the polygon is not simple (Hole lies outside shell)" in message(
        explicit(polygons=[outside])
    )


def test_all_faults_are_told_one_a_line() -> None:
    lines = message({"lidar": {"beams": 0, "dropout": 2}, "robot": {"radius": -1}}).splitlines()
    assert sorted(line.split(": ")[1] for line in lines) == ["lidar.beams", "lidar.dropout", "robot.radius"]


def test_a_long_robot_fits_only_along_the_passage() -> None:
    walls = [[0.0, 0.5, 0.2], [0.0, -0.5, 0.2]]
    robot = {"circles": [[0.3, 0, 0.1], [-0.3, 0, 0.1]]}
    load({"robot": robot, **explicit(circles=walls, start=[0, 0, 0])})
    told = message({"robot": robot, **explicit(circles=walls, start=[0, 0, math.pi / 2])})
    assert "world.start: " in told


def leaves(data: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else None
    if items is None:
        yield path
        return
    for key, value in items:
        yield from leaves(value, (*path, str(key)))


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.usefixtures("folder")
def test_a_wrong_value_anywhere_is_told_by_its_key_in_plain_words(family: str) -> None:
    data = load({"world": {"family": family, **FAMILY_EXAMPLES[family]}}).model_dump(mode="json")
    for path in leaves(data):
        key = ".".join(path)
        told = message(data, {key: {"wrong": 1}})
        # a polygon without holes is written as the list of its corners, which the schema calls its shell
        assert told.replace("shell.", "").startswith(f"scenario with overrides: {key}".replace("shell.", "")), told
        assert "pydantic" not in told.lower()
        assert "Input" not in told
