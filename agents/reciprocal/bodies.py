"""The compiled part of ORCA that finds out who is there, and what the robot would see if no one else were."""

from __future__ import annotations

import math

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.free_way import found_points
from bug_gym.kernels.layout import Floats, Integers, Ranges

# Columns of a body to be avoided: place and velocity in the robot's frame [m, m/s], its radius [m], the share of the
# avoidance that is this robot's (0: it counts as a still thing), and the share of the gap that it may close in a step.
PX, PY, VX, VY, RADIUS, SHARE, GAP_SHARE = range(7)
BODY = 7

# What is known of the robots and of the scanner: their radius [m]; time between two decisions [s]; the range that means
# "nothing seen", and how an observation says it [m]; how far outside the outline of a robot, and of a mover, a hit is still
# of it [m]; and how points are found, see `found_points`.
OWN_RADIUS, STEP, FAR, BLANK, ROBOT_MARGIN, MOVER_MARGIN, WIDTH, IS_ROUND = range(8)
KNOWN = 8

# What is found of a robot: how many bodies there are; how many beams were taken off them; and how many points are left then.
BODIES, TAKEN, LEFT = range(3)

AT_REST = 0.01
"""A robot slower than this does nothing to keep clear [m/s]."""

SETTLED = 2.0
"""A robot at rest for longer is one more still thing, which the bug goes round [s]."""

ROUNDING = 1e-6
"""What places that were turned from frame to frame may be off [m]."""


@kernel
def find_bodies(
    told: Ranges,
    at_rest: Floats,
    movers: Floats,
    poses: Floats,
    known: Floats,
    ranges: Floats,
    directions: Floats,
    bodies: Floats,
    clean: Floats,
    points: Floats,
    found: Integers,
) -> None:
    """Find who is there for each of r robots, and take the beams off them.

    Args:
        told: place and velocity of the n other robots in each one's frame, one after the other (r, 4 n) [m, m/s].
        at_rest: for how long each of them has been at rest, changed in place (r, n) [s].
        movers: place and velocity in the odometry frame, and radius, of what moves (r, k, 5) [m, m/s].
        poses: of the robots there (r, 3) [m, rad].
        known: (KNOWN,).
        ranges: the scans (r, B) [m].
        directions: of the beams in the robot's frame, unit vectors (2, B).
        bodies: filled (r, n + k, BODY): the other robots, then what moves and is none of them.
        clean: filled (r, B): the scans without them; what counts as a still thing stays.
        points: room for their points (r, 2, B), found where any beam was taken.
        found: how many movers there are of each; overwritten by BODIES, TAKEN and LEFT (r, 3).
    """
    others = at_rest.shape[1]
    for r in range(found.shape[0]):
        for b in range(others):
            for column in range(RADIUS):
                bodies[r, b, column] = told[r, RADIUS * b + column]
            bodies[r, b, RADIUS], bodies[r, b, GAP_SHARE] = known[OWN_RADIUS], 0.5
        share_out(bodies[r], at_rest[r], known[STEP])
        count = add_movers(movers[r, : found[r, 0]], poses[r], bodies[r], others)
        for beam in range(ranges.shape[1]):
            clean[r, beam] = ranges[r, beam]
        taken = 0
        for b in range(count):
            if bodies[r, b, SHARE] > 0.0:
                margin = known[ROBOT_MARGIN] if b < others else known[MOVER_MARGIN]
                place, reach = (bodies[r, b, PX], bodies[r, b, PY]), bodies[r, b, RADIUS] + margin
                taken += take_out_disc(clean[r], directions, known[FAR], known[BLANK], place, reach)
        left = 0
        if taken > 0:
            left = found_points(clean[r], directions, known[FAR], known[WIDTH], known[IS_ROUND] > 0.0, points[r])
        found[r, BODIES], found[r, TAKEN], found[r, LEFT] = count, taken, left


@kernel
def share_out(peers: Floats, at_rest: Floats, step: float) -> None:
    """What of the avoidance of each of the other robots is this one's; fills SHARE.

    Args:
        peers: (n, BODY).
        at_rest: for how long each has been at rest, changed in place (n,) [s].
        step: time since the last decision [s].
    """
    for b in range(at_rest.size):
        is_at_rest = math.hypot(peers[b, VX], peers[b, VY]) < AT_REST
        at_rest[b] = at_rest[b] + step if is_at_rest else 0.0
        peers[b, SHARE] = 0.0 if at_rest[b] > SETTLED else 1.0 if is_at_rest else 0.5


@inlined
def add_movers(movers: Floats, pose: Floats, bodies: Floats, others: int) -> int:
    """Write what moves behind the other robots, whose avoidance is all of this one's; returns how many bodies there are.

    What overlaps one of the robots is taken for it.
    """
    x, y, count = pose[0], pose[1], others
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for m in range(movers.shape[0]):
        dx, dy = movers[m, PX] - x, movers[m, PY] - y
        bodies[count, PX], bodies[count, PY] = cos * dx + sin * dy, cos * dy - sin * dx
        bodies[count, RADIUS] = movers[m, RADIUS]
        if is_among(bodies[count], bodies[:others]):
            continue
        vx, vy = movers[m, VX], movers[m, VY]
        bodies[count, VX], bodies[count, VY] = cos * vx + sin * vy, cos * vy - sin * vx
        bodies[count, SHARE], bodies[count, GAP_SHARE] = 1.0, 1.0
        count += 1
    return count


@kernel
def is_among(body: Floats, peers: Floats) -> bool:
    """Whether a body (BODY,) overlaps one of the other robots (n, BODY)."""
    for b in range(peers.shape[0]):
        gap = math.hypot(body[PX] - peers[b, PX], body[PY] - peers[b, PY])
        if gap < body[RADIUS] + peers[b, RADIUS]:
            return True
    return False


@kernel
def take_out_disc(
    ranges: Floats, directions: Floats, far: float, blank: float, place: tuple[float, float], reach: float
) -> int:
    """Take the beams off a body; returns how many.

    Args:
        ranges: (B,), changed in place [m].
        directions: of the beams in the robot's frame, unit vectors (2, B).
        far: range that means "nothing seen" [m].
        blank: what is written [m].
        place: of the body in the robot's frame [m].
        reach: how near to it a point is of the body [m].
    """
    (x, y), count = place, 0
    near = far + reach + ROUNDING
    if x * x + y * y > near * near:
        return 0
    for i in range(ranges.size):
        dx, dy = directions[0, i] * ranges[i] - x, directions[1, i] * ranges[i] - y
        if ranges[i] < far and dx * dx + dy * dy <= reach * reach:
            ranges[i] = blank
            count += 1
    return count
