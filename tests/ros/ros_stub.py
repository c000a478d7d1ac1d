"""Stand-ins for rclpy and the message classes that the nodes use: fields as in ROS 2, topics within one process.

Fields are those of the interface definitions in common_interfaces and rcl_interfaces (humble to kilted).
"""

from __future__ import annotations

import sys
from collections import defaultdict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any


@dataclass
class Time:
    """builtin_interfaces/Time."""

    sec: int = 0
    nanosec: int = 0


@dataclass
class Header:
    """std_msgs/Header."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3:
    """geometry_msgs/Vector3, and Point."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


@dataclass
class Quaternion:
    """geometry_msgs/Quaternion."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


@dataclass
class Pose:
    """geometry_msgs/Pose."""

    position: Vector3 = field(default_factory=Vector3)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseStamped:
    """geometry_msgs/PoseStamped."""

    header: Header = field(default_factory=Header)
    pose: Pose = field(default_factory=Pose)


@dataclass
class PoseWithCovariance:
    """geometry_msgs/PoseWithCovariance."""

    pose: Pose = field(default_factory=Pose)
    covariance: list[float] = field(default_factory=lambda: [0.0] * 36)


@dataclass
class Twist:
    """geometry_msgs/Twist."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistWithCovariance:
    """geometry_msgs/TwistWithCovariance."""

    twist: Twist = field(default_factory=Twist)
    covariance: list[float] = field(default_factory=lambda: [0.0] * 36)


@dataclass
class Odometry:
    """nav_msgs/Odometry."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class LaserScan:
    """sensor_msgs/LaserScan."""

    header: Header = field(default_factory=Header)
    angle_min: float = 0.0
    angle_max: float = 0.0
    angle_increment: float = 0.0
    time_increment: float = 0.0
    scan_time: float = 0.0
    range_min: float = 0.0
    range_max: float = 0.0
    ranges: list[float] = field(default_factory=list)
    intensities: list[float] = field(default_factory=list)


for _message in (Time, Header, Vector3, Quaternion, Pose, PoseStamped, Twist, Odometry, LaserScan):
    # A misspelt field is an error, as in the classes that ROS generates.
    _names = frozenset(_message.__dataclass_fields__)

    def _set(self: Any, name: str, value: Any, names: frozenset[str] = _names) -> None:
        if name not in names:
            raise AttributeError(f"{type(self).__name__} has no field {name!r}")
        object.__setattr__(self, name, value)

    _message.__setattr__ = _set  # type: ignore[method-assign]


class Empty:
    """std_srvs/Empty."""

    class Request:
        """Nothing."""

    class Response:
        """Nothing."""


class DurabilityPolicy(Enum):
    """rclpy.qos.DurabilityPolicy."""

    TRANSIENT_LOCAL = 1
    VOLATILE = 2


class ReliabilityPolicy(Enum):
    """rclpy.qos.ReliabilityPolicy."""

    RELIABLE = 1
    BEST_EFFORT = 2


@dataclass(frozen=True)
class QoSProfile:
    """rclpy.qos.QoSProfile, as much of it as decides who hears whom."""

    depth: int
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE

    @property
    def keeps(self) -> bool:
        """Whether messages are kept for those who come later."""
        return self.durability is DurabilityPolicy.TRANSIENT_LOCAL

    def hears(self, publisher: QoSProfile) -> bool:
        """Whether a subscription with this profile gets what a publisher with that one sends."""
        is_sure = publisher.reliability is ReliabilityPolicy.RELIABLE
        return (is_sure or self.reliability is ReliabilityPolicy.BEST_EFFORT) and (publisher.keeps or not self.keeps)


SENSOR_DATA = QoSProfile(5, ReliabilityPolicy.BEST_EFFORT)


class Ros:
    """One process of ROS: topics, parameters, and a clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0
        self.parameters: dict[str, Any] = {}
        self.listeners: dict[str, list[tuple[Callable[[Any], None], QoSProfile]]] = defaultdict(list)
        self.kept: dict[str, list[tuple[deque[Any], QoSProfile]]] = defaultdict(list)
        self.published: dict[str, list[Any]] = defaultdict(list)
        self.log: list[str] = []


ROS = Ros()


class Parameter:
    """rclpy.parameter.Parameter."""

    def __init__(self, value: Any) -> None:
        self.value = value


class Node:
    """rclpy.node.Node, as much of it as the nodes use."""

    def __init__(self, node_name: str) -> None:
        self.node_name = node_name

    def declare_parameter(self, name: str, value: Any = None) -> Parameter:
        """The parameter, as set or by default."""
        return Parameter(ROS.parameters.get(name, value))

    def create_publisher(self, msg_type: type, topic: str, qos_profile: Any) -> SimpleNamespace:
        """Whose `publish` tells all who listen, and those who come later where both keep messages."""
        own = profile_of(qos_profile)
        kept: deque[Any] = deque(maxlen=own.depth)
        ROS.kept[topic].append((kept, own))

        def publish(message: Any) -> None:
            assert isinstance(message, msg_type)
            ROS.published[topic].append(message)
            kept.append(message)
            for listener, profile in ROS.listeners[topic]:
                if profile.hears(own):
                    listener(message)

        return SimpleNamespace(publish=publish)

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[[Any], None], qos_profile: Any
    ) -> None:
        """Listen."""
        own = profile_of(qos_profile)
        ROS.listeners[topic].append((callback, own))
        for kept, profile in ROS.kept[topic]:
            for message in list(kept)[-own.depth :] if own.keeps and own.hears(profile) else ():
                callback(message)

    def create_service(self, srv_type: type, srv_name: str, callback: Callable[[Any, Any], Any]) -> None:
        """Not called here."""

    def create_timer(self, timer_period_sec: float, callback: Callable[[], None]) -> SimpleNamespace:
        """The test calls the callback."""
        return SimpleNamespace(period=timer_period_sec, callback=callback)

    def get_clock(self) -> SimpleNamespace:
        """The test's clock."""
        nanoseconds = round(ROS.now * 1e9)
        stamp = SimpleNamespace(nanoseconds=nanoseconds, to_msg=lambda: Time(*divmod(nanoseconds, 10**9)))
        return SimpleNamespace(now=lambda: stamp)

    def get_logger(self) -> SimpleNamespace:
        """What is logged is kept."""
        return SimpleNamespace(info=ROS.log.append)


def profile_of(qos_profile: Any) -> QoSProfile:
    """A number is the depth of a profile that is otherwise the default."""
    return QoSProfile(qos_profile) if isinstance(qos_profile, int) else qos_profile


def install() -> Ros:
    """Put the stand-ins where the nodes import them from, in a fresh process of ROS."""
    global ROS
    ROS = Ros()
    contents: dict[str, dict[str, Any]] = {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {
            "DurabilityPolicy": DurabilityPolicy,
            "QoSProfile": QoSProfile,
            "ReliabilityPolicy": ReliabilityPolicy,
            "qos_profile_sensor_data": SENSOR_DATA,
        },
        "geometry_msgs": {},
        "geometry_msgs.msg": {"PoseStamped": PoseStamped, "Twist": Twist},
        "nav_msgs": {},
        "nav_msgs.msg": {"Odometry": Odometry},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"LaserScan": LaserScan},
        "std_msgs": {},
        "std_msgs.msg": {"Header": Header},
        "std_srvs": {},
        "std_srvs.srv": {"Empty": Empty},
    }
    for name, members in contents.items():
        module = ModuleType(name)
        vars(module).update(members)
        sys.modules[name] = module
    return ROS
