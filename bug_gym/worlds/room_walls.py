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
from bug_gym.kernels.rooms import WallsAndDoors, cut_doors, draw_rooms
from bug_gym.worlds.family import Rng
from bug_gym.worlds.outlines import Outlines
from bug_gym.worlds.places import Walls
from bug_gym.worlds.polygons import as_polygons, boxes, lined_walls


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


class WholeRings(NamedTuple):
    """The rings of walls without doors."""

    faces: Integers
    """Numbers (n, 2) of the faces that meet at each corner, see `kernels.rooms.face`."""
    firsts: Integers
    """Where each ring begins (rings + 1,)."""


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
    open_right, open_up = np.zeros(right.shape, dtype=np.bool_), np.zeros(up.shape, dtype=np.bool_)
    seen, trail = np.zeros((columns, rows), dtype=np.bool_), np.empty(columns * rows, dtype=np.int64)
    settings = plan.bounds, plan.half, plan.door, plan.loops, plan.unevenness
    drawn = WallsAndDoors(x, y, right, up)
    lie = draw_rooms(words, *settings, drawn, open_right, open_up, seen, trail)
    whole = whole_rings(columns, rows, lie) if lie >= 0 else None
    if whole is None:
        return None
    give_back(rng, words)
    doors = right.size + up.size
    most = len(whole.faces) + 4 * doors
    walk, after, begins = np.empty((most, 2)), np.empty(most, dtype=np.int64), np.empty(2 * doors, dtype=np.int64)
    corners, firsts = np.empty((most + 4, 2)), np.empty(most + 2, dtype=np.int64)
    rings = cut_doors(*whole, drawn, plan.half, plan.door, walk, after, begins, corners, firsts)
    firsts = firsts[: rings + 1]
    polygons = tuple((corners[begin:end],) for begin, end in pairwise(firsts[1:].tolist()))
    return Walls(polygons, Outlines(corners, firsts))


@functools.cache
def whole_rings(columns: int, rows: int, lie: int) -> WholeRings | None:
    """The rings that shapely makes of walls without doors, where they lie so about the middle (see `draw_rooms`).

    None where several walls are in the very middle: their order may be any.
    """
    lie_x, lie_y = divmod(lie, (rows + 1) ** 2)
    x, y = stand_ins(columns, lie_x), stand_ins(rows, lie_y)
    if x is None or y is None:
        return None
    half = 0.25
    x_faces, y_faces = numbered_faces(x, half), numbered_faces(y, half)
    rings = [ring for rings in as_polygons(boxes(lined_walls(x, y, half))) for ring in rings]
    faces = [(x_faces[i], y_faces[j]) for ring in rings for i, j in ring.tolist()]
    ends = np.cumsum([0, *map(len, rings)])
    return WholeRings(np.array(faces, dtype=np.int64), ends.astype(np.int64))


def stand_ins(count: int, lie: int) -> F64 | None:
    """Places (count + 1,) of walls that lie about 0 as told, at whole numbers; None where several would be at 0."""
    within, before = divmod(lie, count)
    if within > 1:
        return None
    places = np.arange(count + 1.0) - before - 1.0
    places[before + 1 :] += 1 - within
    places[0], places[-1] = -count - 1.0, count + 1.0
    return places


def numbered_faces(lines: F64, half: float) -> dict[float, int]:
    """Numbers of faces by their places, in the order of `kernels.rooms.face`."""
    inner = [face for line in lines[1:-1].tolist() for face in (line - half, line + half)]
    return {face: number for number, face in enumerate([lines[0] - half, *inner, lines[-1] + half])}
