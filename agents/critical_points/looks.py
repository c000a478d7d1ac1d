"""Compiled looks at things: which have shifted since they were looked at last, and how often in a row."""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Flags, Floats

NUMBER, TIME, PLACE_X, PLACE_Y, SHIFT_X, SHIFT_Y, SHIFTS = range(7)
"""Columns of a look: number of the thing, when it was [s], where the thing was then, odometry frame [m], its shift since the
look before [m], and 0 where it is in S, 1 in TD, 2 in D."""
LOOK = 7
THRESHOLD, INTERVAL, LEAST_LOOK, SAME_WAY = range(4)
"""What looks go by: shift above which a thing has moved [m], time between two looks, and the least one [s], and the cosine
of the angle by which two shifts of a thing that goes straight may differ."""


@kernel
def look_at_things(
    number: Floats,
    x: Floats,
    y: Floats,
    unseen: Floats,
    moves: Floats,
    time: float,
    rules: Floats,
    before: Floats,
    looks: Floats,
    is_dynamic: Flags,
) -> int:
    """Look at the things in sight for which it is time; returns how many are dynamic.

    Args:
        number, x, y, unseen, moves: of each thing (T,), places in the odometry frame [m], times since they were seen [s],
            and whether they take space that was seen free.
        time: now [s].
        rules: what looks go by (4,).
        before: things as they were looked at last (K, LOOK).
        looks: these things now (T, LOOK).
        is_dynamic: whether each is (T,), or longer.
    """
    count = 0
    for i in range(len(number)):
        look = looks[i]
        recall(number[i], time, x[i], y[i], before, look)
        if unseen[i] == 0.0 and is_due(look, time, x[i], y[i], rules):
            look_again(look, time, x[i], y[i], rules)
        # Twice shifted, and in space seen free before: the view of a long thing may shift too.
        is_dynamic[i] = look[SHIFTS] >= 2.0 and moves[i] > 0.0
        count += is_dynamic[i]
    return count


@inlined
def recall(number: float, time: float, x: float, y: float, before: Floats, look: Floats) -> None:
    """Write how a thing was looked at last; a new one is so now."""
    for k in range(len(before)):
        if before[k, NUMBER] == number:
            for column in range(LOOK):
                look[column] = before[k, column]
            return
    look[NUMBER], look[TIME], look[PLACE_X], look[PLACE_Y] = number, time, x, y
    look[SHIFT_X] = look[SHIFT_Y] = look[SHIFTS] = 0.0


@inlined
def is_due(look: Floats, time: float, x: float, y: float, rules: Floats) -> bool:
    """Whether it is time for the next look: after DOT, or earlier where a fast thing has shifted already."""
    passed = time - look[TIME] + 1e-6
    if passed >= rules[INTERVAL]:
        return True
    return bool(passed >= rules[LEAST_LOOK] and math.hypot(x - look[PLACE_X], y - look[PLACE_Y]) > rules[THRESHOLD])


@inlined
def look_again(look: Floats, time: float, x: float, y: float, rules: Floats) -> None:
    """Note a thing as it is after one more look."""
    dx, dy = x - look[PLACE_X], y - look[PLACE_Y]
    shift = math.hypot(dx, dy)
    shifts = 0.0
    if shift > rules[THRESHOLD]:
        along = dx * look[SHIFT_X] + dy * look[SHIFT_Y]
        is_same_way = along >= rules[SAME_WAY] * shift * math.hypot(look[SHIFT_X], look[SHIFT_Y])
        shifts = 2.0 if look[SHIFTS] > 0.0 and is_same_way else 1.0
    look[TIME], look[PLACE_X], look[PLACE_Y] = time, x, y
    look[SHIFT_X], look[SHIFT_Y], look[SHIFTS] = dx, dy, shifts
