"""The compiled part of ORCA for robots with inertia: a border between two of them that neither will cross.

What the other one has under way it alone knows, and places say nothing of it. So both keep a line between them, which
either works out from the places of both: on its own side each keeps all of its way, with what is under way. The line moves
only as far as leaves each on its own side wherever it may have got; so to go on no farther is always left. Without latency
it would be the one midway, of a buffered Voronoi cell (Zhou, Wang, Bandyopadhyay and Schwager 2017, "Fast, On-line
Collision Avoidance for Dynamic Vehicles Using Buffered Voronoi Cells").
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.agents.reciprocal.bodies import PX, PY, VX, VY
from bug_gym.compiling import called, kernel
from bug_gym.kernels.layout import Floats

# A border in the odometry frame: unit vector toward the other robot, and how far along it the line lies [m].
TOWARD_X, TOWARD_Y, ALONG = range(3)
BORDER = 3

# What is known of all the robots: how far the middle of one is to keep from a border [m]; greatest speed [m/s]; greatest
# acceleration [m/s^2]; and how late commands act [s].
KEPT, FASTEST, ACCELERATION, LATE = range(4)
LATE_DRIVE = 4

HALVINGS = 24
"""How often a turn is halved to find the greatest that can be had."""


class Side(NamedTuple):
    """Where the middle of a robot may get on its side of a border before commands of now act, and it stands."""

    room: float
    """How much nearer to the border than it is now [m]."""
    reach: float
    """How far from where it is now [m]."""


@called
def side_of(room: float, speed: float, drive: Floats) -> Side:
    """Of a robot of this speed [m/s] that is so near to a border [m]."""
    late, acceleration = drive[LATE], drive[ACCELERATION]
    most = min(speed + acceleration * late, drive[FASTEST])
    return Side(max(room, 0.0), most * late + 0.5 * most * most / acceleration)


@called
def farthest(side: Side, turn: float) -> float:
    """How far a robot may get [m] in the direction that lies by an angle [rad] beside the one to its border."""
    cos = math.cos(turn)
    if side.reach * cos <= side.room:
        return side.reach
    return side.room * cos + math.sqrt(max(side.reach**2 - side.room**2, 0.0)) * abs(math.sin(turn))


@called
def greatest_share(own: Side, its: Side, distance: float, turn: float, kept: float) -> float:
    """The share of a turn [rad] to where the other one lies, so far away [m], that leaves both on their sides."""
    least, most, share = 0.0, 1.0, 1.0
    for _ in range(HALVINGS):
        part = share * turn
        if distance * math.cos(turn - part) >= farthest(own, part) + farthest(its, part) + 2.0 * kept:
            least = share
        else:
            most = share
        if least == most:
            break
        share = 0.5 * (least + most)
    return least


@kernel
def move_borders(borders: Floats, peers: Floats, pose: Floats, speed: float, drive: Floats) -> None:
    """Move a robot's borders as far toward midway as can be had.

    Args:
        borders: to the other robots (n, BORDER), changed in place; those of no direction are drawn midway.
        peers: (n, BODY), in the robot's frame.
        pose: of the robot, odometry frame (3,) [m, rad].
        speed: of the robot [m/s].
        drive: (LATE_DRIVE,).
    """
    x, y, cos, sin = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    for b in range(len(borders)):
        dx, dy = cos * peers[b, PX] - sin * peers[b, PY], sin * peers[b, PX] + cos * peers[b, PY]
        nx, ny, distance = borders[b, TOWARD_X], borders[b, TOWARD_Y], math.hypot(dx, dy)
        if nx == 0.0 and ny == 0.0:
            nx, ny = (dx / distance, dy / distance) if distance > 0.0 else (1.0, 0.0)
            borders[b, TOWARD_X], borders[b, TOWARD_Y] = nx, ny
            borders[b, ALONG] = nx * x + ny * y + 0.5 * distance
            continue
        gap = borders[b, ALONG] - nx * x - ny * y
        own = side_of(gap - drive[KEPT], speed, drive)
        its_gap = nx * dx + ny * dy - gap
        its = side_of(its_gap - drive[KEPT], math.hypot(peers[b, VX], peers[b, VY]), drive)
        whole = math.atan2(nx * dy - ny * dx, nx * dx + ny * dy)
        turn = greatest_share(own, its, distance, whole, drive[KEPT]) * whole
        cos_turn, sin_turn = math.cos(turn), math.sin(turn)
        nx, ny = cos_turn * nx - sin_turn * ny, sin_turn * nx + cos_turn * ny
        # What is left between the two is shared out.
        gap = 0.5 * (distance * math.cos(whole - turn) + farthest(own, turn) - farthest(its, turn))
        borders[b, TOWARD_X], borders[b, TOWARD_Y], borders[b, ALONG] = nx, ny, nx * x + ny * y + gap
