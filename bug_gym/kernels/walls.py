"""Where the walls of a row are. Rings have each of their corners once: wall w begins at corner w."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Floats, Integers, Record

TOUCH = 1e-9  # [m] an origin this near to a wall stands in it


class Room(NamedTuple):
    """A rectangular border with sides along the axes, seen from a point: how far each side is [m]."""

    east: float
    west: float
    north: float
    south: float
    nearest: float
    """Of the four."""
    holds: bool
    """Whether there is one and the point lies in it, else the numbers mean nothing."""


@inlined
def wall_between(f: Floats, s: Record, w: int, after: int) -> tuple[float, float, float, float]:
    """Both ends of wall w, x1, y1, x2, y2 [m], where wall `after` begins at its end."""
    begin, end = s.corner + 2 * w, s.corner + 2 * after
    return f[begin], f[begin + 1], f[end], f[end + 1]


@inlined
def wall_ends(f: Floats, k: Integers, s: Record, w: int) -> tuple[float, float, float, float]:
    """Both ends of wall w, x1, y1, x2, y2 [m], in the frame in which it is kept."""
    return wall_between(f, s, w, k[s.wall_next + w])


@inlined
def next_wall(k: Integers, s: Record, w: int, first: int, total: int, is_ring: bool) -> int:
    """The wall that begins where wall w of `first` ... `first + total - 1` ends; those of a single ring need no look-up."""
    if not is_ring:
        after: int = k[s.wall_next + w]
        return after
    return w + 1 if w + 1 < first + total else first


@inlined
def is_one_ring(k: Integers, s: Record, first: int, total: int) -> bool:
    """Whether a range of walls is a single ring: its last wall leads to its first corner."""
    return bool(k[s.wall_next + first + total - 1] == first)


@called
def after_ring(k: Integers, s: Record, first: int) -> int:
    """The number after that of the last wall of the ring that wall `first` begins."""
    w = first
    while k[s.wall_next + w] != first:
        w += 1
    return w + 1


@inlined
def room_about(f: Floats, k: Integers, s: Record, x: float, y: float) -> Room:
    """The border as a room about (x, y), if it is one."""
    if k[s.border_walls] != 4:
        return Room(0.0, 0.0, 0.0, 0.0, 0.0, False)
    corner = np.uint64(s.corner + 2 * k[s.border_first])
    west, south, east, north = f[corner], f[corner + np.uint64(1)], f[corner + np.uint64(4)], f[corner + np.uint64(5)]
    is_level = f[corner + np.uint64(3)] == south and f[corner + np.uint64(7)] == north
    is_upright = f[corner + np.uint64(2)] == east and f[corner + np.uint64(6)] == west
    to_east, to_west, to_north, to_south = east - x, x - west, north - y, y - south
    nearest = min(min(to_east, to_west), min(to_north, to_south))
    return Room(to_east, to_west, to_north, to_south, nearest, is_level and is_upright and nearest > TOUCH)
