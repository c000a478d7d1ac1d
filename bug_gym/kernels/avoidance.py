"""Half planes of velocities: what a body that looks may do among walls, bodies and robots.

Source: van den Berg, Guy, Lin and Manocha 2011, "Reciprocal n-Body Collision Avoidance" (ORCA).

A velocity is chosen within half planes n . v >= c, kept as triples (nx, ny, c) in scratch: those of still things and of
bodies about to touch hold always and let at least v = 0 through; those of the crowd law give way where they leave
nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.compiling import called, inlined
from bug_gym.kernels.body import body_circle
from bug_gym.kernels.geometry import length, sin_cos
from bug_gym.kernels.layout import HOLONOMIC, RUNNING, Floats, Integers, Record
from bug_gym.kernels.walls import wall_ends

WALL_HORIZON = 0.5  # a body comes no nearer to a still thing than would bring it there in this time [s]
SKIN = 0.02  # room that bodies of a crowd leave between them and to robots [m]
SAME_SPEED = 1e-9  # [m/s]


def steering_floats(walls: int, bodies: int, circles: int) -> int:
    """Length of the scratch that `steer_bodies` needs; `circles` is how many make up all robots."""
    return 2 * bodies + 6 * (walls + 2 * bodies + 2 * circles)


@called
def edge_range(lines: Floats, i: int, count: int, speed: float) -> tuple[float, float]:
    """The part of half plane i's edge that half planes 0 ... count - 1 and the greatest speed leave: low and high.

    They are positions along (-ny, nx) from the edge's point nearest to v = 0; nothing is left where low > high.
    """
    nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
    room = speed * speed - c * c
    if room < 0.0:
        return 1.0, -1.0
    high = math.sqrt(room)
    low = -high
    for j in range(count):
        mx, my = lines[3 * j], lines[3 * j + 1]
        rise = nx * my - ny * mx
        need = lines[3 * j + 2] - c * (nx * mx + ny * my)
        if abs(rise) < 1e-12:  # parallel
            if need > SAME_SPEED:
                return 1.0, -1.0
        elif rise > 0.0:
            low = max(low, need / rise)
        else:
            high = min(high, need / rise)
    if high < low <= high + SAME_SPEED:  # edges that meet in a point, but for rounding
        low = high
    return low, high


@called
def nearest_velocity(lines: Floats, count: int, speed: float, wish_x: float, wish_y: float) -> tuple[float, float, int]:
    """The velocity nearest to a wish within `count` half planes and the greatest speed, by an incremental programme.

    Half planes are taken one after the other; where one cuts off the best velocity so far, the new best one lies on
    its edge.

    Args:
        lines: nx, ny, c of each half plane, one after the other.
        count: how many half planes.
        speed: greatest speed [m/s].
        wish_x: wish [m/s].
        wish_y: wish [m/s].

    Returns:
        vx, vy, and the number of the first half plane that leaves nothing of those before it (`count`: none does).
    """
    norm = length(wish_x, wish_y)
    share = speed / norm if norm > speed else 1.0
    vx, vy = share * wish_x, share * wish_y
    for i in range(count):
        nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        if nx * vx + ny * vy >= c:
            continue
        low, high = edge_range(lines, i, i, speed)
        if low > high:
            return vx, vy, i
        along = min(max(nx * wish_y - ny * wish_x, low), high)
        vx, vy = c * nx - along * ny, c * ny + along * nx
    return vx, vy, count


@called
def farthest_velocity(lines: Floats, count: int, speed: float, nx: float, ny: float) -> tuple[float, float, bool]:
    """The velocity farthest along a unit vector within half planes and the greatest speed; and whether there is one."""
    vx, vy = speed * nx, speed * ny
    for i in range(count):
        mx, my, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        if mx * vx + my * vy >= c:
            continue
        low, high = edge_range(lines, i, i, speed)
        if low > high:
            return vx, vy, False
        along = high if mx * ny - my * nx > 0.0 else low
        vx, vy = c * mx - along * my, c * my + along * mx
    return vx, vy, True


@called
def least_violation(
    lines: Floats, hard: int, first: int, count: int, speed: float, vx: float, vy: float, spare: Floats
) -> tuple[float, float]:
    """The velocity for which the half planes from `hard` on are missed by the least, the worst of them counted.

    Again one after the other: where one is missed by more than the worst before it, the new best velocity is the one
    farthest along its normal among those for which none before it is missed by more.

    Args:
        lines: nx, ny, c of each half plane.
        hard: how many of them hold always.
        first: number of the first one that could not be kept.
        count: how many half planes.
        speed: greatest speed [m/s].
        vx: a velocity that keeps all before `first` [m/s].
        vy: the same.
        spare: room for as many half planes.
    """
    for j in range(3 * hard):
        spare[j] = lines[j]
    worst = 0.0
    for i in range(first, count):
        nx, ny, c = lines[3 * i], lines[3 * i + 1], lines[3 * i + 2]
        if c - nx * vx - ny * vy <= worst:
            continue
        kept = hard
        for j in range(hard, i):
            dx, dy = lines[3 * j] - nx, lines[3 * j + 1] - ny
            apart = length(dx, dy)
            if apart > 1e-12:  # else it is the same normal, and this one asks for more
                kept = add_half_plane(spare, kept, dx / apart, dy / apart, (lines[3 * j + 2] - c) / apart)
        new_x, new_y, found = farthest_velocity(spare, kept, speed, nx, ny)
        if found:
            vx, vy = new_x, new_y
        worst = max(worst, c - nx * vx - ny * vy)
    return vx, vy


@inlined
def add_half_plane(lines: Floats, count: int, nx: float, ny: float, c: float) -> int:
    """Append n . v >= c; returns the new number of half planes."""
    lines[3 * count] = nx
    lines[3 * count + 1] = ny
    lines[3 * count + 2] = c
    return count + 1


@called
def add_wall_half_planes(
    f: Floats,
    k: Integers,
    s: Record,
    first: int,
    walls: int,
    x: float,
    y: float,
    radius: float,
    near: float,
    horizon: float,
    lines: Floats,
    count: int,
) -> int:
    """Half planes that keep a disc off a range of still walls; returns the new number of half planes."""
    for w in range(first, first + walls):
        x1, y1, x2, y2 = wall_ends(f, k, s, w)
        ux, uy = x2 - x1, y2 - y1
        square = ux * ux + uy * uy
        along = min(max(((x - x1) * ux + (y - y1) * uy) / square, 0.0), 1.0)
        dx, dy = x - x1 - along * ux, y - y1 - along * uy
        away = dx * dx + dy * dy
        if away >= near * near:
            continue
        distance = math.sqrt(away)
        gap = max(distance - radius, 0.0)
        if distance == 0.0:
            dx, dy, distance = -uy, ux, math.sqrt(square)
        count = add_half_plane(lines, count, dx / distance, dy / distance, -gap / horizon)
    return count


@called
def add_still_half_planes(f: Floats, k: Integers, s: Record, b: int, lines: Floats) -> int:
    """Half planes that keep body b off still discs, still polygons and the border; returns how many.

    A still thing is a convex piece, a disc or a wall, that lies behind the line through its nearest point square to
    the way there. A body that comes no nearer to that line than the gap never enters it; one that begins too near
    goes no deeper.
    """
    x, y, radius, speed = f[s.body_x + b], f[s.body_y + b], f[s.body_radius + b], f[s.body_speed + b]
    horizon = max(WALL_HORIZON, s.step)
    near = radius + speed * horizon
    count = 0
    for m in range(k[s.moving_disc_count], k[s.disc_count]):
        dx, dy = x - f[s.body_x + m], y - f[s.body_y + m]
        limit = near + f[s.body_radius + m]
        square = dx * dx + dy * dy
        if 0.0 < square < limit * limit:
            distance = math.sqrt(square)
            gap = max(distance - radius - f[s.body_radius + m], 0.0)
            count = add_half_plane(lines, count, dx / distance, dy / distance, -gap / horizon)
    border, walls = k[s.border_first], k[s.border_walls]
    count = add_wall_half_planes(f, k, s, border, walls, x, y, radius, near, horizon, lines, count)
    for number in range(k[s.moving_polygon_count], k[s.polygon_count]):
        p = s.discs + number
        dx, dy, limit = x - f[s.body_x + p], y - f[s.body_y + p], near + f[s.body_radius + p]
        if dx * dx + dy * dy < limit * limit:
            count = add_wall_half_planes(
                f,
                k,
                s,
                k[s.polygon_first + number],
                k[s.polygon_walls + number],
                x,
                y,
                radius,
                near,
                horizon,
                lines,
                count,
            )
    return count


# Crowd: optimal reciprocal collision avoidance of van den Berg, Guy, Lin and Manocha (2011).


@called
def escape_velocity(
    px: float, py: float, vx: float, vy: float, together: float, horizon: float, step: float
) -> tuple[float, float, float, float]:
    """The smallest change u of a relative velocity that avoids contact, and the direction n in which to go on avoiding.

    Args:
        px: place of the other body, seen from this one [m].
        py: the same.
        vx: velocity of this body, seen from the other one [m/s].
        vy: the same.
        together: sum of the radii [m].
        horizon: for so long there is to be no contact [s].
        step: time in which bodies that overlap are to come apart [s].

    Returns:
        ux, uy, nx, ny; n is a unit vector square to the nearest edge of the velocities that lead to contact.
    """
    square = px * px + py * py
    overlap = square <= together * together
    # Velocities that lead to contact: a cone from v = 0 on about p, cut off by the disc of those that do just in time.
    time = step if overlap else horizon
    wx, wy = vx - px / time, vy - py / time
    along = wx * px + wy * py
    norm = length(wx, wy)
    if overlap or (along < 0.0 and along * along > together * together * norm * norm):
        if norm == 0.0:
            wx, wy, norm = -px, -py, math.sqrt(square)
        nx, ny = wx / norm, wy / norm
        short = together / time - norm
        return short * nx, short * ny, nx, ny
    leg = math.sqrt(square - together * together)
    if px * wy - py * wx > 0.0:
        ex, ey = (px * leg - py * together) / square, (px * together + py * leg) / square
    else:
        ex, ey = -(px * leg + py * together) / square, (px * together - py * leg) / square
    along = vx * ex + vy * ey
    return along * ex - vx, along * ey - vy, -ey, ex


class Disc(NamedTuple):
    """A disc to be avoided, seen from the body that avoids it."""

    x: float
    """Place [m]."""
    y: float
    """Place [m]."""
    vx: float
    """Velocity [m/s]."""
    vy: float
    """Velocity [m/s]."""
    together: float
    """Sum of the radii and the skin [m]."""


@inlined
def add_reciprocal(
    other: Disc, share: float, vx: float, vy: float, horizon: float, step: float, lines: Floats, count: int
) -> int:
    """Append the half plane of ORCA because of another disc; returns the new number of half planes.

    Args:
        other: the other disc, seen from the body.
        share: of the avoidance that is this body's.
        vx: velocity of the body [m/s].
        vy: the same.
        horizon: for so long there is to be no contact [s].
        step: time in which bodies that overlap are to come apart [s].
        lines: half planes.
        count: how many there are.
    """
    px, py, ox, oy, together = other
    ux, uy, nx, ny = escape_velocity(px, py, vx - ox, vy - oy, together, horizon, step)
    return add_half_plane(lines, count, nx, ny, nx * (vx + share * ux) + ny * (vy + share * uy))


@called
def add_avoidance(
    f: Floats, s: Record, b: int, other: Disc, share: float, lines: Floats, hard: int, spare: Floats, soft: int
) -> tuple[int, int]:
    """Half planes of body b because of another disc: one that holds always into `lines`, one that may give way `spare`.

    Args:
        f: the row's floats.
        s: the row's record.
        b: the body.
        other: the other disc, seen from the body.
        share: of the avoidance that is this body's: a half where the other does the same, else 1.
        lines: half planes.
        hard: how many there are.
        spare: half planes.
        soft: how many there are.

    Returns:
        The new `hard` and `soft`.
    """
    px, py, ox, oy, together = other
    vx, vy, speed, horizon = f[s.body_vx + b], f[s.body_vy + b], f[s.body_speed + b], f[s.body_foresight + b]
    foreseen, meeting = together + (speed + length(ox, oy)) * horizon, together + 2.0 * speed * s.step
    square = px * px + py * py
    if square >= foreseen * foreseen and square >= meeting * meeting:
        return hard, soft
    distance = math.sqrt(square)
    # Each goes at most its share of the gap this step, so that two never touch however little room a crowd leaves.
    most = share * max(distance - together, 0.0) / s.step
    if most < speed:
        hard = add_half_plane(lines, hard, -px / distance, -py / distance, -most)
    if square < foreseen * foreseen:
        soft = add_reciprocal(other, share, vx, vy, horizon, s.step, spare, soft)
    return hard, soft


@called
def add_robots(
    f: Floats, k: Integers, s: Record, footprint: Floats, b: int, lines: Floats, hard: int, spare: Floats, soft: int
) -> tuple[int, int]:
    """Half planes of body b because of the robots, which avoid nobody; returns the new `hard` and `soft`."""
    x, y = f[s.body_x + b], f[s.body_y + b]
    for r in range(s.robots):
        vx, vy = 0.0, 0.0
        if k[s.outcome + r] == RUNNING:
            ahead, left = f[s.velocity + 2 * r], f[s.velocity + 2 * r + 1]
            if s.kinematics != HOLONOMIC:
                left = 0.0
            sin, cos = sin_cos(f[s.pose + 3 * r + 2])
            vx, vy = cos * ahead - sin * left, sin * ahead + cos * left
        for c in range(s.footprint):
            cx, cy = body_circle(f, footprint, s.pose, r, c)
            if cx != x or cy != y:
                together = f[s.body_radius + b] + footprint[c, 2] + SKIN
                hard, soft = add_avoidance(
                    f, s, b, Disc(cx - x, cy - y, vx, vy, together), 1.0, lines, hard, spare, soft
                )
    return hard, soft
