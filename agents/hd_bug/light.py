"""Light and shadow: which ground a scan lights up for the robot's disc.

The light area of a place is a star: how far the disc can go along each of HEADINGS headings, and no farther than both
beams that bracket the heading saw, else few beams see through walls at small angles. What no light area of the list
holds is shadow.

Source: Hasibuzzaman, Jan and Wu, Procedure 2 (a beam that hits leaves shadow behind it, the end of one that doesn't is
light) and section 5 ("past navigated areas are stored in a double-linked list"). A point of a beam as "area" makes the
test of Procedure 3 meaningless; the star is the local safe region of Oriolo, Vendittelli, Freda and Troso's SRT method.
All coordinates are in the odometry frame [m], headings counter-clockwise from its x axis.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.free_way import free_distance
from bug_gym.kernels.layout import Flags, Floats, Integers

HEADINGS = 180
"""Headings along which a light area is measured."""

ANGLES: F64 = np.arange(HEADINGS, dtype=np.float64) * (2.0 * math.pi / HEADINGS)
"""These headings [rad]."""

SMOOTH = 4
"""Headings to either side along which a wall without a gap goes on."""

SLACK = 0.08
"""How far beyond a light area a place still counts as lit [m]: more closes real doors, less leaves doors to nowhere."""


@kernel
def fill_walls(
    px: Floats, py: Floats, piece: Integers, is_still: Flags, spacing: float, x: Floats, y: Floats, still: Flags
) -> int:
    """Points of the straight lines that join neighbouring scan points of one wall, after each of them.

    At a small angle to a wall the beams meet it so far apart that the disc seems to pass between two of them.

    Args:
        px: scan points (k,) in the order of their beams [m].
        py: the same.
        piece: (k,) number of each one's wall, see scan.pieces.
        is_still: (k,) whether it is of something still.
        spacing: largest distance between points of one wall [m].
        x: points (m,) [m]; is written, as far as there is room.
        y: the same.
        still: (m,) whether it is of something still; is written.

    Returns:
        How many there are.
    """
    count = 0
    for i in range(px.size):
        j = i + 1 if i + 1 < px.size else 0
        dx, dy = px[j] - px[i], py[j] - py[i]
        parts = 1
        if piece[i] == piece[j]:
            parts = max(int(math.ceil(math.hypot(dx, dy) / spacing)), 1)
        for k in range(min(parts, x.size - count)):
            x[count], y[count] = px[i] + k / parts * dx, py[i] + k / parts * dy
            still[count] = is_still[i] and (k == 0 or is_still[j])
            count += 1
    return count


@kernel
def measure_light(
    x: Floats, y: Floats, ranges: Floats, first: float, spacing: float, heading: float, radius: float, reach: float,
    light: Floats,
) -> None:  # fmt: skip
    """The light area (K,) of a scan, how far a disc can go along each heading [m].

    Args:
        x: points of walls (k,) in the robot's frame [m].
        y: the same.
        ranges: (B,) of all beams [m].
        first: bearing of the first beam [rad].
        spacing: angle between beams [rad].
        heading: of the robot [rad].
        radius: of the disc [m].
        reach: range that means "nothing seen" [m].
        light: is written.
    """
    beams, count = ranges.size, light.size
    is_round = spacing * beams > 2.0 * math.pi - 0.5 * spacing
    for k in range(count):
        bearing = 2.0 * math.pi * k / count - heading
        turned = (bearing - first) % (2.0 * math.pi) / spacing
        before = int(turned)
        if not is_round and before >= beams - 1:
            light[k] = 0.0
            continue
        before = before % beams
        seen = min(ranges[before], ranges[(before + 1) % beams])
        light[k] = min(free_distance(x, y, bearing, radius, reach), seen)


@kernel
def light_toward(light: Floats, angle: float, is_strict: bool) -> float:
    """How far a light area (K,) reaches toward an angle [rad]: by the farther of two headings, strictly the nearer."""
    count = light.size
    turned = angle / (2.0 * math.pi) * count % count
    before = int(turned) % count
    one, other = light[before], light[(before + 1) % count]
    return float(min(one, other) if is_strict else max(one, other))


@kernel
def are_lit(places: Floats, lights: Floats, farthest: Floats, points: Floats, slack: float, result: Flags) -> None:
    """Which of some points (m, 2) lie in light areas: set in `result` (m,).

    Args:
        places: of the light areas (n, 2) [m].
        lights: the light areas (n, K) [m].
        farthest: how far each reaches at most (n,) [m].
        points: (m, 2) [m].
        slack: how far beyond the light still counts [m].
        result: (m,) becomes True where it is light; the rest is left as it is.
    """
    for i in range(len(points)):
        for j in range(len(places) - 1, -1, -1):
            dx, dy = points[i, 0] - places[j, 0], points[i, 1] - places[j, 1]
            square = dx * dx + dy * dy
            if square > (farthest[j] + slack) ** 2:
                continue
            if math.sqrt(square) <= light_toward(lights[j], math.atan2(dy, dx), False) + slack:
                result[i] = True
                break


@kernel
def are_before_walls(places: Floats, lights: Floats, points: Floats, reach: float, slack: float, result: Flags) -> None:
    """Which of some points (m, 2) lie at most `slack` [m] behind where a light area ends at something.

    Args:
        places: of the light areas (n, 2) [m].
        lights: the light areas (n, K) [m].
        points: (m, 2) [m].
        reach: range that means "nothing seen" [m].
        slack: [m].
        result: (m,) becomes True where it is so; the rest is left as it is.
    """
    for i in range(len(points)):
        for j in range(len(places) - 1, -1, -1):
            dx, dy = points[i, 0] - places[j, 0], points[i, 1] - places[j, 1]
            square = dx * dx + dy * dy
            if square > (reach + slack) ** 2:
                continue
            way = light_toward(lights[j], math.atan2(dy, dx), False)
            if way < reach - 1e-6 and math.sqrt(square) <= way + slack:
                result[i] = True
                break


@kernel
def are_behind_walls(
    places: Floats, lights: Floats, points: Floats, reach: float, near: float, jump: float, slack: float, result: Flags
) -> None:
    """Which of some points (m, 2) lie behind a wall without a gap that was seen from nearby.

    Args:
        places: of the light areas (n, 2) [m].
        lights: the light areas (n, K) [m].
        points: (m, 2) [m].
        reach: range that means "nothing seen" [m].
        near: how far a light area goes there at most [m]: so near beams lie close together.
        jump: where lengths of the light differ by this, there may be a gap [m].
        slack: how far behind the light's end at most [m].
        result: (m,) becomes True where it is so; the rest is left as it is.
    """
    count = lights.shape[1]
    for i in range(len(points)):
        for j in range(len(places) - 1, -1, -1):
            dx, dy = points[i, 0] - places[j, 0], points[i, 1] - places[j, 1]
            square = dx * dx + dy * dy
            if square > (near + slack) ** 2:
                continue
            middle = int(round(math.atan2(dy, dx) / (2.0 * math.pi) * count))
            least, most = math.inf, 0.0
            for k in range(middle - SMOOTH, middle + SMOOTH + 1):
                least, most = min(least, lights[j, k % count]), max(most, lights[j, k % count])
            if most <= near and most < reach - 1e-6 and most - least < jump and math.sqrt(square) <= least + slack:
                result[i] = True
                break


@kernel
def are_in_sight(places: Floats, lights: Floats, last: int, result: Flags) -> None:
    """Which of the places (n, 2) one can go to straight from place `last`, by either's light area; (n,) is written."""
    for j in range(len(places)):
        dx, dy = places[j, 0] - places[last, 0], places[j, 1] - places[last, 1]
        away, angle = math.hypot(dx, dy), math.atan2(dy, dx)
        is_there = away <= light_toward(lights[last], angle, True)
        result[j] = is_there or away <= light_toward(lights[j], angle + math.pi, True)
