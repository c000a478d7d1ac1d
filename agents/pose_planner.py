"""Ways for a body that is longer than wide: places and headings, with the turns between them checked.

Source: the "optimal path planning with rotation scheme" of Jan, Chang and Parberry (2008), as section 3.1 of the HD-BUG
paper tells it: the body is several circles, it goes straight ahead to a neighbouring cell or turns on the spot to the next
heading, and a turn is looked at in between ("checkpoints"). There are sixteen headings instead of eight: to the eight
cells around and to those a knight's move away, so that no passage lies more than 13 degrees from one. The lattice begins
where the robot stands; the shortest way over it is Dijkstra's. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from .point_map import PointMap

F64 = NDArray[np.float64]
Pose = tuple[float, float, float]

STEPS = (
    (0, 1), (1, 2), (1, 1), (2, 1), (1, 0), (2, -1), (1, -1), (1, -2),
    (0, -1), (-1, -2), (-1, -1), (-2, -1), (-1, 0), (-2, 1), (-1, 1), (-1, 2),
)  # fmt: skip
"""Rows and columns that a body goes ahead in each heading, counter-clockwise."""

HEADINGS = len(STEPS)
ANGLES = tuple(math.atan2(rows, columns) % (2.0 * math.pi) for rows, columns in STEPS)
"""The headings [rad]."""

CHECKPOINTS = 6
"""Poses at which a turn of 45 degrees is looked at."""

TURN_COST = 0.3
"""What a turn of 45 degrees costs [m]."""


def find_poses(grid: PointMap, footprint: F64, pose: Pose, goal: tuple[float, float], goal_radius: float) -> F64 | None:
    """Poses (k, 3), x, y, heading, from the robot's to one within `goal_radius` of the goal; None where there are none.

    Straight runs are one pose at each end. The work grows with the ground known so far.

    Args:
        grid: remembered points; its clearance is the radius of the body's circles and a margin.
        footprint: (F, 3) the body as circles x, y, radius.
        pose: of the robot.
        goal: where to.
        goal_radius: how near is there [m].
    """
    rim = float(np.hypot(footprint[:, 0], footprint[:, 1]).max()) + 1.0
    low = np.minimum(np.minimum(grid.extent[:2], pose[:2]), goal) - rim
    high = np.maximum(np.maximum(grid.extent[2:], pose[:2]), goal) + rim
    before = np.ceil((np.array(pose[:2]) - low) / grid.cell).astype(int)
    after = np.ceil((high - np.array(pose[:2])) / grid.cell).astype(int)
    x = pose[0] + np.arange(-before[0], after[0] + 1) * grid.cell
    y = pose[1] + np.arange(-before[1], after[1] + 1) * grid.cell
    shape = len(y), len(x)
    layer = shape[0] * shape[1]
    number = np.arange(HEADINGS * layer).reshape(HEADINGS, *shape)
    free = np.stack([open_poses(grid, footprint, x, y, angle) for angle in ANGLES])
    begins, ends, costs = [], [], []
    for k, (rows, columns) in enumerate(STEPS):
        here = (slice(max(-rows, 0), shape[0] - max(rows, 0)), slice(max(-columns, 0), shape[1] - max(columns, 0)))
        there = (slice(max(rows, 0), shape[0] - max(-rows, 0)), slice(max(columns, 0), shape[1] - max(-columns, 0)))
        both = free[k][here] & free[k][there]
        if abs(rows) + abs(columns) == 3:
            half = ANGLES[k], 0.5 * columns * grid.cell, 0.5 * rows * grid.cell
            both &= open_poses(grid, footprint, x + half[1], y + half[2], half[0])[here]
        begins.append(number[k][here][both])
        ends.append(number[k][there][both])
        costs.append(np.full(len(begins[-1]), grid.cell * math.hypot(rows, columns)))
        can = free[k] & free[(k + 1) % HEADINGS]
        turn = turn_to(ANGLES[k], ANGLES[(k + 1) % HEADINGS])
        for share in np.arange(1, CHECKPOINTS) / CHECKPOINTS:
            can &= open_poses(grid, footprint, x, y, ANGLES[k] + share * turn)
        left, right = number[k][can], number[(k + 1) % HEADINGS][can]
        begins += [left, right]
        ends += [right, left]
        costs += [np.full(len(left), TURN_COST * turn / (0.25 * math.pi))] * 2
    start = HEADINGS * layer
    reachable = [k for k in range(HEADINGS) if can_turn(grid, footprint, pose, ANGLES[k])]
    begins.append(np.full(len(reachable), start))
    ends.append(number[reachable, before[1], before[0]])
    costs.append(np.array([abs(turn_to(pose[2], ANGLES[k])) + 1e-6 for k in reachable]) * TURN_COST / (0.25 * math.pi))
    graph = coo_array(
        (np.concatenate(costs), (np.concatenate(begins), np.concatenate(ends))), shape=(start + 1, start + 1)
    ).tocsr()
    length, previous = dijkstra(graph, indices=start, return_predecessors=True)
    near = np.hypot(x[None, :] - goal[0], y[:, None] - goal[1]) <= goal_radius
    targets = number[:, near].ravel()
    if len(targets) == 0 or not np.isfinite(length[targets]).any():
        return None
    node = int(targets[length[targets].argmin()])
    nodes = []
    while node != start:
        nodes.append(node)
        node = int(previous[node])
    turned, row, column = np.unravel_index(np.array(nodes[::-1], dtype=np.int64), (HEADINGS, *shape))
    poses = np.column_stack([x[column], y[row], np.array(ANGLES)[turned]])
    inner = np.ones(len(poses), dtype=np.bool_)
    # A pose in the middle of a straight run says nothing.
    inner[1:-1] = (poses[1:-1, 2] != poses[:-2, 2]) | (poses[1:-1, 2] != poses[2:, 2])
    return np.concatenate([np.array([pose]), poses[inner]])


def open_poses(grid: PointMap, footprint: F64, x: F64, y: F64, heading: float) -> NDArray[np.bool_]:
    """At which of the places x (C,), y (R,) the body has all centres of its circles in open cells: (R, C)."""
    rows, columns = grid.blocked.shape
    cos, sin = math.cos(heading), math.sin(heading)
    result = np.ones((len(y), len(x)), dtype=np.bool_)
    for ahead, left, _ in footprint.tolist():
        column = np.floor((x + cos * ahead - sin * left - grid.x) / grid.cell).astype(np.int64)
        row = np.floor((y + sin * ahead + cos * left - grid.y) / grid.cell).astype(np.int64)
        inside = ((row >= 0) & (row < rows))[:, None] & ((column >= 0) & (column < columns))[None, :]
        blocked = grid.blocked[np.clip(row, 0, rows - 1)[:, None], np.clip(column, 0, columns - 1)[None, :]]
        result &= ~inside | (blocked == 0)
    return result


def can_turn(grid: PointMap, footprint: F64, pose: Pose, heading: float) -> bool:
    """Whether the body can turn on the spot to a heading [rad], the shorter way round."""
    turn = turn_to(pose[2], heading)
    count = max(math.ceil(abs(turn) / (0.25 * math.pi) * CHECKPOINTS), 1)
    place = np.array([pose[0]]), np.array([pose[1]])
    return all(open_poses(grid, footprint, *place, pose[2] + turn * i / count)[0, 0] for i in range(1, count + 1))


def turn_to(heading: float, other: float) -> float:
    """The turn from one heading to another [rad], from -pi to pi."""
    return math.atan2(math.sin(other - heading), math.cos(other - heading))


def is_open(grid: PointMap, footprint: F64, poses: F64) -> bool:
    """Whether the straight runs between poses (k, 3) are open for the body."""
    for before, after in zip(poses[:-1], poses[1:], strict=True):
        length = math.dist(before[:2], after[:2])
        shares = np.linspace(0.0, 1.0, max(math.ceil(length / grid.cell), 1) + 1)
        for share in shares[1:]:
            place = before[:2] + share * (after[:2] - before[:2])
            if not open_poses(grid, footprint, place[:1], place[1:], float(after[2]))[0, 0]:
                return False
    return True
