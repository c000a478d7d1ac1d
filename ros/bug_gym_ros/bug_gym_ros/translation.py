"""Between messages of ROS 2 and what policies of bug_gym see and do: plain Python, in which no ROS is imported.

Messages are anything with the fields of `sensor_msgs/LaserScan`, `nav_msgs/Odometry`, `geometry_msgs/PoseStamped` and
`geometry_msgs/Twist`. Units and frames are ROS's own (REP 103, REP 105): metres, radians, x ahead, y to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym import kinematics
from bug_gym.config import Scenario
from bug_gym.view import Sensors, View

Pose = tuple[float, float, float]
"""x, y [m] and heading [rad]."""

SEEN = ("ranges", "goal", "pose", "velocity")
"""Fields of an observation that a robot's own messages tell."""


class MessageError(ValueError):
    """A message cannot be what the robot of the scenario would send."""


def wrap(angle: float) -> float:
    """An angle between -pi and pi [rad]."""
    return math.remainder(angle, math.tau)


def yaw(orientation: Any) -> float:
    """Heading of a quaternion with x, y, z, w [rad]."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def pose_of(pose: Any) -> Pose:
    """Of a `geometry_msgs/Pose`."""
    return pose.position.x, pose.position.y, yaw(pose.orientation)


def seen_from(frame: Pose, x: float, y: float) -> tuple[float, float]:
    """A point in the frame of a pose [m]."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    dx, dy = x - frame[0], y - frame[1]
    return cos * dx + sin * dy, cos * dy - sin * dx


def readings(scan: Any, mount: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What a scan says, seen from the robot's centre: bearings (k,) [rad] and distances (k,) [m], infinite for nothing.

    REP 117: +inf, or beyond `range_max`, is nothing within reach; -inf, or below `range_min`, is something nearer than can be
    measured, taken as at `range_min`; NaN is no reading and left out.

    Args:
        scan: a `sensor_msgs/LaserScan`.
        mount: where the scanner sits on the robot.
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    is_read = ~np.isnan(ranges)
    ranges, angles = np.maximum(ranges[is_read], scan.range_min), wrapped(angles[is_read] + mount[2])
    ranges[ranges > scan.range_max] = np.inf
    if mount[:2] == (0.0, 0.0):
        return angles, ranges
    hit = np.isfinite(ranges)
    x, y = mount[0] + ranges[hit] * np.cos(angles[hit]), mount[1] + ranges[hit] * np.sin(angles[hit])
    angles[hit], ranges[hit] = np.arctan2(y, x), np.hypot(x, y)
    return angles, ranges


def wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles between -pi and pi [rad]."""
    return np.remainder(angles + math.pi, math.tau) - math.pi


def ranges_along(
    beams: NDArray[np.float64], bearings: NDArray[np.float64], distances: NDArray[np.float64], increment: float
) -> NDArray[np.float64]:
    """Range along each beam (B,): the least of the readings nearest to it; infinite where they saw nothing.

    Args:
        beams: bearings of the beams (B,) [rad].
        bearings, distances: of readings (k,).
        increment: between two neighbouring readings [rad].

    Raises:
        MessageError: a beam has no reading within half its own spacing, nor within the scanner's.
    """
    spacing = abs(beams[1] - beams[0]) if len(beams) > 1 else math.tau
    apart = np.abs(wrapped(bearings[None, :] - beams[:, None]))
    near = max(spacing / 2.0, abs(increment)) * 1.001
    if len(bearings) == 0 or (apart.min(axis=1) > near).any():
        lost = beams if len(bearings) == 0 else beams[apart.min(axis=1) > near]
        degrees = math.degrees(float(lost[0]))
        raise MessageError(
            f"the scan has no reading near the beam at {degrees:.0f} degrees, one of {len(lost)} without"
        )
    own = apart <= spacing / 2.0 * 1.001  # readings between two beams count for both, so nothing falls between
    own[np.arange(len(beams)), apart.argmin(axis=1)] = True
    return np.where(own, distances[None, :], np.inf).min(axis=1)


@dataclass
class Robot:
    """A robot of ROS as a policy sees it.

    A policy gets an observation of the scenario's robot: its body, beams and limits are what the real robot has to have, or
    less. Odometry counts from where the robot was when its goal came.
    """

    scenario: Scenario
    """Its robot, scanner and step; the world does not matter."""
    mount: Pose = (0.0, 0.0, 0.0)
    """Where the scanner sits: x, y [m] and heading [rad] in the robot's frame."""
    clearance: float = 0.02
    """What is kept free between the body and what is ahead [m]; a way that is shorter is driven slower, or not at all."""
    patience: float = 0.5
    """How old scan and odometry may be [s]; the robot stands when one is older."""
    sensors: Sensors = field(init=False)
    """What its policy is made for."""

    def __post_init__(self) -> None:
        self.sensors = Sensors.of(self.scenario)
        if others := [one.name for one in self.sensors.fields if one.name not in SEEN]:
            raise ValueError(
                f"{self.scenario.name}: a robot's messages do not tell {', '.join(others)}, expected a scenario without"
            )
        self._ranges: NDArray[np.float64] | None = None
        self._pose: Pose | None = None
        self._velocity = (0.0, 0.0)
        self._start: Pose | None = None
        self._goal: tuple[float, float] | None = None
        self._heard = {"scan": -math.inf, "odometry": -math.inf}

    def hear_scan(self, scan: Any, now: float) -> None:
        """Take a `sensor_msgs/LaserScan`.

        Raises:
            MessageError: it does not cover the beams that the policy looks along.
        """
        bearings, distances = readings(scan, self.mount)
        ranges = ranges_along(self.sensors.angles, bearings, distances, scan.angle_increment)
        self._ranges = np.clip(ranges, self.scenario.lidar.min_range, self.sensors.range)
        self._heard["scan"] = now

    def hear_odometry(self, odometry: Any, now: float) -> None:
        """Take a `nav_msgs/Odometry`, its twist in the robot's frame as ROS has it."""
        self._pose = pose_of(odometry.pose.pose)
        twist = odometry.twist.twist
        second = twist.linear.y if self.sensors.drive.kinematics == "holonomic" else twist.angular.z
        self._velocity = (twist.linear.x, second)
        self._heard["odometry"] = now

    def hear_goal(self, goal: Any, *, moves: bool = False) -> bool:
        """Take a `geometry_msgs/PoseStamped` in the frame of the odometry; its heading does not matter.

        Args:
            goal: the message.
            moves: whether a goal that comes on the way is the same one, which has moved.

        Returns:
            Whether it is a new one, for which a policy begins anew.

        Raises:
            MessageError: no odometry has come yet, so that its frame is unknown.
        """
        if self._pose is None:
            raise MessageError("a goal came before any odometry")
        is_new = self._goal is None or not moves
        if is_new:
            self._start = self._pose
        self._goal = (goal.pose.position.x, goal.pose.position.y)
        return is_new

    @property
    def has_goal(self) -> bool:
        """Whether there is somewhere to go."""
        return self._goal is not None

    @property
    def is_there(self) -> bool:
        """Whether the goal is reached."""
        return self._goal is not None and self._pose is not None and self._distance() <= self.sensors.goal_radius

    def _distance(self) -> float:
        assert self._goal is not None and self._pose is not None
        return math.dist(self._goal, self._pose[:2])

    def forget_goal(self) -> None:
        """Go nowhere until another goal comes."""
        self._goal = None

    def silent(self, now: float) -> str:
        """What has not been heard for too long, "" where all is fresh."""
        return " and ".join(name for name, when in self._heard.items() if now - when > self.patience)

    def observation(self) -> NDArray[np.float32]:
        """The flat observation (D,) of what was heard last.

        Raises:
            MessageError: scan, odometry or goal have not come yet.
        """
        if self._ranges is None or self._pose is None or self._goal is None or self._start is None:
            raise MessageError("scan, odometry and goal have not all come yet")
        parts = {
            "ranges": self._ranges,
            "goal": seen_from(self._pose, *self._goal),
            "pose": (*seen_from(self._start, *self._pose[:2]), wrap(self._pose[2] - self._start[2])),
            "velocity": self._velocity,
        }
        return np.concatenate(
            [np.clip(np.asarray(parts[one.name], dtype=np.float32), one.low, one.high) for one in self.sensors.fields]
        )

    def command(self, action: NDArray[Any]) -> tuple[float, float, float]:
        """What to drive for an action of the policy: ahead and left [m/s], turn rate [rad/s].

        It is slowed down to what ends, a step and braking included, before what is seen ahead and the clearance.

        Args:
            action: (2,) in [-1, 1], or the number of a discrete one.
        """
        ahead, left, turn = velocities(self.sensors.drive, action)
        speed = math.hypot(ahead, left)
        if speed == 0.0:
            return ahead, left, turn
        room = View(self.observation(), self.sensors).free_distance(math.atan2(left, ahead), self.sensors.radius)
        share = min(greatest_speed(self.sensors.drive, room - self.clearance) / speed, 1.0)
        if self.sensors.drive.kinematics == "ackermann":
            turn *= share  # slower on the same arc
        return share * ahead, share * left, turn


def greatest_speed(drive: kinematics.Drive, room: float) -> float:
    """The greatest speed that ends within some room [m], driven for one step and then braked [m/s]."""
    if room <= 0.0:
        return 0.0
    if math.isinf(drive.max_acceleration):
        return room / drive.step
    braked = drive.max_acceleration * drive.step  # the root of v step + v^2 / (2 a) = room
    return math.sqrt(braked**2 + 2.0 * drive.max_acceleration * room) - braked


def velocities(drive: kinematics.Drive, action: NDArray[Any]) -> tuple[float, float, float]:
    """What an action means: velocity ahead and to the left [m/s], turn rate [rad/s].

    Args:
        drive: kinematics and limits of the robot.
        action: (2,) in [-1, 1], or the number of a discrete one.
    """
    if np.ndim(action) == 0:
        action = kinematics.discrete_actions(drive)[int(action)]
    first, second = (min(max(float(value), -1.0), 1.0) for value in action)
    if drive.kinematics == "holonomic":
        scale = drive.max_speed / max(math.hypot(first, second), 1.0)
        return first * scale, second * scale, 0.0
    speed, turn = kinematics.asked_velocity(drive, (first, second))
    return speed, 0.0, turn
