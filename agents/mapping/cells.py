"""The compiled memory of a map: square cells that remember scan points and what the ground costs.

A cell remembers at most one point, with its place inside the cell; a cell is *blocked* when its centre lies nearer than
the clearance to a remembered point. A beam that passes a remembered point twice takes it away. All coordinates are in
the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Flags, Floats

Bytes = NDArray[np.uint8]
Counts = NDArray[np.int16]
Weights = NDArray[np.float32]
Words = NDArray[np.uint64]

BLOCK = 8
"""Cells along the side of a block; empty blocks are skipped at once. As many as a word has bytes."""

FORGET = 2
"""Beams in a row that must pass a point before it is taken away."""

SUPPOSED = 2.0
"""Up to how many times the reach of the terrain field ground is supposed to go on as it is seen."""

ROUGH = 0.005
"""Largest error of a rough angle [rad]."""


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


class Scan(NamedTuple):
    """A scan of B beams, and where it was taken."""

    x: float
    y: float
    heading: float
    """Of the robot [rad]."""
    angles: Floats
    """Bearing of each beam (B,) [rad]."""
    ranges: Floats
    """(B,) [m]."""
    reach: float
    """Range that means "nothing seen" [m]."""
    noise: float
    """Standard deviation of a range [m]."""
    is_still: Flags
    """False where the beam hit something that moves (B,)."""


class Beams(NamedTuple):
    """How the beams of a scan are asked whether they pass a point."""

    cos: float
    """Of the heading."""
    sin: float
    spacing: float
    """Between neighbouring beams [rad]."""
    is_round: bool
    """Whether beams go all round."""
    tube: float
    """A point nearer than this to a beam's line is on it [m]."""
    short: float
    """A beam that ends less than this behind a point may have hit it [m]."""
    farthest: Floats
    """The longest range about each beam (B,) [m], only where they go all round."""


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


# --------------------------------------------------------------------------------------------------------------- points


@kernel
def count_point(cells: Cells, px: float, py: float, change: int) -> None:
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


@kernel
def count_bar(cells: Cells, x: float, y: float) -> None:
    """Count a point near the centre of the cell about a place, unless it is blocked or beside the grid."""
    rows, columns = cells.blocked.shape
    row, column = int(math.floor((y - cells.y) / cells.size)), int(math.floor((x - cells.x) / cells.size))
    if 0 <= row < rows and 0 <= column < columns and cells.blocked[row, column] == 0:
        cells.blocked_in_block[row // BLOCK, column // BLOCK] += 1
        cells.blocked[row, column] = 1


@inlined
def point_of(cells: Cells, row: int, column: int) -> tuple[float, float]:
    """Place of the point that a cell remembers [m]."""
    u, v = (cells.spot[row, column, 0] + 0.5) / 256.0, (cells.spot[row, column, 1] + 0.5) / 256.0
    return cells.x + (column + u) * cells.size, cells.y + (row + v) * cells.size


@called
def remove(cells: Cells, row: int, column: int) -> None:
    """Forget the point of a cell."""
    px, py = point_of(cells, row, column)
    cells.holds[row, column] = 0
    cells.points_in_block[row // BLOCK, column // BLOCK] -= 1
    count_point(cells, px, py, -1)


@called
def nearest(cells: Cells, x: float, y: float, reach: float) -> float:
    """Distance from a place to the nearest remembered point, at most `reach`."""
    holds, x0, y0, cell = cells.holds, cells.x, cells.y, cells.size
    rows, columns = holds.shape
    square = reach * reach
    for row in range(max(int((y - reach - y0) / cell), 0), min(int((y + reach - y0) / cell), rows - 1) + 1):
        for column in range(max(int((x - reach - x0) / cell), 0), min(int((x + reach - x0) / cell), columns - 1) + 1):
            if holds[row, column]:
                px, py = point_of(cells, row, column)
                dx, dy = px - x, py - y
                square = min(square, dx * dx + dy * dy)
    return math.sqrt(square)


@kernel
def forget_disc(cells: Cells, x: float, y: float, radius: float) -> None:
    """Forget the points within a disc."""
    holds, x0, y0, cell = cells.holds, cells.x, cells.y, cells.size
    rows, columns = holds.shape
    for row in range(max(int((y - radius - y0) / cell), 0), min(int((y + radius - y0) / cell), rows - 1) + 1):
        for column in range(max(int((x - radius - x0) / cell), 0), min(int((x + radius - x0) / cell), columns - 1) + 1):
            if holds[row, column]:
                px, py = point_of(cells, row, column)
                dx, dy = px - x, py - y
                if dx * dx + dy * dy <= radius * radius:
                    remove(cells, row, column)


# ---------------------------------------------------------------------------------------------------------------- scans


@kernel
def add_scan(cells: Cells, scan: Scan, extent: Floats, farthest: Floats) -> tuple[int, int]:
    """Take away the points that beams pass, then add the points that they hit. Returns how many came and how many went.

    Args:
        cells: changed in place.
        scan: what is seen.
        extent: xmin, ymin, xmax, ymax of all points, widened in place [m].
        farthest: scratch memory (B,).
    """
    removed = clear_passed(cells, scan, beams_of(scan, cells.size, farthest))
    return add_hits(cells, scan, extent), removed


@inlined
def beams_of(scan: Scan, cell: float, farthest: Floats) -> Beams:
    """How the beams of a scan are asked about points in cells of this side."""
    beams = len(scan.angles)
    spacing = scan.angles[1] - scan.angles[0] if beams > 1 else 2.0 * math.pi
    is_round = beams * spacing > 2.0 * math.pi - 0.5 * spacing
    if is_round:
        look_about(scan.ranges, 1 + int(math.ceil(ROUGH / spacing)), farthest)
    cos, sin = math.cos(scan.heading), math.sin(scan.heading)
    return Beams(cos, sin, spacing, is_round, 0.1 * cell + scan.noise, cell + 3.0 * scan.noise, farthest)


@inlined
def clear_passed(cells: Cells, scan: Scan, beams: Beams) -> int:
    """Count the beams that pass a point, and take it away once they are enough. Returns how many points went."""
    rows, columns = cells.points_in_block.shape
    side, reach = BLOCK * cells.size, scan.reach
    removed = 0
    low_row, high_row = max(int((scan.y - reach - cells.y) / side), 0), int((scan.y + reach - cells.y) / side) + 1
    low_column, high_column = max(int((scan.x - reach - cells.x) / side), 0), int((scan.x + reach - cells.x) / side) + 1
    for block_row in range(low_row, min(high_row, rows)):
        for block_column in range(low_column, min(high_column, columns)):
            if cells.points_in_block[block_row, block_column] > 0:
                removed += clear_block(cells, scan, beams, block_row, block_column)
    return removed


@inlined
def clear_block(cells: Cells, scan: Scan, beams: Beams, block_row: int, block_column: int) -> int:
    """The same within one block."""
    removed = 0
    for row in range(block_row * BLOCK, (block_row + 1) * BLOCK):
        if cells.words[row, block_column] == 0:
            continue
        for column in range(block_column * BLOCK, (block_column + 1) * BLOCK):
            if cells.holds[row, column] == 0 or not is_passed(cells, scan, beams, row, column):
                continue
            cells.holds[row, column] += 1
            if cells.holds[row, column] > FORGET:
                remove(cells, row, column)
                removed += 1
    return removed


@inlined
def is_passed(cells: Cells, scan: Scan, beams: Beams, row: int, column: int) -> bool:
    """Whether a beam passes the point that a cell remembers."""
    angles, ranges, count = scan.angles, scan.ranges, len(scan.angles)
    px, py = point_of(cells, row, column)
    dx, dy = px - scan.x, py - scan.y
    away = math.sqrt(dx * dx + dy * dy)
    ahead, left = beams.cos * dx + beams.sin * dy, beams.cos * dy - beams.sin * dx
    if beams.is_round:
        # Most points are behind what is seen: a rough look saves the arc tangent.
        turn = (rough_angle(left, ahead) - angles[0]) / (2.0 * math.pi)
        i = int((turn - math.floor(turn)) * count + 0.5)
        if away > beams.farthest[i if i < count else 0] - beams.short:
            return False
    turn = (math.atan2(left, ahead) - angles[0]) / (2.0 * math.pi)
    i = int(round((turn - math.floor(turn)) * 2.0 * math.pi / beams.spacing))
    if i >= count:
        if i > count or not beams.is_round:
            return False
        i = 0
    # The beams on both sides must pass too: along a wall one passes close to points that are there, and the rim of a
    # round thing is passed closely by beams whose neighbours hit it. Where the view ends there is none on one side.
    if not beams.is_round and (i == 0 or i == count - 1):
        return False
    if away > min(ranges[i - 1], ranges[i], ranges[(i + 1) % count]) - beams.short:
        return False
    return bool(abs(ahead * math.sin(angles[i]) - left * math.cos(angles[i])) < beams.tube)


@inlined
def add_hits(cells: Cells, scan: Scan, extent: Floats) -> int:
    """Remember the points that beams hit, but for those of things that move. Returns how many came new."""
    angles, ranges = scan.angles, scan.ranges
    added = 0
    for i in range(len(angles)):
        if ranges[i] >= scan.reach or not scan.is_still[i]:
            continue
        px = scan.x + ranges[i] * math.cos(scan.heading + angles[i])
        py = scan.y + ranges[i] * math.sin(scan.heading + angles[i])
        added += add_point(cells, px, py, extent)
    return added


@inlined
def add_point(cells: Cells, px: float, py: float, extent: Floats) -> int:
    """Remember a point, or that the one of its cell is still there. Returns 1 where the cell held none."""
    spot, holds = cells.spot, cells.holds
    x0, y0, cell = cells.x, cells.y, cells.size
    rows, columns = holds.shape
    column, row = int(math.floor((px - x0) / cell)), int(math.floor((py - y0) / cell))
    if not (0 <= row < rows and 0 <= column < columns):
        return 0
    if holds[row, column]:
        holds[row, column] = 1
        return 0
    holds[row, column] = 1
    u, v = (px - x0) / cell - column, (py - y0) / cell - row
    spot[row, column, 0] = min(int(u * 256.0), 255)
    spot[row, column, 1] = min(int(v * 256.0), 255)
    cells.points_in_block[row // BLOCK, column // BLOCK] += 1
    kept_x, kept_y = point_of(cells, row, column)
    count_point(cells, kept_x, kept_y, 1)
    extent[0], extent[1] = min(extent[0], kept_x), min(extent[1], kept_y)
    extent[2], extent[3] = max(extent[2], kept_x), max(extent[3], kept_y)
    return 1


@inlined
def rough_angle(y: float, x: float) -> float:
    """The angle of a direction to within ROUGH [rad], many times sooner than the arc tangent."""
    ax, ay = abs(x), abs(y)
    share = min(ax, ay) / max(ax, ay, 1e-300)
    angle = share * (0.25 * math.pi + 0.273 * (1.0 - share))
    angle = 0.5 * math.pi - angle if ay > ax else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@inlined
def look_about(ranges: Floats, slack: int, farthest: Floats) -> None:
    """For each beam of a full circle the longest range of those up to `slack` beams away."""
    beams = len(ranges)
    for i in range(beams):
        farthest[i] = 0.0
        for j in range(i - slack, i + slack + 1):
            farthest[i] = max(farthest[i], ranges[j % beams])


# -------------------------------------------------------------------------------------------------------------- terrain


@kernel
def add_terrain(cells: Cells, x: float, y: float, heading: float, factors: Weights, spacing: float) -> int:
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
