"""Worlds from files of the BARN benchmark: what is read, and what is said of a file that can't be read."""

import json
import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym.config import load
from bug_gym.scenarios import draw_layout
from bug_gym.simulation import Simulation
from bug_gym.worlds.barn_files import load_barn

CYLINDERS = [[-0.5, 5.0], [-3.5, 7.25], [-1.0, 9.0]]
START, GOAL = [-2.0, 3.0, 1.5707963], [-2.0, 13.0]


def line(world: Any = 0, **changes: Any) -> str:
    """One world as a line of a .jsonl; a change to ... leaves the key out."""
    data: dict[str, Any] = {
        "world": world,
        "start": START,
        "goal": GOAL,
        "cylinder_radius": 0.075,
        "cylinders": CYLINDERS,
    }
    return json.dumps({key: value for key, value in (data | changes).items() if value is not ...})


def jsonl(folder: Path, *lines: str) -> str:
    """A file of these lines."""
    path = folder / "worlds.jsonl"
    path.write_text("".join(f"{text}\n" for text in lines), encoding="utf-8")
    return str(path)


def cylinder_model(name: str, radius: float | str, pose: str | None) -> str:
    """A cylinder as Gazebo saves it: the model, with or without its own pose."""
    place = "" if pose is None else f"<pose>{pose}</pose>"
    shape = f"<geometry><cylinder><radius>{radius}</radius><length>1</length></cylinder></geometry>"
    return f"<model name='{name}'>{place}<link name='l'><collision name='c'>{shape}</collision></link></model>"


def gazebo(folder: Path, number: int, models: str, state: str = "") -> Path:
    """A `world_N.world` file with a ground plane and these models."""
    collision = "<collision name='c'><geometry><plane/></geometry></collision>"
    plane = f"<model name='ground_plane'><link name='l'>{collision}</link></model>"
    path = folder / f"world_{number}.world"
    path.write_text(f"<sdf version='1.6'><world name='default'>{plane}{models}<state>{state}</state></world></sdf>")
    return path


# ------------------------------------------------------------------------------------------------ what is read


def test_a_line_gives_start_goal_and_cylinders(tmp_path: Path) -> None:
    world = load_barn(jsonl(tmp_path, line(7)))[7]
    assert world.start == tuple(START) and world.goal == tuple(GOAL)
    assert world.circles.tolist() == [[*place, 0.075] for place in CYLINDERS]


def test_empty_lines_and_keys_of_no_concern_are_passed_over(tmp_path: Path) -> None:
    path = jsonl(tmp_path, line(1, reference_length=12.0), "", line(5), "   ")
    assert sorted(load_barn(path)) == [1, 5]


def test_the_length_of_the_benchmarks_path_is_kept_where_a_line_tells_it(tmp_path: Path) -> None:
    lines = line(1, reference_length=11.5), line(2), line(3, reference_length=None), line(4, reference_length=12)
    worlds = load_barn(jsonl(tmp_path, *lines))
    assert [worlds[number].reference_length for number in (1, 2, 3, 4)] == [11.5, None, None, 12.0]


def test_a_world_without_cylinders_is_a_world(tmp_path: Path) -> None:
    assert load_barn(jsonl(tmp_path, line(1, cylinders=[])))[1].circles.shape == (0, 3)


def test_a_folder_of_gazebo_worlds_gives_the_cylinders_where_their_saved_state_has_them(tmp_path: Path) -> None:
    models = cylinder_model("a", 0.075, "9 9 0 0 0 0") + cylinder_model("b", 0.1, "-3.5 7.25 0.5 0 0 0")
    gazebo(tmp_path, 4, models, "<model name='a'><pose>-0.5 5.0 0.5 0 0 0</pose></model>")
    gazebo(
        tmp_path,
        12,
        cylinder_model("unit_cylinder", 0.075, None),
        "<model name='unit_cylinder'><pose>1 2 0 0 0 0</pose></model>",
    )
    (tmp_path / "world_x.world").write_text("not one of them")
    (tmp_path / "readme.txt").write_text("nor this")
    worlds = load_barn(str(tmp_path))
    assert sorted(worlds) == [4, 12]
    assert worlds[4].circles.tolist() == [[-0.5, 5.0, 0.075], [-3.5, 7.25, 0.1]]
    assert worlds[12].circles.tolist() == [[1.0, 2.0, 0.075]]
    assert worlds[4].goal == (-2.0, 13.0) and worlds[4].start == (-2.0, 3.0, math.pi / 2.0)


def barn_scenario(path: str, world: int | None = None) -> dict[str, Any]:
    """A scenario in a world of a file."""
    return {
        "robot": {"radius": 0.2},
        "goal": {"radius": 1.0},
        "world": {"family": "barn", "path": path, "world": world},
    }


def test_a_scenario_takes_the_world_of_its_number(tmp_path: Path) -> None:
    path = jsonl(tmp_path, line(3), line(8, cylinders=[[-4.0, 8.0]]))
    layout = draw_layout(load(barn_scenario(path, 8)), 0, 0)
    assert layout.circles.tolist() == [[-4.0, 8.0, 0.075]]
    assert layout.starts.tolist() == [START] and layout.goals.tolist() == [GOAL]


def test_a_scenario_without_a_number_draws_each_world_at_times(tmp_path: Path) -> None:
    path = jsonl(tmp_path, *(line(number, cylinders=[[-4.0, 5.0 + number]]) for number in range(4)))
    scenario = load(barn_scenario(path))
    assert {draw_layout(scenario, seed, 0).circles[0, 1] for seed in range(60)} == {5.0, 6.0, 7.0, 8.0}


def test_a_number_that_is_not_there_is_an_error_that_says_which_are(tmp_path: Path) -> None:
    path = jsonl(tmp_path, line(3), line(8))
    with pytest.raises(ValueError, match=r"no world 4 in .*worlds.jsonl; it holds \[3, 8\]"):
        draw_layout(load(barn_scenario(path, 4)), 0, 0)


def test_the_worlds_of_the_shared_data_load_and_hold_a_robot(shared_data: Path) -> None:
    path = str(shared_data / "barn_worlds.jsonl")
    texts = Path(path).read_text().splitlines()
    worlds = load_barn(path)
    assert len(worlds) == len(texts) == 50
    for text in texts:
        raw = json.loads(text)
        assert worlds[raw["world"]].circles[:, :2].tolist() == raw["cylinders"]
        # The length is that of the path, start and goal with it, to the four digits of the file.
        length = sum(math.dist(*pair) for pair in pairwise(raw["reference_path"]))
        assert worlds[raw["world"]].reference_length == pytest.approx(length, abs=1e-4)
    simulation = Simulation(barn_scenario(path), count=20)
    simulation.reset(seeds=list(range(20)))
    assert np.isfinite(simulation.world.ranges).all()


# ------------------------------------------------------------------------------------------------ what can't be read

CORRUPT: dict[str, tuple[str, str]] = {
    "cut off": (line()[:-20], "not JSON"),
    "no JSON": ("hello", "not JSON"),
    "a list": ("[1, 2]", "not a BARN world"),
    "a number": ("3", "not a BARN world"),
    "no start": (line(start=...), "lacks the key 'start'"),
    "no number": (line(world=...), "lacks the key 'world'"),
    "no cylinders": (line(cylinders=...), "lacks the key 'cylinders'"),
    "short start": (line(start=[0.0, 1.0]), "not a BARN world"),
    "text for a place": (line(goal=["a", "b"]), "not a BARN world"),
    "NaN start": (line(start=[math.nan, 3.0, 0.0]), "not a BARN world"),
    "infinite goal": (line(goal=[-2.0, math.inf]), "not a BARN world"),
    "NaN cylinder": (line(cylinders=[[math.nan, 3.0]]), "not a BARN world"),
    "three numbers a cylinder": (line(cylinders=[[0, 1, 2], [3, 4, 5]]), "not a BARN world"),
    "flat cylinders": (line(cylinders=[0, 1, 2, 3]), "not a BARN world"),
    "ragged cylinders": (line(cylinders=[[0, 1], [2]]), "not a BARN world"),
    "no radius": (line(cylinder_radius=0.0), "not a BARN world"),
    "negative radius": (line(cylinder_radius=-1.0), "not a BARN world"),
    "NaN radius": (line(cylinder_radius=math.nan, cylinders=[]), "not a BARN world"),
    "reference of no length": (line(reference_length=0.0), "got the reference_length 0"),
    "NaN reference": (line(reference_length=math.nan), "got the reference_length nan"),
    "reference beyond all": (line(reference_length=1e9), "got the reference_length"),
    "text for a length": (line(reference_length="long"), "not a BARN world"),
    "broken number": (line(world=2.5), "not a BARN world"),
}


@pytest.mark.parametrize("name", CORRUPT)
def test_a_corrupt_line_is_an_error_with_file_and_line_number(name: str, tmp_path: Path) -> None:
    bad, what = CORRUPT[name]
    path = jsonl(tmp_path, line(1), "", bad, line(2))
    with pytest.raises(ValueError, match=rf"worlds.jsonl, line 3: .*{what}"):
        load_barn(path)


def test_a_world_that_comes_twice_is_an_error_with_its_line_number(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="line 2: .*world 1 .*twice"):
        load_barn(jsonl(tmp_path, line(1), line(1)))


def test_bytes_that_are_no_text_are_an_error_with_file_and_line_number(tmp_path: Path) -> None:
    path = tmp_path / "worlds.jsonl"
    path.write_bytes(line(1).encode() + b"\n\xff\xfe\x00\n")
    with pytest.raises(ValueError, match="worlds.jsonl, line 2: not UTF-8"):
        load_barn(str(path))


def test_line_numbers_count_line_feeds_only(tmp_path: Path) -> None:
    """Text may hold other characters at which Python's splitlines breaks."""
    note = json.dumps({**json.loads(line(1)), "note": "a\u2028b\u0085c"}, ensure_ascii=False)
    path = jsonl(tmp_path, note, "hello")
    with pytest.raises(ValueError, match="line 2: not JSON"):
        load_barn(path)


@pytest.mark.parametrize("what", ["empty file", "empty folder"])
def test_where_there_is_no_world_the_error_says_what_was_expected(what: str, tmp_path: Path) -> None:
    path = jsonl(tmp_path) if what == "empty file" else str(tmp_path)
    with pytest.raises(ValueError, match=r"no BARN world found \(expected a .jsonl, or a folder"):
        load_barn(path)


BROKEN_MODELS = {
    "no pose": (cylinder_model("a", 0.1, None), "'a' has no pose"),
    "short pose": (cylinder_model("a", 0.1, "3"), "'a'"),
    "text for a pose": (cylinder_model("a", 0.1, "x y 0 0 0 0"), "'a'"),
    "text for a radius": (cylinder_model("a", "wide", "1 2 0 0 0 0"), "'a'"),
    "negative radius": (cylinder_model("a", -0.1, "1 2 0 0 0 0"), "'a'"),
    "NaN pose": (cylinder_model("a", 0.1, "nan 2 0 0 0 0"), "'a'"),
    "no cylinder": ("", "no cylinder"),
}


@pytest.mark.parametrize("name", BROKEN_MODELS)
def test_a_broken_gazebo_world_is_an_error_that_names_the_file_and_the_model(name: str, tmp_path: Path) -> None:
    models, what = BROKEN_MODELS[name]
    gazebo(tmp_path, 3, models)
    with pytest.raises(ValueError, match=f"world_3.world: .*{what}"):
        load_barn(str(tmp_path))


def test_a_gazebo_world_that_is_no_xml_is_an_error_with_the_line(tmp_path: Path) -> None:
    (tmp_path / "world_3.world").write_text("<sdf>\n<world>\n</sdf>")
    with pytest.raises(ValueError, match=r"world_3.world: not a Gazebo world \(.*line 3"):
        load_barn(str(tmp_path))
