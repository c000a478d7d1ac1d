"""Light and shadow areas of a scan, how far they are looked at, and the candidates that the scan itself offers.

Source: Hasibuzzaman, Jan and Wu, section 4.1, Procedures 2 and 3, and Table 1; the reading of them is told in policy.py.
All coordinates are in the robot's frame [m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.compiling import kernel
from bug_gym.geometry import F64, Point
from bug_gym.kernels.layout import Flags, Floats, Integers

EDGE = 1e-6
"""Tolerance of the tests for points [m]."""

DENSE, SPARSE = 0.4, 0.15
"""Above and below this share of short beams the surroundings count as dense and as sparse."""

DENSE_STEPS, SPARSE_STEPS = 3, 10
"""For how many steps in a row they must, so that the detection radius changes."""

RUNGS = 4
"""Detection radii: r, 2 r, 4 r and 8 r."""


@dataclass
class Ladder:
    """The detection radius r' = r 2^k and its two counters (Table 1)."""

    k: int = 2
    reductions: int = 0
    """count1: how often r' was reduced."""
    enlargements: int = 0
    """count2: how often it was enlarged."""
    dense: int = 0
    """Steps in a row with many short beams."""
    sparse: int = 0
    """Steps in a row with few."""

    def update(self, density: float) -> None:
        """Climb after three dense steps, descend after ten sparse ones; density: share of short beams."""
        self.dense = self.dense + 1 if density > DENSE else 0
        self.sparse = self.sparse + 1 if density < SPARSE else 0
        if self.dense >= DENSE_STEPS and self.k < RUNGS - 1:
            self.k, self.enlargements, self.dense = self.k + 1, self.enlargements + 1, 0
        elif self.sparse >= SPARSE_STEPS and self.k > 0:
            self.k, self.reductions, self.sparse = self.k - 1, self.reductions + 1, 0


def density(ranges: F64, reach: float) -> float:
    """Share of the beams (B,) that end within the detection radius [m], 0 to 1."""
    return float(np.count_nonzero(ranges < reach)) / len(ranges)


class LightArea:
    """The light and the shadow area of one scan.

    Args:
        angles: (B,) bearing of each beam [rad], rising; over the full circle or a field of view.
        ranges: (B,) [m].
        sensor_range: range that means "nothing seen" [m].
        radius: of the disc that is to go into the light [m].
        reach: detection radius r' [m].
        is_still: (B,) beams that count as obstacles here; None: all.
        trusts_blind: whether what lies outside the field of view counts as free: for a robot that turns before it goes.
    """

    def __init__(
        self,
        angles: F64,
        ranges: F64,
        sensor_range: float,
        radius: float,
        reach: float,
        is_still: NDArray[np.bool_] | None = None,
        *,
        trusts_blind: bool = True,
    ) -> None:
        self.angles, self.ranges, self.sensor_range = angles, ranges, sensor_range
        self.radius, self.reach = radius, min(reach, sensor_range)
        used = ranges < sensor_range
        if is_still is not None:
            used = used & is_still
        self.x: F64 = ranges[used] * np.cos(angles[used])
        """Scan points x (k,) and y (k,) that count."""
        self.y: F64 = ranges[used] * np.sin(angles[used])
        self._used = used
        self._trusts_blind = trusts_blind or _is_round(angles)

    def free(self, bearings: F64) -> F64:
        """How far the disc can go along each bearing (m,) [m], at most the sensor's range."""
        result = np.empty(len(bearings))
        kernels.free_distances(self.x, self.y, bearings, self.radius, self.sensor_range, result)
        if not self._trusts_blind:
            turned = (bearings - self.angles[0]) % (2.0 * math.pi)
            result[turned > float(self.angles[-1] - self.angles[0]) + EDGE] = 0.0
        return result

    def is_light(self, points: F64) -> NDArray[np.bool_]:
        """Which of the points (m, 2) the disc can go to straight, within the detection radius."""
        away = np.hypot(points[:, 0], points[:, 1])
        bearings = np.arctan2(points[:, 1], points[:, 0])
        near: NDArray[np.bool_] = away <= self.reach + EDGE
        return near & (away <= self.free(bearings) + EDGE)

    def is_shadow(self, points: F64) -> NDArray[np.bool_]:
        """Which of the points (m, 2) lie within the detection radius but behind what the beams about them hit."""
        away = np.hypot(points[:, 0], points[:, 1])
        bearings = np.arctan2(points[:, 1], points[:, 0])
        turn = 2.0 * math.pi
        after = np.searchsorted(self.angles, self.angles[0] + (bearings - self.angles[0]) % turn, side="right")
        beams = len(self.angles)
        seen = np.maximum(self.ranges[(after - 1) % beams], self.ranges[after % beams])
        behind: NDArray[np.bool_] = away > seen + EDGE
        return behind & (away <= self.reach)

    def gaps(self, points: F64) -> F64:
        """Distance (m,) of each of the points (m, 2) from the nearest scan point that counts [m]; infinite without one."""
        result = np.empty(len(points))
        _gaps(self.x, self.y, points, result)
        return result

    def candidates(
        self, grid: F64, bearings: F64, chosen: Point, goal: Point, ahead: Point, least: float, most: float
    ) -> F64:
        """Candidates (m, 2) in the light: places of a grid, vertices, centres, and what was chosen last.

        Args:
            grid: (K * J, 2) J places along each of K bearings, at equal distances up to the detection radius.
            bearings: (K,) [rad].
            chosen: last.
            goal: where to.
            ahead: direction of the half-plane that they are to lie in.
            least: no nearer than this, but for the grid [m].
            most: straight to the candidate and on to the goal, no longer than this [m].
        """
        others = np.concatenate([*self.vertices_and_centres(), [chosen]])
        count = len(grid) + len(others)
        points, away, toward, index = np.empty((count, 2)), np.empty(count), np.empty(count), np.empty(count, np.int64)
        of_grid, count, directions = _gather(
            grid, bearings, others, goal, ahead, least, most, self.reach, points, away, toward, index
        )
        limit = np.minimum(self.free(toward[:directions]), self.reach)[index[:count]]
        limit[of_grid:] += EDGE
        return points[:count][away[:count] <= limit]

    def vertices_and_centres(self) -> tuple[F64, F64]:
        """Vertex candidates (k, 2) beside the ends of clusters, and centre candidates (n, 2) of the gaps between them."""
        vertices, centres = np.empty((2 * len(self.angles), 2)), np.empty((len(self.angles), 2))
        k, n = _find_ends(self.angles, self.ranges, self._used, self.radius, vertices, centres)
        return vertices[:k], centres[:n]

    def light_ring(self) -> F64:
        """Outline (k, 2) of what the beams light up within the detection radius; k is B, or B + 1 with the robot's place."""
        ways = np.minimum(self.ranges, self.reach)
        ring = np.column_stack([ways * np.cos(self.angles), ways * np.sin(self.angles)])
        return ring if _is_round(self.angles) else np.concatenate([np.zeros((1, 2)), ring])

    def shadow_rings(self) -> list[F64]:
        """Outlines (k, 2) of the shadows, one for each run of beams that end within the detection radius."""
        dark = self.ranges < self.reach
        if not dark.any():
            return []
        beams = len(dark)
        is_round = _is_round(self.angles)
        # A run goes on past the last beam where the beams go all round; all round in the dark it is cut in two.
        first = int(np.argmin(dark)) if is_round and not dark.all() else 0
        order = (np.arange(beams) + first) % beams
        borders = np.flatnonzero(np.diff(np.concatenate([[False], dark[order], [False]]).astype(np.int8)))
        if is_round and dark.all() and beams > 1:
            borders = np.array([0, beams // 2, beams // 2, beams])
        half = 0.5 * (2.0 * math.pi / beams if beams < 2 else float(self.angles[1] - self.angles[0]))
        rings = []
        for begin, end in borders.reshape(-1, 2):
            run = order[begin:end]
            angles, ranges = self.angles[run], self.ranges[run]
            edges = np.concatenate([[angles[0] - half], angles, [angles[-1] + half]])
            near = np.concatenate([[ranges[0]], ranges, [ranges[-1]]])
            ring_in = np.column_stack([near * np.cos(edges), near * np.sin(edges)])
            ring_out = self.reach * np.column_stack([np.cos(edges), np.sin(edges)])
            rings.append(np.concatenate([ring_in, ring_out[::-1]]))
        return rings


@kernel
def _is_round(angles: Floats) -> bool:
    """Whether beams go all round."""
    beams = len(angles)
    spacing = 2.0 * math.pi if beams < 2 else angles[1] - angles[0]
    return bool(spacing * beams > 2.0 * math.pi - 0.5 * spacing)


@kernel
def _find_ends(
    angles: Floats, ranges: Floats, used: Flags, radius: float, vertices: Floats, centres: Floats
) -> tuple[int, int]:
    """Where neighbouring beams see different things: the places where a disc just passes, and the gaps' middles."""
    beams = len(angles)
    k = n = 0
    for i in range(beams if _is_round(angles) else beams - 1):
        j = (i + 1) % beams
        if not used[i] and not used[j]:
            continue
        if used[i] and used[j] and abs(ranges[i] - ranges[j]) <= 2.0 * radius:
            continue
        near, side = (i, 1.0) if used[i] and (not used[j] or ranges[i] < ranges[j]) else (j, -1.0)
        away = ranges[near]
        if away > radius:
            bearing = angles[near] + side * math.asin(radius / away)
            way = math.sqrt(away * away - radius * radius)
            vertices[k, 0], vertices[k, 1] = way * math.cos(bearing), way * math.sin(bearing)
            k += 1
        if used[i] and used[j]:
            ax, ay = ranges[i] * math.cos(angles[i]), ranges[i] * math.sin(angles[i])
            bx, by = ranges[j] * math.cos(angles[j]), ranges[j] * math.sin(angles[j])
            if (ax - bx) ** 2 + (ay - by) ** 2 >= 4.0 * radius * radius:
                centres[n, 0], centres[n, 1] = 0.5 * (ax + bx), 0.5 * (ay + by)
                n += 1
    return k, n


@kernel
def _gaps(x: Floats, y: Floats, points: Floats, result: Floats) -> None:
    """Distance of each point from the nearest of the places x, y."""
    for i in range(len(points)):
        nearest = np.inf
        for k in range(len(x)):
            dx, dy = points[i, 0] - x[k], points[i, 1] - y[k]
            nearest = min(nearest, dx * dx + dy * dy)
        result[i] = math.sqrt(nearest)


@kernel
def _gather(
    grid: Floats,
    bearings: Floats,
    others: Floats,
    goal: Point,
    ahead: Point,
    least: float,
    most: float,
    reach: float,
    points: Floats,
    away: Floats,
    toward: Floats,
    index: Integers,
) -> tuple[int, int, int]:
    """Gather the candidates ahead that are worth a look, in the light or not.

    Returns how many of `points` (with their distances `away`) are of the grid, how many there are, and how many bearings
    `toward` they have; `index` says which is whose.
    """
    (gx, gy), (ax, ay) = goal, ahead
    count = directions = 0
    rings = len(grid) // len(bearings)
    for i in range(len(grid)):
        x, y = grid[i, 0], grid[i, 1]
        distance = (i % rings + 1.0) / rings * reach
        if x * ax + y * ay <= 0.0 or math.hypot(x - gx, y - gy) > most - distance:
            continue
        bearing = bearings[i // rings]
        if directions == 0 or toward[directions - 1] != bearing:
            toward[directions] = bearing
            directions += 1
        points[count, 0], points[count, 1], away[count], index[count] = x, y, distance, directions - 1
        count += 1
    of_grid = count
    for i in range(len(others)):
        x, y = others[i, 0], others[i, 1]
        distance = math.hypot(x, y)
        if x * ax + y * ay <= 0.0 or distance <= least or distance + math.hypot(x - gx, y - gy) > most:
            continue
        toward[directions] = math.atan2(y, x)
        points[count, 0], points[count, 1], away[count], index[count] = x, y, distance, directions
        directions += 1
        count += 1
    return of_grid, count, directions
