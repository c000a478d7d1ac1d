"""The relative-velocity potential field: its potentials and the forces that are their negative gradients.

Source: Ge and Cui (2002), whose field the paper on potential field and wall following takes over; its displayed formulas
are lost, these are derived from the potentials. All vectors are in the robot's frame [m], [m/s]; R is the robot, T the
target, O the point of an obstacle that is nearest.

    n_RO   unit vector from the robot to the obstacle
    rho    distance to it, rho_s = rho - radius the gap
    v_RO   closing speed (v - v_O) . n_RO,   v_perp n_perp = (v - v_O) - v_RO n_RO
    rho_m  braking distance v_RO^2 / (2 a_max)
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.geometry import Point

LEAST_GAP = 0.05
"""Gap beyond the braking distance below which the repulsion grows no more [m]: a robot that close only avoids."""

LEAST_CLOSING = 0.05
"""Closing speed up to which nothing comes nearer [m/s]. In the printed field the repulsion jumps at 0, and a robot that
turns on the spot beside a wall would feel it come and go."""


@dataclass(frozen=True)
class Gains:
    """The constants of the field."""

    attraction: float
    """alpha_p, weight of the distance to the target."""
    exponent: int
    """m, power of that distance: 1 pulls alike everywhere, 2 in proportion to it."""
    velocity: float
    """alpha_v, weight of the square of the velocity relative to the target."""
    repulsion: float
    """eta, weight of the repulsion of what comes nearer."""
    influence: float
    """rho_0, gap beyond the braking distance at which the repulsion begins [m]."""
    acceleration: float
    """a_max, by which the robot brakes [m/s^2]."""
    floor: float
    """eta_s, weight of the repulsion of what is near, coming nearer or not."""
    floor_gap: float
    """rho_1, gap at which that one begins [m]."""
    radius: float
    """Of the robot's body [m]."""


def attractive_potential(gains: Gains, target: Point, velocity: Point) -> float:
    """alpha_p |p_T - p|^m + alpha_v |v_T - v|^2.

    Args:
        gains: of the field.
        target: p_T - p [m].
        velocity: v_T - v, of the target relative to the robot [m/s].
    """
    distance, speed = math.hypot(*target), math.hypot(*velocity)
    return gains.attraction * distance**gains.exponent + gains.velocity * speed**2


def attractive_force(gains: Gains, target: Point, velocity: Point) -> Point:
    """Its negative gradient by p and by v, together; arguments as of `attractive_potential`."""
    distance = math.hypot(*target)
    pull = gains.exponent * gains.attraction * distance ** (gains.exponent - 2) if distance > 0.0 else 0.0
    match = 2.0 * gains.velocity
    return pull * target[0] + match * velocity[0], pull * target[1] + match * velocity[1]


def braked_gap(gains: Gains, distance: float, closing: float) -> float:
    """rho_s - rho_m [m], at least LEAST_GAP."""
    return max(distance - gains.radius - closing**2 / (2.0 * gains.acceleration), LEAST_GAP)


def repulsive_potential(gains: Gains, obstacle: Point, velocity: Point) -> float:
    """The sum of eta (1 / (rho_s - rho_m) - 1 / rho_0) of what comes nearer, and the floor of what is near.

    The floor eta_s / 2 (1 / rho_s - 1 / rho_1)^2 is Khatib's (1986): along a wall nothing comes nearer, and without it
    the robot would scrape there.

    Args:
        gains: of the field.
        obstacle: p_O - p [m].
        velocity: v - v_O, of the robot relative to the obstacle [m/s].
    """
    distance = math.hypot(*obstacle)
    closing = (velocity[0] * obstacle[0] + velocity[1] * obstacle[1]) / distance
    gap, room = max(distance - gains.radius, LEAST_GAP), braked_gap(gains, distance, closing)
    potential = 0.0
    if closing > LEAST_CLOSING and room < gains.influence:
        potential += gains.repulsion * (1.0 / room - 1.0 / gains.influence)
    if gap < gains.floor_gap:
        potential += 0.5 * gains.floor * (1.0 / gap - 1.0 / gains.floor_gap) ** 2
    return potential


def repulsive_force(gains: Gains, obstacle: Point, velocity: Point) -> Point:
    """Its negative gradient by p and by v, together; arguments as of `repulsive_potential`.

    -eta / (rho_s - rho_m)^2 (1 + v_RO / a_max) n_RO + eta v_RO v_perp / (rho a_max (rho_s - rho_m)^2) n_perp: across the
    line of sight with rho, where Ge and Cui, whose robot is a point, have rho_s.
    """
    distance = math.hypot(*obstacle)
    nx, ny = obstacle[0] / distance, obstacle[1] / distance
    closing = velocity[0] * nx + velocity[1] * ny
    gap, room = max(distance - gains.radius, LEAST_GAP), braked_gap(gains, distance, closing)
    along = across = 0.0
    if closing > LEAST_CLOSING and room < gains.influence:
        strength = gains.repulsion / room**2
        along -= strength * (1.0 + closing / gains.acceleration)
        across += strength * closing / (distance * gains.acceleration)
    if gap < gains.floor_gap:
        along -= gains.floor * (1.0 / gap - 1.0 / gains.floor_gap) / gap**2
    side_x, side_y = velocity[0] - closing * nx, velocity[1] - closing * ny
    return along * nx + across * side_x, along * ny + across * side_y
