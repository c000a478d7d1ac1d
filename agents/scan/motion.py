"""Whether something has moved between two scans: a lap round a boundary proves something only among still obstacles.

A surface that one scan sees where the other one looked through free space was not there, or is there no longer. A
beam of the other one must have passed through it: a post between two beams, and a wall seen edge on, are still. The
scans are compared over a time in which a slow mover leaves the noise behind.

The kernels here call nothing of bug_gym.kernels; only the decorator comes from there.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import kernel
from bug_gym.kernels.layout import Floats
from bug_gym.view import View

STILL = 0.05
"""How far from a surface, beyond the noise, a point must be to be of something else [m]."""

LINKED = 0.5
"""How far apart two neighbouring points of one surface may be [m]."""


def has_moved(before: View, now: View, reach: float) -> bool:
    """Whether something within a reach [m] of the robot, then or now, has moved between two observations."""
    return _sees_new(before, now, reach) or _sees_new(now, before, reach)


def _sees_new(empty: View, view: View, reach: float) -> bool:
    """Whether a view sees something within a reach [m] where another one looked through free space."""
    sensors = view.sensors
    if len(sensors.angles) < 2:
        return False
    cos, sin = sensors.beam_directions
    dx, dy = empty.to_robot(*view.position)
    tolerance = STILL + 3.0 * sensors.range_noise
    pose = dx, dy, view.heading - empty.heading
    angles = float(sensors.angles[0]), float(sensors.angles[1] - sensors.angles[0])
    limits = min(reach, sensors.range), sensors.range, tolerance
    earlier = empty.ranges
    if sensors.dropout > 0.0:  # a beam without a return may have been lost, and shows no free space
        earlier = np.where(earlier >= sensors.range, 0.0, earlier)
    return bool(has_new_surface(view.ranges, earlier, cos, sin, *pose, *angles, *limits))


@kernel
def has_new_surface(
    ranges: Floats,
    earlier: Floats,
    cos: Floats,
    sin: Floats,
    dx: float,
    dy: float,
    turn: float,
    first_angle: float,
    spacing: float,
    reach: float,
    limit: float,
    tolerance: float,
) -> bool:
    """Whether a scan shows a surface where the beams of another one passed.

    Args:
        ranges: the scan (B,) [m].
        earlier: the other one (B,) [m].
        cos: directions of the beams (B,).
        sin: the same.
        dx: where the scanner stands, in the frame of the other scan [m].
        dy: the same [m].
        turn: its heading there [rad].
        first_angle: of beam 0 [rad].
        spacing: between two beams [rad].
        reach: points farther away from the scanner do not count [m].
        limit: range that means "nothing seen" [m].
        tolerance: how near points of one surface lie in two scans [m].
    """
    beams = len(ranges)
    is_round = beams * spacing > 2.0 * math.pi - 1e-6
    turn_cos, turn_sin = math.cos(turn), math.sin(turn)
    x_before, y_before, origin, low, high, is_run = 0.0, 0.0, 0.0, 0.0, 0.0, False
    for number in range(2 * beams if is_round else beams):  # a surface may begin before beam 0
        if number >= beams and not is_run:
            return False  # from here on as in the first round
        beam = number % beams
        was_run, is_run = is_run, False
        if ranges[beam] >= reach:
            continue
        ahead, aside = ranges[beam] * cos[beam], ranges[beam] * sin[beam]
        x, y = dx + turn_cos * ahead - turn_sin * aside, dy + turn_sin * ahead + turn_cos * aside
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        if distance + tolerance >= free_way(earlier, bearing, first_angle, spacing, is_round):
            continue
        if surface_distance(earlier, cos, sin, limit, x, y) <= tolerance:
            continue
        is_run = True
        if not was_run or math.hypot(x - x_before, y - y_before) > LINKED:
            origin, low, high = bearing, 0.0, 0.0
        offset = (bearing - origin + math.pi) % (2.0 * math.pi) - math.pi
        low, high = min(low, offset), max(high, offset)
        if (high - low - spacing) * distance > tolerance:
            return True
        x_before, y_before = x, y
    return False


@kernel
def free_way(ranges: Floats, bearing: float, first_angle: float, spacing: float, is_round: bool) -> float:
    """How far both beams beside a bearing [rad] went [m]; 0 outside the field of view."""
    beams = len(ranges)
    number = int(math.floor(((bearing - first_angle) % (2.0 * math.pi)) / spacing))
    if not is_round and number >= beams - 1:
        return 0.0
    return float(min(ranges[number % beams], ranges[(number + 1) % beams]))


@kernel
def surface_distance(ranges: Floats, cos: Floats, sin: Floats, limit: float, x: float, y: float) -> float:
    """Distance from a place to the nearest surface that a scan shows [m]; neighbouring points are linked."""
    beams = len(ranges)
    nearest = math.inf
    for beam in range(beams):
        if ranges[beam] >= limit:
            continue
        after = (beam + 1) % beams
        ax, ay = ranges[beam] * cos[beam], ranges[beam] * sin[beam]
        ex, ey = ranges[after] * cos[after] - ax, ranges[after] * sin[after] - ay
        square = ex * ex + ey * ey
        share = 0.0
        if ranges[after] < limit and 0.0 < square <= LINKED * LINKED:
            share = min(max(((x - ax) * ex + (y - ay) * ey) / square, 0.0), 1.0)
        nearest = min(nearest, math.hypot(x - ax - share * ex, y - ay - share * ey))
    return nearest
