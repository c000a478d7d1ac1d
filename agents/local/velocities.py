"""The choice of a velocity among movers and still points, compiled.

All is in the robot's frame. A mover is a row x, y [m], vx, vy [m/s], radius [m]. A velocity v leads to contact with one
within the horizon if the ray from the robot along v - v_mover meets the mover's disc, grown by the robot, in time
(Sellers et al. 2026, equations 10 to 12, with the horizon that they name and (12) lacks).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.avoidance import add_half_plane, escape_velocity, least_violation, nearest_velocity
from bug_gym.kernels.free_way import way_to_point
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import Floats

SPEEDS = 16
HEADINGS = 36
PLAIN, RECIPROCAL, ORCA = 0, 1, 2
"""Rules: velocity obstacles, reciprocal ones, half planes."""
SHARES = (1.0, 0.5, 0.1)
"""Of the margin to movers, where the whole of it leaves no velocity: how much is tried."""
NO_CLOSER = 0.999
"""A mover that is nearer than the margin already must not come nearer than this share of its distance."""
TILT = 0.05
"""By so much the wish is turned to the left where half planes cut it [rad]."""
OUTSIDE = 1e-6
"""By how much more than tangential an edge of a velocity obstacle is taken, as a share of the radius."""


class Robot(NamedTuple):
    """What the choice needs of the robot."""

    radius: float
    """That must not meet still points [m]."""
    body: float
    """That must not meet movers [m]."""
    margin: float
    """To movers, beside the bodies [m]."""
    max_speed: float
    """[m/s]"""
    step: float
    """Time of a decision [s]."""
    acceleration: float
    """Largest [m/s^2]; infinite: none."""
    horizon: float
    """tau: how far ahead contact with movers counts [s]."""
    still_horizon: float
    """How far ahead contact with still points counts, beside the time to stop [s]."""
    weight: float
    """Of 1 / time to contact where every velocity leads to one [m]."""
    steadiness: float
    """Weight of a change of velocity beside that of the distance to the wish [-]."""
    rule: int
    """PLAIN, RECIPROCAL or ORCA."""
    is_steered: bool = False
    """Whether it steers as a car does: its acceleration bounds the change of its speed, its direction changes at once."""


class Wish(NamedTuple):
    """What the robot would do, and does."""

    vx: float
    """Preferred velocity [m/s]."""
    vy: float
    """The same."""
    way: float
    """How far it wants to go so: still points beyond do not matter [m]."""
    own_x: float
    """Velocity now [m/s]."""
    own_y: float
    """The same."""


class Around(NamedTuple):
    """What is near."""

    x: Floats
    """Scan points (k,) [m]."""
    y: Floats
    """The same."""
    is_mover: Floats
    """Above 0 where a point lies on a mover (k,)."""
    movers: Floats
    """(n, 5)."""
    free: Floats
    """(HEADINGS, 2) room for the free ways along the headings sampled."""
    lines: Floats
    """Room for n half planes."""
    spare: Floats
    """Room for n half planes."""


class Choice(NamedTuple):
    """The best velocity so far."""

    vx: float
    """[m/s]"""
    vy: float
    """[m/s]"""
    cost: float
    """What it costs [m/s]; infinite: there is none."""


@inlined
def time_to_contact(px: float, py: float, wx: float, wy: float, together: float) -> float:
    """When a point at relative velocity w meets a disc at p [s]; infinite: never, 0: they overlap."""
    c = px * px + py * py - together * together
    if c < 0.0:
        return 0.0
    a, b = wx * wx + wy * wy, px * wx + py * wy
    root = b * b - a * c
    if b <= 0.0 or root < 0.0:
        return math.inf
    return (b - math.sqrt(root)) / a


@inlined
def kept_distance(robot: Robot, movers: Floats, i: int, share: float) -> float:
    """Sum of the radii and a share of the margin [m], or a little under their distance where they are nearer."""
    bodies = robot.body + movers[i, 4]
    together = bodies + share * robot.margin
    away = length(movers[i, 0], movers[i, 1])
    return float(max(min(together, NO_CLOSER * away), bodies) if away < together else together)


@inlined
def contact_time(robot: Robot, around: Around, wish: Wish, i: int, vx: float, vy: float, share: float) -> float:
    """Time until a velocity leads to contact with one mover within the horizon [s]; infinite: it does not."""
    px, py = around.movers[i, 0], around.movers[i, 1]
    wx, wy = vx - around.movers[i, 2], vy - around.movers[i, 3]
    if robot.rule == RECIPROCAL:  # the cone's apex is the mean of both velocities
        wx, wy = 2.0 * vx - wish.own_x - around.movers[i, 2], 2.0 * vy - wish.own_y - around.movers[i, 3]
    time = time_to_contact(px, py, wx, wy, kept_distance(robot, around.movers, i, share))
    return time if time <= robot.horizon else math.inf


@called
def first_contact_time(robot: Robot, around: Around, wish: Wish, vx: float, vy: float, share: float) -> float:
    """The same with any mover [s]."""
    first = math.inf
    for i in range(around.movers.shape[0]):
        first = min(first, contact_time(robot, around, wish, i, vx, vy, share))
    return first


@called
def parting(robot: Robot, around: Around, vx: float, vy: float) -> float:
    """The least speed at which the robot parts from movers that it overlaps [m/s]; infinite where it overlaps none."""
    least = math.inf
    for i in range(around.movers.shape[0]):
        px, py = around.movers[i, 0], around.movers[i, 1]
        away = length(px, py)
        if 0.0 < away < robot.body + around.movers[i, 4]:
            least = min(least, -(px * (vx - around.movers[i, 2]) + py * (vy - around.movers[i, 3])) / away)
    return least


@called
def free_ways(around: Around, radius: float, cos: float, sin: float, reach: float) -> tuple[float, float]:
    """How far a disc goes along a direction until it meets a point of the scan, and a still one [m]."""
    every, still = reach, reach
    for i in range(around.x.size):
        along = around.x[i] * cos + around.y[i] * sin
        way = way_to_point(along, around.y[i] * cos - around.x[i] * sin, radius)
        if way < every:
            every = way
        if way < still and around.is_mover[i] <= 0.0:
            still = way
    return every, still


@inlined
def is_admissible(robot: Robot, wish: Wish, speed: float, every: float, still: float) -> bool:
    """Whether the robot can still stop, and keeps off still things for long enough."""
    stop = speed * robot.step + 0.5 * speed * speed / robot.acceleration
    return every >= stop and still >= max(stop, min(speed * robot.still_horizon, wish.way))


@inlined
def is_reachable(robot: Robot, wish: Wish, vx: float, vy: float) -> bool:
    """Whether a velocity is within the robot's limits, seen from what it does now."""
    if robot.is_steered:
        change = abs(length(vx, vy) - length(wish.own_x, wish.own_y))
    else:
        change = length(vx - wish.own_x, vy - wish.own_y)
    return length(vx, vy) <= robot.max_speed * (1.0 + 1e-9) and (
        change <= robot.acceleration * robot.step * (1.0 + 1e-9) or length(vx, vy) == 0.0
    )


@inlined
def cost_of(robot: Robot, wish: Wish, vx: float, vy: float) -> float:
    """What a velocity costs: its distance to the wish, and a little for a change, so that of two sides one is kept."""
    change = length(vx - wish.own_x, vy - wish.own_y)
    return length(vx - wish.vx, vy - wish.vy) + robot.steadiness * change


@called
def is_outside(robot: Robot, around: Around, wish: Wish, vx: float, vy: float, share: float) -> bool:
    """Whether a velocity is outside every velocity obstacle, or within every half plane."""
    lines = around.lines
    for i in range(around.movers.shape[0]):
        if robot.rule == ORCA:
            if lines[3 * i] * vx + lines[3 * i + 1] * vy < lines[3 * i + 2] - 1e-9:
                return False
        elif contact_time(robot, around, wish, i, vx, vy, share) < math.inf:
            return False
    return True


@called
def weigh(robot: Robot, around: Around, wish: Wish, vx: float, vy: float, share: float, best: Choice) -> Choice:
    """The better of the best velocity so far and one that keeps off still things; share < 0: contact costs, too."""
    cost = cost_of(robot, wish, vx, vy)
    if cost >= best.cost:
        return best
    if share >= 0.0:
        return Choice(vx, vy, cost) if is_outside(robot, around, wish, vx, vy, share) else best
    apart = parting(robot, around, vx, vy)
    if apart < math.inf:  # parting fastest comes first
        cost = cost * 1e-3 - apart + 1e3
    else:
        cost += robot.weight / max(first_contact_time(robot, around, wish, vx, vy, 0.0), 1e-3)
    return Choice(vx, vy, cost) if cost < best.cost else best


@called
def try_velocity(robot: Robot, around: Around, wish: Wish, vx: float, vy: float, share: float, best: Choice) -> Choice:
    """`weigh` for a velocity whose way has to be free as well."""
    speed = length(vx, vy)
    if not is_reachable(robot, wish, vx, vy):
        return best
    # Movers are fewer than the points of a scan: they are looked at first.
    better = weigh(robot, around, wish, vx, vy, share, best)
    if better.cost >= best.cost:
        return best
    if speed > 0.0:
        reach = 2.0 * robot.max_speed * max(robot.still_horizon, 1.0) + 1e3 * robot.step
        every, still = free_ways(around, robot.radius, vx / speed, vy / speed, reach)
        if not is_admissible(robot, wish, speed, every, still):
            return best
    return better


@called
def try_edges(robot: Robot, around: Around, wish: Wish, share: float, best: Choice) -> Choice:
    """The wish projected on both edges of each velocity obstacle's cone."""
    for i in range(around.movers.shape[0]):
        px, py = around.movers[i, 0], around.movers[i, 1]
        away = length(px, py)
        sine = kept_distance(robot, around.movers, i, max(share, 0.0)) * (1.0 + OUTSIDE) / max(away, 1e-9)
        if sine >= 1.0:
            continue
        cosine = math.sqrt(1.0 - sine * sine)
        ox, oy = around.movers[i, 2], around.movers[i, 3]
        if robot.rule == RECIPROCAL:
            ox, oy = 0.5 * (ox + wish.own_x), 0.5 * (oy + wish.own_y)
        for side in (-1.0, 1.0):
            ex, ey = (px * cosine - side * py * sine) / away, (py * cosine + side * px * sine) / away
            along = (wish.vx - ox) * ex + (wish.vy - oy) * ey
            if along > 0.0:
                best = try_velocity(robot, around, wish, ox + along * ex, oy + along * ey, share, best)
    return best


@inlined
def goes_any_way(robot: Robot) -> bool:
    """Whether it may take any direction in a step."""
    return robot.is_steered or robot.acceleration * robot.step >= robot.max_speed


@called
def try_samples(robot: Robot, around: Around, wish: Wish, share: float, best: Choice) -> Choice:
    """Speeds and headings, evenly spread over what the robot can do in a step."""
    radius = robot.acceleration * robot.step
    if goes_any_way(robot):
        own = length(wish.own_x, wish.own_y)
        least = max(own - radius, 0.0) if radius < robot.max_speed else 0.0
        most = min(own + radius, robot.max_speed) if radius < robot.max_speed else robot.max_speed
        for j in range(HEADINGS):
            angle = 2.0 * math.pi * j / HEADINGS
            cos, sin = math.cos(angle), math.sin(angle)
            for k in range(1, SPEEDS + 1):
                speed = least + (most - least) * k / SPEEDS
                vx, vy = speed * cos, speed * sin
                if is_reachable(robot, wish, vx, vy) and is_admissible(
                    robot, wish, speed, around.free[j, 0], around.free[j, 1]
                ):
                    best = weigh(robot, around, wish, vx, vy, share, best)
        return best
    for j in range(HEADINGS):
        angle = 2.0 * math.pi * j / HEADINGS
        for k in range(1, SPEEDS + 1):
            change = radius * k / SPEEDS
            vx, vy = wish.own_x + change * math.cos(angle), wish.own_y + change * math.sin(angle)
            best = try_velocity(robot, around, wish, vx, vy, share, best)
    return best


@called
def half_planes(robot: Robot, around: Around, wish: Wish) -> None:
    """Write each mover's half plane: that of optimal reciprocal collision avoidance, half of it the robot's."""
    for i in range(around.movers.shape[0]):
        vx, vy = wish.own_x - around.movers[i, 2], wish.own_y - around.movers[i, 3]
        together = kept_distance(robot, around.movers, i, 1.0)
        px, py = around.movers[i, 0], around.movers[i, 1]
        ux, uy, nx, ny = escape_velocity(px, py, vx, vy, together, robot.horizon, robot.step)
        least = nx * (wish.own_x + 0.5 * ux) + ny * (wish.own_y + 0.5 * uy)
        add_half_plane(around.lines, i, nx, ny, least)


@called
def solve_half_planes(robot: Robot, around: Around, wish: Wish) -> Wish:
    """The wish within the half planes; where they leave nothing, the velocity that misses them by the least."""
    half_planes(robot, around, wish)
    count = around.movers.shape[0]
    vx, vy, first = nearest_velocity(around.lines, count, robot.max_speed, wish.vx, wish.vy)
    if vx != wish.vx or vy != wish.vy:
        # Straight toward a mover both sides are alike and none is taken: a wish a little to the left decides.
        tilted_x, tilted_y = wish.vx - TILT * wish.vy, wish.vy + TILT * wish.vx
        vx, vy, first = nearest_velocity(around.lines, count, robot.max_speed, tilted_x, tilted_y)
    if first < count:
        vx, vy = least_violation(around.lines, 0, first, count, robot.max_speed, vx, vy, around.spare)
    return Wish(vx, vy, wish.way, wish.own_x, wish.own_y)


@called
def search_velocity(robot: Robot, around: Around, wish: Wish, share: float) -> Choice:
    """The best velocity of all that are tried; its cost is infinite where none will do."""
    best = Choice(0.0, 0.0, math.inf)
    best = try_velocity(robot, around, wish, wish.vx, wish.vy, share, best)
    if best.cost < math.inf and share >= 0.0:
        return best
    if robot.rule != ORCA:
        best = try_edges(robot, around, wish, share, best)
    best = try_samples(robot, around, wish, share, best)
    return weigh(robot, around, wish, 0.0, 0.0, share, best)


@kernel
def choose_velocity(robot: Robot, around: Around, wish: Wish) -> tuple[float, float, float]:
    """The admissible velocity outside every velocity obstacle that is nearest to the wish.

    Where there is none the margin to movers is cut; then the velocity is taken whose distance to the wish and
    weight / time to contact is least; from what the robot overlaps it parts as fast as it can.

    Args:
        robot: limits and horizons.
        around: what is near.
        wish: preferred velocity, no faster than the robot can go.

    Returns:
        vx, vy [m/s], and the share of the margin that is kept, -1: none was possible.
    """
    aim = wish
    if robot.rule == ORCA:
        aim = solve_half_planes(robot, around, wish)
    if goes_any_way(robot):
        reach = 2.0 * robot.max_speed * max(robot.still_horizon, 1.0) + 1e3 * robot.step
        for j in range(HEADINGS):
            angle = 2.0 * math.pi * j / HEADINGS
            every, still = free_ways(around, robot.radius, math.cos(angle), math.sin(angle), reach)
            around.free[j, 0], around.free[j, 1] = every, still
    for share in SHARES:
        best = search_velocity(robot, around, aim, share)
        if best.cost < math.inf:
            return best.vx, best.vy, share
    best = search_velocity(robot, around, aim, -1.0)
    return best.vx, best.vy, -1.0
