"""How a scripted policy's differential robot is driven: on arcs that are free, and on the spot only where none is.

A policy says where to go now (a velocity), and may say what comes then (its course, a chain of places). The robot pursues
its course on an arc (pure pursuit, Coulter 1992): the farthest place of it to which the body, swept along the arc, keeps
clear of the scan and the arc close to the course. Where no such arc is free, it turns toward the velocity and goes ahead
meanwhile as fast as that brings it little off its line. Without a course it is steered as kinematics.steering says.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels, kinematics
from bug_gym.inertia import needs_care, stoppable_arc
from bug_gym.kinematics import Drive, differential_action
from bug_gym.view import View

Velocity = tuple[float, float]

SPACING = 0.1
"""Between the places of a course that are tried [m]."""

OFF_LINE = 0.1
"""How far off its line a turn toward a velocity may bring a robot that goes ahead meanwhile [m]."""

WIDER = 0.03
"""How much farther from things than where it brakes an arc along a course keeps at first [m]: else the robot comes so near
to them that it stands."""

ON_THE_SPOT = math.radians(120.0)
"""Heading error [rad] beyond which a robot turns on the spot."""

GOES_ON = math.radians(150.0)
"""Heading error [rad] beyond which one that turns already does not turn round: both ways round are about as long, and to and
fro would be the longest."""

LEAST_SPEED = 1e-3
"""A velocity below this share of the top speed only says where to turn."""

SHARES = 8
"""In how many parts a speed is cut."""


class Course(NamedTuple):
    """Where a desired velocity leads on."""

    places: NDArray[np.float64]
    """(k, 2) the robot's own place first, in its frame [m]."""
    aside: float
    """How far an arc may lie beside them [m]; 0: it keeps exactly to them, and turns on the spot at corners."""
    hand: int = 0
    """+1: they lead along a wall to the right; -1: to the left; 0: along none. At walls there are so many corners that arcs
    are chosen for the time that the whole course takes."""
    toward: float = 0.0
    """How far an arc that turns toward that wall may lie beside them [m]."""


def steered_action(
    view: View, velocity: Velocity, course: Course, radius: float, room: float | None
) -> NDArray[np.float32]:
    """The action (2,) of a differential robot with a round body.

    Args:
        view: what it sees.
        velocity: desired now, robot's frame [m/s].
        course: where that leads on.
        radius: of the disc that must not meet anything [m].
        room: what it keeps about the body where it cannot stop at once [m]; None: nothing is cut for that.
    """
    speed, rate = 0.0, 0.0
    for disc in (radius + WIDER, radius):
        if speed <= 0.0:
            speed, rate = pursuing(view, math.hypot(*velocity), course, disc)
    if speed > 0.0:
        speed, rate = _within_free_arc(view, speed, rate, radius)
    if speed <= 0.0:
        speed, rate = turning_toward(view, velocity, radius, min(course.aside, OFF_LINE))
    if room is not None and needs_care(view.sensors):
        speed, rate = stoppable_arc(view, (speed, rate), room)
    return differential_action(view.sensors.drive, speed, rate)


def pursuing(view: View, speed: float, course: Course, radius: float) -> tuple[float, float]:
    """Speed [m/s], at most the given one, and turn rate [rad/s] along a course; 0, 0: no arc to it is free."""
    drive = view.sensors.drive
    if speed < LEAST_SPEED * drive.max_speed or drive.max_turn_rate <= 0.0:
        return 0.0, 0.0
    x, y = view.points
    places, aside, toward, hand = course.places, course.aside, course.toward, course.hand
    speed, rate = min(speed, drive.max_speed), drive.max_turn_rate
    samples = np.empty((math.ceil(look_ahead(drive) / SPACING), 3 if hand else 2))
    if hand:
        speed, bend = kernels.round_corners(x, y, places, SPACING, samples, speed, rate, radius, aside, toward, hand)
    else:
        speed, bend = kernels.pursue(x, y, places, SPACING, samples, speed, rate, radius, aside, 0.0)
    return speed, speed / bend


def _within_free_arc(view: View, speed: float, rate: float, radius: float) -> tuple[float, float]:
    """A speed [m/s] and turn rate [rad/s], cut so that a step ends before what is seen: a place of a course may be nearer."""
    x, y = view.points
    turn, step = abs(rate), view.sensors.drive.step
    free = kernels.free_turn(x, y, speed / turn, 1 if rate > 0.0 else -1, radius, turn * step)
    return (speed, rate) if free >= turn * step else (speed * free / (turn * step), rate * free / (turn * step))


def look_ahead(drive: Drive) -> float:
    """How far along its course a robot looks [m]: up to where a turn at full speed through a right angle would end."""
    return 2.0 * drive.fast_bend + SPACING


def corner_cut(drive: Drive) -> float:
    """How far the sharpest arc at full speed passes from the right-angled corner that it rounds [m]."""
    return (math.sqrt(2.0) - 1.0) * drive.fast_bend


def turning_toward(view: View, velocity: Velocity, radius: float, off_line: float) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] toward a velocity [m/s] of the robot's frame, on an arc that is free.

    Args:
        view: what it sees.
        velocity: the desired one [m/s].
        radius: of the disc that must not meet anything [m].
        off_line: how far off its line the turn may bring it [m].
    """
    drive, speed = view.sensors.drive, math.hypot(*velocity)
    error = heading_error(velocity, view.velocity[1])
    rate = kinematics.turn_rate(drive, error)
    if speed == 0.0:
        return 0.0, rate
    speed = min(speed, drive.max_speed)
    if abs(error) <= kinematics.TURN_IN_PLACE:
        return _braked(view, speed * math.cos(error), radius), rate
    if abs(error) > ON_THE_SPOT:
        return 0.0, rate
    # On an arc of radius r it gets r (1 - cos e) off its line.
    speed = min(speed, off_line * abs(rate) / (1.0 - math.cos(error)))
    return _on_a_free_arc(view, speed, rate, abs(error), radius), rate


def heading_error(velocity: Velocity, rate: float) -> float:
    """How far to turn toward a velocity [rad]; a robot that turns already at a rate [rad/s] does not turn round."""
    error = math.atan2(velocity[1], velocity[0]) if velocity != (0.0, 0.0) else 0.0
    if abs(error) > GOES_ON and error * rate < 0.0:
        error += math.copysign(2.0 * math.pi, rate)
    return error


def _on_a_free_arc(view: View, speed: float, rate: float, turn: float, radius: float) -> float:
    """The greatest share of a speed [m/s] at which the whole turn [rad] is free; 0: on the spot."""
    x, y = view.points
    side = 1 if rate > 0.0 else -1
    for part in range(SHARES if speed > 0.0 else 0, 0, -1):
        bend = speed * part / SHARES / abs(rate)
        if kernels.free_turn(x, y, bend, side, radius, turn) >= turn:
            return speed * part / SHARES
    return 0.0


def _braked(view: View, speed: float, radius: float) -> float:
    """A speed [m/s] straight ahead, cut so that a step ends before what is seen."""
    drive = view.sensors.drive
    free = max(view.free_distance(0.0, radius) - (radius - view.sensors.radius), 0.0)
    limit = free / drive.step
    if math.isfinite(drive.max_acceleration):
        limit = min(limit, math.sqrt(2.0 * drive.max_acceleration * free))
    return min(speed, limit)
