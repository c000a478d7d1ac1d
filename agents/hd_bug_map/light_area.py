"""What a scan lights up of the ground, and the edges of what it leaves dark.

Source: Hasibuzzaman, Jan and Wu, section 4.1, Procedure 2, and Table 1.
All coordinates are in the robot's frame [m].
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats

EDGE = 1e-6
"""Tolerance of the test for bearings [rad]."""


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
        self._trusts_blind = trusts_blind or _is_round(angles)

    def free(self, bearings: F64) -> F64:
        """How far the disc can go along each bearing (m,) [m], at most the sensor's range."""
        result = np.empty(len(bearings))
        kernels.free_distances(self.x, self.y, bearings, self.radius, self.sensor_range, result)
        if not self._trusts_blind:
            turned = (bearings - self.angles[0]) % (2.0 * math.pi)
            result[turned > float(self.angles[-1] - self.angles[0]) + EDGE] = 0.0
        return result

    def gaps(self, points: F64) -> F64:
        """Distance (m,) of each of the points (m, 2) from the nearest scan point that counts [m]; infinite without one."""
        result = np.empty(len(points))
        _gaps(self.x, self.y, points, result)
        return result

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
def _gaps(x: Floats, y: Floats, points: Floats, result: Floats) -> None:
    """Distance of each point from the nearest of the places x, y."""
    for i in range(len(points)):
        nearest = np.inf
        for k in range(len(x)):
            dx, dy = points[i, 0] - x[k], points[i, 1] - y[k]
            nearest = min(nearest, dx * dx + dy * dy)
        result[i] = math.sqrt(nearest)
