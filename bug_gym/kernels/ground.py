"""Weighted regions of the ground: what a place costs, and the samples that a robot sees of it.

`regions` holds one after another, for each region: its factor, the centre and the radius of a disc that holds it, the
number of its edges, and their ends x1, y1, x2, y2. One without edges is that disc.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.geometry import TWO_PI, sin_cos
from bug_gym.kernels.layout import TERRAIN_HEADINGS, TERRAIN_RINGS, TERRAIN_STEP, Floats, Ranges, Record

REGION_HEAD = 5  # numbers before the edges


@inlined
def _samples_before(distance: float) -> np.int64:
    """Bits of the samples at 0, TERRAIN_STEP ... TERRAIN_RINGS * TERRAIN_STEP that are nearer than a distance."""
    count = min(max(math.ceil(distance / TERRAIN_STEP), 0), TERRAIN_RINGS + 1)
    return (np.int64(1) << np.int64(count)) - np.int64(1)


@called
def samples_inside(regions: Floats, at: int, x: float, y: float, cos: float, sin: float) -> np.int64:
    """Bits of the samples along a ray from (x, y) that lie in the region at `regions[at]`; bit 0 is (x, y) itself.

    A point is inside where an odd number of edges crosses the ray beyond it. An end on the ray counts as below it.
    """
    edges = int(regions[at + 4])
    if edges == 0:
        dx, dy, radius = regions[at + 1] - x, regions[at + 2] - y, regions[at + 3]
        along, height = cos * dx + sin * dy, cos * dy - sin * dx
        square = radius * radius - height * height
        half = math.sqrt(max(square, 0.0))
        return _samples_before(along + half) ^ _samples_before(along - half)
    inside = np.int64(0)
    for edge in range(edges):
        first = at + REGION_HEAD + 4 * edge
        ax, ay = regions[first] - x, regions[first + 1] - y
        bx, by = regions[first + 2] - x, regions[first + 3] - y
        a, b = cos * ay - sin * ax, cos * by - sin * bx
        if (a > 0.0) != (b > 0.0):
            near, far = cos * ax + sin * ay, cos * bx + sin * by
            inside ^= _samples_before(near + a / (a - b) * (far - near))
    return inside


@inlined
def factor_at(s: Record, regions: Floats, x: float, y: float) -> float:
    """The largest factor of the regions that hold a point, 1 where none does."""
    factor, at = 1.0, 0
    for _ in range(s.regions):
        dx, dy, radius = regions[at + 1] - x, regions[at + 2] - y, regions[at + 3]
        is_near = regions[at] > factor and dx * dx + dy * dy <= radius * radius
        if is_near and samples_inside(regions, at, x, y, 1.0, 0.0) & 1:
            factor = regions[at]
        at += REGION_HEAD + 4 * int(regions[at + 4])
    return factor


@inlined
def sample_ground(s: Record, regions: Floats, ground: Ranges, x: float, y: float, heading: float) -> None:
    """Fill `ground` (TERRAIN_HEADINGS * TERRAIN_RINGS,) with the factors about a pose, ring by ring in each heading."""
    ground[:] = 1.0
    at = 0
    for _ in range(s.regions):
        factor = np.float32(regions[at])
        dx, dy, reach = regions[at + 1] - x, regions[at + 2] - y, regions[at + 3] + TERRAIN_RINGS * TERRAIN_STEP
        if dx * dx + dy * dy < reach * reach:
            for i in range(TERRAIN_HEADINGS):
                sin, cos = sin_cos(heading + i * (TWO_PI / TERRAIN_HEADINGS))
                inside = samples_inside(regions, at, x, y, cos, sin) >> 1
                for j in range(TERRAIN_RINGS):
                    if inside >> j & 1:
                        ground[TERRAIN_RINGS * i + j] = max(ground[TERRAIN_RINGS * i + j], factor)
        at += REGION_HEAD + 4 * int(regions[at + 4])
