"""How a planned way is driven: the followers by name, and the plain one.

A follower has `follow(route, view, scene) -> velocity`. Pure pursuit is Coulter (1992): head for a place of the way a
little ahead. Here it is so near that the straight line to it leaves the way by no more than a slack, which a plan keeps
as its margin beside the body.
"""

from __future__ import annotations

import importlib
import math
from typing import Literal, NamedTuple, Protocol

import numpy as np

from bug_gym import kernels
from bug_gym.agents.planning.live import Moving
from bug_gym.agents.planning.map import Pose
from bug_gym.agents.planning.route import Route, distances_to_chain
from bug_gym.checks import shortened
from bug_gym.geometry import Point
from bug_gym.inertia import foreseen
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View


class Scene(NamedTuple):
    """Where a follower finds itself, in the frame of the plan."""

    pose: Pose
    """Of the robot now."""
    goal: Point
    """Where the goal is now [m]."""
    moving: Moving | None
    """What moves, as it truly is now; None where the planner is not told: then there is the scan."""
    reach: float | None = None
    """How near to the goal a way has to come [m]; None: within the radius of the robot's goal."""


class Follower(Protocol):
    """What drives a robot along a planned way."""

    avoids_movers: bool
    """Whether it gets out of the way of what moves; ways are planned only round what stands then."""

    def follow(self, route: Route, view: View, scene: Scene) -> Velocity:
        """Desired velocity in the robot's frame [m/s], x ahead, y left; `route.done` is up to date."""
        ...


def pose_to_be(view: View, pose: Pose) -> Pose:
    """Where a command of now will find a robot whose pose is this, in the frame of the plan: here, or on with latency.

    A way is followed from there: from here the robot would swing out of it, and back, by what it drives meanwhile.
    """
    if view.sensors.drive.latency == 0:
        return pose
    ahead, (x, y, heading) = foreseen(view), pose
    cos, sin = math.cos(heading), math.sin(heading)
    return x + cos * ahead.x - sin * ahead.y, y + sin * ahead.x + cos * ahead.y, heading + ahead.turn


FollowerName = Literal["pure_pursuit", "velocity_obstacle"]
FOLLOWERS = {
    "pure_pursuit": "follow:PurePursuit",
    "velocity_obstacle": "vo_follower:VelocityObstacleFollower",
}
"""Followers by name: "module:Class", the module in this folder; the class is made with the sensors."""


def make_follower(name: str, sensors: Sensors) -> Follower:
    """The follower of a name.

    Raises:
        ValueError: an unknown name.
    """
    if name not in FOLLOWERS:
        raise ValueError(f"follower must be one of {list(FOLLOWERS)}, got {shortened(name)}")
    module, class_name = FOLLOWERS[name].split(":")
    own = importlib.import_module(f"bug_gym.agents.planning.{module}")
    follower: Follower = getattr(own, class_name)(sensors)
    return follower


LOOKAHEAD = 0.6
"""How far ahead on the way the place is that is headed for, at most [m]."""

SHORTEST = 0.05
"""The least of it where half a step is longer [m]: who goes so far in one must not cut the corners of its way."""

SLACK = 0.4
"""Share of a way's margin by which the straight line there may leave it."""

STILL = 1e-3
"""A robot that goes and turns by less stands [m/s, rad/s]."""


def is_held(view: View) -> bool:
    """Whether a robot stands, as before its first step; not a car, which stands between the moves of a turn."""
    return view.sensors.drive.kinematics != "ackermann" and max(map(abs, view.velocity)) < STILL


class PurePursuit:
    """Head for a place of the way a little ahead, and stand where the scan shows something on the way there.

    A robot that turns while it drives may swing out of its way so far that its brake holds it at a thing beside. Then it
    goes back to the way first.

    Args:
        sensors: what a driver knows of the robot.
    """

    avoids_movers = False

    def __init__(self, sensors: Sensors) -> None:
        self.sensors = sensors
        half = 0.5 * sensors.step_length
        self._least = half if half < LOOKAHEAD else SHORTEST

    def follow(self, route: Route, view: View, scene: Scene) -> Velocity:
        """One decision."""
        (px, py, _), heading = pose_to_be(view, scene.pose), scene.pose[2]
        is_beside = math.dist((px, py), route.at(route.done)) > SLACK * route.margin
        route.is_left = is_beside and (route.is_left or is_held(view))
        x, y = route.at(route.done + self._least) if route.is_left else self._target(route)
        away, bearing = math.hypot(x - px, y - py), math.atan2(y - py, x - px) - heading
        if away == 0.0:
            return 0.0, 0.0
        drive = view.sensors.drive
        speed = min(drive.max_speed, away / drive.step)
        if math.isfinite(drive.max_acceleration):
            # What cannot stop at once must be slow enough in a bend, and at the end, to turn there.
            speed = min(speed, max(math.sqrt(2.0 * drive.max_acceleration * away), drive.max_acceleration * drive.step))
        free = self._free(view, bearing)
        if free > 0.0 or drive.kinematics != "ackermann":
            # Where a car turned in several moves the disc about it may meet things that its body passes.
            speed = min(speed, free / drive.step)
        return speed * math.cos(bearing), speed * math.sin(bearing)

    def _target(self, route: Route) -> Point:
        """The place of the way that is headed for."""
        reach = LOOKAHEAD
        while reach > self._least:
            chain = route.ahead(reach)
            chord = chain[[0, -1]]
            if distances_to_chain(chord, chain).max() <= SLACK * route.margin:
                break
            reach *= 0.5
        return route.at(route.done + reach)

    def _free(self, view: View, bearing: float) -> float:
        """How far the body can go along a bearing before it touches what the scan shows [m]."""
        radius = view.sensors.radius + 2.0 * view.sensors.range_noise
        if view.sensors.drive.latency > 0:
            ahead, (x, y) = foreseen(view), view.points
            free = kernels.free_distance(x - ahead.x, y - ahead.y, bearing, radius, view.sensors.range)
        else:
            free = view.free_distance(bearing, radius)
        return max(free, 0.0) if np.isfinite(free) else view.sensors.range
