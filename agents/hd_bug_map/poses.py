"""Ways for a body that is longer than wide: places and headings, with the turns between them checked.

Source: the "optimal path planning with rotation scheme" of Jan, Chang and Parberry (2008), as section 3.1 of the HD-BUG
paper tells it: the body is several circles, it goes straight ahead to a neighbouring cell or turns on the spot to the next
heading, and a turn is looked at in between ("checkpoints"). There are sixteen headings instead of eight: to the eight
cells around and to those a knight's move away, so that no passage lies more than 13 degrees from one. The lattice begins
where the robot stands; the shortest way over it is Dijkstra's. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.mapping.way import Way
from bug_gym.geometry import F64, velocity_along
from bug_gym.policy import Velocity
from bug_gym.view import View

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

ARRIVED, ALIGNED, ASTRAY = 0.03, math.radians(2.0), 0.05
"""How near to a pose [m, rad] is there, and how far beside the straight line to it [m] is lost."""

TURNING = 1e-6
"""A speed that only tells where to turn [m/s]."""


class Turns:
    """The poses that lead a long body through where it has to turn.

    Args:
        poses: (k, 3) x, y, heading, as `find_poses` gives them.
        grid: the points that they were planned among.
        planned_at: decision at which they were.
    """

    def __init__(self, poses: F64, grid: PointMap, planned_at: int) -> None:
        self.poses, self.grid, self.planned_at = poses, grid, planned_at

    @property
    def way(self) -> Way:
        """The places of the poses as a way."""
        lengths = np.hypot(*np.diff(self.poses[:, :2], axis=0).T)
        return Way(self.poses[:, :2].copy(), np.append(np.cumsum(lengths[::-1])[::-1], 0.0))

    def is_open(self, footprint: F64, pose: Pose) -> bool:
        """Whether the straight runs ahead of a pose are still open for the body."""
        return is_open(self.grid, footprint, np.concatenate([[pose], self.poses[1:]]))

    def lead_on(self, view: View, speed: float) -> Velocity | None:
        """Velocity toward the next pose, in the robot's frame [m/s]; None at the last one, or where it has gone astray.

        Args:
            view: what the robot sees now.
            speed: with which it goes ahead [m/s].
        """
        x, y, heading = view.pose
        while len(self.poses) > 1:
            gap, is_aligned = math.dist((x, y), self.poses[1, :2]), self._is_aligned(heading)
            if gap > ARRIVED or not is_aligned:
                break
            self.poses = self.poses[1:]
        if len(self.poses) < 2:
            return None
        along = float(self.poses[1, 2])
        bearing = along - heading
        if gap > ARRIVED and is_aligned:
            ahead, left = view.to_robot(*self.poses[1, :2].tolist())
            beside = math.cos(along) * (y - float(self.poses[0, 1])) - math.sin(along) * (x - float(self.poses[0, 0]))
            if ahead <= 0.0 or abs(beside) > ASTRAY:
                return None
            bearing = math.atan2(left, max(ahead, 4.0 * ARRIVED))
            speed = min(speed, ahead / view.sensors.drive.step)
        else:
            speed = TURNING
        return velocity_along(bearing, speed)

    def _is_aligned(self, heading: float) -> bool:
        """Whether a heading [rad] is that of the next pose."""
        return abs(turn_to(heading, float(self.poses[1, 2]))) <= ALIGNED


class Lattice(NamedTuple):
    """Places on a grid about the robot, at each heading of ANGLES."""

    x: F64
    """(C,) [m]."""
    y: F64
    """(R,) [m]."""
    number: NDArray[np.int64]
    """Number of each pose (H, R, C)."""
    free: NDArray[np.bool_]
    """Where the body fits (H, R, C)."""
    here: tuple[int, int]
    """Row and column of the robot's own place."""


Edges = tuple[NDArray[np.int64], NDArray[np.int64], F64]
"""Numbers of poses from and to, and what it costs to go [m]."""


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
    lattice = lattice_about(grid, footprint, pose, goal)
    edges: list[Edges] = []
    for k in range(HEADINGS):
        edges.append(drives(grid, footprint, lattice, k))
        edges += turns(grid, footprint, lattice, k)
    start = lattice.number.size
    edges.append(first_turns(grid, footprint, lattice, pose))
    begins, ends, costs = (np.concatenate(part) for part in zip(*edges, strict=True))
    graph = coo_array((costs, (begins, ends)), shape=(start + 1, start + 1)).tocsr()
    length, previous = dijkstra(graph, indices=start, return_predecessors=True)
    near = np.hypot(lattice.x[None, :] - goal[0], lattice.y[:, None] - goal[1]) <= goal_radius
    targets = lattice.number[:, near].ravel()
    if len(targets) == 0 or not np.isfinite(length[targets]).any():
        return None
    poses = poses_to(lattice, int(targets[length[targets].argmin()]), previous)
    return np.concatenate([np.array([pose]), poses])


def lattice_about(grid: PointMap, footprint: F64, pose: Pose, goal: tuple[float, float]) -> Lattice:
    """The poses over all that is known, the robot and the goal, and a rim about it; the robot stands on one."""
    rim = float(np.hypot(footprint[:, 0], footprint[:, 1]).max()) + 1.0
    low = np.minimum(np.minimum(grid.extent[:2], pose[:2]), goal) - rim
    high = np.maximum(np.maximum(grid.extent[2:], pose[:2]), goal) + rim
    before = np.ceil((np.array(pose[:2]) - low) / grid.cells.size).astype(int)
    after = np.ceil((high - np.array(pose[:2])) / grid.cells.size).astype(int)
    x = pose[0] + np.arange(-before[0], after[0] + 1) * grid.cells.size
    y = pose[1] + np.arange(-before[1], after[1] + 1) * grid.cells.size
    number = np.arange(HEADINGS * len(y) * len(x)).reshape(HEADINGS, len(y), len(x))
    free = np.stack([open_poses(grid, footprint, x, y, angle) for angle in ANGLES])
    return Lattice(x, y, number, free, (int(before[1]), int(before[0])))


def drives(grid: PointMap, footprint: F64, lattice: Lattice, k: int) -> Edges:
    """Steps ahead at heading k, where the body fits at both ends, and half-way of a long one."""
    x, y, number, free, _ = lattice
    shape, (rows, columns) = (len(y), len(x)), STEPS[k]
    here = (slice(max(-rows, 0), shape[0] - max(rows, 0)), slice(max(-columns, 0), shape[1] - max(columns, 0)))
    there = (slice(max(rows, 0), shape[0] - max(-rows, 0)), slice(max(columns, 0), shape[1] - max(-columns, 0)))
    both = free[k][here] & free[k][there]
    if abs(rows) + abs(columns) == 3:
        half = ANGLES[k], 0.5 * columns * grid.cells.size, 0.5 * rows * grid.cells.size
        both &= open_poses(grid, footprint, x + half[1], y + half[2], half[0])[here]
    begins = number[k][here][both]
    return begins, number[k][there][both], np.full(len(begins), grid.cells.size * math.hypot(rows, columns))


def turns(grid: PointMap, footprint: F64, lattice: Lattice, k: int) -> list[Edges]:
    """Turns on the spot from heading k to the next and back, where the body fits all the way."""
    x, y, number, free, _ = lattice
    following = (k + 1) % HEADINGS
    can = free[k] & free[following]
    turn = turn_to(ANGLES[k], ANGLES[following])
    for share in np.arange(1, CHECKPOINTS) / CHECKPOINTS:
        can &= open_poses(grid, footprint, x, y, ANGLES[k] + share * turn)
    left, right = number[k][can], number[following][can]
    cost = np.full(len(left), TURN_COST * turn / (0.25 * math.pi))
    return [(left, right, cost), (right, left, cost)]


def first_turns(grid: PointMap, footprint: F64, lattice: Lattice, pose: Pose) -> Edges:
    """Turns on the spot from the robot's own heading, whose pose has the number after the last."""
    reachable = [k for k in range(HEADINGS) if can_turn(grid, footprint, pose, ANGLES[k])]
    row, column = lattice.here
    costs = np.array([abs(turn_to(pose[2], ANGLES[k])) + 1e-6 for k in reachable]) * TURN_COST / (0.25 * math.pi)
    return np.full(len(reachable), lattice.number.size), lattice.number[reachable, row, column], costs


def poses_to(lattice: Lattice, node: int, previous: NDArray[np.int32]) -> F64:
    """Poses (k, 3) from the first one after the robot's own to a node, but for those amid a straight run."""
    nodes = []
    while node != lattice.number.size:
        nodes.append(node)
        node = int(previous[node])
    turned, row, column = np.unravel_index(np.array(nodes[::-1], dtype=np.int64), lattice.number.shape)
    poses = np.column_stack([lattice.x[column], lattice.y[row], np.array(ANGLES)[turned]])
    inner = np.ones(len(poses), dtype=np.bool_)
    inner[1:-1] = (poses[1:-1, 2] != poses[:-2, 2]) | (poses[1:-1, 2] != poses[2:, 2])
    return poses[inner]


def open_poses(grid: PointMap, footprint: F64, x: F64, y: F64, heading: float) -> NDArray[np.bool_]:
    """At which of the places x (C,), y (R,) the body has all centres of its circles in open cells: (R, C)."""
    rows, columns = grid.cells.blocked.shape
    cos, sin = math.cos(heading), math.sin(heading)
    result = np.ones((len(y), len(x)), dtype=np.bool_)
    for ahead, left, _ in footprint.tolist():
        column = np.floor((x + cos * ahead - sin * left - grid.cells.x) / grid.cells.size).astype(np.int64)
        row = np.floor((y + sin * ahead + cos * left - grid.cells.y) / grid.cells.size).astype(np.int64)
        inside = ((row >= 0) & (row < rows))[:, None] & ((column >= 0) & (column < columns))[None, :]
        blocked = grid.cells.blocked[np.clip(row, 0, rows - 1)[:, None], np.clip(column, 0, columns - 1)[None, :]]
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
        shares = np.linspace(0.0, 1.0, max(math.ceil(length / grid.cells.size), 1) + 1)
        for share in shares[1:]:
            place = before[:2] + share * (after[:2] - before[:2])
            if not open_poses(grid, footprint, place[:1], place[1:], float(after[2]))[0, 0]:
                return False
    return True
