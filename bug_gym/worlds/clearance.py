"""Where there is room: distances to obstacles, and tests whether a disc fits."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bug_gym.geometry import F64, following
from bug_gym.worlds.layout import Mover, Rings

Free = Callable[[float, float], bool]
"""Whether there is room at x, y [m]."""
Clear = Callable[[float], Free]
"""That test for discs of a radius [m]."""


class _Outlines:
    """All rings (k, 2) of a world as one list of sides, which is asked again and again."""

    def __init__(self, rings: Sequence[F64]) -> None:
        begin = np.concatenate(rings)
        end = np.concatenate([following(ring) for ring in rings])
        self.x, self.y = begin[:, 0].copy(), begin[:, 1].copy()
        self.along_x, self.along_y = (end - begin).T.copy()
        self.squared = np.maximum(self.along_x * self.along_x + self.along_y * self.along_y, 1e-300)
        self.after = end[:, 1].copy()
        self.count = len(rings)
        self.ring = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])

    def distance(self, x: float, y: float) -> float:
        """To the nearest side [m]."""
        share = ((x - self.x) * self.along_x + (y - self.y) * self.along_y) / self.squared
        share = np.minimum(np.maximum(share, 0.0), 1.0)
        return float(np.hypot(self.x + share * self.along_x - x, self.y + share * self.along_y - y).min())

    def around(self, x: float, y: float) -> NDArray[np.bool_]:
        """Which rings (n,) have a point inside them (even-odd rule)."""
        at = np.flatnonzero((self.y > y) != (self.after > y))
        right = at[x < self.x[at] + (y - self.y[at]) * self.along_x[at] / self.along_y[at]]
        crossed: NDArray[np.bool_] = np.bincount(self.ring[right], minlength=self.count) % 2 == 1
        return crossed


def clearance(circles: F64, rings: Sequence[F64], x: float, y: float) -> float:
    """Distance from a point to the nearest circle or ring edge [m], negative inside a circle."""
    nearest = math.inf
    if len(circles):
        nearest = float((np.hypot(circles[:, 0] - x, circles[:, 1] - y) - circles[:, 2]).min())
    return min(nearest, _Outlines(rings).distance(x, y)) if rings else nearest


def contains(ring: F64, x: float, y: float) -> bool:
    """Whether a point lies inside a ring (even-odd rule)."""
    return bool(_Outlines([ring]).around(x, y)[0])


def is_clear(circles: F64, polygons: Sequence[Rings], border: F64, room: float) -> Free:
    """A test whether a disc of radius `room` [m] fits at a point."""
    outlines = _Outlines([border, *(ring for polygon in polygons for ring in polygon)])
    shells = np.cumsum([1, *map(len, polygons)]).tolist()

    def free(x: float, y: float) -> bool:
        around = outlines.around(x, y)
        if not around[0]:
            return False
        if clearance(circles, (), x, y) < room or outlines.distance(x, y) < room:
            return False
        return not any(
            around[shell] and not around[shell + 1 : after].any() for shell, after in itertools.pairwise(shells)
        )

    return free


def clear_among(border: F64, polygons: Sequence[Rings]) -> Clear:
    """Tests whether discs fit at a point; holes count as filled, as a closed courtyard is no place to be."""
    return partial(is_clear, np.zeros((0, 3)), tuple(rings[:1] for rings in polygons), border)


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
