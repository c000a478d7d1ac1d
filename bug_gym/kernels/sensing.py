"""What a robot senses: the walls in reach, the observation, the clearance."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.body import body_circle, circle_radius
from bug_gym.kernels.chords import point_wall_distance
from bug_gym.kernels.geometry import clip, length, sin_cos
from bug_gym.kernels.ground import sample_ground
from bug_gym.kernels.layout import (
    HOLONOMIC,
    STREAM_RANGES,
    TERRAIN_HEADINGS,
    TERRAIN_RINGS,
    Floats,
    Footprint,
    Integers,
    Ranges,
    Record,
    Regions,
)
from bug_gym.kernels.neighbours import NOWHERE, in_eights, listed_discs
from bug_gym.kernels.noise import add_noise
from bug_gym.kernels.randomness import hash64
from bug_gym.kernels.rays import Beams, Discs, Origin, Walls, cast_rays, find_near_discs
from bug_gym.kernels.vectors import NEAR


@inlined
def gather_walls(
    f: Floats, k: Integers, s: Record, polygons: Discs, x: float, y: float, scratch: Floats, index: Integers
) -> Walls:
    """Walls of the border and of the polygons that reach into the scan's circle round (x, y), where they stand.

    From outside a polygon only those are taken that face (x, y): the others lie behind them. They are written to the
    end of `scratch`.
    """
    room = s.walls
    begin = scratch.size - 4 * room
    x1, y1 = scratch[begin : begin + room], scratch[begin + room : begin + 2 * room]
    x2, y2 = scratch[begin + 2 * room : begin + 3 * room], scratch[begin + 3 * room : begin + 4 * room]
    count = 0
    for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
        x1[count] = f[s.wall + 4 * w]
        y1[count] = f[s.wall + 4 * w + 1]
        x2[count] = f[s.wall + 4 * w + 2]
        y2[count] = f[s.wall + 4 * w + 3]
        count += 1
    if polygons.total == 0:
        return Walls(x1, y1, x2, y2, count)
    moving = k[s.moving_polygon_count]
    near = find_near_discs(polygons, x, y, s.reach, index)
    for j in range(near):
        at = np.uint64(index[np.uint64(NEAR) + j])
        number = k[np.uint64(s.near_number + s.disc_room) + at]
        bx, by, radius = polygons.x[at], polygons.y[at], polygons.radius[at]
        dx, dy = x - bx, y - by
        side = 0.0 if dx * dx + dy * dy <= radius * radius else np.float64(k[s.polygon_side + number])
        if number >= moving:
            bx, by = 0.0, 0.0
        first = k[s.polygon_first + number]
        for w in range(first, first + k[s.polygon_walls + number]):
            ax, ay = f[s.wall + 4 * w] + bx, f[s.wall + 4 * w + 1] + by
            cx, cy = f[s.wall + 4 * w + 2] + bx, f[s.wall + 4 * w + 3] + by
            x1[count] = ax
            y1[count] = ay
            x2[count] = cx
            y2[count] = cy
            count += int(side * ((ax - x) * (cy - y) - (ay - y) * (cx - x)) <= 0.0)
    return Walls(x1, y1, x2, y2, count)


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
                cx, cy = body_circle(f, s, footprint, s.pose, other, c)
                columns[count] = cx
                columns[room + count] = cy
                columns[2 * room + count] = footprint[c, 2]
                count += 1
    for j in range(count, in_eights(count)):
        columns[j], columns[room + j], columns[2 * room + j] = NOWHERE, NOWHERE, 0.0
    return listed_discs(s, 0, in_eights(count), columns)


@inlined
def scan(
    f: Floats,
    k: Integers,
    ranges: Ranges,
    s: Record,
    beams: Floats,
    origin: Origin,
    discs: Discs,
    polygons: Discs,
    scratch: Floats,
    scratch_int: Integers,
    r: int,
) -> None:
    """Fill robot r's ranges (B,), with their noise."""
    walls = gather_walls(f, k, s, polygons, origin.x, origin.y, scratch, scratch_int)
    fan = Beams(beams[0], beams[1], s.first_angle, 1.0 / s.angle_step, np.float64(s.beams) - 1.0)
    cast_rays(discs, walls, origin, fan, s.reach, scratch, scratch_int, ranges)
    if s.range_noise > 0.0 or s.dropout > 0.0 or s.min_range > 0.0:
        key = hash64(k[s.seed], k[s.episode], k[s.steps] * s.robots + r, STREAM_RANGES)
        add_noise(ranges, s.beams, s.reach, s.min_range, s.range_noise, s.dropout, key)
    if s.no_return > s.reach:
        far, none = np.float32(s.reach), np.float32(s.no_return)
        for i in range(s.beams):
            ranges[i] = none if ranges[i] >= far else ranges[i]


@inlined
def goal_in_frame(f: Floats, s: Record, origin: Origin, r: int) -> tuple[float, float]:
    """The goal in robot r's frame [m], sensed as a beacon or computed from odometry."""
    goal_x, goal_y = f[s.goal_place + 2 * r], f[s.goal_place + 2 * r + 1]
    goal_sin, goal_cos = origin.sin, origin.cos
    gx, gy = goal_x - origin.x, goal_y - origin.y
    if s.goal_by_odometry:
        wx, wy = goal_x - f[s.origin + 3 * r], goal_y - f[s.origin + 3 * r + 1]
        origin_sin, origin_cos = sin_cos(f[s.origin + 3 * r + 2])
        ex, ey, eh = f[s.odometry + 3 * r], f[s.odometry + 3 * r + 1], f[s.odometry + 3 * r + 2]
        gx, gy = origin_cos * wx + origin_sin * wy - ex, origin_cos * wy - origin_sin * wx - ey
        goal_sin, goal_cos = sin_cos(eh)
    return goal_cos * gx + goal_sin * gy, goal_cos * gy - goal_sin * gx


@inlined
def see_peers(f: Floats, peers: Ranges, s: Record, origin: Origin, heading: float, r: int) -> None:
    """Fill what robot r senses of the others (4 (R - 1),): place and velocity in its frame [m, m/s]."""
    at = 0
    for other in range(s.robots):
        if other != r:
            dx, dy = f[s.pose + 3 * other] - origin.x, f[s.pose + 3 * other + 1] - origin.y
            vx, vy = f[s.velocity + 2 * other], f[s.velocity + 2 * other + 1]
            turn_sin, turn_cos = sin_cos(f[s.pose + 3 * other + 2] - heading)
            if s.kinematics != HOLONOMIC:
                vy = 0.0
            peers[at] = clip(origin.cos * dx + origin.sin * dy, -s.span, s.span)
            peers[at + 1] = clip(origin.cos * dy - origin.sin * dx, -s.span, s.span)
            peers[at + 2] = turn_cos * vx - turn_sin * vy
            peers[at + 3] = turn_sin * vx + turn_cos * vy
            at += 4


@inlined
def observe(
    f: Floats,
    k: Integers,
    observation: Ranges,
    s: Record,
    beams: Floats,
    footprint: Footprint,
    regions: Regions,
    columns: Floats,
    scratch: Floats,
    scratch_int: Integers,
    r: int,
) -> None:
    """Fill robot r's observation (D,); layout.OBSERVATION says where each field begins."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    sin, cos = sin_cos(heading)
    origin = Origin(x, y, cos, sin)
    discs = stand_in(f, k, s, footprint, columns, r)
    polygons = listed_discs(s, s.disc_room, in_eights(k[s.near_polygons]), columns)
    ranges = observation[s.see_ranges : s.see_ranges + s.beams]
    scan(f, k, ranges, s, beams, origin, discs, polygons, scratch, scratch_int, r)
    ahead, left = goal_in_frame(f, s, origin, r)
    observation[s.see_goal] = clip(ahead, -s.span, s.span)
    observation[s.see_goal + 1] = clip(left, -s.span, s.span)
    observation[s.see_pose] = clip(f[s.odometry + 3 * r], -2.0 * s.span, 2.0 * s.span)
    observation[s.see_pose + 1] = clip(f[s.odometry + 3 * r + 1], -2.0 * s.span, 2.0 * s.span)
    observation[s.see_pose + 2] = f[s.odometry + 3 * r + 2]
    observation[s.see_velocity] = f[s.velocity + 2 * r]
    observation[s.see_velocity + 1] = f[s.velocity + 2 * r + 1]
    if regions is not None:
        samples = TERRAIN_HEADINGS * TERRAIN_RINGS
        sample_ground(s, regions, observation[s.see_terrain : s.see_terrain + samples], x, y, heading)
    if footprint is not None and s.robots > 1:
        see_peers(f, observation[s.see_peers :], s, origin, heading, r)


@inlined
def wall_gap(f: Floats, s: Record, w: int, x: float, y: float) -> float:
    """Distance of a point to wall w, both in the frame in which the wall is kept."""
    at = s.wall + 4 * w
    return point_wall_distance(x, y, f[at], f[at + 1], f[at + 2], f[at + 3])


@called
def clearance_at(f: Floats, k: Integers, s: Record, footprint: Footprint, r: int) -> float:
    """Distance from robot r's body to the nearest obstacle, border and other robot [m], at its present pose.

    All bodies have been brought to now.
    """
    nearest = math.inf
    for c in range(s.footprint):
        x, y = body_circle(f, s, footprint, s.pose, r, c)
        radius = circle_radius(s, footprint, c)
        for w in range(k[s.border_first], k[s.border_first] + k[s.border_walls]):
            nearest = min(nearest, wall_gap(f, s, w, x, y) - radius)
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
                nearest = min(nearest, wall_gap(f, s, w, x - bx, y - by) - radius)
        if footprint is None:
            continue
        for other in range(s.robots):
            if other != r:
                for d in range(s.footprint):
                    ox, oy = body_circle(f, s, footprint, s.pose, other, d)
                    nearest = min(nearest, length(x - ox, y - oy) - radius - footprint[d, 2])
    return nearest
