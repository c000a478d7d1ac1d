"""What a robot whose commands act late sees, as it will be where a command of now finds it.

The robot's own motion until then is known: the commands under way are its own. Whoever decides by what he will see there,
instead of by what he sees, decides as a robot does whose commands act at once (Smith 1957, "Closer control of loops with dead
time": the delay is taken out of the loop by a model of what is under way). What moves by itself is seen where it is now.

Where the scanner does not look all round, what was seen nearby and lies behind now is kept beside it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.inertia import Velocity, foreseen, shown_points
from bug_gym.view import View

NEAR = 1.0
"""What lies behind a robot is kept as far as this [m]."""


def seen_then(view: View, behind: NDArray[np.float64] | None = None) -> View:
    """The observation as it will be where a command of now finds the robot: scan, goal, pose and velocity; else as it is.

    Of the scan what two neighbouring beams meet now is joined where it lies on one thing; where nothing has been seen,
    nothing will be.

    Args:
        view: the observation.
        behind: points (2, k) that lie where the scanner does not look now, odometry frame [m]; they are shown, too.
    """
    ahead, sensors = foreseen(view), view.sensors
    count = sensors.angles.size
    ranges, room = np.empty(count), (np.empty(count, dtype=np.bool_), np.empty((3, count)))
    beams = sensors.beam_directions, sensors.range, float(sensors.angles[0]), sensors.beam_spacing, 2.0 * sensors.radius
    kernels.scan_then(view.ranges, *beams, sensors.is_full_circle, ahead.x, ahead.y, ahead.turn, ranges, *room)
    cos, sin = math.cos(ahead.turn), math.sin(ahead.turn)
    dx, dy = view.points[0] - ahead.x, view.points[1] - ahead.y
    points = cos * dx + sin * dy, cos * dy - sin * dx  # all of them, also those to which no beam will go then
    x, y = view.goal[0] - ahead.x, view.goal[1] - ahead.y
    heading = math.remainder(view.pose[2] + ahead.turn, 2.0 * math.pi)
    pose = *view.to_odometry(ahead.x, ahead.y), heading
    if behind is not None and behind.size:
        late = in_frame(behind, pose)
        points = np.append(points[0], late[0]), np.append(points[1], late[1])
    then = view.showing(ranges.astype(np.float32).astype(np.float64), points)
    then.stand_at(pose, (cos * x + sin * y, cos * y - sin * x))
    then.velocity = ahead.velocity
    return then


def in_frame(places: NDArray[np.float64], pose: tuple[float, float, float]) -> NDArray[np.float64]:
    """Places (2, k) of the odometry frame in that of a robot at a pose [m, rad]."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = places[0] - pose[0], places[1] - pose[1]
    return np.stack([cos * dx + sin * dy, cos * dy - sin * dx])


def left_behind(view: View, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """What of the points (2, k) that were seen nearby lies now where the scanner does not look, odometry frame [m].

    A robot that stands and turns would else decide by another half of its surroundings each time, and turn to and fro for
    ever.
    """
    x, y = in_frame(before, view.pose)
    first, last = float(view.sensors.angles[0]), float(view.sensors.angles[-1])
    bearing = np.arctan2(y, x)
    return before[:, ((bearing < first) | (bearing > last)) & (x * x + y * y < NEAR * NEAR)]


def seen_nearby(view: View) -> NDArray[np.float64]:
    """The points (2, k) that a scan shows nearby, odometry frame [m]."""
    x, y = view.points
    return shown_points(view)[:, x * x + y * y < NEAR * NEAR]


def as_it_lies(view: View, velocity: Velocity) -> Velocity:
    """A velocity of the frame of then in the robot's frame of now [m/s]: what `inertia.as_it_will_lie` turns back."""
    cos, sin = math.cos(turn := foreseen(view).turn), math.sin(turn)
    return cos * velocity[0] - sin * velocity[1], sin * velocity[0] + cos * velocity[1]
