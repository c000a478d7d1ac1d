"""What would come of two desired velocities, one held after the other, in sampled futures of what moves.

In place of the second one the robot may also follow its way.

Source: this package; model predictive control in scenarios, each sequence judged by its mean over them. All coordinates are
in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.futures import Futures
from bug_gym.agents.hd_bug.roll_out import Steering, Velocities, go_on, steering_of
from bug_gym.compiling import inlined, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.free_way import free_distance
from bug_gym.kernels.layout import Floats
from bug_gym.kinematics import Drive

FADING = 2.0
"""Time constant with which a hit ahead fades [s]."""

NEAR_MISS = 0.5
"""What it is to pass at no distance at all, as a share of a hit."""


class Sequences(NamedTuple):
    """What comes of each of m first and n second velocities, the last of which is to follow the way."""

    risk: F64
    """Hits and near misses (m, n), fading with time, the worst of a future counted; their mean over the futures."""
    end: F64
    """Where it is at the last time (m, n, 2) [m], or at the goal."""
    early: F64
    """How long before the last time it is at the goal (m, n) [s]; 0: it is not."""


class Surroundings(NamedTuple):
    """What stands still."""

    x: F64
    """Points that have been seen (P,) [m]."""
    y: F64
    """Points that have been seen (P,) [m]."""
    radius: float
    """Of the disc that keeps off them [m]."""
    nodes: F64
    """Places of the way that come next (k, 2) [m]; second directions are counted from that of the first of them."""
    goal: tuple[float, float]
    """Where to [m]."""
    goal_radius: float
    """[m]."""
    corner: tuple[float, float]
    """Of the map's first cell [m]."""
    size: float
    """Of a cell [m]."""
    blocked: NDArray[np.int16]
    """Cells (R, C) too near to what stands for a way."""


def judge_sequences(
    drive: Drive,
    pose: tuple[float, float, float],
    radius: float,
    first: Velocities,
    backs: bool,
    held: int,
    second: Velocities,
    around: Surroundings,
    futures: Futures,
    margin: float,
    spacing: float,
) -> Sequences:
    """Roll out sequences.

    Args:
        drive: kinematics and limits of the robot.
        pose: x, y [m], heading [rad].
        radius: of the robot [m].
        first: velocities held at first.
        backs: whether the last of them is to drive straight back.
        held: how many times long.
        second: velocities held then, up to the last time; to follow the way at the first one's speed is added to them.
        around: what stands still.
        futures: of the movers.
        margin: nearer than this is a near miss [m].
        spacing: between the times [s].
    """
    shape = (len(first.directions), len(second.directions) + 1)
    result = Sequences(np.zeros(shape), np.empty((*shape, 2)), np.zeros(shape))
    times, count = futures.x.shape[1:]
    fade = np.exp(-spacing * np.arange(1, times + 1) / FADING)
    points = len(around.x)
    scratch = np.empty(count), np.empty(count), np.empty((times, 2)), fade, np.empty(points), np.empty(points)
    _judge(
        steering_of(drive), pose, radius, first, backs, held, second, around, futures, margin, spacing, scratch, result
    )
    return result


@inlined
def _count_hits(
    futures: Futures, path: Floats, begin: int, end: int, radius: float, margin: float, fade: Floats, worst: Floats
) -> None:
    """Raises `worst` (K,) to the hits and near misses on a piece of the path."""
    position, x, y, radii, reach = futures
    for t in range(x.shape[0]):
        for n in range(begin, end):
            px, py = path[n, 0], path[n, 1]
            near = radius + radii[t, n]
            dx, dy = position[t, 0] - px, position[t, 1] - py
            if dx * dx + dy * dy >= (near + margin + reach[t, n]) ** 2:
                continue
            weight = fade[n]
            for k in range(worst.size):
                dx, dy = x[t, n, k] - px, y[t, n, k] - py
                gap = math.sqrt(dx * dx + dy * dy) - near
                short = max(1.0 - gap / margin, 0.0)
                cost = NEAR_MISS * short * short if gap > 0.0 else 1.0 - gap
                worst[k] = max(worst[k], weight * cost)


@inlined
def _drive(
    steering: Steering,
    direction: float,
    speed: float,
    free: float,
    spacing: float,
    place: tuple[float, float, float],
    around: Surroundings,
    path: Floats,
    begin: int,
    end: int,
) -> tuple[float, float, float, int]:
    """Holds a velocity from time `begin` to before `end`; returns the last pose, and after how many times it is at the goal."""
    px, py, theta = place
    left = free
    for n in range(begin, end):
        px, py, theta, way = go_on(steering, direction, speed, left, spacing, px, py, theta)
        left -= way
        path[n, 0], path[n, 1] = px, py
        dx, dy = px - around.goal[0], py - around.goal[1]
        if dx * dx + dy * dy <= around.goal_radius * around.goal_radius:
            return px, py, theta, n + 1
    return px, py, theta, end


@inlined
def _follow_way(
    steering: Steering,
    speed: float,
    free: float,
    spacing: float,
    place: tuple[float, float, float],
    around: Surroundings,
    path: Floats,
    begin: int,
    end: int,
) -> int:
    """Goes from node to node of the way, `free` at most up to the first; after how many times it is at the goal, or `end`."""
    px, py, theta = place
    nodes, node = around.nodes, 0
    for n in range(begin, end):
        gap = math.hypot(nodes[node, 0] - px, nodes[node, 1] - py)
        while gap <= speed * spacing and node < len(nodes) - 1:
            node += 1
            gap = math.hypot(nodes[node, 0] - px, nodes[node, 1] - py)
        left = free if node == 0 else math.inf
        if node == len(nodes) - 1:
            left = min(left, gap)
        direction = math.atan2(nodes[node, 1] - py, nodes[node, 0] - px)
        px, py, theta, way = go_on(steering, direction, speed, left, spacing, px, py, theta)
        free -= way
        path[n, 0], path[n, 1] = px, py
        dx, dy = px - around.goal[0], py - around.goal[1]
        if dx * dx + dy * dy <= around.goal_radius * around.goal_radius:
            return n + 1
    return end


@inlined
def _is_blocked(around: Surroundings, x: float, y: float) -> bool:
    """Whether the cell of a place is blocked; there are none beyond the map."""
    row, column = math.floor((y - around.corner[1]) / around.size), math.floor((x - around.corner[0]) / around.size)
    rows, columns = around.blocked.shape
    return bool(0 <= row < rows and 0 <= column < columns and around.blocked[row, column] != 0)


@kernel
def _judge(
    steering: Steering,
    pose: tuple[float, float, float],
    radius: float,
    first: Velocities,
    backs: bool,
    held: int,
    second: Velocities,
    around: Surroundings,
    futures: Futures,
    margin: float,
    spacing: float,
    scratch: tuple[Floats, Floats, Floats, Floats, Floats, Floats],
    result: Sequences,
) -> None:
    before, worst, path, fade, near_x, near_y = scratch
    backward = Steering(True, steering.max_turn_rate, steering.turn_gain, steering.turn_in_place)
    directions, speeds, free = first
    times = fade.size
    for i in range(directions.size):
        before[:] = 0.0
        steered = backward if backs and i == directions.size - 1 else steering
        px, py, theta, stop = _drive(steered, directions[i], speeds[i], free[i], spacing, pose, around, path, 0, held)
        _count_hits(futures, path, 0, stop, radius, margin, fade, before)
        is_there = stop < held
        count = 0
        if not is_there:
            reach = spacing * (times - held) * second.speeds[0] + around.radius
            for p in range(around.x.size):
                dx, dy = around.x[p] - px, around.y[p] - py
                if dx * dx + dy * dy < reach * reach:
                    near_x[count], near_y[count] = dx, dy
                    count += 1
        dx, dy = around.nodes[0, 0] - px, around.nodes[0, 1] - py
        toward, gap = math.atan2(dy, dx), math.hypot(dx, dy)
        along = second.directions.size
        for j in range(along + 1):
            for k in range(worst.size):
                worst[k] = before[k]
            end = stop
            if not is_there:
                place = px, py, theta
                if j == along:
                    room = free_distance(near_x[:count], near_y[:count], toward, around.radius, gap)
                    room = math.inf if room >= gap else room  # from node to node the way is open
                    end = _follow_way(steering, second.speeds[0], room, spacing, place, around, path, held, times)
                else:
                    direction, room = toward + second.directions[j], 0.0
                    if second.speeds[j] > 0.0:
                        room = free_distance(near_x[:count], near_y[:count], direction, around.radius, second.free[j])
                    _, _, _, end = _drive(
                        steering, direction, second.speeds[j], room, spacing, place, around, path, held, times
                    )
                _count_hits(futures, path, held, end, radius, margin, fade, worst)
            result.risk[i, j] = worst.sum() / worst.size
            result.early[i, j] = spacing * (times - end)
            n = end - 1
            while n >= 0 and _is_blocked(around, path[n, 0], path[n, 1]):
                n -= 1
            ex, ey = (path[n, 0], path[n, 1]) if n >= 0 else (pose[0], pose[1])
            result.end[i, j, 0], result.end[i, j, 1] = ex, ey
