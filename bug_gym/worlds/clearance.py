"""Where there is room: distances to obstacles, and tests whether a disc fits."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from bug_gym.geometry import F64
from bug_gym.worlds.layout import Mover, Rings

Free = Callable[[float, float], bool]


def clearance(circles: F64, rings: Sequence[F64], x: float, y: float) -> float:
    """Distance from a point to the nearest circle or ring edge [m], negative inside a circle."""
    nearest = math.inf
    if len(circles):
        nearest = float((np.hypot(circles[:, 0] - x, circles[:, 1] - y) - circles[:, 2]).min())
    point = np.array([x, y])
    for ring in rings:
        a, along = ring, np.roll(ring, -1, axis=0) - ring
        share = ((point - a) * along).sum(1) / np.maximum((along**2).sum(1), 1e-300)
        gaps = a + np.clip(share, 0.0, 1.0)[:, None] * along - point
        nearest = min(nearest, float(np.hypot(gaps[:, 0], gaps[:, 1]).min()))
    return nearest


def contains(ring: F64, x: float, y: float) -> bool:
    """Whether a point lies inside a ring (even-odd rule)."""
    x1, y1 = ring[:, 0], ring[:, 1]
    x2, y2 = np.roll(x1, -1), np.roll(y1, -1)
    straddles = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of sides that are not straddled
        crossing = x1 + (y - y1) * (x2 - x1) / (y2 - y1)
    return bool(np.count_nonzero(straddles & (x < crossing)) % 2)


def is_clear(circles: F64, polygons: Sequence[Rings], border: F64, room: float) -> Free:
    """A test whether a disc of radius `room` [m] fits at a point."""
    rings = [border, *(ring for polygon in polygons for ring in polygon)]

    def free(x: float, y: float) -> bool:
        if not contains(border, x, y) or clearance(circles, rings, x, y) < room:
            return False
        return not any(
            contains(polygon[0], x, y) and not any(contains(hole, x, y) for hole in polygon[1:]) for polygon in polygons
        )

    return free


def obstacles_of(circles: F64, polygons: tuple[Rings, ...], movers: Sequence[Mover]) -> tuple[F64, tuple[Rings, ...]]:
    """Still obstacles and movers that are there, where they begin, as circles (n, 3) and polygons."""
    movers = [mover for mover in movers if mover.is_there]
    round_ones = [(*mover.at, float(mover.outline)) for mover in movers if mover.is_circle]
    others = [(np.asarray(mover.outline) + mover.at,) for mover in movers if not mover.is_circle]
    return np.vstack([circles, np.array(round_ones).reshape(-1, 3)]), (*polygons, *others)


def share_of_box(radii: F64, box: tuple[float, float, float, float]) -> float:
    """Share of a box that discs of these radii (k,) [m] cover, 0 to 1 (overlaps count twice)."""
    xmin, ymin, xmax, ymax = box
    return float(np.pi * (radii**2).sum() / ((xmax - xmin) * (ymax - ymin)))
