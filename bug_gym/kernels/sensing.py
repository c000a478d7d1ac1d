"""What a robot senses: the walls in reach, the scan, the goal, the others, the clearance."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.body import body_circle, circle_radius
from bug_gym.kernels.chords import point_wall_distance
from bug_gym.kernels.geometry import length, sin_cos
from bug_gym.kernels.layout import (
    HOLONOMIC,
    STREAM_RANGES,
    Floats,
    Footprint,
    Integers,
    Ranges,
    Record,
)
from bug_gym.kernels.neighbours import NOWHERE, in_eights, listed_discs, listed_walls
from bug_gym.kernels.noise import add_noise
from bug_gym.kernels.randomness import hash64
from bug_gym.kernels.rays import Beams, Discs, Origin, Walls, cast_rays, find_near_discs, is_wall_near
from bug_gym.kernels.vectors import NEAR, write_wall
from bug_gym.kernels.walls import after_ring, next_wall, room_about, wall_between, wall_ends


class Look(NamedTuple):
    """One robot that looks round: who, from where, and what the kernels need for it."""

    robot: int
    x: float
    """[m]."""
    y: float
    """[m]."""
    heading: float
    """[rad]."""
    cos: float
    """Of the heading."""
    sin: float
    """Of the heading."""
    beams: Floats
    """As `rays.Beams`."""
    columns: Floats
    """The bodies in the row's lists, as `neighbours.near_bodies` leaves them."""
    scratch: Floats
    """Working memory."""
    scratch_int: Integers
    """Likewise."""


@inlined
def gather_walls(
    f: Floats,
    k: Integers,
    s: Record,
    polygons: Discs,
    has_room: bool,
    x: float,
    y: float,
    scratch: Floats,
    index: Integers,
) -> Walls:
    """Walls of the border, unless it is a room, and of the polygons that reach into the scan's circle round (x, y).

    From outside a polygon only those are taken that face (x, y): the others lie behind them. They are written to the
    end of `scratch`.
    """
    ends = scratch[scratch.size - 4 * s.wall_room :]
    count = np.uint64(0)
    first, total = k[s.border_first], 0 if has_room else k[s.border_walls]
    for w in range(first, first + total):
        ax, ay, cx, cy = wall_between(f, s, w, next_wall(k, s, w, first, total, True))
        write_wall(ends, count, ax, ay, cx, cy)
        count += np.uint64(is_wall_near(ax - x, ay - y, cx - x, cy - y, s.reach))
    if polygons.total == 0:
        return Walls(ends, count)
    near = find_near_discs(polygons, x, y, s.reach, index)
    for j in range(near):
        at = np.uint64(index[np.uint64(NEAR) + j])
        walls = listed_walls(k, s, at)
        bx, by, radius = polygons.x[at], polygons.y[at], polygons.radius[at]
        dx, dy = x - bx, y - by
        side = 0.0 if dx * dx + dy * dy <= radius * radius else np.float64(walls.side)
        if not walls.moves:
            bx, by = 0.0, 0.0
        first, past = walls.first, walls.first + walls.total
        while first < past:
            after = past if walls.is_ring else after_ring(k, s, first)
            begin, end = np.uint64(s.corner + 2 * first), np.uint64(s.corner + 2 * after)
            # The wall comes first that ends at the ring's first corner: so each corner is read once.
            cx, cy = f[end - np.uint64(2)] + bx, f[end - np.uint64(1)] + by
            right, up = cx - x, cy - y
            for corner in range(begin, end, np.uint64(2)):
                ax, ay, left, down = cx, cy, right, up
                cx, cy = f[corner] + bx, f[corner + np.uint64(1)] + by
                right, up = cx - x, cy - y
                write_wall(ends, count, ax, ay, cx, cy)
                count += np.uint64(side * (left * up - down * right) <= 0.0)
            first = after
    return Walls(ends, count)


@inlined
def stand_in(f: Floats, k: Integers, s: Record, footprint: Footprint, columns: Floats, r: int) -> Discs:
    """The listed discs, and behind them the other robots, who are discs too while robot r looks."""
    count: int = k[s.near_discs]
    if footprint is None:
        return listed_discs(s, 0, in_eights(count), columns)
    room = s.disc_room + s.polygon_room
    for other in range(s.robots):
        if other != r:
            for c in range(s.footprint):
                cx, cy = body_circle(f, footprint, s.pose, other, c)
                columns[count] = cx
                columns[room + count] = cy
                columns[2 * room + count] = footprint[c, 2]
                count += 1
    for j in range(count, in_eights(count)):
        columns[j], columns[room + j], columns[2 * room + j] = NOWHERE, NOWHERE, 0.0
    return listed_discs(s, 0, in_eights(count), columns)


@inlined
def look_from(
    f: Floats, s: Record, beams: Floats, columns: Floats, scratch: Floats, scratch_int: Integers, r: int
) -> Look:
    """Robot r looks from where it is."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    sin, cos = sin_cos(heading)
    return Look(r, x, y, heading, cos, sin, beams, columns, scratch, scratch_int)


@inlined
def scan(f: Floats, k: Integers, s: Record, ranges: Ranges, look: Look, footprint: Footprint) -> None:
    """Fill the ranges (B,), with their noise."""
    origin = Origin(look.x, look.y, look.cos, look.sin)
    discs = stand_in(f, k, s, footprint, look.columns, look.robot)
    polygons = listed_discs(s, s.disc_room, in_eights(k[s.near_polygons]), look.columns)
    room = room_about(f, k, s, look.x, look.y)
    walls = gather_walls(f, k, s, polygons, room.holds, look.x, look.y, look.scratch, look.scratch_int)
    fan = Beams(look.beams[0], look.beams[1], s.first_angle, 1.0 / s.angle_step, np.float64(s.beams) - 1.0)
    cast_rays(discs, walls, room, origin, fan, s.reach, look.scratch, look.scratch_int, ranges)
    if s.range_noise > 0.0 or s.dropout > 0.0 or s.min_range > 0.0:
        key = hash64(k[s.seed], k[s.episode], k[s.steps] * s.robots + look.robot, STREAM_RANGES)
        add_noise(ranges, s.beams, s.reach, s.min_range, s.range_noise, s.dropout, key)
    if s.no_return > s.reach:
        far, none = np.float32(s.reach), np.float32(s.no_return)
        for i in range(s.beams):
            ranges[i] = none if ranges[i] >= far else ranges[i]


@inlined
def goal_in_frame(f: Floats, s: Record, look: Look) -> tuple[float, float]:
    """The goal in the robot's frame [m], sensed as a beacon or computed from odometry."""
    r = look.robot
    goal_x, goal_y = f[s.goal_place + 2 * r], f[s.goal_place + 2 * r + 1]
    goal_sin, goal_cos = look.sin, look.cos
    gx, gy = goal_x - look.x, goal_y - look.y
    if s.goal_by_odometry:
        wx, wy = goal_x - f[s.origin + 3 * r], goal_y - f[s.origin + 3 * r + 1]
        origin_sin, origin_cos = sin_cos(f[s.origin + 3 * r + 2])
        ex, ey, eh = f[s.odometry + 3 * r], f[s.odometry + 3 * r + 1], f[s.odometry + 3 * r + 2]
        gx, gy = origin_cos * wx + origin_sin * wy - ex, origin_cos * wy - origin_sin * wx - ey
        goal_sin, goal_cos = sin_cos(eh)
    return goal_cos * gx + goal_sin * gy, goal_cos * gy - goal_sin * gx


@inlined
def peer_in_frame(f: Floats, s: Record, look: Look, other: int) -> tuple[float, float, float, float]:
    """Place [m] and velocity [m/s] of another robot in the robot's frame."""
    dx, dy = f[s.pose + 3 * other] - look.x, f[s.pose + 3 * other + 1] - look.y
    vx, vy = f[s.velocity + 2 * other], f[s.velocity + 2 * other + 1]
    turn_sin, turn_cos = sin_cos(f[s.pose + 3 * other + 2] - look.heading)
    if s.kinematics != HOLONOMIC:
        vy = 0.0
    ahead, left = look.cos * dx + look.sin * dy, look.cos * dy - look.sin * dx
    return ahead, left, turn_cos * vx - turn_sin * vy, turn_sin * vx + turn_cos * vy


@inlined
def wall_gap(f: Floats, k: Integers, s: Record, w: int, x: float, y: float) -> float:
    """Distance of a point to wall w, both in the frame in which the wall is kept."""
    x1, y1, x2, y2 = wall_ends(f, k, s, w)
    return point_wall_distance(x, y, x1, y1, x2, y2)


@called
def clearance_at(f: Floats, k: Integers, s: Record, footprint: Footprint, r: int) -> float:
    """Distance from robot r's body to the nearest obstacle, border and other robot [m], at its present pose.

    All bodies have been brought to now.
    """
    nearest = math.inf
    for c in range(s.footprint):
        x, y = body_circle(f, footprint, s.pose, r, c)
        radius = circle_radius(s, footprint, c)
        for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
            nearest = min(nearest, wall_gap(f, k, s, w, x, y) - radius)
        for m in range(k[s.disc_count]):
            dx, dy = x - f[s.body_x + m], y - f[s.body_y + m]
            reach = radius + f[s.body_radius + m]
            if dx * dx + dy * dy < (nearest + reach) * (nearest + reach):
                nearest = min(nearest, length(dx, dy) - reach)
        for number in range(k[s.polygon_count]):
            b = s.discs + number
            bx, by = f[s.body_x + b], f[s.body_y + b]
            reach = nearest + radius + f[s.body_radius + b]
            if (x - bx) * (x - bx) + (y - by) * (y - by) >= reach * reach:
                continue
            if number >= k[s.moving_polygon_count]:
                bx, by = 0.0, 0.0
            first = k[s.polygon_first + number]
            for w in range(first, first + k[s.polygon_walls + number]):
                nearest = min(nearest, wall_gap(f, k, s, w, x - bx, y - by) - radius)
        if footprint is None:
            continue
        for other in range(s.robots):
            if other != r:
                for d in range(s.footprint):
                    ox, oy = body_circle(f, footprint, s.pose, other, d)
                    nearest = min(nearest, length(x - ox, y - oy) - radius - footprint[d, 2])
    return nearest
