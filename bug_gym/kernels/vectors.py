"""Vectors of eight numbers, written in LLVM's terms.

LLVM is given vectors of eight numbers by hand (the functions marked @vectors) where its own vectoriser fails: numba
switches off vectorising of straight code, and loops of eight are unrolled before they are looked at. A vector of
eight is lowered to what the processor has. Nothing is fused or reordered.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils as numba_cgutils

from bug_gym.compiling import vectors

cgutils: Any = numba_cgutils  # without types upstream
LANES = 8
WIDE = 0.38  # a disc's radius as a part of its distance: a bit less than the sine of half an octant
TILE = 64  # near obstacles prepared together; a column of scratch is this long

# scratch_f: four columns of wall data, four of disc data, then the best value of each beam.
DISCS = 4 * TILE
BEST = 8 * TILE
# scratch_i: columns of beam blocks likewise, the queue (a tile's two pieces of at most four blocks each), near obstacles.
QUEUE = 8 * TILE
NEAR = 17 * TILE


FLOATS = ir.VectorType(ir.DoubleType(), LANES)
INTEGERS = ir.VectorType(ir.IntType(64), LANES)
ZEROS = ir.Constant(FLOATS, [0.0] * LANES)
NEVER_MET = ir.Constant(FLOATS, [math.inf] * LANES)


def _int64(value: int) -> Any:
    return ir.Constant(ir.IntType(64), value)


def _splat(builder: Any, value: Any) -> Any:
    kind = ir.VectorType(value.type, LANES)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    same = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), same)


def _data(context: Any, builder: Any, array_type: Any, array: Any) -> Any:
    return context.make_array(array_type)(context, builder, array).data


def _lanes(builder: Any, data: Any, start: Any, kind: Any) -> Any:
    """Address of the eight numbers of `data` from `start` on."""
    return builder.bitcast(builder.gep(data, [start]), kind.as_pointer())


def _load(builder: Any, data: Any, start: Any, kind: Any = FLOATS) -> Any:
    return builder.load(_lanes(builder, data, start, kind), align=8)


def _store(builder: Any, value: Any, data: Any, start: Any) -> None:
    builder.store(value, _lanes(builder, data, start, value.type), align=8)


def _smaller(builder: Any, first: Any, second: Any) -> Any:
    """Lane by lane; the second where either is no number. One instruction of the processor, as `_larger`."""
    return builder.select(builder.fcmp_ordered("<", first, second), first, second)


def _larger(builder: Any, first: Any, second: Any) -> Any:
    """Likewise."""
    return builder.select(builder.fcmp_ordered(">", first, second), first, second)


def _columns(builder: Any, data: Any, row: Any, count: int) -> list[Any]:
    """Numbers of obstacle `row` of the tile, each repeated in all lanes."""
    places = [builder.add(row, _int64(column * TILE)) for column in range(count)]
    return [_splat(builder, builder.load(builder.gep(data, [place]))) for place in places]


@vectors
def prefetch(typingctx: Any, array: Any, start: Any) -> Any:
    """Asks for the cache line of array[start], which is needed soon."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, start = arguments
        data = _data(context, builder, signature.args[0], array)
        place = builder.bitcast(builder.gep(data, [start]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        prefetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(prefetch, [place, ir.Constant(number, 0), ir.Constant(number, 3), ir.Constant(number, 1)])
        return context.get_dummy_value()

    return types.void(array, types.int64), codegen


@vectors
def move_eight(typingctx: Any, columns: Any, j: Any, room: Any, f: Any, block: Any, time: Any) -> Any:
    """Writes where eight bodies are at a time to columns[j ...], [room + j ...], and their radii to [2 room + j ...].

    The block f[block ...] has x, y at time 0, velocities and radii, each eight numbers.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        columns, j, room, f, block, time = arguments
        target = _data(context, builder, signature.args[0], columns)
        source = _data(context, builder, signature.args[3], f)
        x, y, vx, vy, radius = (
            _load(builder, source, builder.add(block, _int64(LANES * number))) for number in range(5)
        )
        now = _splat(builder, time)
        _store(builder, builder.fadd(x, builder.fmul(vx, now)), target, j)
        j = builder.add(j, room)
        _store(builder, builder.fadd(y, builder.fmul(vy, now)), target, j)
        _store(builder, radius, target, builder.add(j, room))
        return context.get_dummy_value()

    return types.void(columns, types.uint64, types.uint64, f, types.uint64, types.float64), codegen


def _append(context: Any, builder: Any, index: Any, lanes: Any, j: Any, end: Any) -> Any:
    """Writes those of j ... j + 7 whose lane (8 i1) is true to index[end ...]; returns the new end.

    Branch-free: eight numbers are always written, the end moves by as many as count.
    """
    positions = [[bit for bit in range(8) if mask >> bit & 1] for mask in range(256)]
    table = np.array([row + [0] * (8 - len(row)) for row in positions], np.uint8)
    mask = builder.zext(builder.bitcast(lanes, ir.IntType(8)), ir.IntType(64))
    bytes_ = ir.Constant(ir.ArrayType(ir.IntType(8), table.size), bytearray(table.tobytes()))
    rows = cgutils.global_constant(builder, "positions_of_bits", bytes_)
    row = builder.gep(rows, [_int64(0), builder.mul(mask, _int64(LANES))])
    small = ir.VectorType(ir.IntType(8), LANES)
    chosen = builder.load(builder.bitcast(row, small.as_pointer()), align=1)
    _store(builder, builder.add(builder.zext(chosen, INTEGERS), _splat(builder, j)), index, end)
    return builder.add(end, builder.ctpop(mask))


@vectors
def append_awake(typingctx: Any, index: Any, f: Any, wakes: Any, j: Any, closing: Any, end: Any) -> Any:
    """Writes those of the bodies j ... j + 7 with f[wakes + j ...] up to `closing` to index[end ...]; returns the new end."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        index, f, wakes, j, closing, end = arguments
        wake = _load(builder, _data(context, builder, signature.args[1], f), builder.add(wakes, j))
        lanes = builder.fcmp_ordered("<=", wake, _splat(builder, closing))
        return _append(context, builder, _data(context, builder, signature.args[0], index), lanes, j, end)

    return types.uint64(index, f, types.uint64, types.uint64, types.float64, types.uint64), codegen


@vectors
def lanes_until(typingctx: Any, f: Any, start: Any, limit: Any) -> Any:
    """Which of f[start ... start + 7] are no larger than a limit: eight bits, the first one's lowest."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        f, start, limit = arguments
        values = _load(builder, _data(context, builder, signature.args[0], f), start)
        lanes = builder.fcmp_ordered("<=", values, _splat(builder, limit))
        return builder.zext(builder.bitcast(lanes, ir.IntType(8)), ir.IntType(64))

    return types.uint64(f, types.uint64, types.float64), codegen


@vectors
def least_of_eight(typingctx: Any, f: Any, start: Any) -> Any:
    """The smallest of f[start ... start + 7]."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        f, start = arguments
        values = _load(builder, _data(context, builder, signature.args[0], f), start)
        for half in (4, 2, 1):
            lanes = [
                ir.Constant(ir.VectorType(ir.IntType(32), half), [*range(first, first + half)]) for first in (0, half)
            ]
            values = _smaller(builder, *(builder.shuffle_vector(values, values, chosen) for chosen in lanes))
        return builder.extract_element(values, ir.Constant(ir.IntType(32), 0))

    return types.float64(f, types.uint64), codegen


@vectors
def append_close(
    typingctx: Any, index: Any, xs: Any, ys: Any, radii: Any, j: Any, x: Any, y: Any, reach: Any, end: Any
) -> Any:
    """Writes those of the discs j ... j + 7 that reach into a circle about (x, y) to index[end ...]; returns the new end."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, *columns, j, x, y, reach, end = arguments
        data = [_data(context, builder, signature.args[1 + number], column) for number, column in enumerate(columns)]
        dx = builder.fsub(_load(builder, data[0], j), _splat(builder, x))
        dy = builder.fsub(_load(builder, data[1], j), _splat(builder, y))
        far = builder.fadd(_splat(builder, reach), _load(builder, data[2], j))
        square = builder.fadd(builder.fmul(dx, dx), builder.fmul(dy, dy))
        lanes = builder.fcmp_ordered("<", square, builder.fmul(far, far))
        return _append(context, builder, _data(context, builder, signature.args[0], array), lanes, j, end)

    numbers = (types.float64, types.float64, types.float64)
    return types.uint64(index, xs, ys, radii, types.uint64, *numbers, types.uint64), codegen


@vectors
def append_seen(
    typingctx: Any,
    index: Any,
    xs: Any,
    ys: Any,
    radii: Any,
    j: Any,
    x: Any,
    y: Any,
    low: Any,
    limits: Any,
    at: Any,
    end: Any,
) -> Any:
    """Likewise, of those that don't reach into the circle of radius `low`, but within the limit of where they lie.

    The limits limits[at ...] are of the octants about (x, y), each of three bits: to the left, below, steep; a ninth one
    holds for discs that are wide for their distance.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, *columns, j, x, y, low, limits, at, end = arguments
        data = [_data(context, builder, signature.args[1 + number], column) for number, column in enumerate(columns)]
        limits = _data(context, builder, signature.args[8], limits)
        dx = builder.fsub(_load(builder, data[0], j), _splat(builder, x))
        dy = builder.fsub(_load(builder, data[1], j), _splat(builder, y))
        radius = _load(builder, data[2], j)
        along, up = builder.fmul(dx, dx), builder.fmul(dy, dy)
        square = builder.fadd(along, up)
        limit = [_splat(builder, builder.load(builder.gep(limits, [builder.add(at, _int64(n))]))) for n in range(9)]
        for bit in (
            builder.fcmp_ordered("<", dx, ZEROS),
            builder.fcmp_ordered("<", dy, ZEROS),
            builder.fcmp_ordered(">", up, along),
        ):
            limit = [builder.select(bit, limit[n + 1], limit[n]) for n in range(0, len(limit) - 1, 2)] + limit[-1:]
        share = ir.Constant(FLOATS, [WIDE * WIDE] * LANES)
        wide = builder.fcmp_ordered(">", builder.fmul(radius, radius), builder.fmul(square, share))
        far = builder.fadd(builder.select(wide, limit[1], limit[0]), radius)
        near = builder.fadd(_splat(builder, low), radius)
        lanes = builder.and_(
            builder.fcmp_ordered("<", square, builder.fmul(far, far)),
            builder.fcmp_ordered(">=", square, builder.fmul(near, near)),
        )
        return _append(context, builder, _data(context, builder, signature.args[0], array), lanes, j, end)

    numbers = (types.float64,) * 3
    return types.uint64(index, xs, ys, radii, types.uint64, *numbers, limits, types.uint64, types.uint64), codegen


@vectors
def gather(typingctx: Any, scratch: Any, k: Any, source: Any, index: Any, start: Any, origin: Any) -> Any:
    """scratch[k ... k + 7] = source[index[start ... start + 7]] - origin.

    Loads of one vector follow soon; written one by one, the processor couldn't forward them to it.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        scratch, k, source, index, start, origin = arguments
        target = _data(context, builder, signature.args[0], scratch)
        source = _data(context, builder, signature.args[2], source)
        index = _data(context, builder, signature.args[3], index)
        values = ir.Constant(FLOATS, ir.Undefined)
        for lane in range(LANES):
            j = builder.load(builder.gep(index, [builder.add(start, _int64(lane))]))
            value = builder.load(builder.gep(source, [j]))
            values = builder.insert_element(values, value, ir.Constant(ir.IntType(32), lane))
        _store(builder, builder.fsub(values, _splat(builder, origin)), target, k)
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, source, index, types.uint64, types.float64), codegen


WALL = ir.VectorType(ir.DoubleType(), 4)


@vectors
def write_wall(typingctx: Any, ends: Any, number: Any, x1: Any, y1: Any, x2: Any, y2: Any) -> Any:
    """ends[4 number ... 4 number + 3] = x1, y1, x2, y2, at once, so that the processor forwards them to `take_walls`."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        ends, number, *values = arguments
        data = _data(context, builder, signature.args[0], ends)
        wall = ir.Constant(WALL, ir.Undefined)
        for lane, value in enumerate(values):
            wall = builder.insert_element(wall, value, ir.Constant(ir.IntType(32), lane))
        _store(builder, wall, data, builder.mul(number, _int64(4)))
        return context.get_dummy_value()

    return types.void(ends, types.uint64, *(types.float64,) * 4), codegen


@vectors
def take_walls(typingctx: Any, scratch: Any, k: Any, ends: Any, first: Any, x: Any, y: Any) -> Any:
    """Writes the walls first ... first + 7 to scratch[k ... k + 7] and the three columns behind, seen from (x, y)."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        scratch, k, ends, first, x, y = arguments
        target = _data(context, builder, signature.args[0], scratch)
        source = _data(context, builder, signature.args[2], ends)
        begin = builder.mul(first, _int64(4))
        walls = [_load(builder, source, builder.add(begin, _int64(4 * lane)), WALL) for lane in range(LANES)]

        def joined(one: Any, other: Any, lanes: list[int]) -> Any:
            chosen = ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), lanes)
            return builder.shuffle_vector(one, other, chosen)

        # x and y of both ends of two walls side by side, then of four, then of all eight.
        pairs = [
            [joined(one, other, [0, 4, 2, 6]), joined(one, other, [1, 5, 3, 7])]
            for one, other in zip(walls[::2], walls[1::2], strict=True)
        ]
        for column in range(4):
            halves = []
            for one, other in (pairs[:2], pairs[2:]):
                lanes = [0, 1, 4, 5] if column < 2 else [2, 3, 6, 7]
                halves.append(joined(one[column % 2], other[column % 2], lanes))
            values = joined(halves[0], halves[1], list(range(LANES)))
            origin = _splat(builder, y if column % 2 else x)
            _store(builder, builder.fsub(values, origin), target, builder.add(k, _int64(column * TILE)))
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, ends, types.uint64, types.float64, types.float64), codegen


def _load_block(context: Any, builder: Any, signature: Any, arguments: Any, count: int) -> tuple[Any, ...]:
    """What `test_disc` and `test_wall` read.

    Returns the data of scratch, `count` columns of the obstacle, cosines and sines of the beams, their best values and
    the place of these.
    """
    scratch, row, beam, beam_cos, beam_sin, best = arguments
    data = _data(context, builder, signature.args[0], scratch)
    columns = _columns(builder, data, row, count)
    cos = _load(builder, _data(context, builder, signature.args[3], beam_cos), beam)
    sin = _load(builder, _data(context, builder, signature.args[4], beam_sin), beam)
    place = builder.add(beam, best)
    # Best values are positive. A store of "the better one of what lies there" would become one with a mask, which some
    # processors do slowly.
    kind = ir.FunctionType(FLOATS, [FLOATS])
    magnitude = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fabs.v{LANES}f64")
    return data, columns, cos, sin, builder.call(magnitude, [_load(builder, data, place)]), place


@vectors
def test_disc(typingctx: Any, scratch: Any, row: Any, beam: Any, beam_cos: Any, beam_sin: Any, best: Any) -> Any:
    """Ranges of beams beam ... beam + 7 to disc `row` (columns x, y, radius squared).

    The smaller one of each and its value at `best` stays.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data, (x, y, radius2), cos, sin, best, place = _load_block(context, builder, signature, arguments, 3)
        along = builder.fadd(builder.fmul(x, cos), builder.fmul(y, sin))
        aside = builder.fsub(builder.fmul(x, sin), builder.fmul(y, cos))
        # The root of a negative number, a miss, is NaN and loses each comparison.
        kind = ir.FunctionType(FLOATS, [FLOATS])
        root = cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{LANES}f64")
        half_chord = builder.call(root, [builder.fsub(radius2, builder.fmul(aside, aside))])
        distance = builder.fsub(along, half_chord)
        ahead = builder.fcmp_ordered(">", along, ZEROS)
        _store(builder, _smaller(builder, builder.select(ahead, distance, NEVER_MET), best), data, place)
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, types.uint64, beam_cos, beam_sin, types.uint64), codegen


@vectors
def test_wall(typingctx: Any, scratch: Any, row: Any, beam: Any, beam_cos: Any, beam_sin: Any, best: Any) -> Any:
    """Inverse ranges of beams beam ... beam + 7 to wall `row` (columns x, y of both ends).

    The larger one of each and its value at `best` stays.

    The ends a, b are divided by a x b, which makes the inverse range the linear a x d + d x b: no division a beam.
    The beam d passes between the ends where both terms are positive, as a, b stand counter-clockwise.
    """

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data, (ax, ay, bx, by), cos, sin, best, place = _load_block(context, builder, signature, arguments, 4)
        past_a = builder.fsub(builder.fmul(ax, sin), builder.fmul(ay, cos))
        before_b = builder.fsub(builder.fmul(by, cos), builder.fmul(bx, sin))
        inverse = builder.fadd(past_a, before_b)
        between = builder.fcmp_ordered(">=", _smaller(builder, past_a, before_b), ZEROS)
        _store(builder, _larger(builder, builder.select(between, inverse, ZEROS), best), data, place)
        return context.get_dummy_value()

    return types.void(scratch, types.uint64, types.uint64, beam_cos, beam_sin, types.uint64), codegen
