"""The walls of `rooms` worlds in compiled code: 20 times as fast as the plain way of `rooms.py`, and the same bit for bit.

Where each corner of the walls lies among the rings that shapely makes of them depends on how many walls there are, and on
how they lie about the middle; shapely is asked once for each such case. What doors cut out of those rings is walked along
by `kernels.rooms`.
"""

from __future__ import annotations

import functools
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from bug_gym.geometry import F64
from bug_gym.kernels.generator import give_back, taken
from bug_gym.kernels.layout import Integers
from bug_gym.kernels.rooms import cut_doors, draw_rooms
from bug_gym.worlds.clearance import Outlines
from bug_gym.worlds.family import Rng
from bug_gym.worlds.places import Walls
from bug_gym.worlds.polygons import Rectangle, as_polygons, boxes


class Plan(NamedTuple):
    """What a scenario says of its rooms."""

    columns: int
    """How many rooms lie along x."""
    rows: int
    """How many rooms lie along y."""
    bounds: tuple[float, float, float, float]
    """xmin, ymin, xmax, ymax [m]."""
    half: float
    """Half the thickness of walls [m]."""
    door: float
    """Width of doors [m]."""
    loops: float
    """Share of walls between neighbours that have a door without need."""
    unevenness: float
    """How far walls stand off their even places, 0 to 1."""


class Uncut(NamedTuple):
    """The rings of walls without doors."""

    faces: Integers
    """Numbers (n, 2) of the faces that meet at each corner, see `kernels.rooms.face`."""
    firsts: Integers
    """Where each ring begins (rings + 1,)."""


def whole_walls(x: F64, y: F64, half: float) -> list[Rectangle]:
    """The walls between rooms as if they had no doors, along lines at x (columns + 1,) and y (rows + 1,) [m].

    They go on a little beyond the border, so that no beam slips between the two.
    """
    xmin, ymin, xmax, ymax = (float(place) for place in (x[0], y[0], x[-1], y[-1]))
    walls = [(line - half, ymin - half, line + half, ymax + half) for line in x[1:-1].tolist()]
    return walls + [(xmin - half, line - half, xmax + half, line + half) for line in y[1:-1].tolist()]


def drawn_walls(plan: Plan, rng: Rng) -> Walls | None:
    """The walls of one world; None, and nothing drawn, where the plain way has to draw it.

    That is where a generator isn't NumPy's PCG64, where there are less than two walls, and where doors leave slivers of
    walls.
    """
    words = taken(rng)
    columns, rows = plan.columns, plan.rows
    if words is None or columns + rows < 4:
        return None
    x, y = np.empty(columns + 1), np.empty(rows + 1)
    right, up = np.empty((columns - 1, rows)), np.empty((columns, rows - 1))
    flags = np.zeros(right.shape, dtype=np.bool_), np.zeros(up.shape, dtype=np.bool_)
    seen, trail = np.zeros((columns, rows), dtype=np.bool_), np.empty(columns * rows, dtype=np.int64)
    settings = plan.bounds, plan.half, plan.door, plan.loops, plan.unevenness
    lie = draw_rooms(words, *settings, x, y, right, up, *flags, seen, trail)
    uncut = uncut_walls(columns, rows, lie, Lines(x, y, plan.half)) if lie >= 0 else None
    if uncut is None:
        return None
    give_back(rng, words)
    most = len(uncut.faces) + 4 * (right.size + up.size)
    walk, after, begins = np.empty((most, 2)), np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
    corners, firsts = np.empty((most + 4, 2)), np.empty(most + 2, dtype=np.int64)
    rings = cut_doors(*uncut, x, y, right, up, plan.half, plan.door, walk, after, begins, corners, firsts)
    firsts = firsts[: rings + 1]
    polygons = tuple((corners[begin:end],) for begin, end in pairwise(firsts[1:].tolist()))
    return Walls(polygons, Outlines(corners, firsts))


class Lines:
    """Where the walls of one world stand; all that lie alike about the middle are one to a cache."""

    def __init__(self, x: F64, y: F64, half: float) -> None:
        self.x, self.y, self.half = x, y, half

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Lines)

    def __hash__(self) -> int:
        return 0


@functools.lru_cache(maxsize=256)
def uncut_walls(columns: int, rows: int, lie: int, lines: Lines) -> Uncut | None:
    """The rings that shapely makes of walls without doors, for all worlds whose walls lie alike about the middle.

    None where it makes a corner that isn't one of two faces.
    """
    x_faces, y_faces = (
        {place: number for number, place in enumerate(faces_of(places, lines.half))} for places in (lines.x, lines.y)
    )
    rings = [ring for rings in as_polygons(boxes(whole_walls(lines.x, lines.y, lines.half))) for ring in rings]
    try:
        faces = [(x_faces[x], y_faces[y]) for ring in rings for x, y in ring.tolist()]
    except KeyError:
        return None
    ends = np.cumsum([0, *map(len, rings)])
    return Uncut(np.array(faces, dtype=np.int64), ends.astype(np.int64))


def faces_of(lines: F64, half: float) -> list[float]:
    """Places of the faces of walls in order: the border's outer one, two of each wall, the border's [m]."""
    inner = [face for line in lines[1:-1].tolist() for face in (line - half, line + half)]
    return [float(lines[0]) - half, *inner, float(lines[-1]) + half]
