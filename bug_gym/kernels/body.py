"""The robot's body: circles in its frame, how those beside its origin swing, and how all go on arcs.

Where a robot may leave the chord of a step by more than FLATTEST_ARC (bug_gym.limits) it goes on the arc (`s.arcs`), else
straight while it turns evenly.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, inlined
from bug_gym.kernels.chords import NEVER, disc_contact, nearest_on_chord, nearest_to_wall, wall_contact
from bug_gym.kernels.geometry import chord_of, length, sin_cos
from bug_gym.kernels.layout import Floats, Footprint, Record
from bug_gym.kernels.walls import wall_between


@inlined
def body_circle(f: Floats, footprint: Footprint, at: int, r: int, c: int) -> tuple[float, float]:
    """Centre of circle c of robot r's body at the pose stored at `at` (s.pose or s.next_pose)."""
    if footprint is None:
        return f[at + 3 * r], f[at + 3 * r + 1]
    return point_at(f, at, r, footprint[c, 0], footprint[c, 1])


@inlined
def point_at(f: Floats, at: int, r: int, ox: float, oy: float) -> tuple[float, float]:
    """Where the point (ox, oy) of robot r's frame is at the pose stored at `at`."""
    x, y = f[at + 3 * r], f[at + 3 * r + 1]
    if ox == 0.0 and oy == 0.0:
        return x, y
    sin, cos = sin_cos(f[at + 3 * r + 2])
    return x + cos * ox - sin * oy, y + sin * ox + cos * oy


@inlined
def circle_radius(s: Record, footprint: Footprint, c: int) -> float:
    """Radius of circle c of a robot's body [m]."""
    if footprint is None or (s.footprint == 1 and not is_beside(footprint, c)):
        reach: float = s.body_reach  # it may be drawn
        return reach
    radius: float = footprint[c, 2]
    return radius


@inlined
def is_beside(footprint: Floats, c: int) -> bool:
    """Whether circle c of the body lies beside the robot's origin: a turn moves it."""
    return bool(footprint[c, 0] != 0.0 or footprint[c, 1] != 0.0)


NO_WALL = -1
SWING = 1e-5  # what swings or goes on an arc leaves the chords that stand for its way by no more than this [m]


@inlined
def way_of(f: Floats, s: Record, r: int) -> float:
    """Length of the way of robot r's origin in this step [m]."""
    if s.arcs != 0:
        arc: float = abs(f[s.velocity + 2 * r]) * s.step
        return arc
    return length(f[s.next_pose + 3 * r] - f[s.pose + 3 * r], f[s.next_pose + 3 * r + 1] - f[s.pose + 3 * r + 1])


@inlined
def place_after(f: Floats, s: Record, r: int, share: float) -> tuple[float, float]:
    """Place of robot r's origin after a share of this step's motion."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    if s.arcs != 0:
        half = 0.5 * share * (f[s.next_pose + 3 * r + 2] - heading)
        chord = chord_of(share * f[s.velocity + 2 * r] * s.step, half)
        sin, cos = sin_cos(heading + half)
        return x + chord * cos, y + chord * sin
    return x + share * (f[s.next_pose + 3 * r] - x), y + share * (f[s.next_pose + 3 * r + 1] - y)


@inlined
def swing(f: Floats, s: Record, r: int, ox: float, oy: float) -> tuple[int, float]:
    """How many chords stand for the way of a point of robot r's frame in this step, and how far it leaves them [m].

    While the robot goes straight and turns evenly, a point beside its origin runs along an arc of a cycloid; while the robot
    goes on an arc, on an arc about the same centre. Contact is tested on the chords with that much more radius: none is
    missed, and none comes more than twice SWING too early, as the chord may lie that much beside the arc besides; between
    two such bodies four times.
    """
    turn = f[s.next_pose + 3 * r + 2] - f[s.pose + 3 * r + 2]
    if s.arcs != 0:
        bend = 0.125 * abs(turn) * length(f[s.velocity + 2 * r] * s.step - turn * oy, turn * ox)
        pieces = max(1, math.ceil(math.sqrt(bend / SWING)))
        return pieces, bend / (pieces * pieces)
    offset, turn = length(ox, oy), abs(turn)
    pieces = max(1, math.ceil(turn * math.sqrt(0.125 * offset / SWING)))
    turn /= pieces
    return pieces, 0.125 * offset * turn * turn


@inlined
def swung_point(f: Floats, s: Record, r: int, ox: float, oy: float, share: float) -> tuple[float, float]:
    """Where the point (ox, oy) of robot r's frame is after a share of this step's motion."""
    if share == 0.0:
        return point_at(f, s.pose, r, ox, oy)
    if share == 1.0:
        return point_at(f, s.next_pose, r, ox, oy)
    x, y = place_after(f, s, r, share)
    heading = f[s.pose + 3 * r + 2]
    sin, cos = sin_cos(heading + share * (f[s.next_pose + 3 * r + 2] - heading))
    return x + cos * ox - sin * oy, y + sin * ox + cos * oy


@called
def swing_contact(
    f: Floats,
    s: Record,
    r: int,
    ox: float,
    oy: float,
    x: float,
    y: float,
    mx: float,
    my: float,
    reach: float,
    w: int,
    after: int,
    end: float,
) -> tuple[float, float]:
    """First contact of a circle of robot r's body with what comes to (x, y) from (x - mx, y - my).

    Args:
        f: the row's floats.
        s: the row's record.
        r: the robot.
        ox: centre of the circle in the robot's frame [m].
        oy: the same.
        x: place of the disc, or that from which wall w is measured [m].
        y: the same.
        mx: its way in this step [m].
        my: the same.
        reach: distance at which they touch [m].
        w: number of the wall, or NO_WALL: it is a disc.
        after: number of the wall that begins where that ends.
        end: fraction of the step up to which it counts.

    Returns:
        Fraction of the step or NEVER, and clearance [m].
    """
    first, clearance = NEVER, math.inf
    pieces, margin = swing(f, s, r, ox, oy)
    x0, y0 = point_at(f, s.pose, r, ox, oy)
    for piece in range(pieces):
        finish = min(end * pieces - piece, 1.0)
        if finish < 0.0:
            break
        x1, y1 = swung_point(f, s, r, ox, oy, (piece + 1) / pieces)
        left = 1.0 - piece / pieces
        px, py = x0 - x + mx * left, y0 - y + my * left
        ex, ey = x1 - x0 - mx / pieces, y1 - y0 - my / pieces
        if w == NO_WALL:
            fraction = disc_contact(px, py, ex, ey, reach + margin)
            gap = nearest_on_chord(px, py, ex, ey, finish)
        else:
            ax, ay, bx, by = wall_between(f, s, w, after)
            fraction = wall_contact(px, py, ex, ey, ax, ay, bx, by, reach + margin)
            gap = nearest_to_wall(px, py, ex, ey, ax, ay, bx, by, finish)
        if fraction <= finish:
            first = min(first, (piece + fraction) / pieces)
        clearance = min(clearance, gap - reach)
        x0, y0 = x1, y1
    return first, clearance
