"""What a robot remembers of still obstacles: points of its scans on a grid, and the shortest way among them.

The plane is cut into square cells. A cell remembers at most one scan point, with its place inside the cell; a cell is
*blocked* when its centre lies nearer than the clearance to a remembered point. Everything else counts as open, seen or
not ("free-space assumption"; Koenig, Tovey and Smirnov 2003). A beam that passes a remembered point twice takes it
away. The way is found by Lazy Theta* (Nash, Koenig and Tovey 2010), which bends at cells but runs straight between
them. As every cell is looked at before it gives up, no way is found only where the remembered points close the goal
off, up to half a cell's diagonal.

All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.compiling import inlined, kernel
from bug_gym.geometry import Point
from bug_gym.kernels.layout import Flags, Floats, Integers

Bytes = NDArray[np.uint8]
Counts = NDArray[np.int16]
Indices = NDArray[np.int32]
Weights = NDArray[np.float32]
Words = NDArray[np.uint64]

BLOCK = 8
"""Cells along the side of a block; empty blocks are skipped at once. As many as a word has bytes."""

FORGET = 2
"""Beams in a row that must pass a point before it is taken away."""

SUPPOSED = 2.0
"""Up to how many times the reach of the terrain field ground is supposed to go on as it is seen."""

ESCAPE = 1.5
"""How far from a place nearer to a wall than the clearance the way out of there may lead, in clearances."""

MARGIN = 3.0
"""Open ground kept around everything known [m], so that a way round it is on the grid."""

MOST_CELLS = 64_000_000
"""Cells of the largest grid; points beyond are not remembered."""

ROUGH = 0.005
"""Largest error of a rough angle [rad]."""

_ROW, _COLUMN = (-1, -1, -1, 0, 0, 1, 1, 1), (-1, 0, 1, -1, 1, -1, 0, 1)
"""The eight cells around one."""


class Cells(NamedTuple):
    """The grid of a map (R, C): what its cells remember, and where they lie."""

    spot: Bytes
    """Place of the point inside its cell in 1/256 of the side (R, C, 2)."""
    holds: Bytes
    """1: a point; 1 + n: n beams in a row have passed it (R, C)."""
    words: Words
    """The same memory, a row of a block in one number (R, C / BLOCK)."""
    blocked: Counts
    """Points nearer to the cell's centre than the clearance (R, C)."""
    points_in_block: Counts
    """Cells of each block that hold a point (R / BLOCK, C / BLOCK)."""
    blocked_in_block: Counts
    """Cells of each block that are blocked (R / BLOCK, C / BLOCK)."""
    weight: Weights
    """Cost of a metre of the ground, negative where it is only supposed (R, C); (1, 1) where it isn't remembered."""
    looked_from: Weights
    """From how far that was seen or supposed [m], of the shape of `weight`; infinite where it wasn't."""
    is_weighted: bool
    x: float
    """Where the grid begins [m]."""
    y: float
    size: float
    """Side of a cell [m]."""
    clearance: float
    """Distance that a way keeps from every remembered point [m]."""


class Scratch(NamedTuple):
    """Working memory of a search over n cells and the goal (n + 1,)."""

    cost: Floats
    parent: Indices
    seen: Indices
    """Number of the search that last came to the cell."""
    place: Indices
    """Of an open node in the heap; -1: it is closed."""
    heap: Indices
    key: Floats


class Search:
    """The working memory of searches, shared by the maps of one policy."""

    def __init__(self) -> None:
        self.resize(0)

    def resize(self, cells: int) -> None:
        """Make room for a grid of so many cells."""
        self.cells = cells
        self.stamp = 0
        parent, seen, place, heap = np.zeros((4, cells + 1), dtype=np.int32)
        self.scratch = Scratch(np.empty(cells + 1), parent, seen, place, heap, np.empty(cells + 1))


class Way:
    """A way over places (k, 2) from the robot to the goal, and what is left to go from each.

    Attributes:
        places: (k, 2) the robot's place, the bends, the goal [m].
        rest: (k,) cost from each place to the goal: length [m], weighted where terrain is.
    """

    __slots__ = ("places", "rest")

    def __init__(self, places: NDArray[np.float64], rest: NDArray[np.float64]) -> None:
        self.places = places
        self.rest = rest


class PointMap:
    """Remembered scan points and the ways among them.

    Args:
        center: place around which the grid begins [m].
        span: half of its side [m]; it grows by itself.
        cell: side of a cell [m].
        clearance: distance that a way keeps from every remembered point [m].
        search: scratch memory.
        is_weighted: whether terrain is remembered too.
    """

    def __init__(
        self, center: Point, span: float, cell: float, clearance: float, search: Search, *, is_weighted: bool = False
    ) -> None:
        self.search = search
        self.removed = 0
        """Points taken away so far because beams passed them."""
        self.revised = 0
        """Cells whose ground has turned out or is supposed to cost something else, so far."""
        self.extent = np.array([center[0], center[1], center[0], center[1]])
        """xmin, ymin, xmax, ymax of all points and all dear terrain so far [m]."""
        side = math.ceil(2.0 * span / cell)
        self.cells = empty_cells(center[0] - span, center[1] - span, side, side, cell, clearance, is_weighted)

    def cover(self, x: float, y: float, margin: float) -> None:
        """Grow the grid until it reaches `margin` [m] beyond a place, if it doesn't yet."""
        old = self.cells
        rows, columns = old.holds.shape
        right, top = old.x + columns * old.size, old.y + rows * old.size
        if old.x <= x - margin and x + margin <= right and old.y <= y - margin and y + margin <= top:
            return
        # By half as much again, so that it seldom happens.
        ahead = margin + 0.25 * max(right - old.x, top - old.y)
        low_x, low_y = min(old.x, x - ahead), min(old.y, y - ahead)
        high_x, high_y = max(right, x + ahead), max(top, y + ahead)
        new_columns, new_rows = (math.ceil(span / old.size) + BLOCK for span in (high_x - low_x, high_y - low_y))
        if new_columns * new_rows > MOST_CELLS:
            return
        self.cells = empty_cells(low_x, low_y, new_columns, new_rows, old.size, old.clearance, old.is_weighted)
        column, row = round((old.x - self.cells.x) / old.size), round((old.y - self.cells.y) / old.size)
        inside = (slice(row, row + rows), slice(column, column + columns))
        blocks = tuple(slice(part.start // BLOCK, part.stop // BLOCK) for part in inside)
        for name in ("spot", "holds", "blocked", *(("weight", "looked_from") if old.is_weighted else ())):
            getattr(self.cells, name)[inside] = getattr(old, name)
        for name in ("points_in_block", "blocked_in_block"):
            getattr(self.cells, name)[blocks] = getattr(old, name)

    def add_scan(
        self,
        position: Point,
        heading: float,
        angles: NDArray[np.float64],
        ranges: NDArray[np.float64],
        reach: float,
        noise: float,
        is_still: NDArray[np.bool_],
    ) -> int:
        """Remember the points of a scan, and forget those that its beams pass.

        Args:
            position: where the scan was taken.
            heading: of the robot [rad].
            angles: (B,) bearing of each beam [rad].
            ranges: (B,) [m].
            reach: range that means "nothing seen" [m].
            noise: standard deviation of a range [m].
            is_still: (B,) False where the beam hit something that moves: it is not remembered.

        Returns:
            How many points came new.
        """
        self.cover(*position, reach + MARGIN)
        added, removed = _add_scan(
            self.cells, *position, heading, angles, ranges, reach, noise, is_still, self.extent, np.empty(len(ranges))
        )
        self.removed += removed
        return int(added)

    def add_terrain(self, position: Point, heading: float, factors: NDArray[np.float32], spacing: float) -> None:
        """Remember the cost factors (K, J) at K headings and J distances, `spacing` [m] apart."""
        self.revised += _add_terrain(self.cells, *position, heading, factors, spacing)
        if factors.max() > 1.0:
            # What is dear may be worth going round: its surroundings belong to the box that is searched.
            reach = SUPPOSED * factors.shape[1] * spacing
            self.extent[:2] = np.minimum(self.extent[:2], (position[0] - reach, position[1] - reach))
            self.extent[2:] = np.maximum(self.extent[2:], (position[0] + reach, position[1] + reach))

    def forget(self, x: float, y: float, radius: float) -> None:
        """Forget the points within a disc [m]."""
        _forget_disc(self.cells, x, y, radius)

    def forget_all(self) -> None:
        """Forget every point."""
        cells = self.cells
        for array in (cells.holds, cells.blocked, cells.points_in_block, cells.blocked_in_block):
            array[:] = 0

    def set_clearance(self, clearance: float) -> None:
        """Find ways at another clearance [m] from now on."""
        self.cells = self.cells._replace(clearance=clearance)
        self.cells.blocked[:] = 0
        self.cells.blocked_in_block[:] = 0
        for x, y in self.points():
            _stamp(self.cells, x, y, 1)

    def points(self) -> NDArray[np.float64]:
        """The remembered points (k, 2)."""
        cells = self.cells
        rows, columns = np.nonzero(cells.holds)
        spot = (cells.spot[rows, columns] + 0.5) / 256.0
        return np.column_stack(
            [cells.x + (columns + spot[:, 0]) * cells.size, cells.y + (rows + spot[:, 1]) * cells.size]
        )

    def is_open(self, a: Point, b: Point, tolerance: float = 0.0) -> bool:
        """Whether the straight way from a to b keeps the clearance, but for its last `tolerance` metres."""
        return bool(_sight(self.cells, *a, *b, _escape(self.cells, *a), tolerance))

    def is_blocked(self, place: Point) -> bool:
        """Whether a place lies nearer than the clearance to a remembered point, by its cell."""
        return bool(_is_blocked(self.cells, *place))

    def is_way_open(self, way: Way, tolerance: float) -> bool:
        """Whether a way keeps the clearance, but for its last `tolerance` metres."""
        return bool(_is_way_open(self.cells, way.places, tolerance))

    def pass_nodes(self, way: Way, position: Point, near: float, *, cuts: bool) -> None:
        """Let a way begin at another place, without the nodes before the first that lies ahead.

        Args:
            way: changed in place.
            position: where it is to begin.
            near: a node nearer than this is passed [m].
            cuts: whether a node is passed too where the way to the next one is open.
        """
        way.places[0] = position
        passed = _passed_nodes(self.cells, way.places, near, cuts)
        way.places, way.rest = way.places[passed:], way.rest[passed:]
        way.places[0] = position
        way.rest[0] = self.costs_to(position, way.places[1:2])[0] + way.rest[1]

    def find_way(self, start: Point, goal: Point, goal_radius: float) -> Way | None:
        """The shortest way that keeps the clearance from all remembered points; None: they close the goal off.

        Args:
            start: where the robot is.
            goal: where to.
            goal_radius: within this distance of the goal [m] the clearance doesn't count.
        """
        self.cover(*start, MARGIN)
        self.cover(*goal, MARGIN)
        cells, search = self.cells, self.search
        if search.cells < cells.holds.size:
            search.resize(cells.holds.size)
        search.stamp += 1
        # A way that leaves the box about all that is known can as well go along its rim.
        rim = cells.clearance + 3.0 * cells.size
        rows, columns = cells.blocked.shape
        box = np.array(
            [
                max(int((min(self.extent[1], start[1], goal[1]) - rim - cells.y) / cells.size), 0),
                max(int((min(self.extent[0], start[0], goal[0]) - rim - cells.x) / cells.size), 0),
                min(int((max(self.extent[3], start[1], goal[1]) + rim - cells.y) / cells.size), rows - 1),
                min(int((max(self.extent[2], start[0], goal[0]) + rim - cells.x) / cells.size), columns - 1),
            ]
        )
        places = np.empty((512, 2))
        rest = np.empty(512)
        count = _find_way(cells, *start, *goal, goal_radius, box, search.scratch, search.stamp, places, rest)
        return Way(places[:count].copy(), rest[:count].copy()) if count else None

    def costs_to(self, start: Point, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost of the straight ways from a place to each of the places (m, 2): length [m], weighted where terrain is."""
        if not self.cells.is_weighted:
            away: NDArray[np.float64] = np.hypot(places[:, 0] - start[0], places[:, 1] - start[1])
            return away
        return np.array([_cost_between(self.cells, *start, x, y) for x, y in places])

    def rest_distances(self, places: NDArray[np.float64], way: Way) -> NDArray[np.float64]:
        """What is left to go from each of the places (m, 2): straight to the best place of a way, and on along it.

        Infinite where no place of the way is in sight.
        """
        result = np.empty(len(places))
        _rest_distances(self.cells, places, way.places, way.rest, result)
        return result


def empty_cells(x: float, y: float, columns: int, rows: int, size: float, clearance: float, is_weighted: bool) -> Cells:
    """A grid that remembers nothing, of whole blocks and on a lattice, so that a grid that grows keeps its cells."""
    columns, rows = (-(-number // BLOCK) * BLOCK for number in (columns, rows))
    words = np.zeros((rows, columns // BLOCK), dtype=np.uint64)
    of_terrain = (rows, columns) if is_weighted else (1, 1)
    return Cells(
        spot=np.zeros((rows, columns, 2), dtype=np.uint8),
        holds=words.view(np.uint8),
        words=words,
        blocked=np.zeros((rows, columns), dtype=np.int16),
        points_in_block=np.zeros((rows // BLOCK, columns // BLOCK), dtype=np.int16),
        blocked_in_block=np.zeros((rows // BLOCK, columns // BLOCK), dtype=np.int16),
        weight=np.full(of_terrain, -1.0, dtype=np.float32),
        looked_from=np.full(of_terrain, np.inf, dtype=np.float32),
        is_weighted=is_weighted,
        x=math.floor(x / (size * BLOCK)) * size * BLOCK,
        y=math.floor(y / (size * BLOCK)) * size * BLOCK,
        size=size,
        clearance=clearance,
    )


# ------------------------------------------------------------------------------------------------------- kernels


@kernel
def _stamp(cells: Cells, px: float, py: float, change: int) -> None:
    """Count a point in (change 1) or out (-1) of the cells whose centre is nearer than the clearance."""
    blocked, blocked_in_block, clearance = cells.blocked, cells.blocked_in_block, cells.clearance
    x0, y0, cell = cells.x, cells.y, cells.size
    rows, columns = blocked.shape
    low_row = max(int(math.floor((py - clearance - y0) / cell)), 0)
    high_row = min(int(math.floor((py + clearance - y0) / cell)), rows - 1)
    low_column = max(int(math.floor((px - clearance - x0) / cell)), 0)
    high_column = min(int(math.floor((px + clearance - x0) / cell)), columns - 1)
    square = clearance * clearance
    for row in range(low_row, high_row + 1):
        dy = y0 + (row + 0.5) * cell - py
        for column in range(low_column, high_column + 1):
            dx = x0 + (column + 0.5) * cell - px
            if dx * dx + dy * dy < square:
                before = blocked[row, column]
                blocked[row, column] = before + change
                if before == 0:
                    blocked_in_block[row // BLOCK, column // BLOCK] += 1
                elif before + change == 0:
                    blocked_in_block[row // BLOCK, column // BLOCK] -= 1


@inlined
def _point(cells: Cells, row: int, column: int) -> tuple[float, float]:
    """Place of the point that a cell remembers [m]."""
    u, v = (cells.spot[row, column, 0] + 0.5) / 256.0, (cells.spot[row, column, 1] + 0.5) / 256.0
    return cells.x + (column + u) * cells.size, cells.y + (row + v) * cells.size


@kernel
def _remove(cells: Cells, row: int, column: int) -> None:
    """Forget the point of a cell."""
    px, py = _point(cells, row, column)
    cells.holds[row, column] = 0
    cells.points_in_block[row // BLOCK, column // BLOCK] -= 1
    _stamp(cells, px, py, -1)


@kernel
def _nearest(cells: Cells, x: float, y: float, reach: float) -> float:
    """Distance from a place to the nearest remembered point, at most `reach`."""
    holds, x0, y0, cell = cells.holds, cells.x, cells.y, cells.size
    rows, columns = holds.shape
    square = reach * reach
    for row in range(max(int((y - reach - y0) / cell), 0), min(int((y + reach - y0) / cell), rows - 1) + 1):
        for column in range(max(int((x - reach - x0) / cell), 0), min(int((x + reach - x0) / cell), columns - 1) + 1):
            if holds[row, column]:
                px, py = _point(cells, row, column)
                dx, dy = px - x, py - y
                square = min(square, dx * dx + dy * dy)
    return math.sqrt(square)


@kernel
def _forget_disc(cells: Cells, x: float, y: float, radius: float) -> None:
    """Forget the points within a disc."""
    holds, x0, y0, cell = cells.holds, cells.x, cells.y, cells.size
    rows, columns = holds.shape
    for row in range(max(int((y - radius - y0) / cell), 0), min(int((y + radius - y0) / cell), rows - 1) + 1):
        for column in range(max(int((x - radius - x0) / cell), 0), min(int((x + radius - x0) / cell), columns - 1) + 1):
            if holds[row, column]:
                px, py = _point(cells, row, column)
                dx, dy = px - x, py - y
                if dx * dx + dy * dy <= radius * radius:
                    _remove(cells, row, column)


@inlined
def _rough_angle(y: float, x: float) -> float:
    """The angle of a direction to within ROUGH [rad], many times sooner than the arc tangent."""
    ax, ay = abs(x), abs(y)
    share = min(ax, ay) / max(ax, ay, 1e-300)
    angle = share * (0.25 * math.pi + 0.273 * (1.0 - share))
    angle = 0.5 * math.pi - angle if ay > ax else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@inlined
def _look_about(ranges: Floats, slack: int, farthest: Floats) -> None:
    """For each beam of a full circle the longest range of those up to `slack` beams away."""
    beams = len(ranges)
    for i in range(beams):
        farthest[i] = 0.0
        for j in range(i - slack, i + slack + 1):
            farthest[i] = max(farthest[i], ranges[j % beams])


@kernel
def _add_scan(
    cells: Cells,
    x: float,
    y: float,
    heading: float,
    angles: Floats,
    ranges: Floats,
    reach: float,
    noise: float,
    is_still: Flags,
    extent: Floats,
    farthest: Floats,
) -> tuple[int, int]:
    """Take away the points that beams pass, then add the points that they hit. Returns how many of both."""
    spot, holds, words, points_in_block = cells.spot, cells.holds, cells.words, cells.points_in_block
    x0, y0, cell = cells.x, cells.y, cells.size
    rows, columns = holds.shape
    beams = len(angles)
    spacing = angles[1] - angles[0] if beams > 1 else 2.0 * math.pi
    is_round = beams * spacing > 2.0 * math.pi - 0.5 * spacing
    tube = 0.1 * cell + noise
    short = cell + 3.0 * noise
    cos, sin = math.cos(heading), math.sin(heading)
    if is_round:
        _look_about(ranges, 1 + int(math.ceil(ROUGH / spacing)), farthest)
    removed = 0
    low_row, high_row = max(int((y - reach - y0) / (BLOCK * cell)), 0), int((y + reach - y0) / (BLOCK * cell)) + 1
    low_column, high_column = max(int((x - reach - x0) / (BLOCK * cell)), 0), int((x + reach - x0) / (BLOCK * cell)) + 1
    for block_row in range(low_row, min(high_row, rows // BLOCK)):
        for block_column in range(low_column, min(high_column, columns // BLOCK)):
            if points_in_block[block_row, block_column] == 0:
                continue
            for row in range(block_row * BLOCK, (block_row + 1) * BLOCK):
                if words[row, block_column] == 0:
                    continue
                for column in range(block_column * BLOCK, (block_column + 1) * BLOCK):
                    if holds[row, column] == 0:
                        continue
                    px, py = _point(cells, row, column)
                    dx, dy = px - x, py - y
                    away = math.sqrt(dx * dx + dy * dy)
                    ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
                    if is_round:
                        # Most points are behind what is seen: a rough look saves the arc tangent.
                        turn = (_rough_angle(left, ahead) - angles[0]) / (2.0 * math.pi)
                        i = int((turn - math.floor(turn)) * beams + 0.5)
                        if away > farthest[i if i < beams else 0] - short:
                            continue
                    turn = (math.atan2(left, ahead) - angles[0]) / (2.0 * math.pi)
                    i = int(round((turn - math.floor(turn)) * 2.0 * math.pi / spacing))
                    if i >= beams:
                        if i > beams or not is_round:
                            continue
                        i = 0
                    # The beams on both sides must pass too: along a wall one passes close to points that are there, and
                    # the rim of a round thing is passed closely by beams whose neighbours hit it.
                    if away > min(ranges[i - 1], ranges[i], ranges[(i + 1) % beams]) - short:
                        continue
                    if abs(ahead * math.sin(angles[i]) - left * math.cos(angles[i])) < tube:
                        holds[row, column] += 1
                        if holds[row, column] > FORGET:
                            _remove(cells, row, column)
                            removed += 1
    added = 0
    for i in range(len(angles)):
        if ranges[i] >= reach or not is_still[i]:
            continue
        px = x + ranges[i] * math.cos(heading + angles[i])
        py = y + ranges[i] * math.sin(heading + angles[i])
        column, row = int(math.floor((px - x0) / cell)), int(math.floor((py - y0) / cell))
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        if holds[row, column]:
            holds[row, column] = 1
            continue
        holds[row, column] = 1
        u, v = (px - x0) / cell - column, (py - y0) / cell - row
        spot[row, column, 0] = min(int(u * 256.0), 255)
        spot[row, column, 1] = min(int(v * 256.0), 255)
        points_in_block[row // BLOCK, column // BLOCK] += 1
        px, py = _point(cells, row, column)
        _stamp(cells, px, py, 1)
        extent[0], extent[1] = min(extent[0], px), min(extent[1], py)
        extent[2], extent[3] = max(extent[2], px), max(extent[3], py)
        added += 1
    return added, removed


@kernel
def _add_terrain(cells: Cells, x: float, y: float, heading: float, factors: Weights, spacing: float) -> int:
    """Write the factors seen around the robot into the cells; ground beyond, not yet seen, is taken for what lies before.

    A factor that is only supposed is written negative. A look from nearer counts, by `spacing` at least: what lies at the
    border of a region would else change with the heading. Returns how many cells cost something else now.
    """
    weight, looked_from = cells.weight, cells.looked_from
    x0, y0, cell = cells.x, cells.y, cells.size
    revised = 0
    rows, columns = weight.shape
    headings, rings = factors.shape
    reach = rings * spacing
    far = SUPPOSED * reach
    for row in range(max(int((y - far - y0) / cell), 0), min(int((y + far - y0) / cell), rows - 1) + 1):
        dy = y0 + (row + 0.5) * cell - y
        for column in range(max(int((x - far - x0) / cell), 0), min(int((x + far - x0) / cell), columns - 1) + 1):
            dx = x0 + (column + 0.5) * cell - x
            away = math.sqrt(dx * dx + dy * dy)
            is_first = away <= reach and weight[row, column] < 0.0
            if away > far or not (is_first or away <= looked_from[row, column] - spacing):
                continue
            ring = min(max(int(round(away / spacing)) - 1, 0), rings - 1)
            turn = (math.atan2(dy, dx) - heading) / (2.0 * math.pi)
            k = int(round((turn - math.floor(turn)) * headings)) % headings
            if factors[k, ring] != abs(weight[row, column]):
                revised += 1
            weight[row, column] = factors[k, ring] if away <= reach else -factors[k, ring]
            looked_from[row, column] = away
    return revised


@inlined
def _along(u: float, cos: float, size: float) -> float:
    """How far along a direction the next line of a lattice of this size is crossed, the lines across one axis alone."""
    if cos == 0.0:
        return np.inf
    gap = u - math.floor(u / size) * size
    if cos > 0.0:
        gap = size - gap
    # On a line already, up to rounding: without this, a way along a line would be followed by tiny steps.
    if gap < 1e-9:
        gap += size
    return gap / abs(cos)


@inlined
def _to_border(u: float, v: float, cos: float, sin: float, size: float) -> float:
    """How far along a direction the square of a lattice of this size that holds (u, v) ends."""
    return min(_along(u, cos, size), _along(v, sin, size))


@kernel
def _sight(cells: Cells, ax: float, ay: float, bx: float, by: float, escape: float, tolerance: float) -> bool:
    """Whether the cells between a and b are open, but for the first `escape` and the last `tolerance` metres."""
    blocked, blocked_in_block = cells.blocked, cells.blocked_in_block
    x0, y0, cell = cells.x, cells.y, cells.size
    rows, columns = blocked.shape
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    if length == 0.0:
        return True
    cos, sin = (bx - ax) / length, (by - ay) / length
    size = BLOCK * cell
    t = min(escape, length)
    end = length - tolerance
    while t <= end:
        u, v = ax + t * cos - x0, ay + t * sin - y0
        if u < 0.0 or v < 0.0:
            return True
        column, row = int(u / cell), int(v / cell)
        if row >= rows or column >= columns:
            return True
        if blocked_in_block[row // BLOCK, column // BLOCK] == 0:
            t += _to_border(u, v, cos, sin, size) + 1e-6
        else:
            if blocked[row, column]:
                return False
            t += _to_border(u, v, cos, sin, cell) + 1e-6
    return True


@kernel
def _is_blocked(cells: Cells, x: float, y: float) -> bool:
    """Whether a place lies in a blocked cell."""
    rows, columns = cells.blocked.shape
    column, row = int((x - cells.x) / cells.size), int((y - cells.y) / cells.size)
    return bool(0 <= row < rows and 0 <= column < columns and cells.blocked[row, column] != 0)


@kernel
def _escape(cells: Cells, x: float, y: float) -> float:
    """How far from a place blocked cells don't count: 0 where it isn't in one."""
    if not _is_blocked(cells, x, y):
        return 0.0
    # Beyond a wall, open cells begin a clearance behind it: no farther, or the way out could lead through the wall.
    out = _nearest(cells, x, y, cells.clearance) + cells.clearance - cells.size
    return min(ESCAPE * cells.clearance, out)


@kernel
def _is_way_open(cells: Cells, places: Floats, tolerance: float) -> bool:
    """Whether the straight ways from place to place are open, but for the last `tolerance` metres."""
    last = len(places) - 2
    for i in range(last + 1):
        ax, ay = places[i, 0], places[i, 1]
        slack = tolerance if i == last else 0.0
        if not _sight(cells, ax, ay, places[i + 1, 0], places[i + 1, 1], _escape(cells, ax, ay), slack):
            return False
    return True


@kernel
def _passed_nodes(cells: Cells, places: Floats, near: float, cuts: bool) -> int:
    """How many nodes after the first are near to it, or not needed since the way to the next one is open."""
    x, y = places[0, 0], places[0, 1]
    escape = _escape(cells, x, y)
    passed = 0
    while len(places) - passed > 2:
        node, following = passed + 1, passed + 2
        is_near = math.hypot(places[node, 0] - x, places[node, 1] - y) < near
        is_cut = cuts and _sight(cells, x, y, places[following, 0], places[following, 1], escape, 0.0)
        if not (is_near or is_cut):
            break
        passed += 1
    return passed


@kernel
def _cost_between(cells: Cells, ax: float, ay: float, bx: float, by: float) -> float:
    """Integral of the weight along the segment from a to b."""
    weight, x0, y0, cell = cells.weight, cells.x, cells.y, cells.size
    rows, columns = weight.shape
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
    pieces = max(int(math.ceil(length / (0.5 * cell))), 1)
    total = 0.0
    for i in range(pieces):
        share = (i + 0.5) / pieces
        column, row = int((ax + share * (bx - ax) - x0) / cell), int((ay + share * (by - ay) - y0) / cell)
        total += abs(weight[row, column]) if 0 <= row < rows and 0 <= column < columns else 1.0
    return total * length / pieces


@kernel
def _rise(heap: Indices, key: Floats, place: Indices, index: int) -> None:
    """Restore the heap above position `index`."""
    node = heap[index]
    value = key[node]
    while index > 0:
        above = (index - 1) >> 1
        if key[heap[above]] <= value:
            break
        heap[index] = heap[above]
        place[heap[index]] = index
        index = above
    heap[index] = node
    place[node] = index


@kernel
def _sink(heap: Indices, key: Floats, place: Indices, count: int) -> None:
    """Restore the heap below its top."""
    node = heap[0]
    value = key[node]
    index = 0
    while True:
        below = 2 * index + 1
        if below >= count:
            break
        if below + 1 < count and key[heap[below + 1]] < key[heap[below]]:
            below += 1
        if key[heap[below]] >= value:
            break
        heap[index] = heap[below]
        place[heap[index]] = index
        index = below
    heap[index] = node
    place[node] = index


@kernel
def _find_way(
    cells: Cells,
    sx: float,
    sy: float,
    gx: float,
    gy: float,
    tolerance: float,
    box: Integers,
    scratch: Scratch,
    stamp: int,
    places: Floats,
    rest: Floats,
) -> int:
    """Lazy Theta*. Returns the number of places of the way, 0 for none.

    The goal is a node of its own (number rows * columns), in reach of every node that it is in sight of. A node is
    open while place >= 0 and closed when place is -1.
    """
    cost, parent, seen, place, heap, key = scratch
    blocked, is_weighted, x0, y0, cell = cells.blocked, cells.is_weighted, cells.x, cells.y, cells.size
    escape = _escape(cells, sx, sy)
    rows, columns = blocked.shape
    goal = rows * columns
    start_column = min(max(int((sx - x0) / cell), 0), columns - 1)
    start_row = min(max(int((sy - y0) / cell), 0), rows - 1)
    start = start_row * columns + start_column
    count = 0
    seen[start] = stamp
    cost[start] = 0.0
    parent[start] = start
    key[start] = math.sqrt((gx - sx) ** 2 + (gy - sy) ** 2)
    heap[0] = start
    place[start] = 0
    count = 1
    while count > 0:
        node = heap[0]
        count -= 1
        if count > 0:
            heap[0] = heap[count]
            place[heap[0]] = 0
            _sink(heap, key, place, count)
        place[node] = -1
        if node == goal:
            break
        row, column = node // columns, node % columns
        nx, ny = x0 + (column + 0.5) * cell, y0 + (row + 0.5) * cell
        if node == start:
            nx, ny = sx, sy
        else:
            # The parent was taken on trust; where it is out of sight, the best closed neighbour stands in for it.
            up = parent[node]
            ux, uy = x0 + (up % columns + 0.5) * cell, y0 + (up // columns + 0.5) * cell
            if up == start:
                ux, uy = sx, sy
            is_seen = _sight(cells, ux, uy, nx, ny, escape if up == start else 0.0, 0.0)
            if is_seen and is_weighted:
                cost[node] = cost[up] + _cost_between(cells, ux, uy, nx, ny)
            if not is_seen or is_weighted:
                best = cost[node] if is_seen else np.inf
                for k in range(8):
                    dr, dc = _ROW[k], _COLUMN[k]
                    r, c = row + dr, column + dc
                    if not (0 <= r < rows and 0 <= c < columns):
                        continue
                    other = r * columns + c
                    if seen[other] != stamp or place[other] != -1:
                        continue
                    ox, oy = x0 + (c + 0.5) * cell, y0 + (r + 0.5) * cell
                    if other == start:
                        ox, oy = sx, sy
                    if is_weighted:
                        via = cost[other] + _cost_between(cells, ox, oy, nx, ny)
                    else:
                        via = cost[other] + math.sqrt((nx - ox) ** 2 + (ny - oy) ** 2)
                    if via < best:
                        best = via
                        parent[node] = other
                cost[node] = best
        if _sight(cells, nx, ny, gx, gy, escape if node == start else 0.0, tolerance):
            # From the node's parent, if it sees the goal too, the way is no longer; it was looked at before.
            if is_weighted:
                total = cost[node] + _cost_between(cells, nx, ny, gx, gy)
            else:
                total = cost[node] + math.sqrt((gx - nx) ** 2 + (gy - ny) ** 2)
            if seen[goal] != stamp or total < cost[goal]:
                if seen[goal] != stamp:
                    seen[goal] = stamp
                    heap[count] = goal
                    place[goal] = count
                    count += 1
                cost[goal] = total
                key[goal] = total
                parent[goal] = node
                _rise(heap, key, place, place[goal])
            if not is_weighted:
                continue
        up = parent[node]
        ux, uy = x0 + (up % columns + 0.5) * cell, y0 + (up // columns + 0.5) * cell
        if up == start:
            ux, uy = sx, sy
        if node == start:
            ux, uy = nx, ny
        reach = 1 if node != start or escape == 0.0 else int(math.ceil(escape / cell))
        for r in range(max(row - reach, box[0]), min(row + reach, box[2]) + 1):
            for c in range(max(column - reach, box[1]), min(column + reach, box[3]) + 1):
                if blocked[r, c] or (r == row and c == column):
                    continue
                other = r * columns + c
                if seen[other] == stamp and place[other] == -1:
                    continue
                ox, oy = x0 + (c + 0.5) * cell, y0 + (r + 0.5) * cell
                if reach > 1 and (ox - nx) ** 2 + (oy - ny) ** 2 > escape * escape:
                    continue
                through = cost[up] + math.sqrt((ox - ux) ** 2 + (oy - uy) ** 2)
                if seen[other] != stamp:
                    seen[other] = stamp
                    heap[count] = other
                    place[other] = count
                    count += 1
                elif through >= cost[other]:
                    continue
                cost[other] = through
                parent[other] = up
                key[other] = through + math.sqrt((gx - ox) ** 2 + (gy - oy) ** 2)
                _rise(heap, key, place, place[other])
    if seen[goal] != stamp or place[goal] != -1:
        return 0
    # Backward from the goal: count, then write in order.
    length = 1
    node = parent[goal]
    while True:
        length += 1
        if node == start:
            break
        node = parent[node]
    # Of a longer way the first places are kept: the rest is planned again on the way.
    kept = min(length, len(places))
    total = cost[goal]
    node = goal
    for i in range(length - 1, -1, -1):
        if i < kept:
            if node == goal:
                places[i, 0], places[i, 1] = gx, gy
                rest[i] = 0.0
            elif node == start:
                places[i, 0], places[i, 1] = sx, sy
                rest[i] = total
            else:
                places[i, 0] = x0 + (node % columns + 0.5) * cell
                places[i, 1] = y0 + (node // columns + 0.5) * cell
                rest[i] = total - cost[node]
        node = parent[node]
    return kept


@kernel
def _rest_distances(cells: Cells, points: Floats, places: Floats, rest: Floats, result: Floats) -> None:
    """For each point the least of: straight to a place of the way, and on along it."""
    for i in range(len(points)):
        best = np.inf
        px, py = points[i, 0], points[i, 1]
        for k in range(len(places)):
            qx, qy = places[k, 0], places[k, 1]
            away = math.sqrt((px - qx) ** 2 + (py - qy) ** 2)
            if away + rest[k] >= best:
                continue
            if cells.is_weighted:
                away = _cost_between(cells, px, py, qx, qy)
                if away + rest[k] >= best:
                    continue
            if _sight(cells, px, py, qx, qy, 0.0, cells.size):
                best = away + rest[k]
        result[i] = best
