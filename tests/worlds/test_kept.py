"""Worlds from files: a file that was changed is read again, one that was not is not, and a results folder tells."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_maps import write_map

from bug_gym.agents.planning.map import PlanningMap
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.scenario_code import data_digest
from bug_gym.scenarios import draw_layout
from bug_gym.worlds.kept import MOST_KEPT, Kept, only_itself

ROOM = np.pad(np.zeros((40, 40), dtype=np.uint8), 1, constant_values=2)
"""A room of 2 m with walls, as cells."""


def with_pillar(width: int) -> Any:
    """The room with a pillar of some width [cells] in its middle."""
    cells = ROOM.copy()
    cells[20 : 20 + width, 20 : 20 + width] = 2
    return cells


def gazebo(folder: Path, number: int, radius: float) -> None:
    shape = f"<collision><geometry><cylinder><radius>{radius}</radius></cylinder></geometry></collision>"
    text = f"<sdf><world><model name='a'><pose>-2 8 0 0 0 0</pose>{shape}</model></world></sdf>"
    (folder / f"world_{number}.world").write_text(text)


def barn(folder: Path, radius: float) -> str:
    data = {"world": 0, "start": [-2, 3, 1.57], "goal": [-2, 13], "cylinder_radius": radius, "cylinders": [[0, 5]]}
    (folder / "worlds.jsonl").write_text(json.dumps(data) + "\n")
    return str(folder / "worlds.jsonl")


def barn_folder(folder: Path, radius: float) -> str:
    gazebo(folder, 0, radius)
    return str(folder)


def dynabarn(folder: Path, radius: float) -> str:
    wall = [[0, 0], [9, 0], [9, radius]]
    data = {"world": 0, "start": [1, 1, 0], "goal": [8, 1], "walls": [{"polygon": wall}], "movers": []}
    (folder / "worlds.jsonl").write_text(json.dumps(data) + "\n")
    return str(folder / "worlds.jsonl")


def recording(folder: Path, radius: float) -> str:
    (folder / "walk.csv").write_text(f"time_s,pedestrian,x_m,y_m\n0,1,0,0\n9,1,12,{radius}\n0,2,5,9\n9,2,5,3\n")
    return str(folder / "walk.csv")


WRITERS: dict[str, tuple[Callable[[Path, float], str], dict[str, Any]]] = {
    "ros_map": (lambda folder, size: write_map(folder, with_pillar(int(10 * size))), {"separation": 0.5}),
    "barn": (barn, {}),
    "barn folder": (barn_folder, {}),
    "dynabarn": (dynabarn, {}),
    "replay": (recording, {"start_time": 0.0}),
}
"""What writes a file or folder that a size is in, and what its scenario says beside the path."""


def drawn(source: dict[str, Any]) -> str:
    """All that stands in a world of a scenario that is loaded anew."""
    layout = draw_layout(load(source), 0, 0)
    return repr((layout.circles.tolist(), [[ring.tolist() for ring in one] for one in layout.polygons], layout.movers))


def source_of(family: str, path: str) -> dict[str, Any]:
    return {"world": {"family": family.split()[0], "path": path, **WRITERS[family][1]}, "robot": {"radius": 0.1}}


@pytest.mark.parametrize("family", WRITERS)
def test_a_file_that_was_changed_is_read_again(family: str, tmp_path: Path) -> None:
    write, _ = WRITERS[family]
    source = source_of(family, write(tmp_path, 0.3))
    before, kept = drawn(source), load(source)
    assert drawn(source) == before
    write(tmp_path, 0.55)
    after = drawn(source)
    assert after != before
    assert data_digest(kept) == data_digest(load(source))  # both are of what lies there now
    write(tmp_path, 0.3)
    assert drawn(source) == before


def test_a_picture_that_was_changed_is_read_again_beside_a_yaml_that_was_not(tmp_path: Path) -> None:
    path = write_map(tmp_path, ROOM)
    text = Path(path).read_bytes()
    empty, walls = load(source_of("ros_map", path)), len(PlanningMap.of_ros(path).polygons)
    digest = data_digest(empty)
    write_map(tmp_path, with_pillar(4))
    assert Path(path).read_bytes() == text
    assert len(draw_layout(empty, 0, 0).polygons) == walls + 1 == len(PlanningMap.of_ros(path).polygons)
    assert data_digest(empty) != digest


def test_a_world_that_comes_into_a_folder_is_found(tmp_path: Path) -> None:
    source = source_of("barn folder", barn_folder(tmp_path, 0.3))
    with pytest.raises(ValueError, match="no world 7"):
        draw_layout(load(source, {"world.world": 7}), 0, 0)
    gazebo(tmp_path, 7, 0.4)
    assert draw_layout(load(source, {"world.world": 7}), 0, 0).circles.tolist() == [[-2.0, 8.0, 0.4]]


def test_a_file_is_read_once_and_stays_known_when_it_is_gone(tmp_path: Path) -> None:
    reads = []

    def read(path: str) -> str:
        reads.append(path)
        return Path(path).read_text()

    kept, path = Kept(read, only_itself), tmp_path / "a.txt"
    path.write_text("one")
    assert [kept(str(path)) for _ in range(3)] == ["one"] * 3 and len(reads) == 1
    path.unlink()
    assert kept(str(path)) == "one" and len(reads) == 1
    path.write_text("two, longer")
    assert kept(str(path)) == "two, longer" and len(reads) == 2
    path.write_text("x")
    for number in range(MOST_KEPT):
        other = tmp_path / f"{number}.txt"
        other.write_text("")
        kept(str(other))
    assert kept(str(path)) == "x" and len(reads) == 3 + MOST_KEPT


def test_what_is_written_while_a_file_is_read_is_seen_the_next_time(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("one")

    def read(name: str) -> str:
        text = Path(name).read_text()
        Path(name).write_text("two, longer")
        return text

    kept = Kept(read, only_itself)
    assert [kept(str(path)), kept(str(path))] == ["one", "two, longer"]


def test_rows_of_a_map_that_was_changed_since_are_not_gone_on_with(tmp_path: Path) -> None:
    source, out = {"name": "room", **source_of("ros_map", write_map(tmp_path, ROOM))}, tmp_path / "rows"
    evaluate("go_to_goal", source, episodes=1, out=out)
    assert len(evaluate("go_to_goal", source, episodes=1, out=out)) == 1
    write_map(tmp_path, with_pillar(4))
    with pytest.raises(ValueError, match=r"holds another run: scenarios\.room\.data was"):
        evaluate("go_to_goal", source, episodes=1, out=out)
