"""The course of a robot that follows a wall: the contour ahead, whose corners a differential robot rounds."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.scan.contour_ahead import contour_ahead
from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.contour import Contour
from bug_gym.geometry import velocity_along
from bug_gym.policy import Velocity
from bug_gym.steering import Course, corner_cut, look_ahead
from bug_gym.view import View


def course_along(boundary: Boundary, view: View, contour: Contour | None, velocity: Velocity) -> Course | None:
    """The contour ahead, or straight on where no wall is followed; None for a robot that stands."""
    if velocity == (0.0, 0.0):
        return None
    drive, bearing = boundary.sensors.drive, math.atan2(velocity[1], velocity[0])
    reach = look_ahead(drive)
    if contour is None:
        straight = np.array([(0.0, 0.0), velocity_along(bearing, reach)])
        return Course(straight, corner_cut(drive))
    places = np.empty((math.ceil(reach / boundary.step) + 2, 2))
    count = contour_ahead(*view.points, bearing, contour.side, boundary.step, boundary.clearance, places)
    # The hand would lose a wall that is left farther.
    return Course(places[:count], boundary.step)
