"""What a robot whose commands act late sees, as it will be where a command of now finds it.

The robot's own motion until then is known: the commands under way are its own. Whoever decides by what he will see there,
instead of by what he sees, decides as a robot does whose commands act at once (Smith 1957, "Closer control of loops with dead
time": the delay is taken out of the loop by a model of what is under way). What moves by itself is seen where it is now.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym import kernels
from bug_gym.inertia import Velocity, foreseen
from bug_gym.view import View


def seen_then(view: View) -> View:
    """The observation as it will be where a command of now finds the robot: scan, goal, pose and velocity; else as it is.

    Of the scan what two neighbouring beams meet now is joined where it lies on one thing; where nothing has been seen,
    nothing will be.
    """
    ahead, sensors = foreseen(view), view.sensors
    ranges, told = np.empty(sensors.angles.size), np.empty(sensors.angles.size, dtype=np.bool_)
    beams = sensors.beam_directions, sensors.range, float(sensors.angles[0]), sensors.beam_spacing, 2.0 * sensors.radius
    kernels.scan_then(view.ranges, *beams, sensors.is_full_circle, ahead.x, ahead.y, ahead.turn, ranges, told)
    cos, sin = math.cos(ahead.turn), math.sin(ahead.turn)
    dx, dy = view.points[0] - ahead.x, view.points[1] - ahead.y
    points = cos * dx + sin * dy, cos * dy - sin * dx  # all of them, also those to which no beam will go then
    then = view.showing(ranges.astype(np.float32).astype(np.float64), points)
    x, y = view.goal[0] - ahead.x, view.goal[1] - ahead.y
    heading = math.remainder(view.pose[2] + ahead.turn, 2.0 * math.pi)
    then.stand_at((*view.to_odometry(ahead.x, ahead.y), heading), (cos * x + sin * y, cos * y - sin * x))
    then.velocity = ahead.velocity
    return then


def as_it_lies(view: View, velocity: Velocity) -> Velocity:
    """A velocity of the frame of then in the robot's frame of now [m/s]: what `inertia.as_it_will_lie` turns back."""
    cos, sin = math.cos(turn := foreseen(view).turn), math.sin(turn)
    return cos * velocity[0] - sin * velocity[1], sin * velocity[0] + cos * velocity[1]
