"""A scan cut into pieces of one surface, their borders, and the runs of beams between them (TangentBug)."""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.free_way import first_contact
from bug_gym.kernels.layout import Floats, Integers


@inlined
def bend_of(px: Floats, py: Floats, slack: float, noise: float, g: int, h: int, i: int) -> tuple[float, float]:
    """By how much point i lies before the straight line through the points g and h, neighbours, in inverse ranges.

    On a line the inverse ranges of three neighbours have no second difference, and at a small angle to a wall the nearer
    two foretell the third badly.

    Returns:
        The bend [1/m], positive where i is nearer than the line; infinite where noise leaves it open whether that line is
        met at all. And how much of it `slack` [m] and three times what noise makes of the ranges account for.
    """
    ax, ay = px[h] - px[g], py[h] - py[g]
    u, v, w = 1.0 / math.hypot(px[g], py[g]), 1.0 / math.hypot(px[h], py[h]), 1.0 / math.hypot(px[i], py[i])
    foretold = (px[i] * ay - py[i] * ax) * w / (px[h] * ay - py[h] * ax)
    spread = u**4 + 4.0 * v**4
    if not foretold > 3.0 * noise * math.sqrt(spread):
        return math.inf, 0.0
    return w - foretold, slack * w * foretold + 3.0 * noise * math.sqrt(spread + w**4)


@inlined
def continues(px: Floats, py: Floats, gap: float, noise: float, g: int, h: int, i: int) -> bool:
    """Whether the wall through the scan points g and h, neighbours, goes on to the next one i.

    Their chords are in line within 15 degrees, and the second is not over two and a half times as long. Nor is i nearer
    to the robot than the line through g and h by more than `gap` [m] and three times what noise makes of the ranges: that
    is something behind the end of the wall. It may be farther away, for walls bend away. Where noise leaves it open
    whether the line is met at all, the wall ends.
    """
    ax, ay, bx, by = px[h] - px[g], py[h] - py[g], px[i] - px[h], py[i] - py[h]
    first, second = ax * ax + ay * ay, bx * bx + by * by
    along = ax * bx + ay * by
    if not (along > 0.0 and along * along > 0.933 * first * second and second < 6.25 * first):
        return False
    bend, error = bend_of(px, py, gap, noise, g, h, i)
    return bend <= error


@kernel
def find_pieces(px: Floats, py: Floats, gap: float, growth: float, noise: float, piece: Integers) -> None:
    """Scan points, in the order of their beams around the full circle, cut into pieces of wall that hang together.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        gap: neighbours not farther apart than this hang together [m].
        growth: nor those not farther apart than this share of their distance from the robot; beyond that only those
            in line with the points beside them: a wall that the beams meet at a small angle.
        noise: standard deviation of the ranges [m].
        piece: result (k,), number of each point's piece.
    """
    n = px.size
    first = -1  # the first point that does not hang together with the one before it
    for i in range(n):
        h = i - 1 if i > 0 else n - 1
        x, y = px[i] - px[h], py[i] - py[h]
        away = max(math.hypot(px[h], py[h]), math.hypot(px[i], py[i]))
        piece[i] = 0
        if x * x + y * y <= max(gap, growth * away) ** 2:
            continue
        g = h - 1 if h > 0 else n - 1
        j = i + 1 if i + 1 < n else 0
        if continues(px, py, gap, noise, g, h, i) or continues(px, py, gap, noise, j, i, h):
            continue
        piece[i] = 1
        first = i if first < 0 else first
    if first < 0:
        return
    number = -1
    for k in range(n):
        i = first + k if first + k < n else first + k - n
        number += piece[i]
        piece[i] = number


@inlined
def is_joined(px: Floats, py: Floats, piece: Integers, first: int, second: int, gap: float) -> bool:
    """Whether two contacts (-1: none) are of one obstacle: on one piece of wall, or too near for the disc to pass."""
    if first < 0 or second < 0:
        return False
    if piece[first] == piece[second]:
        return True
    x, y = px[first] - px[second], py[first] - py[second]
    return bool(x * x + y * y <= gap * gap)


@kernel
def last_heading(run_of: Integers, run: int, side: int) -> int:
    """The first heading of a run behind which, to its left (side +1) or right (-1), it does not go on; -1: all round.

    Args:
        run_of: number of the run that each heading belongs to (m,), counter-clockwise.
        run: its number.
        side: which way.
    """
    headings = run_of.size
    for heading in range(headings):
        if run_of[heading] == run and run_of[(heading + side + headings) % headings] != run:
            return heading
    return -1


@kernel
def find_border(
    px: Floats,
    py: Floats,
    piece: Integers,
    low: float,
    high: float,
    low_contact: int,
    high_contact: int,
    radius: float,
    reach: float,
    gap: float,
) -> tuple[bool, int, int]:
    """Where between two headings an obstacle ends, by bisection.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        piece: number of each point's piece of wall (k,).
        low: the one heading [rad].
        high: the other [rad].
        low_contact: number of the point that the one ends at.
        high_contact: number of the point that the other ends at.
        radius: of the disc [m].
        reach: free way that means "nothing" [m].
        gap: a distance between two points that the disc does not pass [m].

    Returns:
        Whether an obstacle ends there; the last contact on the side of `low`, and the first one on that of `high`.
    """
    for _ in range(10):
        if is_joined(px, py, piece, low_contact, high_contact, gap):
            return False, low_contact, high_contact
        middle = 0.5 * (low + high)
        _, contact = first_contact(px, py, middle, radius, reach)
        if contact == low_contact or is_joined(px, py, piece, low_contact, contact, gap):
            low, low_contact = middle, contact
        else:
            high, high_contact = middle, contact
    return True, low_contact, high_contact


@kernel
def find_runs(
    px: Floats,
    py: Floats,
    piece: Integers,
    angles: Floats,
    radius: float,
    reach: float,
    gap: float,
    free: Floats,
    contact: Integers,
    run: Integers,
) -> None:
    """The profile of free ways over a full circle of headings, cut into runs: neighbours that end at one obstacle.

    Args:
        px: points' x (k,) in the robot's frame [m].
        py: points' y (k,) [m].
        piece: number of each point's piece of wall (k,).
        angles: headings (m,), rising by equal angles around the full circle [rad].
        radius: of the disc [m].
        reach: free way that means "nothing" [m].
        gap: a distance between two points that the disc does not pass [m].
        free: result (m,), free way along each heading [m].
        contact: result (m,), number of the point touched there, -1 for none.
        run: result (m,), number of the run that each heading belongs to, -1 for none.
    """
    count = 0
    last = angles.size - 1
    for j in range(angles.size):
        free[j], contact[j] = first_contact(px, py, angles[j], radius, reach)
    for j in range(angles.size):
        run[j] = -1
        if contact[j] < 0:
            continue
        if j > 0 and contact[j - 1] >= 0:
            ends, _, _ = find_border(
                px, py, piece, angles[j - 1], angles[j], contact[j - 1], contact[j], radius, reach, gap
            )
            if not ends:
                run[j] = run[j - 1]
                continue
        run[j] = count
        count += 1
    if run[last] > run[0] >= 0:
        high = angles[last] + angles[1] - angles[0]
        ends, _, _ = find_border(px, py, piece, angles[last], high, contact[last], contact[0], radius, reach, gap)
        if not ends:
            number = run[last]
            for j in range(last, -1, -1):
                if run[j] != number:
                    break
                run[j] = run[0]
