"""The scan: the exact range along each beam, obstacle by obstacle.

Far obstacles are dropped; for each near one the interval of beams that can meet it is estimated, and every beam of the
interval is tested exactly, eight at a time. Estimates only ever widen the interval, so that they cost time and never
exactness. Among many discs the nearest go first, and of the others those that they hide are dropped.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.compiling import inlined
from bug_gym.kernels.geometry import HALF_PI, TWO_PI
from bug_gym.kernels.layout import Floats, Integers, Ranges
from bug_gym.kernels.vectors import (
    BEST,
    DISCS,
    LANES,
    NEAR,
    QUEUE,
    TILE,
    append_close,
    append_seen,
    gather,
    take_walls,
    test_disc,
    test_wall,
    write_wall,
)
from bug_gym.kernels.walls import TOUCH, Room

# Which beams an obstacle has is estimated in 32 bits, of which processors do twice as many at once as of 64.
# The margin [rad] is more than the errors of arc_tangent (8.2e-5), half_angle (3.9e-5) and rounding (2e-6) together, and
# LARGER is more than 1 by more than a sine is rounded.
ANGLE_MARGIN = 2e-4
NOUGHT, ONE, LARGER = np.float32(0.0), np.float32(1.0), np.float32(1.0 + 5e-7)
QUARTER, HALF_TURN, TURN = np.float32(HALF_PI), np.float32(math.pi), np.float32(TWO_PI)
TANGENT_1, TANGENT_3 = np.float32(0.9992138), np.float32(-0.3211749)
TANGENT_5, TANGENT_7 = np.float32(0.1462644), np.float32(-0.0389865)
SINE_0, SINE_1 = np.float32(1.5707584), np.float32(-0.2128756)
SINE_2, SINE_3 = np.float32(0.0768984), np.float32(-0.0208927)
OVERLAP = 1e-9  # each wall is longer by this part of its length at both ends, so that no beam slips through a corner
SLACK = 1e-9  # [m] more than the rounding of a range: what lies farther by this than all ranges shortens none
CROWDED = 128  # so many discs at hand hide most of one another
FOREMOST = 48  # of so many the nearest go first, roughly
LIMITS = 32  # room for what `_set_limits` writes: nine numbers and the sectors
SECTORS = 16  # of a full turn, half an octant each
SECTOR = TWO_PI / SECTORS  # [rad]
OCTANTS = (0, 4, 5, 1, 3, 7, 6, 2)  # of each octant, counter-clockwise from the x axis, its number in `append_seen`


class Discs(NamedTuple):
    """Circular obstacles of one world."""

    x: Floats
    """Centres (M,) [m]."""
    y: Floats
    """Centres (M,) [m]."""
    radius: Floats
    """(M,) [m]."""
    total: int
    """How many of them count, a multiple of eight."""


class Walls(NamedTuple):
    """Wall segments of one world, with room for as many in eights. Sides of a polygon share their ends bit for bit."""

    ends: Floats
    """x1, y1, x2, y2 of each (4 S,) [m]."""
    total: np.uint64
    """How many of them count."""


class Origin(NamedTuple):
    """Where the beams begin, and the frame that they are counted in."""

    x: float
    """[m]."""
    y: float
    """[m]."""
    cos: float
    """Of the robot's heading."""
    sin: float
    """Of the robot's heading."""


class Beams(NamedTuple):
    """The beams in the robot's frame: a fan of any width up to a full circle."""

    cos: Floats
    """(B + 8,) from `beam_table`."""
    sin: Floats
    """(B + 8,) from `beam_table`."""
    first_angle: float
    """Of beam 0, from -pi to pi [rad]."""
    per_rad: float
    """How many lie in a radian, positive, also if there is but one [1/rad]."""
    last: float
    """Number of the last one."""


def scratch_floats(beams: int) -> int:
    """Length of `scratch_f` that `cast_rays` needs."""
    return BEST + 2 * (beams + 2 * LANES) + LIMITS


def scratch_integers(obstacles: int) -> int:
    """Length of `scratch_i` that `cast_rays` needs; `obstacles` are discs."""
    return NEAR + obstacles + 4 * LANES


def beam_table(beams: int, first_angle: float, angle_step: float) -> tuple[Floats, Floats]:
    """Cosines and sines of the beams in the robot's frame, (beams + 8,) each: a block may start at the last beam."""
    angle = first_angle + angle_step * np.arange(beams)
    padding = (0, LANES)
    return np.pad(np.cos(angle), padding), np.pad(np.sin(angle), padding)


# Unsigned numbers as index below: a signed one makes numba ask each time whether it counts from the end.


@inlined
def _arc_tangent(y: np.float32, x: np.float32) -> np.float32:
    """Direction of (x, y) [rad], within 8.2e-5."""
    across, up = abs(x), abs(y)
    steep = up > across
    slope = (across if steep else up) / (up if steep else across)
    square = slope * slope
    angle = slope * (TANGENT_1 + square * (TANGENT_3 + square * (TANGENT_5 + square * TANGENT_7)))
    angle = QUARTER - angle if steep else angle
    angle = HALF_TURN - angle if x < NOUGHT else angle
    return -angle if y < NOUGHT else angle


@inlined
def _half_angle(sine: np.float32) -> np.float32:
    """Arc sine [rad] of a number from 0 to 1, within 3.9e-5."""
    shape = SINE_0 + sine * (SINE_1 + sine * (SINE_2 + sine * SINE_3))
    return QUARTER - np.float32(math.sqrt(ONE - sine)) * shape


@inlined
def _clamp(value: np.float32, low: np.float32, high: np.float32) -> np.float32:
    value = value if value > low else low
    return value if value < high else high


# 32 bits hold a beam's number, and processors turn several numbers at once into integers of 32 bits, not into those of 64.


@inlined
def _first_beam(number: np.float32, last: np.float32) -> np.int32:
    """The first beam from a real number of a beam on."""
    return np.int32(_clamp(number, -ONE, last) + ONE)


@inlined
def _blocks(first: np.int32, past: np.int32) -> np.int32:
    """How many blocks of eight hold the beams from the first to before `past`."""
    beams = np.int32(past - first)
    return np.int32(np.int32(beams + LANES - 1) >> 3) if beams > 0 else np.int32(0)


@inlined
def _store_blocks(
    index: Integers, k: int, low: np.float32, high: np.float32, period: np.float32, last: np.float32
) -> None:
    """Beams within [low, high] (real numbers of beams) as first beam and number of blocks of eight, in two pieces.

    The second piece is what lies beyond the end of the fan and comes in again at its other side.
    """
    shift = period if low < NOUGHT else -period
    first, first_2 = _first_beam(low, last), _first_beam(low + shift, last)
    index[k] = first
    index[k + np.uint64(TILE)] = _blocks(first, _first_beam(high, last))
    index[k + np.uint64(2 * TILE)] = first_2
    index[k + np.uint64(3 * TILE)] = _blocks(first_2, _first_beam(high + shift, last))


@inlined
def _fill_up(index: Integers, start: np.uint64, end: np.uint64) -> None:
    """Tiles are worked on in eights: the last eight of a list is filled up with an obstacle that exists."""
    fill = index[start]
    for lane in range(np.uint64(LANES)):
        index[end + lane] = fill


@inlined
def find_near_discs(discs: Discs, x: float, y: float, reach: float, index: Integers) -> np.uint64:
    """Lists in index[NEAR:] the discs that reach into the scan's circle; returns how many."""
    start = np.uint64(NEAR)
    end: np.uint64 = start
    for j in range(np.uint64(0), np.uint64(discs.total), np.uint64(LANES)):
        end = append_close(index, discs.x, discs.y, discs.radius, j, x, y, reach, end)
    _fill_up(index, start, end)
    return end - start


@inlined
def _find_farther_discs(
    discs: Discs, x: float, y: float, low: float, f: Floats, limits: np.uint64, index: Integers
) -> np.uint64:
    """Lists in index[NEAR:] the discs beyond `low` that the limits f[limits:] do not rule out; returns how many."""
    start = np.uint64(NEAR)
    end: np.uint64 = start
    for j in range(np.uint64(0), np.uint64(discs.total), np.uint64(LANES)):
        end = append_seen(index, discs.x, discs.y, discs.radius, j, x, y, low, f, limits, end)
    _fill_up(index, start, end)
    return end - start


@inlined
def _set_limits(f: Floats, beams: Beams, origin: Origin, reach: float, count: np.uint64, at: np.uint64) -> None:
    """How far the beams go that may meet a disc in an octant about the origin, f[at:] as `append_seen` reads it.

    A disc that isn't wide has no beams farther from its octant than half of one. So an octant's limit is the longest of
    the ranges f[BEST:] in four of the SECTORS, half an octant each.
    """
    sectors, last = at + np.uint64(9), np.uint64(SECTORS - 1)
    for sector in range(np.uint64(SECTORS)):
        f[sectors + sector] = 0.0
    beams_each = SECTOR * beams.per_rad
    heading = np.float64(_arc_tangent(np.float32(origin.sin), np.float32(origin.cos)))
    begin = (heading + beams.first_angle + 2.0 * TWO_PI) / SECTOR
    number, beam = np.uint64(begin), np.uint64(0)
    while beam < count:
        past = (np.float64(number) + 1.0 - begin) * beams_each
        end = np.uint64(past) + np.uint64(1) if past < beams.last else count
        place = sectors + (number & last)
        longest = f[place]
        for i in range(beam, end):
            distance = f[np.uint64(BEST) + i]
            longest = distance if distance > longest else longest
        f[place] = longest
        beam = end
        number += np.uint64(1)
    farthest = 0.0
    for octant in range(np.uint64(8)):
        longest = 0.0
        for part in range(np.uint64(4)):
            distance = f[sectors + ((np.uint64(2) * octant + part + last) & last)]
            longest = distance if distance > longest else longest
        farthest = longest if longest > farthest else farthest
        f[at + np.uint64(OCTANTS[octant])] = longest + SLACK if longest + SLACK < reach else reach
    f[at + np.uint64(8)] = farthest + SLACK if farthest + SLACK < reach else reach


@inlined
def is_wall_near(ax: float, ay: float, bx: float, by: float, reach: float) -> bool:
    """Whether a wall's bounding box comes within reach of the origin: exact for walls along an axis."""
    gap_x = max(ax if ax < bx else bx, -(ax if ax > bx else bx))
    gap_y = max(ay if ay < by else by, -(ay if ay > by else by))
    gap_x = gap_x if gap_x > 0.0 else 0.0
    gap_y = gap_y if gap_y > 0.0 else 0.0
    return bool(gap_x * gap_x + gap_y * gap_y < reach * reach)


@inlined
def _padded(count: np.uint64) -> np.uint64:
    """The multiple of eight that holds so many."""
    return (count + np.uint64(LANES - 1)) // np.uint64(LANES) * np.uint64(LANES)


@inlined
def _cast_room(
    f: Floats, room: Room, origin: Origin, beams: Beams, reach: float, count: np.uint64, inverse: np.uint64
) -> None:
    """Sets the beams' inverse ranges f[inverse:] to those of the room.

    From inside, its sides can be lines without end: a beam meets its own first, so nobody asks which beams that are.
    """
    east, west, north, south = 1.0 / room.east, -1.0 / room.west, 1.0 / room.north, -1.0 / room.south
    least = 1.0 / reach
    for i in range(_padded(count)):
        x = origin.cos * beams.cos[i] - origin.sin * beams.sin[i]
        y = origin.cos * beams.sin[i] + origin.sin * beams.cos[i]
        across = x * (east if x > 0.0 else west)
        along = y * (north if y > 0.0 else south)
        nearer = across if across > along else along
        f[i + inverse] = nearer if nearer > least else least


@inlined
def _merge(f: Floats, padded: np.uint64, inverse: np.uint64) -> None:
    """Lowers the beams' ranges f[BEST:] to those whose inverses are f[inverse:]."""
    for i in range(padded):
        distance = 1.0 / f[i + inverse]
        best = abs(f[i + np.uint64(BEST)])  # so that nothing is stored with a mask, as `vectors` has it
        f[i + np.uint64(BEST)] = distance if distance < best else best


@inlined
def _prepare_discs(f: Floats, index: Integers, padded: np.uint64, origin: Origin, beams: Beams) -> np.int64:
    """Turns a tile of discs (x, y, radius) into the robot's frame and finds their beams; returns how many hold it."""
    around = np.int64(0)
    margin, per_rad = np.float32(ANGLE_MARGIN * beams.per_rad), np.float32(beams.per_rad)
    first_angle, last = np.float32(beams.first_angle), np.float32(beams.last)
    period = np.float32(TWO_PI * beams.per_rad)
    for k in range(np.uint64(DISCS), np.uint64(DISCS) + padded):
        dx = f[k]
        dy = f[k + np.uint64(TILE)]
        radius = f[k + np.uint64(2 * TILE)]
        x = dx * origin.cos + dy * origin.sin
        y = dy * origin.cos - dx * origin.sin
        distance2 = dx * dx + dy * dy
        around += np.int64(distance2 <= radius * radius)
        sine = np.float32(radius) / np.float32(math.sqrt(np.float32(distance2))) * LARGER
        half = _half_angle(sine if sine < ONE else ONE) * per_rad + margin
        angle = _arc_tangent(np.float32(y), np.float32(x)) - first_angle
        middle = (angle + TURN if angle < NOUGHT else angle) * per_rad
        f[k] = x
        f[k + np.uint64(TILE)] = y
        f[k + np.uint64(2 * TILE)] = radius * radius
        _store_blocks(index, k, middle - half, middle + half, period, last)
    return around


@inlined
def _prepare_walls(f: Floats, index: Integers, padded: np.uint64, origin: Origin, beams: Beams) -> np.int64:
    """Turns a tile of walls into columns for `test_wall` and finds their beams; returns how many the robot touches."""
    touched = np.int64(0)
    margin, per_rad = np.float32(ANGLE_MARGIN * beams.per_rad), np.float32(beams.per_rad)
    first_angle, last = np.float32(beams.first_angle), np.float32(beams.last)
    period = np.float32(TWO_PI * beams.per_rad)
    for k in range(padded):
        x1 = f[k]
        y1 = f[k + np.uint64(TILE)]
        x2 = f[k + np.uint64(2 * TILE)]
        y2 = f[k + np.uint64(3 * TILE)]
        dx = x2 - x1
        dy = y2 - y1
        cross = x1 * y2 - y1 * x2
        beside = x1 * dx + y1 * dy <= 0.0 and x2 * dx + y2 * dy >= 0.0
        touched += np.int64(beside and cross * cross <= TOUCH * TOUCH * (dx * dx + dy * dy))
        x1 -= OVERLAP * dx
        y1 -= OVERLAP * dy
        x2 += OVERLAP * dx
        y2 += OVERLAP * dy
        clockwise = cross < 0.0
        ax = (x2 if clockwise else x1) * origin.cos + (y2 if clockwise else y1) * origin.sin
        ay = (y2 if clockwise else y1) * origin.cos - (x2 if clockwise else x1) * origin.sin
        bx = (x1 if clockwise else x2) * origin.cos + (y1 if clockwise else y2) * origin.sin
        by = (y1 if clockwise else y2) * origin.cos - (x1 if clockwise else x2) * origin.sin
        low = _arc_tangent(np.float32(ay), np.float32(ax)) - first_angle
        high = _arc_tangent(np.float32(by), np.float32(bx)) - first_angle
        low = low + TURN if low < NOUGHT else low
        high = high + TURN if high < NOUGHT else high
        # A wall seen edge-on has low and high within the error of the angles: not a whole turn apart.
        high = high + TURN if high < low - ONE else high
        cross = ax * by - ay * bx
        scale = 1.0 / (cross if cross > 1e-12 else 1e-12)
        f[k] = ax * scale
        f[k + np.uint64(TILE)] = ay * scale
        f[k + np.uint64(2 * TILE)] = bx * scale
        f[k + np.uint64(3 * TILE)] = by * scale
        _store_blocks(index, k, low * per_rad - margin, high * per_rad + margin, period, last)
    return touched


@inlined
def _test_block(f: Floats, is_wall: bool, k: np.uint64, beam: np.uint64, beams: Beams, best: np.uint64) -> None:
    """Tests eight beams against obstacle k of the tile. Which kind it is is known where this is copied to."""
    if is_wall:
        test_wall(f, k, beam, beams.cos, beams.sin, best)
    else:
        test_disc(f, k, beam, beams.cos, beams.sin, best)


@inlined
def _queue_blocks(
    f: Floats, index: Integers, is_wall: bool, k: np.uint64, end: np.uint64, beams: Beams, best: np.uint64
) -> np.uint64:
    """Appends the blocks of obstacle k to the queue, or tests those of a piece of more than four; returns the new end.

    Branch-free up to four, like `append_close`. Obstacles have one, two or three blocks in no order that a processor
    foresees, and each wrong guess at the end of a loop over them costs more than the tests themselves.
    """
    for piece in range(np.uint64(0), np.uint64(4 * TILE), np.uint64(2 * TILE)):
        first = index[k + piece]
        blocks = np.uint64(index[k + piece + np.uint64(TILE)])
        if blocks <= np.uint64(4):
            if piece == np.uint64(0) or blocks > np.uint64(0):
                block = first | (np.int64(k) << 32)
                index[end] = block
                index[end + np.uint64(1)] = block + 8
                index[end + np.uint64(2)] = block + 16
                index[end + np.uint64(3)] = block + 24
                end += blocks
        else:
            for number in range(blocks):
                _test_block(f, is_wall, k, np.uint64(first) + np.uint64(LANES) * number, beams, best)
    return end


@inlined
def _test_queued(f: Floats, index: Integers, is_wall: bool, end: np.uint64, beams: Beams, best: np.uint64) -> None:
    """Tests all blocks of the queue."""
    for m in range(np.uint64(QUEUE), end):
        block = index[m]
        _test_block(f, is_wall, np.uint64(block >> 32), np.uint64(block & 0xFFFFFFFF), beams, best)


@inlined
def _take_discs(
    discs: Discs, origin: Origin, beams: Beams, first: np.uint64, count: np.uint64, f: Floats, index: Integers
) -> np.int64:
    """Prepares the tile of the near discs from the list's place `first` on; returns how many hold the robot."""
    tile = np.uint64(TILE)
    for k in range(np.uint64(0), count, np.uint64(LANES)):
        at, to = first + k, np.uint64(DISCS) + k
        gather(f, to, discs.x, index, at, origin.x)
        gather(f, to + tile, discs.y, index, at, origin.y)
        gather(f, to + np.uint64(2 * TILE), discs.radius, index, at, 0.0)
    return _prepare_discs(f, index, _padded(count), origin, beams)


@inlined
def _take_walls(
    walls: Walls, origin: Origin, beams: Beams, first: np.uint64, count: np.uint64, f: Floats, index: Integers
) -> np.int64:
    """Prepares the tile of the walls from number `first` on; returns how many the robot touches."""
    for k in range(np.uint64(0), count, np.uint64(LANES)):
        take_walls(f, k, walls.ends, first + k, origin.x, origin.y)
    return _prepare_walls(f, index, _padded(count), origin, beams)


@inlined
def _cast_discs(f: Floats, index: Integers, count: np.uint64, beams: Beams) -> None:
    """Lowers the beams' ranges f[BEST:] to those of a prepared tile."""
    best, end = np.uint64(BEST), np.uint64(QUEUE)
    for k in range(np.uint64(DISCS), np.uint64(DISCS) + count):
        end = _queue_blocks(f, index, False, np.uint64(k), end, beams, best)
    _test_queued(f, index, False, end, beams, best)


@inlined
def _cast_walls(f: Floats, index: Integers, count: np.uint64, beams: Beams, inverse: np.uint64) -> None:
    """Raises the beams' inverse ranges f[inverse:] to those of a prepared tile."""
    end = np.uint64(QUEUE)
    # Sides of one polygon share beams: worked on in a row, each would wait for the other's result.
    for side in range(np.uint64(4)):
        for k in range(side, count, np.uint64(4)):
            end = _queue_blocks(f, index, True, np.uint64(k), end, beams, inverse)
    _test_queued(f, index, True, end, beams, inverse)


@inlined
def cast_rays(
    discs: Discs,
    walls: Walls,
    room: Room,
    origin: Origin,
    beams: Beams,
    reach: float,
    scratch_f: Floats,
    scratch_i: Integers,
    ranges: Ranges,
) -> None:
    """Exact ranges from the origin to the nearest disc or wall along each beam.

    A beam without return reads `reach`. All beams read 0 where the origin lies in a disc or on a wall (within TOUCH).
    A beam beyond one end of the fan comes in again at the other where the turn is full.

    It is copied into each caller: handing over sixty words of array headers costs a third of a small scan. So call it
    in one place, on rows cut out there.

    Args:
        discs: Of one world's row.
        walls: Likewise; the last eight are filled up.
        room: If it holds the origin, its sides are four more walls.
        origin: Where the robot is.
        beams: Of its scanner.
        reach: Largest range [m].
        scratch_f: (scratch_floats(B),) f8, overwritten; what it held doesn't matter.
        scratch_i: (scratch_integers(M),) i8, likewise.
        ranges: (B,) f4 [m], the result.
    """
    count = np.uint64(ranges.size)
    padded = (count // np.uint64(LANES) + np.uint64(2)) * np.uint64(LANES)
    limits = np.uint64(BEST) + padded
    inverse = limits + np.uint64(LIMITS)
    inside = False
    tile = np.uint64(TILE)
    near_walls = walls.total
    for number in range(near_walls, _padded(near_walls)):
        write_wall(walls.ends, number, walls.ends[0], walls.ends[1], walls.ends[2], walls.ends[3])
    for i in range(padded):
        scratch_f[i + np.uint64(BEST)] = reach
        scratch_f[i + inverse] = 1.0 / reach
    to_merge = bool(near_walls > np.uint64(0))
    if room.holds and room.nearest < reach:
        _cast_room(scratch_f, room, origin, beams, reach, count, inverse)
        to_merge = True
    # Among many discs the nearest go first: most others lie behind them.
    crowded = discs.total > CROWDED
    low = reach * math.sqrt(FOREMOST / discs.total) if crowded else reach
    near = find_near_discs(discs, origin.x, origin.y, low, scratch_i)
    for ring in range(2 if crowded else 1):
        if ring == 1:
            _set_limits(scratch_f, beams, origin, reach, count, limits)
            near = _find_farther_discs(discs, origin.x, origin.y, low, scratch_f, limits, scratch_i)
        # Walls and discs are prepared together: how many blocks either has is known late, and what a processor has begun
        # by a wrong guess at that is lost.
        for start in range(np.uint64(0), max(near, near_walls), tile):
            few_walls = min(near_walls - start, tile) if near_walls > start else np.uint64(0)
            few = min(near - start, tile) if near > start else np.uint64(0)
            touched = _take_walls(walls, origin, beams, np.uint64(start), few_walls, scratch_f, scratch_i)
            touched += _take_discs(discs, origin, beams, np.uint64(NEAR) + start, few, scratch_f, scratch_i)
            if touched > 0:
                inside = True
            _cast_walls(scratch_f, scratch_i, few_walls, beams, inverse)
            _cast_discs(scratch_f, scratch_i, few, beams)
        if to_merge:
            _merge(scratch_f, padded, inverse)
            near_walls, to_merge = np.uint64(0), False
    for i in range(count):
        distance = scratch_f[i + np.uint64(BEST)]
        # Inverting `reach` twice may end one bit off, which mustn't turn a beam without return into one with.
        distance = distance if distance < reach * (1.0 - 1e-15) else reach
        ranges[i] = np.float32(0.0 if inside else distance)
