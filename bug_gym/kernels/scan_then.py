"""The scan that a robot would have from a pose nearby, as far as it can be told from the one that it has."""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.geometry import length, wrap
from bug_gym.kernels.layout import Flags, Floats

SLANTED = 4.0
"""Two neighbouring beams meet one thing where its points lie nearer to one another than so many times what is between them."""


@inlined
def _met(px: float, py: float, qx: float, qy: float, cos: float, sin: float) -> float:
    """How far from the origin along a unit vector the line through two points is [m]; infinite where it is not ahead."""
    ux, uy = qx - px, qy - py
    across = cos * uy - sin * ux
    way = (px * uy - py * ux) / across if across != 0.0 else math.inf
    return way if way > 0.0 else math.inf


@kernel
def scan_then(
    ranges: Floats,
    directions: Floats,
    reach: float,
    first_angle: float,
    spacing: float,
    width: float,
    is_round: bool,
    x: float,
    y: float,
    turn: float,
    then: Floats,
    told: Flags,
    met: Floats,
) -> None:
    """Ranges from a pose nearby: points that two neighbouring beams met are joined where they lie on one thing.

    Elsewhere a beam reads as the point that it passes, or as the farther one of the two that it passes between; where
    nothing has been seen that it would meet, `reach`.

    Args:
        ranges: of the scan (B,) [m].
        directions: of its beams (2, B), unit vectors.
        reach: range that means "nothing seen" [m].
        first_angle: of beam 0 [rad].
        spacing: between two beams [rad].
        width: of the body [m]: points farther apart than that are not joined in any case.
        is_round: whether the last beam is the first one's neighbour.
        x: the other pose in the robot's frame [m].
        y: likewise.
        turn: its heading [rad].
        then: (B,) filled with the ranges from there [m].
        told: (B,) room for which of them lie between joined points.
        met: (3, B) room for the points x, y [m] and their bearings [rad] from there.
    """
    beams = ranges.size
    cos, sin = math.cos(turn), math.sin(turn)
    then[:] = reach
    told[:] = False
    for beam in range(beams):
        dx, dy = directions[0, beam] * ranges[beam] - x, directions[1, beam] * ranges[beam] - y
        met[0, beam], met[1, beam] = cos * dx + sin * dy, cos * dy - sin * dx
        met[2, beam] = math.atan2(met[1, beam], met[0, beam])
    for joins in (True, False):  # other points count only where joined ones leave a beam untold
        for beam in range(beams):
            if ranges[beam] >= reach:
                continue
            px, py = met[0, beam], met[1, beam]
            here = (met[2, beam] - first_angle) / spacing
            low, high = here - 0.5, here + 0.5
            other, next_one, qx, qy = beam, here, px, py
            if beam + 1 < beams or is_round:
                other = (beam + 1) % beams
            if other != beam and ranges[other] < reach:
                qx, qy = met[0, other], met[1, other]
                apart = length(qx - px, qy - py)
                is_one = apart <= width and apart <= SLANTED * spacing * max(ranges[beam], ranges[other])
                next_one = here + wrap(met[2, other] - met[2, beam]) / spacing
                if joins:
                    if not is_one:
                        continue
                    low, high = min(here, next_one), max(here, next_one)
                elif not is_one:
                    low, high = min(low, next_one), max(high, next_one)
            elif joins:
                continue
            for number in range(int(math.ceil(low)), int(math.floor(high)) + 1):
                place = number % beams if is_round else number
                if not 0 <= place < beams or (told[place] and not joins):
                    continue
                if joins:
                    way = _met(px, py, qx, qy, directions[0, place], directions[1, place])
                    told[place] = True
                elif abs(number - here) <= 0.5:
                    way = length(px, py)
                else:
                    way = max(length(px, py), length(qx, qy))
                then[place] = min(then[place], way)
