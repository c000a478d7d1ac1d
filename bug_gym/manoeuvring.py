"""How a scripted policy's ackermann robot is driven: on free arcs ahead and back, in turns of several moves where need be.

A policy says where to go now (a velocity), and may say what comes then (its course). Along a course the robot goes as one
that turns on the spot does (steering.py: pure pursuit, Coulter 1992), but on no arc sharper than its own. Else it takes,
anew each time, the arc ahead or back after which the least is left to where it wants to be (kernels.manoeuvre): the way
there and the turn toward it, as Reeds and Shepp (1990) count both, but one arc ahead only. Where no arc ahead turns it, as
before a wall or beside a goal within its turning circle, it turns about where it is instead, by a plan that is kept until
it is driven (`Turn`). Backwards it goes only where its scanner looks all around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.geometry import Point
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


BEGINS, ENDS = math.radians(30.0), math.radians(2.0)
"""How far off its heading [rad] what it wants must be for a turn in several moves to begin, and to be over."""

NEEDS = 0.5
"""What must be free of the arc ahead for such a turn not to begin, in lengths of its radius."""

MOVE = 0.5
"""By how much a move of such a turn turns it at most [rad], where it is free so far."""

LEAST_MOVE = 0.02
"""The shortest move, in lengths of the sharpest arc's radius."""


@dataclass(frozen=True)
class Turn:
    """A turn in several moves on the sharpest arcs, ahead and back by turns, which is kept until it is over.

    The first and the last move turn by half a share, so that what is between swings about the place where it began. From
    where it then is beside its place the robot goes straight to it.
    """

    place: Point
    """Where it began and is to end, odometry frame [m]."""
    heading: float
    """Heading that it is to end with, odometry frame [rad]."""
    side: int
    """1 to the left, -1 to the right; 0: it is done, and the robot goes straight to where it began."""
    direction: int
    """Of the move that is driven: 1 ahead, -1 back."""
    share: float
    """By how much each move turns [rad]."""
    left: float
    """What is to be left of the turn as this move ends [rad]."""

    def arc(self, view: View) -> Velocity:
        """Speed [m/s] and turn rate [rad/s] of its move, where nothing is in the way."""
        drive = view.sensors.drive
        to_go = (self.to_turn(view) - self.left) * drive.least_bend if self.side else abs(self.way(view))
        speed = min(drive.max_speed if self.direction > 0 else drive.max_reverse, to_go / drive.step)
        return self.direction * speed, self.side * speed / drive.least_bend

    def to_turn(self, view: View) -> float:
        """What is left of the turn [rad]."""
        return math.remainder(self.side * (self.heading - view.heading), 2.0 * math.pi)

    def way(self, view: View) -> float:
        """How far ahead, below 0 back, it is to where it began [m]."""
        (x, y), (px, py) = self.place, view.position
        return (x - px) * math.cos(view.heading) + (y - py) * math.sin(view.heading)


def begun(view: View, velocity: Velocity, radius: float) -> Turn | None:
    """The turn that brings a robot's heading to where it wants to go; None: one arc ahead does, or it cannot.

    Args:
        view: what it sees.
        velocity: desired now, robot's frame [m/s].
        radius: of the disc that must not meet anything [m].
    """
    drive, bearing = view.sensors.drive, math.atan2(velocity[1], velocity[0])
    off = abs(bearing)
    if off < BEGINS or velocity == (0.0, 0.0) or drive.latency > 0 or not sees_behind(view.sensors):
        return None
    side = 1 if bearing > 0.0 else -1
    ahead = _free(view, side, 1, radius)
    if ahead > min(off, NEEDS) * drive.least_bend and not _circles(view, bearing):
        return None
    back = _free(view, side, -1, radius)
    if max(ahead, back) < LEAST_MOVE * drive.least_bend:
        return None
    share = off / math.ceil(off / MOVE)
    return Turn(view.position, view.heading + bearing, side, 1 if ahead >= back else -1, share, off - 0.5 * share)


def gone_on(view: View, turn: Turn, radius: float, room: float | None) -> Turn | None:
    """The same turn, or its next move; None: it is over, or nothing is free to either side.

    Args:
        view: what it sees.
        turn: which is under way.
        radius: of the disc that must not meet anything [m].
        room: what it keeps about the body where it cannot stop at once [m]; None: nothing is cut for that.
    """
    to_turn = turn.to_turn(view)
    if turn.side and to_turn < ENDS:
        turn = replace(turn, side=0, direction=1 if turn.way(view) > 0.0 else -1)
    goes = _goes(view, turn, radius, room)
    if turn.side == 0:
        is_far = turn.direction * turn.way(view) >= LEAST_MOVE * view.sensors.drive.least_bend
        return turn if goes and is_far else None
    if goes and to_turn > turn.left + ENDS:
        return turn
    turn = replace(turn, left=max(to_turn - turn.share, 0.0))
    back = replace(turn, direction=-turn.direction)
    return next((move for move in (back, turn) if _goes(view, move, radius, room)), None)


def _goes(view: View, turn: Turn, radius: float, room: float | None) -> bool:
    """Whether a move's arc is free, and who stands is let begin it: what is cut for a robot's inertia may leave nothing."""
    if _free(view, turn.side, turn.direction, radius) < LEAST_MOVE * view.sensors.drive.least_bend:
        return False
    if room is None or moving(view) or not needs_care(view.sensors):
        return True
    return stoppable_arc(view, _braked(view, turn.arc(view), radius), room) != (0.0, 0.0)


def _circles(view: View, bearing: float) -> bool:
    """Whether it heads for a goal that its sharpest arc ahead goes round."""
    bend, away = view.sensors.drive.least_bend, view.goal_distance
    if math.cos(bearing - view.goal_bearing) <= math.cos(TOWARD_GOAL):
        return False
    x, y = away * math.cos(view.goal_bearing), away * abs(math.sin(view.goal_bearing))
    return math.hypot(x, y - bend) < bend - view.sensors.goal_radius


def _free(view: View, side: int, direction: int, radius: float) -> float:
    """How far the sharpest arc ahead or back that turns to a side is free [m]."""
    x, y = view.points
    drive, margin = view.sensors.drive, radius - view.sensors.radius
    return kernels.free_arc(
        x, y, view.sensors.circles, margin, direction, direction * side / drive.least_bend, look_ahead(drive)
    )


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
    """Speed [m/s] and turn rate [rad/s] toward a velocity [m/s] or along a course; 0, 0: no arc is free.

    It keeps more from things where it can, but goes ahead nearer to them rather than back.
    """
    drive = view.sensors.drive
    speed = min(math.hypot(*velocity), drive.max_speed)
    speed = speed if speed >= LEAST_SPEED * drive.max_speed else SLOW * drive.max_speed
    x, y, target, chain = _as_found(view, velocity, course)
    margin, back = radius - view.sensors.radius, (0.0, 0.0)
    for kept in (margin + WIDER, margin, 0.5 * margin):
        if chain is not None and moving(view) >= 0:
            samples = np.empty((math.ceil(look_ahead(drive) / SPACING), 2))
            disc, least = view.sensors.radius + kept, drive.least_bend
            assert course is not None
            found, bend = kernels.pursue(x, y, chain, SPACING, samples, speed, math.inf, disc, course.aside, least)
            if found > 0.0:
                return found, found / bend
        direction, curvature, free, way = kernels.best_arc(
            x, y, view.sensors.circles, kept, *target, drive.least_bend, look_ahead(drive), moving(view),
            sees_behind(view.sensors), ARCS, PARTS,
        )  # fmt: skip
        if direction:
            driven = direction * min(
                speed, way / drive.step, _limit(drive, free), drive.max_speed if direction > 0 else drive.max_reverse
            )
            if direction > 0:
                return driven, driven * curvature
            back = back if back[0] else (driven, driven * curvature)
    return back


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
