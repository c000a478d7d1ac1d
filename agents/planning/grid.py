"""Occupancy grids: a map cut into square cells, and the steps that lead from each to its neighbours.

A cell is blocked where its centre lies in an obstacle grown by the body. Which of the eight steps out of a cell are open
is written down once (`links`): searches read only that, so none of them knows about connectivity or corners. The
outermost cells are always blocked, so no step leads out of the grid.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.map import PlanningMap
from bug_gym.compiling import called, inlined, kernel
from bug_gym.geometry import F64, Point
from bug_gym.kernels.layout import Floats, Integers
from bug_gym.limits import told_bytes

Bytes = NDArray[np.uint8]
Nodes = NDArray[np.int32]

ROW_STEPS = (0, 1, 1, 1, 0, -1, -1, -1)
COLUMN_STEPS = (1, 1, 0, -1, -1, -1, 0, 1)
"""From a cell to those around it, counter-clockwise from the next column: even ones straight, odd ones diagonal."""

STRAIGHT, DIAGONAL = 2**30, 1518500250
"""What a step costs: a cell's side and its diagonal, 2^30 sqrt(2), as integers. Sums of them do not depend on the order,
so that equal ways are equal, and never differ from a + b sqrt(2) by more than 1e-10 b cells."""

UNIT = 1024
"""Weight of open ground: what regions cost is rounded to a part of this."""

FAR = 2**62
"""A cost above those of all ways."""

MOST_CELLS, CELL_BYTES = 50_000_000, 40
"""Cells of the largest grid, and what one of them takes while D* Lite searches it [bytes]."""


class Lattice(NamedTuple):
    """Where the cells of a grid lie."""

    x: float
    """Centre of the cell in row 0 and column 0 [m]."""
    y: float
    size: float
    """Side of a cell [m]."""
    rows: int
    columns: int

    def places(self, nodes: Nodes) -> F64:
        """Centres (k, 2) of cells by their numbers, row * columns + column [m]."""
        rows, columns = np.divmod(nodes, self.columns)
        return np.column_stack([self.x + self.size * columns, self.y + self.size * rows])

    def node_at(self, place: Point) -> int:
        """Number of the cell that holds a place; of the nearest one where that is beside the grid."""
        column = min(max(round((place[0] - self.x) / self.size), 0), self.columns - 1)
        row = min(max(round((place[1] - self.y) / self.size), 0), self.rows - 1)
        return row * self.columns + column


class Grid(NamedTuple):
    """Cells (rows, columns), and the steps between them."""

    blocked: Bytes
    """1 where the robot's centre cannot be."""
    links: Bytes
    """Bit k says that step k (ROW_STEPS, COLUMN_STEPS) out of the cell is open; (rows * columns,)."""
    lattice: Lattice
    connectivity: int
    """4: straight steps only; 8: diagonal ones too."""
    cut_corners: bool
    """Whether a diagonal step may pass one blocked cell beside it; between two it never does."""
    weights: Integers | None = None
    """What the ground of each cell costs (rows * columns,), in UNIT to the metre; None: the same everywhere."""

    def is_free(self, node: int) -> bool:
        """Whether the centre of a cell is."""
        return not self.blocked.ravel()[node]

    def free_node_near(self, place: Point, reach: float) -> int:
        """Number of the free cell whose centre is nearest to a place, -1 where none is within reach [m]."""
        lattice = self.lattice
        cells = math.ceil(reach / lattice.size) + 1
        row, column = divmod(lattice.node_at(place), lattice.columns)
        low_row, low_column = max(row - cells, 0), max(column - cells, 0)
        near = self.blocked[low_row : row + cells + 1, low_column : column + cells + 1]
        rows, columns = np.nonzero(near == 0)
        if len(rows) == 0:
            return -1
        nodes = (rows + low_row) * lattice.columns + columns + low_column
        away = np.hypot(*(lattice.places(nodes) - place).T)
        best = int(away.argmin())
        return int(nodes[best]) if away[best] <= max(reach, lattice.size) else -1


def make_grid(
    blocked: Bytes, lattice: Lattice | None = None, *, connectivity: int = 8, cut_corners: bool = False
) -> Grid:
    """The grid of some cells.

    Args:
        blocked: (rows, columns); where there is no lattice, a rim of blocked cells is put around them.
        lattice: where they lie; their outermost ones are blocked then.
        connectivity: 4 or 8.
        cut_corners: whether a diagonal step may pass one blocked cell beside it.
    """
    if lattice is None:
        blocked = np.pad(np.asarray(blocked, dtype=np.uint8), 1, constant_values=1)
        lattice = Lattice(-1.0, -1.0, 1.0, *blocked.shape)
    links = np.zeros(blocked.size, dtype=np.uint8)
    link_all(blocked, links, connectivity == 8, cut_corners)
    return Grid(blocked, links, lattice, connectivity, cut_corners)


def lattice_of(box: tuple[float, float, float, float], size: float) -> Lattice:
    """The lattice with a cell's centre in the origin that covers xmin, ymin, xmax, ymax [m] and a rim of one cell.

    Raises:
        ValueError: it would have too many cells; the message says how much memory they would take.
    """
    xmin, ymin, xmax, ymax = box
    first_column, first_row = math.floor(xmin / size) - 1, math.floor(ymin / size) - 1
    columns, rows = math.ceil(xmax / size) + 2 - first_column, math.ceil(ymax / size) + 2 - first_row
    if rows * columns > MOST_CELLS:
        what = f"{rows:,} x {columns:,} cells of resolution {size:g} m would take {told_bytes(CELL_BYTES * rows * columns)}"
        side = size * math.sqrt(1.02 * rows * columns / MOST_CELLS)
        unit = 10.0 ** (math.floor(math.log10(side)) - 1)
        side = math.ceil(side / unit) * unit  # two digits, rounded up: what is told must do
        raise ValueError(f"{what}, expected at most {MOST_CELLS:,} cells: a resolution of {side:.2g} m or more")
    return Lattice(first_column * size, first_row * size, size, rows, columns)


def grid_of(plan: PlanningMap, size: float, growth: float, *, connectivity: int = 8, cut_corners: bool = False) -> Grid:
    """The grid of a map for a disc robot.

    Args:
        plan: the map.
        size: side of a cell [m].
        growth: nearer to anything than this, a cell's centre is blocked [m].
        connectivity: 4 or 8.
        cut_corners: whether a diagonal step may pass one blocked cell beside it.

    Raises:
        ValueError: too many cells.
    """
    lattice = lattice_of(plan.box, size)
    blocked = np.ones((lattice.rows, lattice.columns), dtype=np.uint8)
    edges, first = edges_of(((plan.border,), *plan.polygons))
    fill_map(blocked, lattice, edges, first, plan.discs.copy(), growth, np.empty(len(edges)))
    return make_grid(blocked, lattice, connectivity=connectivity, cut_corners=cut_corners)


def edges_of(polygons: tuple[tuple[F64, ...], ...]) -> tuple[F64, Integers]:
    """The sides (e, 4) of all polygons, x1, y1, x2, y2 [m], and the number of the first of each (p + 1,)."""
    sides = [np.hstack([ring, np.roll(ring, -1, axis=0)]) for rings in polygons for ring in rings]
    counts = [sum(map(len, rings)) for rings in polygons]
    return np.ascontiguousarray(np.concatenate(sides), dtype=np.float64), np.concatenate([[0], np.cumsum(counts)])


def with_discs(grid: Grid, discs: F64, growth: float) -> Grid:
    """The same grid with more round obstacles (n, 3) x, y, radius [m], grown too; the old one stays as it is."""
    grid = grid._replace(blocked=grid.blocked.copy(), links=grid.links.copy())
    for x, y, radius in discs.tolist():
        fill_disc(grid.blocked, grid.lattice, x, y, radius + growth)
        relink(grid, x, y, radius + growth)
    return grid


def relink(grid: Grid, x: float, y: float, radius: float) -> None:
    """Write the steps of the cells in and about a disc [m] anew."""
    lattice = grid.lattice
    low = lattice.node_at((x - radius, y - radius))
    high = lattice.node_at((x + radius, y + radius))
    (low_row, low_column), (high_row, high_column) = divmod(low, lattice.columns), divmod(high, lattice.columns)
    first = max(low_row - 2, 1), max(low_column - 2, 1)
    last = min(high_row + 3, lattice.rows - 1), min(high_column + 3, lattice.columns - 1)
    link_box(grid.blocked, grid.links, *first, *last, grid.connectivity == 8, grid.cut_corners)


def relink_nodes(grid: Grid, nodes: Nodes) -> None:
    """Write the steps of cells (k,) that have changed, and of those about them, anew."""
    link_nodes(grid.blocked, grid.links, nodes, grid.connectivity == 8, grid.cut_corners)


# ------------------------------------------------------------------------------------------------------------- compiled


@kernel
def fill_map(
    blocked: Bytes,
    lattice: Lattice,
    edges: Floats,
    first: Integers,
    discs: Floats,
    growth: float,
    crossings: Floats,
) -> None:
    """Free what lies within the border, the first polygon, then block what is in an obstacle or nearer than the growth."""
    fill_inside(blocked, lattice, edges[: first[1]], crossings, 0)
    for polygon in range(1, len(first) - 1):
        fill_inside(blocked, lattice, edges[first[polygon] : first[polygon + 1]], crossings, 1)
    if growth > 0.0:
        for edge in range(len(edges)):
            fill_near(blocked, lattice, edges[edge, 0], edges[edge, 1], edges[edge, 2], edges[edge, 3], growth)
    for disc in range(len(discs)):
        fill_disc(blocked, lattice, discs[disc, 0], discs[disc, 1], discs[disc, 2] + growth)


@called
def fill_inside(blocked: Bytes, lattice: Lattice, edges: Floats, crossings: Floats, value: int) -> None:
    """Write a value into the cells whose centres lie in a polygon, row by row between its sides."""
    rows, columns = blocked.shape
    low, high = edges[0, 1], edges[0, 1]
    for edge in range(len(edges)):  # the sides of closed rings: each corner begins one
        low, high = min(low, edges[edge, 1]), max(high, edges[edge, 1])
    for row in range(max(int(math.ceil((low - lattice.y) / lattice.size)), 0), rows):
        y = lattice.y + row * lattice.size
        if y > high:
            break
        count = 0
        for edge in range(len(edges)):
            y1, y2 = edges[edge, 1], edges[edge, 3]
            if (y1 <= y) != (y2 <= y):
                crossings[count] = edges[edge, 0] + (y - y1) / (y2 - y1) * (edges[edge, 2] - edges[edge, 0])
                count += 1
        sort(crossings, count)
        for pair in range(0, count - 1, 2):
            left = max(int(math.ceil((crossings[pair] - lattice.x) / lattice.size)), 0)
            right = min(int(math.floor((crossings[pair + 1] - lattice.x) / lattice.size)), columns - 1)
            for column in range(left, right + 1):
                blocked[row, column] = value


@called
def sort(values: Floats, count: int) -> None:
    """Sort the first few of some values by insertion."""
    for index in range(1, count):
        value, at = values[index], index
        while at > 0 and values[at - 1] > value:
            values[at] = values[at - 1]
            at -= 1
        values[at] = value


@called
def fill_near(blocked: Bytes, lattice: Lattice, x1: float, y1: float, x2: float, y2: float, reach: float) -> None:
    """Block the cells whose centres are nearer to a straight piece than a reach [m]."""
    rows, columns = blocked.shape
    dx, dy = x2 - x1, y2 - y1
    square = dx * dx + dy * dy
    low_row = max(int(math.ceil((min(y1, y2) - reach - lattice.y) / lattice.size)), 0)
    high_row = min(int(math.floor((max(y1, y2) + reach - lattice.y) / lattice.size)), rows - 1)
    for row in range(low_row, high_row + 1):
        y = lattice.y + row * lattice.size - y1
        # Of the piece, only what is no higher or lower than the reach can be near.
        begin, end = 0.0, 1.0
        if dy != 0.0:
            a, b = (y - reach) / dy, (y + reach) / dy
            begin, end = max(min(a, b), 0.0), min(max(a, b), 1.0)
        left, right = min(x1 + begin * dx, x1 + end * dx) - reach, max(x1 + begin * dx, x1 + end * dx) + reach
        low_column = max(int(math.ceil((left - lattice.x) / lattice.size)), 0)
        high_column = min(int(math.floor((right - lattice.x) / lattice.size)), columns - 1)
        for column in range(low_column, high_column + 1):
            x = lattice.x + column * lattice.size - x1
            share = min(max((x * dx + y * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
            gap_x, gap_y = x - share * dx, y - share * dy
            if gap_x * gap_x + gap_y * gap_y < reach * reach:
                blocked[row, column] = 1


@kernel
def fill_disc(blocked: Bytes, lattice: Lattice, x: float, y: float, radius: float) -> None:
    """Block the cells whose centres lie in a disc [m]."""
    fill_near(blocked, lattice, x, y, x, y, radius)


@kernel
def link_all(blocked: Bytes, links: Bytes, diagonal: bool, cut: bool) -> None:
    """Write which steps out of all cells are open."""
    rows, columns = blocked.shape
    link_box(blocked, links, 1, 1, rows - 1, columns - 1, diagonal, cut)


@kernel
def link_box(
    blocked: Bytes,
    links: Bytes,
    low_row: int,
    low_column: int,
    high_row: int,
    high_column: int,
    diagonal: bool,
    cut: bool,
) -> None:
    """The same for the cells from a low row and column up to, and without, a high one."""
    columns = blocked.shape[1]
    for row in range(low_row, high_row):
        for column in range(low_column, high_column):
            links[row * columns + column] = links_of(blocked, row, column, diagonal, cut)


@kernel
def link_nodes(blocked: Bytes, links: Bytes, nodes: Nodes, diagonal: bool, cut: bool) -> None:
    """The same for some cells and those about them; none is in the outermost rows and columns."""
    rows, columns = blocked.shape
    for index in range(len(nodes)):
        row, column = nodes[index] // columns, nodes[index] % columns
        for r in range(max(row - 1, 1), min(row + 2, rows - 1)):
            for c in range(max(column - 1, 1), min(column + 2, columns - 1)):
                links[r * columns + c] = links_of(blocked, r, c, diagonal, cut)


@inlined
def links_of(blocked: Bytes, row: int, column: int, diagonal: bool, cut: bool) -> int:
    """Which steps out of a cell are open, as bits."""
    if blocked[row, column]:
        return 0
    east, north = 1 - blocked[row, column + 1], 1 - blocked[row + 1, column]
    west, south = 1 - blocked[row, column - 1], 1 - blocked[row - 1, column]
    steps: int = east | north << 2 | west << 4 | south << 6
    if diagonal:
        steps |= (corner(east, north, cut) & 1 - blocked[row + 1, column + 1]) << 1
        steps |= (corner(north, west, cut) & 1 - blocked[row + 1, column - 1]) << 3
        steps |= (corner(west, south, cut) & 1 - blocked[row - 1, column - 1]) << 5
        steps |= (corner(south, east, cut) & 1 - blocked[row - 1, column + 1]) << 7
    return steps


@inlined
def corner(one: int, other: int, cut: bool) -> int:
    """Whether a diagonal step may pass the two cells beside it, 1 for each that is free."""
    return one | other if cut else one & other
