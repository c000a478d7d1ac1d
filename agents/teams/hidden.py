"""What a partner's body hides from a scan, compiled: its beams are taken out, and what the partner sees there put in."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.free_way import found_points
from bug_gym.kernels.layout import Flags, Floats, Integers

# Columns of a robot: where its odometry frame lies in the team's, origin [m] and direction of the x axis [rad]; its pose in
# its odometry frame [m, rad]; and whether (1 or 0) it looks, and is a partner, whose body others look through.
FRAME_X, FRAME_Y, FRAME_HEADING, POSE_X, POSE_Y, POSE_HEADING, LOOKS, IS_PARTNER = range(8)

# What holds for all robots: the range that means "nothing seen" [m]; how near to a place a point is of the body there [m]; two
# neighbouring points are of one wall where they are nearer than so many ranges; and how points are found, see `found_points`.
FAR, REACH, WIDEST, WIDTH, IS_ROUND = range(5)

# Of each robot: how many beams partners stopped, and how many points are left.
TAKEN, LEFT = range(2)

ROUNDING = 1e-6
"""What places that were turned from frame to frame may be off [m]."""


@inlined
def is_body_point(x: float, y: float, bodies: Floats, reach: float) -> bool:
    """Whether a point lies within `reach` [m] of one of some places (k, 2) [m]."""
    for b in range(bodies.shape[0]):
        dx, dy = x - bodies[b, 0], y - bodies[b, 1]
        if dx * dx + dy * dy <= reach * reach:
            return True
    return False


@inlined
def place_of(robots: Floats, number: int) -> tuple[float, float]:
    """The place of a robot in the team's frame [m]."""
    cos, sin = math.cos(robots[number, FRAME_HEADING]), math.sin(robots[number, FRAME_HEADING])
    x, y = robots[number, POSE_X], robots[number, POSE_Y]
    return robots[number, FRAME_X] + cos * x - sin * y, robots[number, FRAME_Y] + sin * x + cos * y


@inlined
def in_frame(origin_x: float, origin_y: float, heading: float, x: float, y: float) -> tuple[float, float]:
    """A place [m] in the frame that lies at an origin [m] and heading [rad]."""
    cos, sin = math.cos(heading), math.sin(heading)
    dx, dy = x - origin_x, y - origin_y
    return cos * dx + sin * dy, cos * dy - sin * dx


@inlined
def turn_between(robots: Floats, looker: int, other: int) -> float:
    """The heading of a robot in the frame of another one, which looks [rad]."""
    heading = robots[other, POSE_HEADING] + robots[other, FRAME_HEADING]
    wrapped = (heading + math.pi) % (2.0 * math.pi) - math.pi
    turn: float = wrapped - robots[looker, FRAME_HEADING] - robots[looker, POSE_HEADING]
    return turn


@called
def find_partners(robots: Floats, looker: int, near: float, who: Integers, bodies: Floats) -> tuple[int, int]:
    """Find the partners of a robot: their numbers `who` and places in its frame, the robot's own behind them.

    Returns how many there are, and how many of them, which come first, are not farther away than `near` [m].
    """
    frame_x, frame_y, frame_heading, pose_x, pose_y, pose_heading = robots[looker, :LOOKS]
    count, at_hand = 0, 0
    for other in range(robots.shape[0]):
        if other == looker or robots[other, IS_PARTNER] == 0.0:
            continue
        x, y = place_of(robots, other)
        x, y = in_frame(frame_x, frame_y, frame_heading, x, y)
        x, y = in_frame(pose_x, pose_y, pose_heading, x, y)
        place = count
        if x * x + y * y <= near * near:
            place = at_hand
            who[count], bodies[count, 0], bodies[count, 1] = who[place], bodies[place, 0], bodies[place, 1]
            at_hand += 1
        who[place], bodies[place, 0], bodies[place, 1] = other, x, y
        count += 1
    bodies[count] = 0.0
    return count, at_hand


@called
def take_out_bodies(
    ranges: Floats, ux: Floats, uy: Floats, far: float, bodies: Floats, reach: float, beams: Integers
) -> int:
    """Take the beams off bodies; returns how many, and fills in which.

    Args:
        ranges: (B,), changed in place [m].
        ux: directions' x (B,) in the robot's frame.
        uy: directions' y (B,).
        far: range that means "nothing seen" [m].
        bodies: places (k, 2) in the robot's frame [m]; further columns are left alone.
        reach: how near to a place a point is of the body there [m].
        beams: numbers of the beams that were taken off (B,), filled as far as there are any.
    """
    count = 0
    for i in range(ranges.size):
        if ranges[i] < far and is_body_point(ux[i] * ranges[i], uy[i] * ranges[i], bodies, reach):
            beams[count] = i
            count += 1
    for n in range(count):
        ranges[beams[n]] = far
    return count


@called
def find_walls(
    scan: Floats, ux: Floats, uy: Floats, far: float, widest: float, pose: tuple[float, float, float], walls: Floats
) -> int:
    """Find the pieces of wall that a scan shows, which lie between neighbouring points; returns how many there are.

    Args:
        scan: the ranges (B,) [m].
        ux: directions' x (B,) in the frame of who sees them.
        uy: y (B,).
        far: range that means "nothing seen" [m].
        widest: two neighbouring points are of one wall where they are nearer than so many ranges.
        pose: x, y [m] and heading [rad] of who sees them.
        walls: begin x, y and end x, y of each piece (B, 4), filled as far as there are any [m].
    """
    x, y, turn = pose
    cos, sin = math.cos(turn), math.sin(turn)
    count = 0
    for i in range(scan.size):
        j = i + 1 if i + 1 < scan.size else 0
        if scan[i] >= far or scan[j] >= far:
            continue
        x1, y1 = x + scan[i] * (cos * ux[i] - sin * uy[i]), y + scan[i] * (sin * ux[i] + cos * uy[i])
        x2, y2 = x + scan[j] * (cos * ux[j] - sin * uy[j]), y + scan[j] * (sin * ux[j] + cos * uy[j])
        length = widest * min(scan[i], scan[j])
        if (x2 - x1) * (x2 - x1) + (y2 - y1) * (y2 - y1) <= length * length:
            walls[count, 0], walls[count, 1], walls[count, 2], walls[count, 3] = x1, y1, x2, y2
            count += 1
    return count


@called
def range_before(walls: Floats, ux: float, uy: float, nearest: float, bodies: Floats, reach: float) -> float:
    """How far a beam goes until it meets a wall, if that is less than `nearest` [m].

    Args:
        walls: pieces, begin x, y and end x, y (n, 4) [m].
        ux: the beam's direction, x.
        uy: y.
        nearest: how far it goes without them [m].
        bodies: places (k, 2) of robots: what is seen of them is no wall; further columns are left alone [m].
        reach: how near to a place a point is of the body there [m].
    """
    for w in range(walls.shape[0]):
        x, y, end_x, end_y = walls[w, 0], walls[w, 1], walls[w, 2], walls[w, 3]
        aside, aside_end = ux * y - uy * x, ux * end_y - uy * end_x
        if aside * aside_end > 0.0 or aside == aside_end:
            continue
        share = aside / (aside - aside_end)
        along = (1.0 - share) * (ux * x + uy * y) + share * (ux * end_x + uy * end_y)
        if not 0.0 < along < nearest:
            continue
        if not (is_body_point(x, y, bodies, reach) or is_body_point(end_x, end_y, bodies, reach)):
            nearest = along
    return nearest


@kernel
def look_through_partners(
    scans: Floats,
    directions: Floats,
    limits: Floats,
    robots: Floats,
    clean: Floats,
    hidden: Flags,
    points: Floats,
    counts: Integers,
    numbers: Integers,
    room: Floats,
) -> None:
    """Take the bodies of partners out of the scans of k robots, and put in the walls that the partners see behind them.

    These are pieces between neighbouring points of their scans.

    Args:
        scans: what they see (k, B) [m].
        directions: x and y (2, B), in any robot's own frame.
        limits: what holds for all.
        robots: (k, 8).
        clean: filled, of who looks, with what is left (k, B), as an observation rounds it [m].
        hidden: filled likewise with which beams partners stopped (k, B).
        points: (k, 2, B) room for the points that are left where partners stopped any beam [m].
        counts: filled (k, 2).
        numbers: to work in (2, k or B, whichever is more).
        room: to work in (2, k + 1 or B, 4).
    """
    ux, uy, who, beams, places, walls = directions[0], directions[1], numbers[0], numbers[1], room[0], room[1]
    far, reach, in_sight = limits[FAR], limits[REACH], 2.0 * limits[FAR] + ROUNDING
    for looker in range(scans.shape[0]):
        counts[looker, TAKEN] = 0
        if robots[looker, LOOKS] == 0.0:
            continue
        told, at_hand = find_partners(robots, looker, far + reach + ROUNDING, who, places)
        for i in range(ux.size):
            clean[looker, i], hidden[looker, i] = scans[looker, i], False
        taken = take_out_bodies(clean[looker], ux, uy, far, places[:at_hand], reach, beams)
        counts[looker, TAKEN] = taken
        if taken == 0:
            continue
        for p in range(told):
            x, y = places[p, 0], places[p, 1]
            if x * x + y * y > in_sight * in_sight:  # it sees nothing in reach
                continue
            turn = turn_between(robots, looker, who[p])
            seen = find_walls(scans[who[p]], ux, uy, far, limits[WIDEST], (x, y, turn), walls)
            for n in range(taken):
                i = beams[n]
                before = clean[looker, i]
                clean[looker, i] = range_before(walls[:seen], ux[i], uy[i], before, places[: told + 1], reach)
        for n in range(taken):
            hidden[looker, beams[n]] = True
            clean[looker, beams[n]] = np.float32(clean[looker, beams[n]])
        width, is_round = limits[WIDTH], limits[IS_ROUND] > 0.0
        counts[looker, LEFT] = found_points(clean[looker], directions, far, width, is_round, points[looker])
