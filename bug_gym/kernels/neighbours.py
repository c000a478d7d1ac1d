"""The bodies near the robots, side by side: what a step looks at, however many others there are.

A row lists the discs and the polygons that may come within reach of a robot's scan or contact before `closing` has grown
by the margin. `closing` grows by the robots' ways and the greatest way of a body: no two come nearer by more. Whoever is
not listed sleeps until `closing` says that it may be near (`body_wake`), and is then brought forward exactly: so bodies far
off cost nothing, and not even their first event is planned before they are near. Where all are
listed that of one which only reflects has time, until it may touch something.

No result depends on what is listed, only the time it takes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.compiling import apart, called, inlined
from bug_gym.kernels.body import way_of
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import ACKERMANN, BOUNCE, CROWD, Floats, Integers, Record
from bug_gym.kernels.motion import UNPLANNED, body_motion, bring_forward, move_looker, plan_quiet, quiet_until
from bug_gym.kernels.rays import Discs
from bug_gym.kernels.vectors import LANES, append_awake, lanes_until, least_of_eight, move_eight
from bug_gym.kernels.walls import is_one_ring

FEW = 64  # up to so many all are listed once an episode: to choose among them would cost more than it saves
NOWHERE = 1e100  # x and y of what fills up the last eight of a list [m]
BLOCK = 5 * LANES  # numbers of eight listed bodies that lie together
COLUMNS = 3  # of scratch for a listed body: x, y, radius


class Near(NamedTuple):
    """The listed bodies where they are now, lists filled up to a multiple of eight."""

    discs: Discs
    """Circular obstacles."""
    polygons: Discs
    """The discs that hold the polygons."""


class ListedWalls(NamedTuple):
    """The walls of a listed polygon, which are kept side by side in one number each: those of all polygons lie apart."""

    first: int
    """Where they begin."""
    total: int
    side: int
    """1 or -1: on which side of its walls the inside lies."""
    is_ring: bool
    """A single one, without holes."""
    moves: bool


@inlined
def pack_walls(walls: ListedWalls) -> int:
    """One number of 64 bits."""
    return walls.first << 32 | walls.total << 4 | (walls.side + 1) << 2 | int(walls.is_ring) << 1 | int(walls.moves)


@inlined
def listed_walls(k: Integers, s: Record, at: np.uint64) -> ListedWalls:
    """Of the polygon at a place of the list of polygons."""
    packed = k[np.uint64(s.near_walls + s.disc_room) + at]
    side = (packed >> 2 & 3) - 1
    return ListedWalls(packed >> 32, packed >> 4 & 0xFFFFFFF, side, packed & 2 != 0, packed & 1 != 0)


def list_room(bodies: int) -> int:
    """Length of a list that holds so many, in eights, and eight more."""
    return (bodies // LANES + 2) * LANES


@inlined
def in_eights(count: int) -> int:
    """The multiple of eight that holds so many."""
    return (count + 7) >> 3 << 3


@inlined
def reach_of(f: Floats, s: Record, r: int, way: float, turn: float) -> float:
    """From where robot r's step would end, how far the edges of bodies matter to its contacts and its scan [m]."""
    touch: float = max(f[s.min_clearance + r], s.clearance_reach) + s.body_reach * (1.0 + turn) + f[s.fastest] * s.step
    reach: float = max(touch, s.reach) + way
    return reach


@inlined
def close_in(f: Floats, s: Record) -> float:
    """Tell `closing` of this step's motions; returns the longest reach of a robot [m]."""
    farthest, reach = 0.0, 0.0
    for r in range(s.robots):
        x, y = f[s.next_pose + 3 * r], f[s.next_pose + 3 * r + 1]
        farthest = max(farthest, length(x - f[s.seen + 2 * r], y - f[s.seen + 2 * r + 1]))
        f[s.seen + 2 * r] = x
        f[s.seen + 2 * r + 1] = y
        turn = abs(f[s.next_pose + 3 * r + 2] - f[s.pose + 3 * r + 2])
        reach = max(reach, reach_of(f, s, r, way_of(f, s, r), turn))
    f[s.closing] += farthest + f[s.fastest] * s.step
    return reach


@apart
def list_bodies(
    f: Floats, k: Integers, s: Record, first: int, moving: int, total: int, at: int, time: float, columns: Floats
) -> int:
    """List those of the bodies `first` ... `first + total - 1` that are near, from `at` on; returns how many.

    Discs are listed from 0 on, polygons behind their room. The first `moving` of them move. What is asked of all that are
    awake is asked in passes without branches: who is near comes in no order that a processor foresees.
    """
    margin: float = f[s.listed_until] - f[s.closing]
    # Among what stands it is soon that one might touch something; where all are listed most are far off.
    stand = k[s.disc_count] > k[s.moving_disc_count] or k[s.polygon_count] > k[s.moving_polygon_count]
    can_wait = k[s.steered_count] == 0 and (margin == math.inf or not stand)
    if can_wait and time == 0.0 and k[s.disc_count] == k[s.moving_disc_count]:
        plan_quiet(f, k, s, first, moving)
    awake = find_awake(f, k, s, first, total, at)
    room, numbers = np.uint64(s.disc_room + s.polygon_room), np.uint64(s.near_number + at)
    for j in range(np.uint64(awake)):
        b = first + k[numbers + j]
        x, y = f[s.body_x + b], f[s.body_y + b]
        if time > 0.0 and b - first < moving and k[s.body_law + b] < CROWD:
            waits = can_wait and k[s.body_law + b] == BOUNCE and f[s.body_event + b] == UNPLANNED
            if waits and is_quiet(f, k, s, b, time):
                x += f[s.body_vx + b] * time
                y += f[s.body_vy + b] * time
            else:
                bring_forward(f, k, s, b, time)
                x, y = f[s.body_x + b], f[s.body_y + b]
        columns[j] = x
        columns[room + j] = y
        columns[room + room + j] = f[s.body_radius + b]
    measure_gaps(f, s, at, awake, margin, columns)
    count = sort_out(f, k, s, first, at, awake)
    for j in range(at, at + count):
        number = k[s.near_number + j]
        b, moves = first + number, number < moving
        if at > 0:
            begin, walls = k[s.polygon_first + number], k[s.polygon_walls + number]
            is_ring = is_one_ring(k, s, begin, walls)
            k[s.near_walls + j] = pack_walls(ListedWalls(begin, walls, k[s.polygon_side + number], is_ring, moves))
        waits = can_wait and moves and k[s.body_law + b] == BOUNCE and f[s.body_event + b] == UNPLANNED
        if waits and is_quiet(f, k, s, b, time):
            list_waiting(f, s, b, j)
        else:
            if moves and k[s.body_law + b] < CROWD and time == 0.0:
                bring_forward(f, k, s, b, time)
            list_body(f, s, b, j, moves)
    for j in range(at + count, at + in_eights(count)):
        write_block(f, s, j, NOWHERE, NOWHERE, 0.0, 0.0, 0.0)
    return count


@inlined
def find_awake(f: Floats, k: Integers, s: Record, first: int, total: int, at: int) -> int:
    """Write the numbers of those that may be near to `near_number`, from `at` on; returns how many."""
    begin = np.uint64(s.near_number + at)
    end: np.uint64 = begin
    for j in range(np.uint64(0), np.uint64(total), np.uint64(LANES)):
        end = append_awake(k, f, np.uint64(s.body_wake + first), j, f[s.closing], end)
    while end > begin and k[end - np.uint64(1)] >= total:
        end -= np.uint64(1)
    return int(end - begin)


@inlined
def measure_gaps(f: Floats, s: Record, at: int, awake: int, margin: float, columns: Floats) -> None:
    """Write what is missing until each of the awake bodies must be listed [m] to `near_event`, from `at` on."""
    room, gaps = np.uint64(s.disc_room + s.polygon_room), np.uint64(s.near_event + at)
    reach = f[s.listed_reach]
    for r in range(s.robots):
        x, y = f[s.seen + 2 * r], f[s.seen + 2 * r + 1]
        for j in range(np.uint64(awake)):
            gap = length(columns[j] - x, columns[room + j] - y)
            f[gaps + j] = gap if r == 0 else min(f[gaps + j], gap)
    for j in range(np.uint64(awake)):
        f[gaps + j] -= columns[room + room + j] + reach + margin  # minus infinity where all are listed


@inlined
def sort_out(f: Floats, k: Integers, s: Record, first: int, at: int, awake: int) -> int:
    """Tell the awake bodies when to wake next, and keep the numbers of the near ones only; returns how many."""
    numbers, gaps, wakes = np.uint64(s.near_number + at), np.uint64(s.near_event + at), np.uint64(s.body_wake + first)
    closing = f[s.closing]
    end: np.uint64 = numbers
    for j in range(np.uint64(awake)):
        number, gap = k[numbers + j], f[gaps + j]
        f[wakes + np.uint64(number)] = closing + max(gap, 0.0)
        k[end] = number
        end += np.uint64(not gap > 0.0)
    return int(end - numbers)


@inlined
def write_block(f: Floats, s: Record, j: int, x: float, y: float, vx: float, vy: float, radius: float) -> None:
    """Write place j of the lists."""
    block = s.near + (j >> 3) * BLOCK + (j & 7)
    f[block] = x
    f[block + LANES] = y
    f[block + 2 * LANES] = vx
    f[block + 3 * LANES] = vy
    f[block + 4 * LANES] = radius


@inlined
def list_body(f: Floats, s: Record, b: int, j: int, moves: bool) -> None:
    """Write body b, which has no event left before now, to place j of the lists."""
    if moves:
        vx, vy = f[s.body_vx + b], f[s.body_vy + b]
        write_block(f, s, j, f[s.line_x + b], f[s.line_y + b], vx, vy, f[s.body_radius + b])
        f[s.near_event + j] = f[s.body_event + b]
    else:
        write_block(f, s, j, f[s.body_x + b], f[s.body_y + b], 0.0, 0.0, f[s.body_radius + b])
        f[s.near_event + j] = math.inf


@inlined
def is_quiet(f: Floats, k: Integers, s: Record, b: int, time: float) -> bool:
    """Whether body b, whose first event is not planned, certainly has none up to a time."""
    if f[s.body_quiet + b] < 0.0:
        f[s.body_quiet + b] = quiet_until(f, k, s, b)
    quiet: bool = f[s.body_quiet + b] > time
    return quiet


@inlined
def list_waiting(f: Floats, s: Record, b: int, j: int) -> None:
    """Write body b, which goes on as it was placed until its first event is planned, to place j of the lists."""
    f[s.body_turned + b] = -1.0
    x, y, vx, vy = f[s.body_x + b], f[s.body_y + b], f[s.body_vx + b], f[s.body_vy + b]
    write_block(f, s, j, x, y, vx, vy, f[s.body_radius + b])
    f[s.near_event + j] = f[s.body_quiet + b]


@apart
def meet_events(f: Floats, k: Integers, s: Record, end: float) -> None:
    """Bring the listed bodies through their events up to `end`."""
    next_event = math.inf
    f[s.listed_turn] = end
    for kind in range(2):
        at, count, first = 0, k[s.near_discs], 0
        if kind == 1:
            at, count, first = s.disc_room, k[s.near_polygons], s.discs
        past = at + count
        for block in range(at, past, LANES):
            due = lanes_until(f, np.uint64(s.near_event + block), end)
            if due == np.uint64(0):
                continue
            for j in range(block, min(block + LANES, past)):
                if f[s.near_event + j] <= end:
                    b = first + k[s.near_number + j]
                    bring_forward(f, k, s, b, end)
                    list_body(f, s, b, j, True)
        earliest, whole = -1, past - count % LANES
        for block in range(at, whole, LANES):
            event = least_of_eight(f, np.uint64(s.near_event + block))
            if event < next_event:
                next_event, earliest = event, block
        for j in range(whole, past):
            if f[s.near_event + j] < next_event:
                next_event, earliest = f[s.near_event + j], j
        if earliest >= 0:
            while f[s.near_event + earliest] != next_event:
                earliest += 1
            k[s.next_body] = first + k[s.near_number + earliest]
    f[s.next_event] = next_event


@apart
def list_near(f: Floats, k: Integers, s: Record, time: float, reach: float, columns: Floats) -> None:
    """List the near bodies anew at a time; all are looked at where `reach` is more than what they were listed for."""
    margin = s.margin
    if k[s.steered_count] > 0 or k[s.disc_count] + k[s.polygon_count] <= FEW:
        margin, reach = math.inf, math.inf  # all, in their order; what looks would go anywhere
    if reach > f[s.listed_reach]:
        f[s.listed_reach] = reach + max(s.max_speed, s.max_reverse) * s.step
        for b in range(s.discs + s.polygons):
            f[s.body_wake + b] = 0.0
    f[s.listed_until] = f[s.closing] + margin
    k[s.near_discs] = list_bodies(f, k, s, 0, k[s.moving_disc_count], k[s.disc_count], 0, time, columns)
    k[s.near_polygons] = list_bodies(
        f, k, s, s.discs, k[s.moving_polygon_count], k[s.polygon_count], s.disc_room, time, columns
    )
    meet_events(f, k, s, time)


@called
def list_from_here(f: Floats, k: Integers, s: Record, columns: Floats) -> None:
    """List the near bodies where the robots are now, whatever was listed before."""
    reach = 0.0
    for r in range(s.robots):
        f[s.seen + 2 * r] = f[s.pose + 3 * r]
        f[s.seen + 2 * r + 1] = f[s.pose + 3 * r + 1]
        # An ackermann robot's own rate is no number that is drawn.
        rate = s.full_turn_rate if s.kinematics == ACKERMANN else s.max_turn_rate
        reach = max(reach, reach_of(f, s, r, 0.0, rate * s.step))
    f[s.closing] = 0.0
    f[s.listed_reach] = 0.0
    list_near(f, k, s, f[s.time], reach, columns)


@called
def keep_list(f: Floats, k: Integers, s: Record, end: float, columns: Floats) -> None:
    """Bring the lists to `end`, the robots being about to go to where this step would bring them."""
    if f[s.listed_until] < math.inf:
        reach = close_in(f, s)
        if f[s.closing] > f[s.listed_until] or reach > f[s.listed_reach]:
            list_near(f, k, s, end, reach, columns)
    if f[s.next_event] <= end:
        meet_events(f, k, s, end)


@inlined
def near_motion(f: Floats, k: Integers, s: Record, first: int, moving: int, j: np.uint64) -> tuple[float, float]:
    """The way in this step of the body at place j of the lists [m]: one of those from `first` on, of which so many move.

    Which one it is, is looked up only where bodies have met events: their numbers lie far from the rest.
    """
    if f[s.listed_turn] == f[s.time]:
        number = k[np.uint64(s.near_number) + j]
        return body_motion(f, s, first + number) if number < moving else (0.0, 0.0)
    block = np.uint64(s.near) + (j >> np.uint64(3)) * np.uint64(BLOCK) + (j & np.uint64(7))
    return f[block + np.uint64(2 * LANES)] * s.step, f[block + np.uint64(3 * LANES)] * s.step


@called
def move_lookers(f: Floats, k: Integers, s: Record, start: float, end: float) -> None:
    """Move the bodies that have taken a velocity for this step. Where there are any, all bodies are listed in order."""
    for b in range(s.bodies):
        if k[s.body_law + b] < CROWD or k[s.disc_count] <= b < s.discs:
            continue
        move_looker(f, s, b, start, end)
        if b < s.discs:
            list_body(f, s, b, b, True)
        elif b < s.discs + s.polygons:
            list_body(f, s, b, s.disc_room + b - s.discs, True)


@inlined
def move_list(f: Floats, s: Record, at: int, count: int, time: float, columns: Floats) -> Discs:
    """Where the listed bodies `at` ... are at a time, in `columns`."""
    room = np.uint64(s.disc_room + s.polygon_room)
    padded = in_eights(count)
    block = np.uint64(s.near + at // LANES * BLOCK)
    for j in range(np.uint64(at), np.uint64(at + padded), np.uint64(LANES)):
        move_eight(columns, j, room, f, block, time)
        block += np.uint64(BLOCK)
    return listed_discs(s, at, padded, columns)


@inlined
def listed_discs(s: Record, at: int, count: int, columns: Floats) -> Discs:
    """The part of `columns` where `count` listed bodies lie."""
    room = s.disc_room + s.polygon_room
    return Discs(
        columns[at : at + count],
        columns[room + at : room + at + count],
        columns[2 * room + at : 2 * room + at + count],
        count,
    )


@inlined
def near_bodies(f: Floats, k: Integers, s: Record, columns: Floats) -> Near:
    """Where the listed bodies are now."""
    time = f[s.time]
    discs = move_list(f, s, 0, k[s.near_discs], time, columns)
    return Near(discs, move_list(f, s, s.disc_room, k[s.near_polygons], time, columns))
