"""How far a disc can go among the points of a scan.

For policies: `px`, `py` (k,) are the scan's points in the robot's frame. Nothing here sees the world.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Floats, Integers, Ranges


@kernel
def scan_points(ranges: Floats, directions: Floats, reach: float, points: Floats) -> int:
    """The points (2, B) of a scan in the robot's frame [m], those of beams that saw something; how many there are.

    Args:
        ranges: (B,) [m].
        directions: of the beams (2, B), unit vectors.
        reach: range that means "nothing seen" [m].
        points: (2, B) room for them.
    """
    count = 0
    for beam in range(ranges.size):
        if ranges[beam] < reach:
            points[0, count], points[1, count] = directions[0, beam] * ranges[beam], directions[1, beam] * ranges[beam]
            count += 1
    return count


@kernel
def bridged_points(
    ranges: Floats, directions: Floats, reach: float, width: float, is_round: bool, points: Floats
) -> int:
    """The same of a scanner that loses beams: one between two points that are nearer than `width` [m] met what they met.

    Nothing so wide passes between the two. It is taken to be as near as the nearer one.

    Args:
        ranges, directions, reach, points: see `scan_points`.
        width: of the body [m].
        is_round: whether the last beam is the first one's neighbour.
    """
    count, beams = 0, ranges.size
    for beam in range(beams):
        way = ranges[beam]
        if way >= reach and (is_round or 0 < beam < beams - 1):
            one, other = (beam + beams - 1) % beams, (beam + 1) % beams
            dx = directions[0, one] * ranges[one] - directions[0, other] * ranges[other]
            dy = directions[1, one] * ranges[one] - directions[1, other] * ranges[other]
            if max(ranges[one], ranges[other]) < reach and dx * dx + dy * dy < width * width:
                way = min(ranges[one], ranges[other])
        if way < reach:
            points[0, count], points[1, count] = directions[0, beam] * way, directions[1, beam] * way
            count += 1
    return count


@called
def found_points(ranges: Floats, directions: Floats, reach: float, width: float, is_round: bool, points: Floats) -> int:
    """`bridged_points` of a scanner that loses beams, `scan_points` of one that does not, whose `width` is 0."""
    if width > 0.0:
        return bridged_points(ranges, directions, reach, width, is_round, points)
    return scan_points(ranges, directions, reach, points)


@kernel
def read_scans(
    rows: Ranges,
    begin: int,
    directions: Floats,
    reach: float,
    width: float,
    is_round: bool,
    disc: float,
    ranges: Floats,
    points: Floats,
    ahead: Floats,
    counts: Integers,
) -> bool:
    """Read the scans of k robots; False: a number of theirs is not finite.

    Args:
        rows: their observations (k, D).
        begin: where the ranges begin in them.
        directions, reach, width, is_round: see `found_points`.
        disc: radius of the one that goes straight ahead [m].
        ranges: (k, B), filled [m].
        points: (k, 2, B) room for their points.
        ahead: (k,), filled: how far the disc can go [m].
        counts: (k,), filled: how many points there are.
    """
    is_finite = True
    for row in range(rows.shape[0]):
        for column in range(rows.shape[1]):
            is_finite &= math.isfinite(rows[row, column])
        for beam in range(ranges.shape[1]):
            ranges[row, beam] = rows[row, begin + beam]
        count = found_points(ranges[row], directions, reach, width, is_round, points[row])
        counts[row] = count
        ahead[row] = free_distance(points[row, 0, :count], points[row, 1, :count], 0.0, disc, reach)
    return is_finite


@kernel
def nearest_point(px: Floats, py: Floats, x: float, y: float) -> int:
    """Number of the scan point nearest to a place [m], the first one of several; -1: there is no point."""
    nearest, least = -1, math.inf
    for i in range(px.size):
        dx, dy = px[i] - x, py[i] - y
        square = dx * dx + dy * dy
        if square < least:
            nearest, least = i, square
    return nearest


@kernel
def nearest_within(px: Floats, py: Floats, cos: float, sin: float, least_cos: float) -> int:
    """Number of the nearest of the scan points that lie near a direction (cos, sin), the first one of several; -1: none does.

    Near: the angle between has a cosine of at least `least_cos`, which takes no arc tangent.
    """
    nearest, least = -1, math.inf
    for i in range(px.size):
        square = px[i] * px[i] + py[i] * py[i]
        if square < least and px[i] * cos + py[i] * sin >= least_cos * math.sqrt(square):
            nearest, least = i, square
    return nearest


@inlined
def way_to_point(along: float, beside: float, radius: float) -> float:
    """How far a disc goes until it touches a point, so far ahead and so far to the side [m]; infinite: it passes."""
    room = radius * radius - beside * beside
    if along <= 0.0 or room <= 0.0:
        return math.inf
    return max(along - math.sqrt(room), 0.0)


@called
def first_contact(px: Floats, py: Floats, angle: float, radius: float, reach: float) -> tuple[float, int]:
    """`free_distance` along `angle`, and the number of the scan point that the disc touches there, -1 for none."""
    cos, sin = math.cos(angle), math.sin(angle)
    free, contact = reach, -1
    for i in range(px.size):
        way = way_to_point(px[i] * cos + py[i] * sin, py[i] * cos - px[i] * sin, radius)
        if way < free:
            free, contact = way, i
    return free, contact


@kernel
def free_distance(px: Floats, py: Floats, angle: float, radius: float, reach: float) -> float:
    """How far a disc of `radius` can travel along `angle` before it touches a scan point, at most `reach` [m].

    Points beside or behind the disc's centre never block, so a robot nearer to a wall than `radius` can leave it.
    """
    free, _contact = first_contact(px, py, angle, radius, reach)
    return free


@kernel
def free_distances(px: Floats, py: Floats, angles: Floats, radius: float, reach: float, result: Floats) -> None:
    """`free_distance` for each of `angles` (m,), into `result` (m,)."""
    for j in range(angles.size):
        result[j] = free_distance(px, py, angles[j], radius, reach)
