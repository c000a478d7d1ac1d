"""Following a planned way among movers: velocity obstacles, with a place a little ahead on the way as the goal.

Source: Sellers et al. 2026, section 5. The way is planned anew only where something stands in it; what moves is left to
the navigator, which leaves the way and comes back: the place ahead is counted from the nearest place of the way, and
how far that has come never falls.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.local.navigator import ROOM, Navigator, NavigatorParameters
from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.live import Moving
from bug_gym.agents.planning.map import Pose, in_frame
from bug_gym.agents.planning.route import Route
from bug_gym.geometry import F64, Point
from bug_gym.inertia import stopping_radius
from bug_gym.policy import Velocity, braking_radius
from bug_gym.view import Sensors, View

BESIDE = 1e-3
"""How much farther from things than where its brake would make the robot stand it is led [m]."""

LOOKAHEADS = (1.0, 0.5, 0.25)
"""How far ahead on the way the place is that is headed for [m]: the first that the body comes to straight."""


class VelocityObstacleFollower:
    """Drives along a way, out of the way of movers.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of the navigator; None: its own, with no horizon for what stands, as the way keeps off that.
    """

    avoids_movers = True

    def __init__(self, sensors: Sensors, parameters: NavigatorParameters | None = None) -> None:
        self.sensors = sensors
        self.navigator = Navigator(sensors, parameters or NavigatorParameters(still_horizon=0.0))
        self.stopping_room = stopping_radius(sensors) + BESIDE - braking_radius(sensors)
        """What must be kept beside the braking radius [m]: nearer to things a robot with inertia would be made to stand."""

    def follow(self, route: Route, view: View, scene: Scene) -> Velocity:
        """One decision."""
        room = max(min(ROOM, 0.5 * route.margin), min(self.stopping_room, route.margin))
        (x, y), along = self._target(route, view, scene, max(ROOM, room))
        distance = math.hypot(x, y)
        if distance == 0.0:
            return 0.0, 0.0
        speed = min(self.sensors.drive.max_speed, (distance + route.rest - along) / self.sensors.drive.step)
        wish = speed * x / distance, speed * y / distance
        return self.navigator.velocity(view, wish, distance, movers_seen(scene.moving, scene.pose), room=room)

    def _target(self, route: Route, view: View, scene: Scene, room: float) -> tuple[Point, float]:
        """The place that is headed for, in the robot's frame [m], and how far along the way from here it lies [m]."""
        place, along, radius = (0.0, 0.0), 0.0, braking_radius(self.sensors) + room
        for reach in LOOKAHEADS:
            along = min(reach, route.rest)
            ((x, y),) = in_frame(np.array([route.at(route.done + along)]), scene.pose).tolist()
            place = (x, y)
            distance = math.hypot(x, y)
            if view.free_distance(math.atan2(y, x), radius) >= distance:
                break
        return place, along


def movers_seen(moving: Moving | None, pose: Pose) -> F64:
    """Movers (n, 5) in the robot's frame: x, y [m], vx, vy [m/s], radius [m]; none where nothing is told."""
    if moving is None:
        return np.zeros((0, 5))
    places = in_frame(moving.discs[:, :2], pose)
    velocities = in_frame(moving.velocities, (0.0, 0.0, pose[2]))
    return np.column_stack([places, velocities, moving.discs[:, 2]])
