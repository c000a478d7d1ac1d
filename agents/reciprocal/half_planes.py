"""The compiled part of ORCA for a robot: its half planes of velocities, and the velocity chosen within them.

The half planes of other bodies and the programme that chooses within them are those of the crowd
(bug_gym.kernels.avoidance).
"""

from __future__ import annotations

import math

from bug_gym.agents.reciprocal.bodies import GAP_SHARE, PX, PY, RADIUS, SHARE, VX, VY
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.avoidance import Disc, add_half_plane, add_reciprocal, least_violation, nearest_velocity
from bug_gym.kernels.layout import Floats, Integers
from bug_gym.kernels.levers import TURN_IN_PLACE, turn_rate
from bug_gym.kernels.randomness import hash64, uniform

# What is known of the robots that choose: radius [m]; what they keep from walls and from bodies beside it [m]; greatest speed
# [m/s]; horizon, and step [s]; greatest deceleration [m/s^2]; how far before walls they begin to slow down [s]; the greatest
# turn rate [rad/s], 0 of those that go any way without turning.
OWN_RADIUS, WALL_MARGIN, MARGIN, SPEED, HORIZON, STEP, DECELERATION, BEFORE_WALLS, TURN_RATE = range(9)
ROBOT = 9

# Of what each has chosen: the velocity in its frame [m/s]; 1 where bodies change what it would do without them; and that
# velocity, slower where it must turn toward it first.
CHOSEN_X, CHOSEN_Y, IS_DISTURBED, SLOW_X, SLOW_Y = range(5)
CHOSEN = 5


@called
def is_hidden(clean: Floats, cos: Floats, sin: Floats, reach: float, x: float, y: float, room: float) -> bool:
    """Whether a wall stands before a place [m]: the beam nearest to its bearing ends more than `room` [m] before it."""
    distance = math.hypot(x, y)
    best, nearest = -math.inf, 0
    for i in range(len(clean)):
        along = cos[i] * x + sin[i] * y
        if along > best:
            best, nearest = along, i
    seen: float = clean[nearest]
    return seen < reach and seen < distance - room


@called
def approach_limit(gap: float, step: float, deceleration: float) -> float:
    """The greatest speed [m/s] after a step at which a robot stops within a gap [m]."""
    if gap <= 0.0:
        return 0.0
    if deceleration == math.inf:
        return gap / step
    # w step + w^2 / (2 a) = gap
    lost = deceleration * step
    return math.sqrt(lost * lost + 2.0 * deceleration * gap) - lost


@inlined
def add_bodies(
    clean: Floats,
    cos: Floats,
    sin: Floats,
    reach: float,
    bodies: Floats,
    robot: Floats,
    velocity: tuple[float, float],
    lines: Floats,
    hard: int,
    spare: Floats,
) -> tuple[int, int]:
    """Half planes of bodies (n, BODY): not to touch in this step behind the `hard` ones in `lines`, ORCA's in `spare`.

    Returns how many there are then in each.
    """
    radius, margin, speed, horizon = robot[OWN_RADIUS], robot[MARGIN], robot[SPEED], robot[HORIZON]
    step, deceleration = robot[STEP], robot[DECELERATION]
    soft = 0
    for b in range(len(bodies)):
        x, y = bodies[b, PX], bodies[b, PY]
        distance = math.hypot(x, y)
        closing = speed + math.hypot(bodies[b, VX], bodies[b, VY])
        touching = radius + bodies[b, RADIUS]
        if distance == 0.0 or distance >= touching + margin + closing * horizon:
            continue
        limit = approach_limit(bodies[b, GAP_SHARE] * (distance - touching), step, deceleration)
        if limit < speed:
            hard = add_half_plane(lines, hard, -x / distance, -y / distance, -limit)
        if bodies[b, SHARE] == 0.0 or is_hidden(clean, cos, sin, reach, x, y, bodies[b, RADIUS]):
            continue
        # Two that are nearer than they would like keep the room that there is.
        together = max(min(touching + margin, distance * (1.0 - 1e-9)), touching)
        other = Disc(x, y, bodies[b, VX], bodies[b, VY], together)
        soft = add_reciprocal(other, bodies[b, SHARE], velocity[0], velocity[1], horizon, step, spare, soft)
    return hard, soft


@kernel
def choose_velocities(
    ranges: Floats,
    clean: Floats,
    cos: Floats,
    sin: Floats,
    reach: float,
    bodies: Floats,
    counts: Integers,
    robot: Floats,
    velocities: Floats,
    wishes: Floats,
    lines: Floats,
    spare: Floats,
    chosen: Floats,
) -> None:
    """The velocities of r robots nearest to their wishes that keep clear of walls and bodies.

    Half planes of walls, and those that keep two bodies from touching in this step, hold always; those of ORCA give way
    by the least where they leave nothing.

    Args:
        ranges: the scans (r, B) [m].
        clean: the same without bodies (r, B) [m].
        cos: directions of the beams, x (B,).
        sin: y (B,).
        reach: range that means "nothing seen" [m].
        bodies: (r, n, BODY).
        counts: how many of them there are (r,).
        robot: (ROBOT,).
        velocities: of the robots in their frames (r, 2) [m/s].
        wishes: in their frames (r, 2) [m/s].
        lines: room for B + 2 n half planes.
        spare: room for as many.
        chosen: filled (r, CHOSEN).
    """
    for r in range(counts.size):
        there, velocity, wish = (
            bodies[r, : counts[r]],
            (velocities[r, 0], velocities[r, 1]),
            (wishes[r, 0], wishes[r, 1]),
        )
        x, y, is_disturbed = reciprocal_velocity(
            ranges[r], clean[r], cos, sin, reach, there, robot, velocity, wish, lines, spare
        )
        chosen[r, CHOSEN_X], chosen[r, CHOSEN_Y], chosen[r, IS_DISTURBED] = x, y, 1.0 if is_disturbed else 0.0
        share = share_while_turning(there, robot, x, y)
        chosen[r, SLOW_X], chosen[r, SLOW_Y] = x * share, y * share


@called
def reciprocal_velocity(
    ranges: Floats,
    clean: Floats,
    cos: Floats,
    sin: Floats,
    reach: float,
    bodies: Floats,
    robot: Floats,
    velocity: tuple[float, float],
    wish: tuple[float, float],
    lines: Floats,
    spare: Floats,
) -> tuple[float, float, bool]:
    """The velocity of one of them, and whether bodies (n, BODY) change what it would do without them."""
    speed, step, before_walls = robot[SPEED], robot[STEP], robot[BEFORE_WALLS]
    near = robot[OWN_RADIUS] + robot[WALL_MARGIN] + speed * max(before_walls, step)
    walls = 0
    for i in range(len(clean)):
        if ranges[i] < near and ranges[i] < reach:
            gap = ranges[i] - robot[OWN_RADIUS] - robot[WALL_MARGIN]
            limit = approach_limit(gap, max(before_walls, step), robot[DECELERATION])
            walls = add_half_plane(lines, walls, -cos[i], -sin[i], -limit)
    hard, soft = add_bodies(clean, cos, sin, reach, bodies, robot, velocity, lines, walls, spare)
    vx, vy, failed = nearest_velocity(lines, walls, speed, wish[0], wish[1])
    alone_x, alone_y = vx, vy
    for j in range(3 * soft):
        lines[3 * hard + j] = spare[j]
    vx, vy, failed = nearest_velocity(lines, hard + soft, speed, wish[0], wish[1])
    if failed < hard:
        return 0.0, 0.0, True  # by rounding: to stand always keeps those
    if failed < hard + soft:
        vx, vy = least_violation(lines, hard, failed, hard + soft, speed, vx, vy, spare)
    return vx, vy, abs(vx - alone_x) + abs(vy - alone_y) > 1e-6 * speed


@inlined
def share_while_turning(bodies: Floats, robot: Floats, x: float, y: float) -> float:
    """What a robot that goes ahead while it turns toward a velocity [m/s] may drive of it, before bodies (n, BODY)."""
    speed, error = math.hypot(x, y), math.atan2(y, x)
    if robot[TURN_RATE] == 0.0 or speed == 0.0 or abs(error) > TURN_IN_PLACE:
        return 1.0
    chord = 0.5 * turn_rate(error, robot[STEP], robot[TURN_RATE]) * robot[STEP]
    # A vanishing speed keeps the direction, so that the robot goes on turning.
    return max(speed_before_bodies(bodies, robot, chord, speed) / speed, 1e-6)


@inlined
def speed_before_bodies(bodies: Floats, robot: Floats, direction: float, speed: float) -> float:
    """What of a speed [m/s] along a direction of the robot's frame [rad] leaves a gap to each body after this step."""
    ahead_x, ahead_y = math.cos(direction), math.sin(direction)
    for b in range(bodies.shape[0]):
        x, y = bodies[b, PX], bodies[b, PY]
        distance = math.hypot(x, y)
        closing = ahead_x * x + ahead_y * y
        if closing > 0.0:
            gap = bodies[b, GAP_SHARE] * (distance - robot[OWN_RADIUS] - bodies[b, RADIUS])
            speed = min(speed, approach_limit(gap, robot[STEP], robot[DECELERATION]) * distance / closing)
    return speed


@kernel
def drawn_share(seed: int, leg: int) -> float:
    """A number from 0 to 1 that a robot draws for a leg."""
    share: float = uniform(hash64(seed, 0, leg, 0), 0)
    return share
