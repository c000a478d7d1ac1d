"""Maps and problems in the MovingAI archive's format: a dozen small ones of our own, and what is wrong with others."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from test_searches import SHORTEST, slow_distances

from bug_gym.agents.planning.grid import STRAIGHT
from bug_gym.agents.planning.moving_ai import grid_of_map, load_map, load_problems, node_of

FOLDER = Path(__file__).parent / "moving_ai"
MAPS = sorted(FOLDER.glob("*.map"))
ARCHIVE = os.environ.get("BUG_GYM_MOVING_AI", "")
"""A folder of the archive's own maps, each with its .scen beside it."""


def test_there_are_a_dozen_maps() -> None:
    assert len(MAPS) == 12


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_every_exact_search_finds_the_lengths_of_the_file(path: Path) -> None:
    cells = load_map(path)
    grid = grid_of_map(cells)
    for problem in load_problems(path.with_name(f"{path.name}.scen")):
        assert problem.map_name == path.name
        (column, row), (goal_column, goal_row) = problem.start, problem.goal
        slow = slow_distances(cells, (row, column), connectivity=8, cut=False)[goal_row, goal_column]
        assert slow / STRAIGHT == pytest.approx(problem.length, abs=1e-7)
        for search in SHORTEST.values():
            found = search(grid, node_of(grid, problem.start), node_of(grid, problem.goal))
            assert found.cost == slow


@pytest.mark.skipif(not ARCHIVE, reason="BUG_GYM_MOVING_AI names no folder of the archive's maps")
def test_the_archives_own_lengths() -> None:
    for path in sorted(Path(ARCHIVE).rglob("*.scen")):
        grid = grid_of_map(load_map(path.with_name(path.name.removesuffix(".scen"))))
        for problem in load_problems(path)[::50]:
            for name in ("a_star", "bidirectional_a_star"):
                found = SHORTEST[name](grid, node_of(grid, problem.start), node_of(grid, problem.goal))
                assert found.length == pytest.approx(problem.length, abs=1e-4)


def test_row_0_is_the_first_of_the_file() -> None:
    cells = load_map(FOLDER / "wall.map")
    assert cells.shape == (14, 18)
    assert cells[:11, 8].all() and not cells[11:, 8].any()
    assert load_map(FOLDER / "open.map").sum() == 0  # "G" is free
    assert load_map(FOLDER / "closed.map")[3, 5] == 1  # "W" is not


HEAD = "type octile\nheight 2\nwidth 3\nmap\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "height: got None, expected a number of cells"),
        ("type octile\nheight two\nwidth 3\nmap\n...\n...\n", "height: got 'two'"),
        ("type octile\nheight 2\nwidth 3\ncolour red\nmap\n", "line 4: got 'colour red', expected one of type"),
        (HEAD + "...\n", "got 1 rows of cells, expected 2"),
        (HEAD + "...\n..\n", "line 6: got '..', expected 3 cells"),
        (HEAD + "...\n.x.\n", "line 6: got '.x.', expected cells of"),
        (HEAD.replace("2", "999999") + "...\n", "height: got '999999'"),
    ],
)
def test_a_map_that_is_none_is_told_where(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wrong.map"
    path.write_text(text)
    with pytest.raises(ValueError) as raised:
        load_map(path)
    assert words in str(raised.value) and str(path) in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: got '', expected version 1"),
        ("version 1\n0\ta.map\t3\t2\t0\t0\t1\n", "line 2: got .* expected bucket, map, width"),
        ("version 1\n\n0\ta.map\t3\t2\t0\tx\t1\t1\t1.4\n", "line 3: got .* expected bucket, map, width"),
    ],
)
def test_problems_that_are_none_are_told_where(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "wrong.scen"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        load_problems(path)


def test_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "bytes.map").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="expected text in ASCII"):
        load_map(tmp_path / "bytes.map")
    with pytest.raises(ValueError, match="No such file"):
        load_map(tmp_path / "none.map")
    with pytest.raises(ValueError, match="not a regular file"):
        load_problems(tmp_path)


def test_a_place_outside_of_a_map_is_refused() -> None:
    grid = grid_of_map(np.zeros((3, 4), dtype=np.uint8))
    with pytest.raises(ValueError, match="got column 4 and row 0, expected a cell of 4 x 3"):
        node_of(grid, (4, 0))
