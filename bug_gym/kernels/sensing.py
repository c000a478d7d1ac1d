"""What a robot senses: the walls in reach, the observation, the clearance."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.body import body_circle
from bug_gym.kernels.chords import point_wall_distance
from bug_gym.kernels.contact import find_near_polygons
from bug_gym.kernels.geometry import clip, length, sin_cos
from bug_gym.kernels.ground import sample_ground
from bug_gym.kernels.layout import (
    DIFFERENTIAL,
    STREAM_RANGES,
    TERRAIN_HEADINGS,
    TERRAIN_RINGS,
    Floats,
    Integers,
    Ranges,
    Record,
)
from bug_gym.kernels.noise import add_noise
from bug_gym.kernels.randomness import hash64
from bug_gym.kernels.rays import cast_rays
from bug_gym.kernels.vectors import NEAR


@inlined
def gather_walls(
    f: Floats, k: Integers, s: Record, x: float, y: float, scratch: Floats, index: Integers
) -> tuple[Floats, Floats, Floats, Floats, int]:
    """Walls of the border and of the polygons that reach into the scan's circle round (x, y), where they stand.

    From outside a polygon only those are taken that face (x, y): the others lie behind them. They are written to the
    end of `scratch`. Returns x1, y1, x2, y2 (S,) and how many of them count.
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
    polygons, moving = k[s.polygon_count], k[s.moving_polygon_count]
    if polygons == 0:
        return x1, y1, x2, y2, count
    near = find_near_polygons(f, s, polygons, x, y, s.reach, index)
    for j in range(near):
        number = index[np.uint64(NEAR) + j]
        b = s.discs + number
        bx, by, radius = f[s.body_x + b], f[s.body_y + b], f[s.body_radius + b]
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
    return x1, y1, x2, y2, count


@inlined
def observe(
    f: Floats,
    k: Integers,
    observation: Ranges,
    s: Record,
    beams: Floats,
    footprint: Floats,
    regions: Floats,
    scratch: Floats,
    scratch_int: Integers,
    r: int,
) -> None:
    """Fill robot r's observation (D,): ranges, goal, pose, velocity, terrain, peers, as observation.fields says."""
    x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
    sin, cos = sin_cos(heading)
    discs = k[s.disc_count]
    # The other robots are discs too while this one looks; they lie behind the world's own.
    for other in range(s.robots):
        if other != r:
            for c in range(s.footprint):
                cx, cy = body_circle(f, s, footprint, s.pose, other, c)
                f[s.body_x + discs] = cx
                f[s.body_y + discs] = cy
                f[s.body_radius + discs] = footprint[c, 2]
                discs += 1
    near_x1, near_y1, near_x2, near_y2, walls = gather_walls(f, k, s, x, y, scratch, scratch_int)
    ranges = observation[: s.beams]
    cast_rays(
        f[s.body_x : s.body_x + discs],
        f[s.body_y : s.body_y + discs],
        f[s.body_radius : s.body_radius + discs],
        discs,
        near_x1,
        near_y1,
        near_x2,
        near_y2,
        walls,
        x,
        y,
        heading,
        beams[0],
        beams[1],
        s.first_angle,
        s.angle_step,
        s.reach,
        scratch,
        scratch_int,
        ranges,
    )
    if s.range_noise > 0.0 or s.dropout > 0.0 or s.min_range > 0.0:
        key = hash64(k[s.seed], k[s.episode], k[s.steps] * s.robots + r, STREAM_RANGES)
        add_noise(ranges, s.beams, s.reach, s.min_range, s.range_noise, s.dropout, key)
    at = s.beams
    g = k[s.goal_body + r]
    ex, ey, eh = f[s.odometry + 3 * r], f[s.odometry + 3 * r + 1], f[s.odometry + 3 * r + 2]
    goal_sin, goal_cos = sin, cos
    gx, gy = f[s.body_x + g] - x, f[s.body_y + g] - y
    if s.goal_by_odometry:
        wx, wy = f[s.body_x + g] - f[s.origin + 3 * r], f[s.body_y + g] - f[s.origin + 3 * r + 1]
        origin_sin, origin_cos = sin_cos(f[s.origin + 3 * r + 2])
        gx, gy = origin_cos * wx + origin_sin * wy - ex, origin_cos * wy - origin_sin * wx - ey
        goal_sin, goal_cos = sin_cos(eh)
    observation[at] = clip(goal_cos * gx + goal_sin * gy, -s.span, s.span)
    observation[at + 1] = clip(goal_cos * gy - goal_sin * gx, -s.span, s.span)
    observation[at + 2] = clip(ex, -2.0 * s.span, 2.0 * s.span)
    observation[at + 3] = clip(ey, -2.0 * s.span, 2.0 * s.span)
    observation[at + 4] = eh
    observation[at + 5] = f[s.velocity + 2 * r]
    observation[at + 6] = f[s.velocity + 2 * r + 1]
    at += 7
    if s.regions > 0:
        samples = TERRAIN_HEADINGS * TERRAIN_RINGS
        sample_ground(s, regions, observation[at : at + samples], x, y, heading)
        at += samples
    for other in range(s.robots):
        if other != r:
            dx, dy = f[s.pose + 3 * other] - x, f[s.pose + 3 * other + 1] - y
            vx, vy = f[s.velocity + 2 * other], f[s.velocity + 2 * other + 1]
            turn_sin, turn_cos = sin_cos(f[s.pose + 3 * other + 2] - heading)
            if s.kinematics == DIFFERENTIAL:
                vy = 0.0
            observation[at] = clip(cos * dx + sin * dy, -s.span, s.span)
            observation[at + 1] = clip(cos * dy - sin * dx, -s.span, s.span)
            observation[at + 2] = turn_cos * vx - turn_sin * vy
            observation[at + 3] = turn_sin * vx + turn_cos * vy
            at += 4


@inlined
def wall_gap(f: Floats, s: Record, w: int, x: float, y: float) -> float:
    """Distance of a point to wall w, both in the frame in which the wall is kept."""
    at = s.wall + 4 * w
    return point_wall_distance(x, y, f[at], f[at + 1], f[at + 2], f[at + 3])


@called
def clearance_at(f: Floats, k: Integers, s: Record, footprint: Floats, r: int) -> float:
    """Distance from robot r's body to the nearest obstacle, border and other robot [m], at its present pose."""
    nearest = math.inf
    for c in range(s.footprint):
        x, y = body_circle(f, s, footprint, s.pose, r, c)
        radius = footprint[c, 2]
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
        for other in range(s.robots):
            if other != r:
                for d in range(s.footprint):
                    ox, oy = body_circle(f, s, footprint, s.pose, other, d)
                    nearest = min(nearest, length(x - ox, y - oy) - radius - footprint[d, 2])
    return nearest
