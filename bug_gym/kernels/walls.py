"""Where the walls of a row are. Rings have each of their corners once: wall w begins at corner w."""

from __future__ import annotations

from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Floats, Integers, Record


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
