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


def stamped(message: Any) -> float:
    """When a message says that it was made [s]; 0 where it does not say."""
    return seconds(message.header.stamp)


def seconds(stamp: Any) -> float:
    """Of a `builtin_interfaces/Time` [s]."""
    return float(stamp.sec + stamp.nanosec * 1e-9)


def readings(scan: Any, heading: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What a scan says, seen from the scanner: bearings (k,) [rad] and distances (k,) [m], infinite for nothing.

    REP 117: +inf, or beyond `range_max`, is nothing within reach; -inf, or below `range_min`, is something nearer than can be
    measured, taken as at `range_min`; NaN is no reading and left out.

    Args:
        scan: a `sensor_msgs/LaserScan`.
        heading: of the scanner in the robot's frame [rad], in which the bearings are.
    """
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    is_read = ~np.isnan(ranges)
    ranges, angles = np.maximum(ranges[is_read], scan.range_min), wrapped(angles[is_read] + heading)
    ranges[ranges > scan.range_max] = np.inf
    return angles, ranges


def wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles between -pi and pi [rad]."""
    return np.remainder(angles + math.pi, math.tau) - math.pi


def points(
    bearings: NDArray[np.float64], distances: NDArray[np.float64], centre: tuple[float, float] = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Places (k, 2) of what is at these bearings (k,) [rad] and distances (k,) from a centre [m]."""
    return np.stack([centre[0] + distances * np.cos(bearings), centre[1] + distances * np.sin(bearings)], axis=1)


def ranges_along(
    beams: NDArray[np.float64],
    bearings: NDArray[np.float64],
    distances: NDArray[np.float64],
    increment: float,
    place: tuple[float, float] = (0.0, 0.0),
) -> NDArray[np.float64]:
    """Range along each beam (B,) from the robot's centre [m]; infinite where nothing was seen.

    It is the least of the readings nearest to the beam. Of a scanner that is not at the centre it is the least of the points
    seen near the beam, and ends where the beam comes behind something, out of the scanner's sight.

    Args:
        beams: bearings of the beams (B,) [rad].
        bearings, distances: of readings, seen from the scanner (k,).
        increment: between two neighbouring readings [rad].
        place: of the scanner, x and y in the robot's frame [m].

    Raises:
        MessageError: a beam has no reading of its bearing within half its own spacing, nor within the scanner's.
    """
    spacing = abs(beams[1] - beams[0]) if len(beams) > 1 else math.tau
    near = max(spacing / 2.0, abs(increment)) * 1.001
    apart = np.abs(wrapped(bearings[None, :] - beams[:, None]))
    require_cover(beams, apart, near)
    shadows = np.full(len(beams), np.inf)
    if place != (0.0, 0.0):
        shadows = first_shadows(beams, bearings, distances, min(near, 1.0), place)
        hit = np.isfinite(distances)
        x, y = points(bearings[hit], distances[hit], place).T
        distances, apart = np.hypot(x, y), np.abs(wrapped(np.arctan2(y, x)[None, :] - beams[:, None]))
    own = apart <= spacing / 2.0 * 1.001  # readings between two beams count for both, so nothing falls between
    if place == (0.0, 0.0):
        own[np.arange(len(beams)), apart.argmin(axis=1)] = True
    return np.minimum(np.where(own, distances[None, :], np.inf).min(axis=1, initial=np.inf), shadows)


def require_cover(beams: NDArray[np.float64], apart: NDArray[np.float64], near: float) -> None:
    """Refuse a scan that leaves beams without a reading.

    Args:
        beams: their bearings (B,) [rad].
        apart: of each beam and each reading (B, k) [rad].
        near: how far apart they may be [rad].

    Raises:
        MessageError: a beam has none so near.
    """
    lost = beams[apart.min(axis=1, initial=np.inf) > near]
    if len(lost) > 0:
        degrees = math.degrees(float(lost[0]))
        raise MessageError(
            f"the scan has no reading near the beam at {degrees:.0f} degrees, one of {len(lost)} without"
        )


def first_shadows(
    beams: NDArray[np.float64],
    bearings: NDArray[np.float64],
    distances: NDArray[np.float64],
    near: float,
    place: tuple[float, float],
) -> NDArray[np.float64]:
    """How far each beam runs (B,) before it comes to or behind what a scanner beside the centre sees [m].

    Each hit hides a wedge from the scanner: what is beyond it, half-way to the readings beside it. A beam from the centre ends
    where it comes into one, by its front (two lines through the hit) or by a side. What no reading looks at hides nothing.

    Args:
        beams: bearings of the beams (B,) [rad].
        bearings, distances: of readings, seen from the scanner (k,).
        near: how far to either side a reading counts at most [rad].
        place: of the scanner, x and y in the robot's frame [m].
    """
    order = np.argsort(bearings)
    bearings, distances = bearings[order], distances[order]
    half = np.minimum(np.diff(bearings, append=bearings[:1] + math.tau) / 2.0, near)
    hit = np.isfinite(distances)
    seen = points(bearings[hit], distances[hit], place)
    starts, ways, ends = [], [], []
    for edge in ((bearings + half)[hit], (bearings - np.roll(half, 1))[hit]):
        corner = points(edge, distances[hit], place)
        starts += [seen, corner]
        ways += [corner - seen, points(edge, np.ones(len(edge)))]
        ends += [np.ones(len(edge)), np.full(len(edge), np.inf)]
    return first_crossings(beams, np.concatenate(starts), np.concatenate(ways), np.concatenate(ends))


def first_crossings(
    beams: NDArray[np.float64], starts: NDArray[np.float64], ways: NDArray[np.float64], ends: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How far each beam from the origin runs (B,) to the first line that it crosses [m]; infinite where it crosses none.

    Args:
        beams: bearings of the beams (B,) [rad].
        starts, ways, ends: lines of the points start + s way, s from 0 to end: (n, 2), (n, 2) and (n,).
    """
    along = points(beams, np.ones(len(beams)))[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel ones do not cross
        slant = along[..., 0] * ways[:, 1] - along[..., 1] * ways[:, 0]
        reach = (starts[:, 0] * ways[:, 1] - starts[:, 1] * ways[:, 0]) / slant
        share = (starts[:, 0] * along[..., 1] - starts[:, 1] * along[..., 0]) / slant
    crosses = (reach >= 0.0) & (share >= -1e-9) & (share <= ends + 1e-9)  # nothing slips through between two lines
    return np.where(crosses, reach, np.inf).min(axis=1, initial=np.inf)


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
        self._stamps = {"scan": 0.0, "odometry": 0.0, "goal": 0.0}
        self._since = 0.0

    def restart(self, since: float = 0.0) -> None:
        """Forget what was heard of the time before the robot was put elsewhere, or its world begun anew.

        Args:
            since: when that was [s], by the clock of the messages' stamps: what is stamped later and has come already is kept,
                and what was stamped before is not taken when it comes late. 0 forgets all, and takes all that comes.
        """
        self._since = since
        old = {name for name, stamp in self._stamps.items() if since == 0.0 or stamp <= since}
        self._heard.update({name: -math.inf for name in old & self._heard.keys()})
        self._ranges = None if "scan" in old else self._ranges
        self._pose = None if "odometry" in old else self._pose
        self._goal = None if "goal" in old else self._goal
        self._start = self._pose

    def _is_late(self, message: Any) -> bool:
        """Whether it is of the time before the last restart."""
        return 0.0 < stamped(message) < self._since

    def hear_scan(self, scan: Any, now: float) -> None:
        """Take a `sensor_msgs/LaserScan`.

        Raises:
            MessageError: it does not cover the beams that the policy looks along.
        """
        if self._is_late(scan):
            return
        bearings, distances = readings(scan, self.mount[2])
        ranges = ranges_along(self.sensors.angles, bearings, distances, scan.angle_increment, self.mount[:2])
        self._ranges = np.clip(ranges, self.scenario.lidar.min_range, self.sensors.range)
        self._heard["scan"], self._stamps["scan"] = now, stamped(scan)

    def hear_odometry(self, odometry: Any, now: float) -> None:
        """Take a `nav_msgs/Odometry`, its twist in the robot's frame as ROS has it."""
        if self._is_late(odometry):
            return
        self._pose = pose_of(odometry.pose.pose)
        if self._start is None:
            self._start = self._pose
        twist = odometry.twist.twist
        second = twist.linear.y if self.sensors.drive.kinematics == "holonomic" else twist.angular.z
        self._velocity = (twist.linear.x, second)
        self._heard["odometry"], self._stamps["odometry"] = now, stamped(odometry)

    def hear_goal(self, goal: Any, *, moves: bool = False) -> bool:
        """Take a `geometry_msgs/PoseStamped` in the frame of the odometry, which may come later; its heading does not matter.

        Args:
            goal: the message.
            moves: whether a goal that comes on the way is the same one, which has moved.

        Returns:
            Whether it is a new one, for which a policy begins anew.

        Raises:
            MessageError: it was given before the last restart.
        """
        if self._is_late(goal):
            raise MessageError("a goal of the time before the reset is not taken")
        is_new = self._goal is None or not moves
        if is_new:
            self._start = self._pose
        self._goal, self._stamps["goal"] = (goal.pose.position.x, goal.pose.position.y), stamped(goal)
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
