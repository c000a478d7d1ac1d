"""How a scripted policy's ackermann robot is driven: on free arcs ahead and back, in turns of several moves where need be.

A policy says where to go now (a velocity), and may say what comes then (its course). Along a course the robot goes as one
that turns on the spot does (steering.py: pure pursuit, Coulter 1992), but on no arc sharper than its own. Else it takes,
anew each time, the arc ahead or back after which the least is left to where it wants to be (kernels.manoeuvre): the way
there and the turn toward it, as Reeds and Shepp (1990) count both, but one arc ahead only. Backwards it goes only where its
scanner looks all around.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.inertia import foreseen, needs_care, stoppable_arc
from bug_gym.kinematics import Drive, differential_action
from bug_gym.steering import LEAST_SPEED, SPACING, WIDER, Course, Velocity
from bug_gym.view import Sensors, View

SLOW = 0.4
"""Share of the top speed at which a robot manoeuvres that was only told where to turn."""

ARCS, PARTS = 6, 8
"""Arcs to each side, and parts of the way to look ahead, that are tried."""

TOWARD_GOAL = math.radians(15.0)
"""A velocity so near to the goal's bearing [rad] is meant for the goal, not for what lies beyond it."""

CRAWLS = 0.01
"""Below this share of the top speed it goes neither ahead nor back."""


def arc_action(
    view: View,
    velocity: Velocity,
    course: Course | None,
    radius: float,
    room: float | None,
    arc: Velocity | None = None,
) -> NDArray[np.float32]:
    """The action (2,) of an ackermann robot.

    Args:
        view: what it sees.
        velocity: desired now, robot's frame [m/s].
        course: where that leads on; None: nobody knows.
        radius: of the disc that must not meet anything [m].
        room: what it keeps about the body where it cannot stop at once [m]; None: nothing is cut for that.
        arc: speed [m/s] and turn rate [rad/s] to drive instead, of a policy that plans arcs itself.
    """
    if arc is not None:
        wish = _braked(view, arc, radius)
    else:
        wish = chosen_arc(view, velocity, course, radius) if velocity != (0.0, 0.0) else (0.0, 0.0)
    if room is not None and needs_care(view.sensors):
        wish = stoppable_arc(view, wish, room)
    return differential_action(view.sensors.drive, *wish)


def chosen_arc(view: View, velocity: Velocity, course: Course | None, radius: float) -> Velocity:
    """Speed [m/s] and turn rate [rad/s] toward a velocity [m/s] or along a course; 0, 0: no arc is free."""
    drive = view.sensors.drive
    speed = min(math.hypot(*velocity), drive.max_speed)
    speed = speed if speed >= LEAST_SPEED * drive.max_speed else SLOW * drive.max_speed
    x, y, target, chain = _as_found(view, velocity, course)
    margin = radius - view.sensors.radius
    for kept in (margin + WIDER, margin, 0.5 * margin):
        if chain is not None and moving(view) >= 0:
            samples = np.empty((math.ceil(look_ahead(drive) / SPACING), 2))
            disc, least = view.sensors.radius + kept, drive.least_bend
            assert course is not None
            found, bend = kernels.pursue(x, y, chain, SPACING, samples, speed, math.inf, disc, course.aside, least)
            if found > 0.0:
                return found, found / bend
        direction, curvature, free = kernels.best_arc(
            x, y, view.sensors.circles, kept, *target, drive.least_bend, look_ahead(drive), moving(view),
            sees_behind(view.sensors), ARCS, PARTS,
        )  # fmt: skip
        if direction:
            driven = direction * min(
                speed, _limit(drive, free), drive.max_speed if direction > 0 else drive.max_reverse
            )
            return driven, driven * curvature
    return 0.0, 0.0


def look_ahead(drive: Drive) -> float:
    """How far ahead arcs are tried [m]: the sharpest one turns by more than a right angle."""
    return 2.0 * drive.least_bend + SPACING


def moving(view: View) -> int:
    """Which way the robot goes now: 1 ahead, -1 back, 0 neither."""
    speed = view.velocity[0]
    return 0 if abs(speed) < CRAWLS * view.sensors.drive.max_speed else (1 if speed > 0.0 else -1)


def sees_behind(sensors: Sensors) -> bool:
    """Whether a robot may go backwards: it can, and its scanner looks all around."""
    return sensors.drive.max_reverse > 0.0 and sensors.is_full_circle


def _braked(view: View, arc: Velocity, radius: float) -> Velocity:
    """An arc, slowed down so that a step ends before what is seen on it."""
    speed, rate = arc
    if speed == 0.0:
        return 0.0, 0.0
    drive, (x, y) = view.sensors.drive, view.points
    direction, margin = (1 if speed > 0.0 else -1), radius - view.sensors.radius
    free = kernels.free_arc(x, y, view.sensors.circles, margin, direction, rate / speed, look_ahead(drive))
    share = min(1.0, _limit(drive, free) / abs(speed))
    return share * speed, share * rate


def _limit(drive: Drive, free: float) -> float:
    """The greatest speed [m/s] on an arc that is free so far [m]."""
    limit = free / drive.step
    return (
        min(limit, math.sqrt(2.0 * drive.max_acceleration * free)) if math.isfinite(drive.max_acceleration) else limit
    )


def _as_found(
    view: View, velocity: Velocity, course: Course | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[float, float], NDArray[np.float64] | None]:
    """Scan points x, y (k,), the place to head for, and the course (m, 2) [m], where a command of now finds the robot."""
    drive = view.sensors.drive
    bearing, reach = math.atan2(velocity[1], velocity[0]), look_ahead(drive)
    if math.cos(bearing - view.goal_bearing) > math.cos(TOWARD_GOAL):
        reach = min(reach, view.goal_distance)
    target = np.array([[reach * math.cos(bearing), reach * math.sin(bearing)]])
    chain = course.places if course is not None and course.aside > 0.0 else None
    x, y = view.points
    if drive.latency > 0:
        ahead = foreseen(view)
        cos, sin = math.cos(ahead.turn), math.sin(ahead.turn)
        frame = np.array([[cos, -sin], [sin, cos]])
        x, y = ((np.column_stack([x, y]) - (ahead.x, ahead.y)) @ frame).T
        x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)
        target = (target - (ahead.x, ahead.y)) @ frame
        chain = None  # it begins where the robot is
    return x, y, (float(target[0, 0]), float(target[0, 1])), chain
