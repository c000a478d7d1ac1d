"""Every number of a scenario has limits; beyond them it is refused by name, with the memory where that is the reason."""

from __future__ import annotations

import math
import sys
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import annotated_types
import numpy as np
import pytest
from PIL import Image
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from bug_gym.agents.learning.settings import ALGORITHMS
from bug_gym.config import Scenario, ScenarioError, load
from bug_gym.evaluation import make_plan
from bug_gym.evaluation.suites import Suite, load_suite
from bug_gym.limits import DATA, MEMORY, MOST_EPISODES, read_file, told_bytes
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv
from bug_gym.worlds.barn_files import load_barn, load_gazebo
from bug_gym.worlds.recordings import load_recording
from bug_gym.worlds.ros_files import load_ros_map

FIELD = {"family": "field", "separation": 0.0}
RECORDS = "time_s,pedestrian,x_m,y_m\n"

# -- Every number ------------------------------------------------------------------------------------------------------


def numbers_of(annotation: Any, metadata: tuple[Any, ...], place: str, seen: set[type]) -> Iterator[tuple[str, bool]]:
    """Each number below an annotation: where it is, and whether it has a least and a greatest value."""
    if typing.get_origin(annotation) is typing.Annotated:
        inner, *own = typing.get_args(annotation)
        yield from numbers_of(inner, (*own, *metadata), place, seen)
    elif annotation in (int, float):
        limits = [part for one in metadata for part in (one.metadata if isinstance(one, FieldInfo) else [one])]
        low = any(isinstance(limit, (annotated_types.Ge, annotated_types.Gt)) for limit in limits)
        high = any(isinstance(limit, (annotated_types.Le, annotated_types.Lt)) for limit in limits)
        yield place, low and high
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if annotation not in seen:
            seen.add(annotation)
            for name, field in annotation.model_fields.items():
                yield from numbers_of(field.annotation, tuple(field.metadata), f"{annotation.__name__}.{name}", seen)
    else:
        for part in typing.get_args(annotation):
            yield from numbers_of(part, (), place, seen)


@pytest.mark.parametrize("model", [Scenario, Suite, *ALGORITHMS.values()])
def test_every_number_has_a_least_and_a_greatest_value(model: type[BaseModel]) -> None:
    found = dict.fromkeys(numbers_of(model, (), "", set()))
    assert len(found) > (60 if model is Scenario else 2)
    assert [place for place, has_limits in found if not has_limits] == []


HUGE = [1e300, -1e300, 1e22, -1e22, sys.float_info.max, 10**400, 10**5000]
TINY = [1e-300, sys.float_info.min, 5e-324]

NUMBERS = {
    "robot": ("radius", "max_speed", "max_reverse", "max_turn_rate", "max_acceleration"),
    "lidar": ("beams", "range", "min_range", "fov", "noise", "dropout"),
    "odometry": ("translation_noise", "rotation_noise", "translation_bias", "rotation_bias"),
    "time": ("step", "limit"),
    "goal": ("radius",),
    "reward": ("progress", "goal", "collision", "step", "clearance", "smoothness"),
    "robots": ("count",),
    "world": (
        "obstacles",
        "pedestrians",
        "pedestrian_radius",
        "moving",
        "solvable",
        "separation",
        "start_clearance",
        "goal_clearance",
    ),
}


@pytest.mark.parametrize("key", [f"{part}.{name}" for part, names in NUMBERS.items() for name in names])
def test_a_number_beyond_all_sense_is_refused_by_name(key: str) -> None:
    for value in HUGE:
        with pytest.raises(ScenarioError) as caught:
            load({"world": FIELD}, {key: value})
        told = str(caught.value)
        assert f"{key}: got " in told
        assert "\n" not in told and len(told) < 300


@pytest.mark.parametrize("value", TINY)
@pytest.mark.parametrize(
    "key",
    ["robot.radius", "robot.max_speed", "robot.max_turn_rate", "robot.max_acceleration", "lidar.range", "lidar.fov"]
    + ["time.step", "time.limit", "goal.radius", "world.pedestrian_radius", "world.solvable"],
)
def test_a_number_whose_square_is_lost_is_refused(key: str, value: float) -> None:
    with pytest.raises(ScenarioError, match="expected at least 1e-06"):
        load({"world": FIELD}, {key: value})


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        ({"lidar.beams": 10**8}, "lidar.beams: got 100000000, expected at most 100,000: so many would take 2.8 GB"),
        ({"robots.count": 10**6}, "robots.count: got 1000000, expected at most 1,000: so many would take 16.0 TB"),
        ({"world.obstacles": 10**21}, "expected at most 20,000: so many would take more than 1,000 PB in each world"),
        ({"world": {"family": "rooms", "columns": 300, "rows": 300}}, "300 x 300 cells, expected at most 40,000"),
        ({"world": {"family": "urban", "columns": 10**9}}, "so many would take 2.0 TB"),
        ({"world": {"family": "maze", "passage": 0.42, "bounds": [0, 0, 9e4, 9e4]}}, "they would take"),
        ({"world": {"family": "crossing", "bounds": [0, 0, 9e4, 9e4], "streams": 20_000}}, "movers would take"),
        ({"world": {"family": "beach", "corners_each": [3, 10**7]}}, "so many would take 400.0 MB for each obstacle"),
        ({"world": {"family": "forest", "trees": 10**7}}, "so many would take 4.5 GB in each world"),
    ],
)
def test_what_would_fill_the_memory_says_how_much(overrides: dict[str, Any], told: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load({"world": FIELD}, overrides)
    assert told in str(caught.value)


def test_a_wheel_of_circles_that_spins_within_a_step_is_refused() -> None:
    robot = {"kinematics": "differential", "circles": [[0, 0, 0.2], [1, 0, 0.2]], "max_turn_rate": 900}
    with pytest.raises(ScenarioError, match="robot.max_turn_rate: got 900, which turns the body by 900 rad in a step"):
        load({"robot": robot, "time": {"step": 1.0}})
    load({"robot": robot, "time": {"step": 0.1}})
    load({"robot": {**robot, "kinematics": "holonomic"}, "time": {"step": 1.0}})


def test_a_robot_whose_way_bends_too_much_within_a_step_is_refused() -> None:
    robot = {"kinematics": "differential", "max_speed": 100.0, "max_turn_rate": 10.0}
    told = r"max_turn_rate: got 10, which turns the body by 100 rad in a step \(time.step\), expected at most 10 rad"
    with pytest.raises(ScenarioError, match=f"robot.{told} with a way of 1000 m"):
        load({"robot": robot, "time": {"step": 10.0}})
    load({"robot": robot, "time": {"step": 1.0}})
    load({"robot": {**robot, "max_turn_rate": 1.0}, "time": {"step": 10.0}})
    load({"robot": {**robot, "kinematics": "holonomic"}, "time": {"step": 10.0}})


# -- Memory ------------------------------------------------------------------------------------------------------------


def test_more_worlds_than_memory_are_refused_before_they_are_made() -> None:
    with pytest.raises(
        ValueError, match=r"1,000,000,000 worlds of 'empty' would take .* TB, expected at most 68\.7 GB"
    ):
        NavigationVectorEnv(10**9, scenario="empty")
    with pytest.raises(ValueError, match="worlds of 'static' would take"):
        Simulation("static", 10**15)


def test_worlds_that_grow_beyond_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bug_gym.world.MEMORY", MEMORY // 10_000)  # as 3,000,000 worlds are to all of it
    simulation = Simulation("empty", 300)
    rows = np.zeros(1, dtype=np.int64)
    walls = [[[4 * i, 0], [4 * i + 1, 0], [4 * i + 1, 1]] for i in range(1000)]
    world = {
        "family": "explicit",
        "bounds": [-9, -9, 5000, 9],
        "polygons": walls,
        "start": [-5, -5, 0],
        "goal": [-5, 5],
    }
    many = Simulation({"world": world}, 300)
    assert simulation.count == 300
    with pytest.raises(ValueError, match="300 worlds of 'custom' would take"):
        many.reset(rows, [0])


def test_an_evaluation_of_too_many_episodes_says_what_they_would_take() -> None:
    with pytest.raises(ValueError, match=r"got 200,000,000 episodes of all policies.*rows would take 200\.0 GB"):
        make_plan(["bug0", "bug2"], "empty", episodes=10**8)
    with pytest.raises(
        ScenarioError, match="seeds.count: got 100000000, expected at most 10,000,000: .* 100.0 GB in rows"
    ):
        load_suite({"scenarios": ["empty"], "seeds": {"count": 10**8}})
    with pytest.raises(ValueError, match="expected seeds below"):
        make_plan(["bug0"], "empty", seed=2**63 - 3, episodes=5)


def test_the_seeds_of_a_plan_are_a_range() -> None:
    plan = make_plan(["go_to_goal"], "empty", episodes=MOST_EPISODES)
    assert plan.scenarios[0].seeds == range(MOST_EPISODES)


def test_pictures_of_too_many_pixels_say_what_they_would_take() -> None:
    canvas = pytest.importorskip("bug_gym.drawing.canvas")
    simulation = Simulation("empty")
    with pytest.raises(ValueError, match="size must be at most 5,000 pixels, got 10000: a picture would take 5.0 GB"):
        canvas.Canvas(simulation, size=10_000)
    with pytest.raises(ValueError, match="pictures of 10,000 worlds would take 180.0 GB"):
        NavigationVectorEnv(10_000, scenario="empty", render_mode="rgb_array")


@pytest.mark.parametrize(
    ("count", "told"),
    [(0, "0 bytes"), (999, "999 bytes"), (1000, "1.0 kB"), (2_800_000_000, "2.8 GB"), (10**400, "more than 1,000 PB")],
)
def test_memory_is_told_in_its_unit(count: int, told: str) -> None:
    assert told_bytes(count) == told


# -- Files that others made --------------------------------------------------------------------------------------------


def write_map(folder: Path, picture: bytes, name: str = "plan.pgm", **keys: Any) -> str:
    (folder / name).write_bytes(picture)
    keys = {"image": name, "resolution": 0.05, "origin": [0, 0, 0], **keys}
    (folder / "plan.yaml").write_text("".join(f"{key}: {value}\n" for key, value in keys.items()))
    return str(folder / "plan.yaml")


def refused(folder: Path, picture: bytes, name: str = "plan.pgm", **keys: Any) -> str:
    path = write_map(folder, picture, name, **keys)
    with pytest.raises(ScenarioError) as caught:
        load({"world": {"family": "ros_map", "path": path}})
    told = str(caught.value)
    assert told.startswith("scenario: world.path: ")
    assert "\n" not in told and len(told) < 500
    return told


@pytest.mark.parametrize(
    ("picture", "reason"),
    [
        (b"P5 1000000 1000000 255\n", "got 1000000 x 1000000 pixels, expected at most 16,000,000"),
        (b"P5 999999999999999999 9 255\n", "expected at most 16,000,000"),
        (b"P5 " + 5000 * b"9" + b" 9 255\n", "not a .pgm picture"),
        (b"P5 4000 4000 255\n\0", "got 1 pixels, expected 4000 x 4000"),
        (b"P2 2 2 255\n1 2 3 -4\n", "a pixel is not a whole number"),
        (b"P2 2 2 255\n1 2 3 " + 40 * b"9", "expected at most 255"),
        (b"P2 2 2 255\n", "got 0 pixels, expected 2 x 2"),
        (b"P5" + 200_000 * b"\n", "not a .pgm picture"),
    ],
)
def test_a_pgm_that_lies_about_its_size_is_one_line(tmp_path: Path, picture: bytes, reason: str) -> None:
    assert reason in refused(tmp_path, picture)


def png(width: int, height: int) -> bytes:
    import io

    buffer = io.BytesIO()
    Image.new("L", (width, height)).save(buffer, "PNG")
    return buffer.getvalue()


def test_a_picture_of_too_many_pixels_is_one_line(tmp_path: Path) -> None:
    assert "got 5000 x 4000 pixels" in refused(tmp_path, png(5000, 4000), "plan.png")
    size = (60_000).to_bytes(4, "big")
    bomb = png(8, 8)
    assert "not a picture" in refused(tmp_path, bomb[:16] + size + size + bomb[24:], "plan.png")


@pytest.mark.parametrize("cut", [10, 40, 60])
def test_a_picture_that_is_cut_off_is_one_line(tmp_path: Path, cut: int) -> None:
    assert "not a picture" in refused(tmp_path, png(64, 64)[:cut], "plan.png")


def test_a_program_is_no_picture(tmp_path: Path) -> None:
    assert "not a picture" in refused(tmp_path, b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "plan.eps")


@pytest.mark.parametrize("image", ["/dev/zero", "../nowhere.pgm", "'\\0'", "x" * 5000, ".", "[1]", "~"])
def test_an_image_that_is_no_regular_file_is_one_line(tmp_path: Path, image: str) -> None:
    refused(tmp_path, b"", image=image)


def test_an_image_may_lie_elsewhere_as_in_map_server(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    picture = b"P5 3 3 255\n" + 9 * b"\xff"
    write_map(tmp_path, picture)
    for image in ("../plan.pgm", str(tmp_path / "plan.pgm")):
        assert load_ros_map(write_map(tmp_path / "maps", b"", image=image)).cells.shape == (3, 3)


@pytest.mark.parametrize(
    "keys",
    [
        {"resolution": 1e300},
        {"resolution": 1e-300},
        {"resolution": 10**400},
        {"origin": [1e300, 0, 0]},
        {"origin": [0, 0, 1e9]},
        {"origin": [0, 0, 10**400]},
        {"free_thresh": 10**400},
    ],
)
def test_a_map_beyond_all_places_is_one_line(tmp_path: Path, keys: dict[str, Any]) -> None:
    (key,) = keys
    assert f"{key}: got " in refused(tmp_path, b"P5 3 3 255\n" + 9 * b"\xff", **keys)


def sparse(path: Path) -> str:
    """A file of 100 MB."""
    with path.open("wb") as file:
        file.truncate(100_000_000)
    return str(path)


def test_a_file_of_100_mb_is_one_line(tmp_path: Path) -> None:
    large = sparse(tmp_path / "large.pgm")
    assert "got 100.0 MB, expected at most 64.0 MB" in refused(tmp_path, b"", image="large.pgm")
    for read in (load_recording, load_barn):
        with pytest.raises(ValueError, match=r"got 100\.0 MB, expected at most 64\.0 MB"):
            read(large)
    with pytest.raises(ValueError, match=r"got 100\.0 MB, expected at most 2\.0 MB"):
        load_ros_map(large)
    with pytest.raises(ValueError, match=r"got 100\.0 MB"):
        load_gazebo(Path(large))
    (tmp_path / "large.yaml").symlink_to(large)
    with pytest.raises(ScenarioError, match="got more than 2.0 MB"):
        load(tmp_path / "large.yaml")


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such files")
def test_a_device_is_no_file() -> None:
    with pytest.raises(ValueError, match="/dev/zero: not a regular file"):
        read_file(Path("/dev/zero"), DATA)
    for family in ("barn", "dynabarn", "replay", "ros_map"):
        with pytest.raises(ValueError, match="/dev/zero: not a regular file"):
            Simulation({"world": {"family": family, "path": "/dev/zero"}}).reset(seeds=[0])


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("1e300,1,0,0", "expected times up to 1e+10 s and places up to 100000 m"),
        ("0,1,1e300,0", "expected times up to"),
        ("0,1,0,0\n1e-300,1,1,1", "s between two records of pedestrian 1, expected at least 1e-06"),
        ("0,1,0," + 100_000 * "9", "expected finite numbers"),
        ("0,1,0,\0", "line 2"),
    ],
)
def test_a_recording_beyond_all_places_is_one_line(tmp_path: Path, row: str, reason: str) -> None:
    path = tmp_path / "walk.csv"
    path.write_text(f"{RECORDS}{row}\n")
    with pytest.raises(ScenarioError) as caught:
        load({"world": {"family": "replay", "path": str(path)}})
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 600


WORLD = '{"world": 0, "start": [0, 0, 0], "goal": [1, 1], "cylinder_radius": %s, "cylinders": %s}\n'


@pytest.mark.parametrize(
    "line",
    [
        100_000 * "[",
        '{"world": ' + 5000 * "9" + "}",
        WORLD % ("1e300", "[[1, 1]]"),
        WORLD % ("1e-300", "[[1, 1]]"),
        WORLD % ("1" + 400 * "0", "[[1, 1]]"),
        WORLD % ("0.1", "[[1e300, 1]]"),
        WORLD % ("0.1", "[[1" + 400 * "0" + ", 1]]"),
        WORLD % ("0.1", "[[1], [1, 2]]"),
        WORLD % ("0.1", '{"a": 1}'),
        WORLD % ("0.1", [[0, 0]] * 20_001),
        "null",
        '{"world": []}',
    ],
)
def test_a_hostile_line_of_barn_is_told_with_its_number(tmp_path: Path, line: str) -> None:
    path = tmp_path / "worlds.jsonl"
    path.write_text(line)
    with pytest.raises(ValueError, match=r"worlds\.jsonl, line 1: ") as caught:
        load_barn(str(path))
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


def test_a_hostile_gazebo_world_is_one_line(tmp_path: Path) -> None:
    laughs = "".join(f'<!ENTITY l{n + 1} "{10 * f"&l{n};"}">' for n in range(10))
    model = "<model name='a'><pose>{}</pose><collision><geometry><cylinder><radius>{}</radius></cylinder></geometry>"
    whole = f"<sdf><world>{model}</collision></model></world></sdf>"
    for text in (
        f'<!DOCTYPE x [<!ENTITY l0 "lol">{laughs}]><sdf>&l10;</sdf>',
        '<?xml version="1.0" encoding="nobody-knows"?><sdf/>',
        whole.format("1e300 0", "1"),
        whole.format("0 0", "1e-300"),
        whole.format(5000 * "9", "1"),
        1000 * "<a>",
    ):
        file = tmp_path / "world_0.world"
        file.write_text(text)
        with pytest.raises(ValueError, match="world_0.world: ") as caught:
            load_gazebo(file)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


@pytest.mark.parametrize(
    "fastest",
    [
        {"kinematics": "holonomic", "max_speed": 1e4},
        {"kinematics": "differential", "max_speed": 1e4, "max_turn_rate": 1e-6},
        {"kinematics": "differential", "max_speed": 1e-5, "max_reverse": 0.0, "max_turn_rate": 1e3},
    ],
)
def test_numbers_within_the_limits_stay_finite_at_their_ends(fastest: dict[str, Any]) -> None:
    """The largest of everything at once; who goes fast does not turn fast too."""
    scenario = {
        "robot": {"radius": 1.0, **fastest},
        "lidar": {"beams": 9, "range": 1e5, "noise": 1e5},
        "odometry": dict.fromkeys(("translation_noise", "rotation_noise", "translation_bias", "rotation_bias"), 100.0),
        "time": {"step": 1e3, "limit": 1e7},
        "goal": {"radius": 1e-6, "sensing": "odometry"},
        "reward": dict.fromkeys(NUMBERS["reward"], 1e9),
        "world": {"family": "empty", "bounds": [-1e5, -1e5, 1e5, 1e5], "start": [0, 0, 1e6], "goal": [9e4, 9e4]},
    }
    simulation = Simulation(scenario)
    seen = simulation.reset(seeds=[1])
    for turn in (0.0, 1.0, -1.0, 0.001):
        transition = simulation.step([[[-1.0, turn]]])
        seen = np.append(seen, transition.observation)
        assert math.isfinite(transition.reward[0, 0])
    assert np.isfinite(seen).all()
