"""Maps and problems in the format of the MovingAI archive (Sturtevant 2012): `.map` and `.scen` files.

A map's rows are read from the top, as they stand in the file: row 0 is the first. "." and "G" are free, "S" (swamp) too;
"@", "O", "T" (trees) and "W" (water) are not. The archive's lengths are those of octile steps that cut no corner.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from bug_gym.agents.planning.grid import Bytes, Grid, make_grid
from bug_gym.limits import DATA, read_file
from bug_gym.schema.errors import shortened

FREE, BLOCKED = ".GS", "@OTW"
KEYS = ("type", "height", "width")


class Problem(NamedTuple):
    """A line of a `.scen` file."""

    map_name: str
    """The map it is of, as the file says it."""
    start: tuple[int, int]
    """Column and row."""
    goal: tuple[int, int]
    """Column and row."""
    length: float
    """Of the shortest way [cells]."""


def load_map(path: str | Path) -> Bytes:
    """The cells of a `.map` file (rows, columns), 1 where they are blocked.

    Raises:
        ValueError: no such map; the message names the file, the line, what came and what is expected.
    """
    lines = text_of(path).splitlines()
    head: dict[str, str] = {}
    number = 0
    while number < len(lines) and lines[number].strip() != "map":
        key, _, value = lines[number].strip().partition(" ")
        if key not in KEYS:
            raise wrong_line(path, number, lines[number], f"one of {', '.join(KEYS)}, or map")
        head[key] = value
        number += 1
    rows, columns = (size_of(path, key, head.get(key)) for key in ("height", "width"))
    body = lines[number + 1 : number + 1 + rows]
    if len(body) < rows:
        raise ValueError(f"{path}: got {len(body)} rows of cells, expected {rows}")
    cells = np.ones((rows, columns), dtype=np.uint8)
    for row, line in enumerate(body):
        if len(line) != columns:
            raise wrong_line(path, number + 1 + row, line, f"{columns} cells")
        for column, letter in enumerate(line):
            if letter not in FREE + BLOCKED:
                raise wrong_line(path, number + 1 + row, line, f"cells of {' '.join(FREE + BLOCKED)}")
            cells[row, column] = letter in BLOCKED
    return cells


def load_problems(path: str | Path) -> list[Problem]:
    """The problems of a `.scen` file.

    Raises:
        ValueError: no such file; the message names the file, the line, what came and what is expected.
    """
    lines = text_of(path).splitlines()
    if not lines or not lines[0].startswith("version"):
        raise wrong_line(path, 0, lines[0] if lines else "", "version 1")
    problems = []
    for number, line in enumerate(lines[1:], start=1):
        if not line.strip():
            continue
        fields = line.split("\t") if "\t" in line else line.split()
        expected = "bucket, map, width, height, start x, start y, goal x, goal y and length"
        if len(fields) != 9:
            raise wrong_line(path, number, line, expected)
        try:
            places, length = [int(value) for value in fields[4:8]], float(fields[8])
        except ValueError:
            raise wrong_line(path, number, line, expected) from None
        problems.append(Problem(fields[1], (places[0], places[1]), (places[2], places[3]), length))
    return problems


def grid_of_map(cells: Bytes) -> Grid:
    """The grid of a map's cells (rows, columns), a rim of blocked ones about them."""
    return make_grid(cells)


def node_of(grid: Grid, place: tuple[int, int]) -> int:
    """Number of the cell in a column and row of a map.

    Raises:
        ValueError: a place outside of the map.
    """
    column, row = place
    rows, columns = grid.lattice.rows - 2, grid.lattice.columns - 2
    if not (0 <= row < rows and 0 <= column < columns):
        raise ValueError(f"got column {column} and row {row}, expected a cell of {columns} x {rows}")
    return (row + 1) * grid.lattice.columns + column + 1


def text_of(path: str | Path) -> str:
    """The text of a file.

    Raises:
        ValueError: no such file, or none of text.
    """
    try:
        return read_file(Path(path), DATA).decode("ascii")
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: expected text in ASCII") from None


def size_of(path: str | Path, key: str, value: str | None) -> int:
    """A height or width of a map's head."""
    if value is None or not value.isdigit() or not 1 <= int(value) <= 100_000:
        raise ValueError(f"{path}: {key}: got {shortened(value)}, expected a number of cells from 1 to 100,000")
    return int(value)


def wrong_line(path: str | Path, number: int, line: str, expected: str) -> ValueError:
    """What is wrong with a line of a file, counted from 0."""
    return ValueError(f"{path}: line {number + 1}: got {shortened(line)}, expected {expected}")
