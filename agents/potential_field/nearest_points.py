"""The point of each obstacle in sight that is nearest to the robot: what the potential field takes for obstacles."""

from __future__ import annotations

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Floats


@inlined
def are_near(px: Floats, py: Floats, i: int, j: int, gap: float) -> bool:
    """Whether two points are at most `gap` [m] apart."""
    dx, dy = px[i] - px[j], py[i] - py[j]
    return bool(dx * dx + dy * dy <= gap * gap)


@kernel
def find_nearest_points(px: Floats, py: Floats, reach: float, gap: float, found: Floats) -> int:
    """The nearest point of each cluster of a scan, into `found` (n, 2) [m].

    Neighbours in the scan that are within reach and at most `gap` apart belong to one cluster; the last and the first
    too.

    Args:
        px: points' x (k,) in the robot's frame, in the order of the beams [m].
        py: points' y (k,) [m].
        reach: points farther away do not count [m].
        gap: distance between neighbours at which another cluster begins [m].
        found: result (n, 2), the first n clusters.

    Returns:
        How many there are.
    """
    count, last = 0, -1
    for i in range(px.size):
        square = px[i] * px[i] + py[i] * py[i]
        if square > reach * reach:
            continue
        is_next = last >= 0 and last == i - 1 and are_near(px, py, last, i, gap)
        last = i
        if is_next:
            x, y = found[count - 1, 0], found[count - 1, 1]
            if square < x * x + y * y:
                found[count - 1, 0], found[count - 1, 1] = px[i], py[i]
        elif count < found.shape[0]:
            found[count, 0], found[count, 1] = px[i], py[i]
            count += 1
    begins_first = px.size > 0 and px[0] * px[0] + py[0] * py[0] <= reach * reach
    if count > 1 and last == px.size - 1 and begins_first and are_near(px, py, last, 0, gap):
        first = found[0, 0] * found[0, 0] + found[0, 1] * found[0, 1]
        other = found[count - 1, 0] * found[count - 1, 0] + found[count - 1, 1] * found[count - 1, 1]
        if other < first:
            found[0, 0], found[0, 1] = found[count - 1, 0], found[count - 1, 1]
        count -= 1
    return count
