"""What a policy sees: what a driver knows of the robot, and one observation with names."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from dataclasses import fields as fields_of
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.checks import shortened
from bug_gym.config import Scenario
from bug_gym.geometry import F32
from bug_gym.kinematics import Drive
from bug_gym.observation import Field, fields, width
from bug_gym.schema.ranges import most_of
from bug_gym.world import beam_angles

Points = tuple[NDArray[np.float64], NDArray[np.float64]]
"""x (k,), y (k,) [m]; the frame is said where it is used."""


class Scans(NamedTuple):
    """Scans of k robots that were read at once; each view of theirs has a row."""

    ranges: NDArray[np.float64]
    """(k, B) [m]."""
    points: NDArray[np.float64]
    """(k, 2, B), of each the first ones, in its own frame [m]."""
    counts: NDArray[np.int64]
    """How many of each (k,)."""
    disc: float
    """Radius of the disc that goes straight ahead [m]."""


Read = tuple[NDArray[np.float64], list[float], Points, Scans, float]
"""Of one of them the ranges, the numbers behind them in the observation, the points, all scans, and how far the disc can go."""


class Shown(NamedTuple):
    """What scans have shown, in the robot's frame."""

    x: NDArray[np.float64]
    """Ahead (k,) [m]."""
    y: NDArray[np.float64]
    """To the left (k,) [m]."""
    wide: int
    """How many of them, the first ones, may go on beside themselves, unseen, as far as half of what lies between two beams."""


@dataclass(frozen=True, eq=False)
class Sensors:
    """What a driver of the robot knows about it: body, motion, scanner. Nothing about the world.

    One is another one than a second with the same numbers, so that what follows from them can be remembered.
    """

    drive: Drive
    """Kinematics and limits."""
    radius: float
    """Radius of the disc about the robot's origin that holds its body [m]."""
    footprint: tuple[tuple[float, float, float], ...]
    """The body as circles x, y, radius in the robot's frame [m]."""
    angles: NDArray[np.float64]
    """Bearing of each beam (B,) [rad]."""
    range: float
    """Range that means "nothing seen" [m]."""
    range_noise: float
    """Standard deviation of a range, from the data sheet [m]."""
    goal_radius: float
    """Distance within which the goal counts as reached [m]."""
    fields: tuple[Field, ...]
    """The fields of the observation."""
    dropout: float = 0.0
    """Share of the beams that see nothing, from the data sheet."""
    min_range: float = 0.0
    """Below this no range is told: what is nearer seems to be so far away [m]."""

    @classmethod
    def of(cls, scenario: Scenario) -> Sensors:
        """The sensors of a scenario's robot; of numbers drawn for each episode, the end with which it is safe."""
        robot, lidar = scenario.robot, scenario.lidar
        acceleration = math.inf if robot.max_acceleration is None else robot.max_acceleration
        return cls(
            drive=Drive(
                robot.kinematics,
                float(robot.max_speed),
                float(robot.max_reverse),
                float(robot.greatest_turn_rate),
                scenario.time.step,
                float(acceleration),
                scenario.latency_steps,
                *((float(robot.wheelbase), float(robot.max_steering)) if robot.kinematics == "ackermann" else ()),
            ),
            radius=robot.reach,
            footprint=robot.footprint,
            angles=beam_angles(scenario),
            range=float(np.float32(lidar.range)),  # as observations tell it: a beam that meets nothing reads just that
            range_noise=float(lidar.noise),
            goal_radius=scenario.goal.radius,
            fields=fields(scenario),
            dropout=most_of(lidar.dropout),
            min_range=most_of(lidar.min_range),
        )

    def differences(self, other: Sensors) -> Iterator[str]:
        """Each thing in which another robot differs for a driver, as "max_speed 1.0, not 2.0"; data sheets do not count.

        Nor do peers: who knows none sees them as movers.
        """
        names = [one.name for one in fields_of(Drive)]
        pairs: list[tuple[str, Any, Any]] = [
            (name, getattr(self.drive, name), getattr(other.drive, name)) for name in names
        ]
        for name in ("radius", "footprint", "range"):
            pairs.append((name, getattr(self, name), getattr(other, name)))
        pairs.append(("beams", len(self.angles), len(other.angles)))
        pairs.append(("first angle", float(self.angles[0]), float(other.angles[0])))
        pairs.append(("angle between beams", self.beam_spacing, other.beam_spacing))
        mine, theirs = ({one.name: one.end - one.begin for one in robot.fields} for robot in (self, other))
        pairs += [(f"numbers of {name}", mine.get(name, 0), theirs.get(name, 0)) for name in mine | theirs]
        left_out = ("numbers of ranges", "numbers of peers")
        yield from (f"{name} {one}, not {two}" for name, one, two in pairs if one != two and name not in left_out)

    @cached_property
    def width(self) -> int:
        """Length of the flat observation."""
        return width(self.fields)

    @property
    def step_length(self) -> float:
        """Way at full speed in one step [m]."""
        return self.drive.max_speed * self.drive.step

    @cached_property
    def always_seen(self) -> tuple[slice, ...]:
        """Where the ranges lie in the flat observation, where the rest that each has, and in it goal, pose, velocity."""
        places = {field.name: field for field in self.fields}
        ranges, *rest = (places[name] for name in ("ranges", "goal", "pose", "velocity"))
        first, last = min(field.begin for field in rest), max(field.end for field in rest)
        within = (slice(field.begin - first, field.end - first) for field in rest)
        return slice(ranges.begin, ranges.end), slice(first, last), *within

    @cached_property
    def beam_spacing(self) -> float:
        """Angle between two neighbouring beams [rad]."""
        return float(self.angles[1] - self.angles[0]) if len(self.angles) > 1 else 2.0 * math.pi

    @cached_property
    def is_full_circle(self) -> bool:
        """Whether the last beam is the first one's neighbour."""
        return len(self.angles) * self.beam_spacing >= 2.0 * math.pi - 1e-6

    @cached_property
    def bridged_gap(self) -> float:
        """How far apart two points are at most between which a lost beam met what they met [m]; 0: no beam is lost."""
        return 2.0 * self.radius if self.dropout > 0.0 else 0.0

    @cached_property
    def circles(self) -> NDArray[np.float64]:
        """The footprint as an array (c, 3)."""
        return np.array(self.footprint, dtype=np.float64)

    @cached_property
    def beam_directions(self) -> NDArray[np.float64]:
        """Unit vectors (2, B) of the beams in the robot's frame."""
        return np.stack([np.cos(self.angles), np.sin(self.angles)])


def require_sensors(sensors: object, policy: object) -> None:
    """Refuse what is no Sensors to a policy that is being made for them, such as the env that `make_policy` takes.

    Raises:
        ValueError: it is none.
    """
    if not isinstance(sensors, Sensors):
        expected = "bug_gym.view.Sensors, as Sensors.of(scenario) or make_policy(name, env) hands over"
        raise ValueError(f"{type(policy).__name__} got {shortened(sensors)} as its sensors, expected {expected}")


class View:
    """One robot's observation with names, and answers to what every policy asks of it.

    Two frames: the robot's (x ahead, y left) and "odometry", the frame of the start, in which the robot keeps its
    memory. Both in metres and radians.

    Args:
        flat: the observation (D,).
        sensors: of the robot.
        under_way: its actions (2,) that have yet to act, the first one first; None: nobody kept them.
        lately: points (2, k) that scans before this one showed, odometry frame [m].
        read: what has been read of it already, together with those of others.
    """

    _points: Points | None
    scans: Scans | None
    """The scans of several robots that were read at once, this one among them; None: it was read alone."""
    _ahead: float

    __slots__ = (
        "sensors",
        "under_way",
        "lately",
        "flat",
        "ranges",
        "goal",
        "pose",
        "velocity",
        "_points",
        "_late",
        "_trig",
        "scans",
        "_ahead",
    )

    def __init__(
        self,
        flat: F32,
        sensors: Sensors,
        under_way: Sequence[NDArray[np.float32]] | None = None,
        lately: Sequence[NDArray[np.float64]] = (),
        read: Read | None = None,
    ) -> None:
        self.sensors = sensors
        self.under_way = under_way
        self.lately = lately
        self._late: Shown | None = None
        self.flat = flat
        ranges, rest, goal, pose, velocity = sensors.always_seen
        told: Any
        if read is None:
            self.ranges: NDArray[np.float64] = flat[ranges].astype(np.float64)
            told, self._points, self.scans = flat[rest].tolist(), None, None
        else:
            self.ranges, told, self._points, self.scans, self._ahead = read
        numbers = tuple(told)
        self.goal: tuple[float, float] = numbers[goal]
        self.pose: tuple[float, float, float] = numbers[pose]
        self.velocity: tuple[float, float] = numbers[velocity]
        self._trig = (math.cos(self.pose[2]), math.sin(self.pose[2]))

    @classmethod
    def of_rows(cls, rows: F32, sensors: Sensors, disc: float) -> list[View]:
        """Those of several observations of robots alike, each as of its row alone; what is the same for all is done once.

        Args:
            rows: the observations (k, D).
            sensors: of each.
            disc: radius of the one of which `free_ahead` is asked [m].

        Raises:
            ValueError: a number that is not finite.
        """
        count, directions, (places, rest, *_) = len(rows), sensors.beam_directions, sensors.always_seen
        beams, how = directions.shape[1], (directions, sensors.range, sensors.bridged_gap, sensors.is_full_circle, disc)
        ranges, points = np.empty((count, beams)), np.empty((count, 2, beams))
        ahead, counts = np.empty(count), np.empty(count, dtype=np.int64)
        if not kernels.read_scans(rows, places.start, *how, ranges, points, ahead, counts):
            raise ValueError("the observation holds a number that is not finite")
        scans, numbers, views = Scans(ranges, points, counts, disc), rows[:, rest].tolist(), []
        for row, (shown, free) in enumerate(zip(counts.tolist(), ahead.tolist(), strict=True)):
            seen = points[row, 0, :shown], points[row, 1, :shown]
            views.append(cls(rows[row], sensors, read=(ranges[row], numbers[row], seen, scans, free)))
        return views

    def with_ranges(self, ranges: NDArray[np.float64]) -> View:
        """The same observation with other ranges (B,) [m]."""
        return self.showing(ranges.astype(np.float32).astype(np.float64))

    def showing(self, ranges: NDArray[np.float64], points: Points | None = None) -> View:
        """The same with other ranges (B,) [m], rounded as an observation's are, and their points where those are known."""
        other = View.__new__(View)
        other.sensors, other.under_way, other.lately = self.sensors, self.under_way, self.lately
        other._points, other._late, other.scans = points, None, None
        other.goal, other.pose, other.velocity, other._trig = self.goal, self.pose, self.velocity, self._trig
        other.flat = self.flat
        other.ranges = ranges
        return other

    def stand_at(self, pose: tuple[float, float, float], goal: tuple[float, float]) -> None:
        """Have the robot stand at another pose, in the odometry frame, from where the goal lies elsewhere [m, rad]."""
        self.pose, self.goal = pose, goal
        self._trig = math.cos(pose[2]), math.sin(pose[2])

    @property
    def terrain(self) -> F32 | None:
        """What a metre of ground costs (32, 16), 1 or more: row k at bearing 2 pi k / 32, column j at (j + 1) / 4 m.

        None in a scenario without regions.
        """
        return self.field("terrain") if any(field.name == "terrain" for field in self.sensors.fields) else None

    def field(self, name: str) -> F32:
        """A field of the observation by name, in its shape.

        Raises:
            KeyError: the scenario has no such field.
        """
        if name == "ranges":  # those of `with_ranges` are in no observation
            return self.ranges.astype(np.float32)
        for field in self.sensors.fields:
            if field.name == name:
                return self.flat[field.begin : field.end].reshape(field.shape)
        raise KeyError(name)

    @property
    def position(self) -> tuple[float, float]:
        """Own place in the odometry frame [m]."""
        return self.pose[0], self.pose[1]

    @property
    def heading(self) -> float:
        """Own heading in the odometry frame [rad]."""
        return self.pose[2]

    @property
    def own_velocity(self) -> tuple[float, float]:
        """The robot's velocity in its frame [m/s], by its wheels."""
        return self.velocity if self.sensors.drive.kinematics == "holonomic" else (self.velocity[0], 0.0)

    @property
    def goal_distance(self) -> float:
        """Distance to the goal [m]."""
        return math.hypot(*self.goal)

    @property
    def goal_bearing(self) -> float:
        """Bearing of the goal from the heading [rad]."""
        return math.atan2(self.goal[1], self.goal[0])

    @property
    def goal_position(self) -> tuple[float, float]:
        """The goal in the odometry frame [m]."""
        return self.to_odometry(*self.goal)

    @property
    def points(self) -> Points:
        """Scan points x (k,), y (k,) in the robot's frame [m]: the beams that saw something.

        Of a scanner that loses beams also where one was lost between two points that the body does not pass between.
        """
        if self._points is None:
            sensors, ranges, directions = self.sensors, self.ranges, self.sensors.beam_directions
            reach, places = sensors.range, np.empty(directions.shape)
            if sensors.bridged_gap > 0.0:
                is_round = sensors.is_full_circle
                count = kernels.bridged_points(ranges, directions, reach, sensors.bridged_gap, is_round, places)
            else:
                count = kernels.scan_points(ranges, directions, reach, places)
            self._points = (places[0, :count], places[1, :count])
        return self._points

    @property
    def points_met(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The same without those between which a beam was lost."""
        if self.sensors.dropout == 0.0:
            return self.points
        directions = self.sensors.beam_directions
        places = np.empty(directions.shape)
        count = kernels.scan_points(self.ranges, directions, self.sensors.range, places)
        return places[0, :count], places[1, :count]

    @property
    def points_of_late(self) -> Shown:
        """The same with the points that scans before this one showed, as far as they were kept.

        Between two of them things may go on unseen where the robot needs a way to stand, and where the beam that would show
        them was lost; else a robot that stops at once would stand beside a wall whose points scatter.
        """
        if self._late is None:
            x, y = self.points
            if not self.lately:
                self._late = Shown(x, y, x.size)
                return self._late
            cos, sin = self._trig
            away = np.concatenate(self.lately, axis=1) - np.array([[self.pose[0]], [self.pose[1]]])
            late = np.array([[cos, sin], [-sin, cos]]) @ away
            wide = self._go_on_beside(*late)
            every = np.concatenate([self.points, late[:, wide], late[:, ~wide]], axis=1)
            self._late = Shown(every[0], every[1], x.size + int(np.count_nonzero(wide)))
        return self._late

    def _go_on_beside(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether what was at a place (k,), in the robot's frame [m], may go on beside it: see `points_of_late`.

        A beam that met nothing may have been lost.
        """
        sensors = self.sensors
        if sensors.drive.has_inertia:
            return np.ones(x.shape, dtype=np.bool_)
        if sensors.dropout == 0.0:
            return np.zeros(x.shape, dtype=np.bool_)
        turned = (np.arctan2(y, x) - sensors.angles[0] + 0.5 * sensors.beam_spacing) % (2.0 * math.pi)
        beams = (turned / sensors.beam_spacing).astype(np.intp)
        lost = np.append(self.ranges >= sensors.range, False)  # and one for where no beam goes
        is_seen = beams < sensors.angles.size
        return np.asarray(lost[np.where(is_seen, beams, -1)])

    def nearest(self, bearing: float = 0.0, half_width: float = math.pi) -> tuple[float, float]:
        """Distance [m] and bearing [rad] of the nearest scan point within `half_width` of a bearing.

        The distance is infinite where there is none.
        """
        x, y = self.points
        if half_width < math.pi:
            index = kernels.nearest_within(x, y, math.cos(bearing), math.sin(bearing), math.cos(half_width))
        else:
            index = kernels.nearest_point(x, y, 0.0, 0.0)
        if index < 0:
            return math.inf, bearing
        ahead, left = x.item(index), y.item(index)
        return math.sqrt(ahead * ahead + left * left), math.atan2(left, ahead)

    def point_nearest_to(self, x: float, y: float) -> tuple[float, float] | None:
        """The scan point nearest to a place, both in the robot's frame [m]; None: nothing is seen."""
        px, py = self.points
        index = kernels.nearest_point(px, py, x, y)
        return (px.item(index), py.item(index)) if index >= 0 else None

    def free_distance(self, bearing: float, radius: float) -> float:
        """How far a disc of `radius` [m] can travel along a bearing [rad] before it touches a scan point.

        At most the LIDAR's range. (The scan in configuration space; algorithms use it instead of single beams.)
        """
        x, y = self.points
        return float(kernels.free_distance(x, y, bearing, radius, self.sensors.range))

    def free_ahead(self, radius: float) -> float:
        """`free_distance` straight ahead, which is known already of the disc of `scans`."""
        if self.scans is not None and self.scans.disc == radius:
            return self._ahead
        return self.free_distance(0.0, radius)

    def free_distances(self, bearings: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
        """`free_distance` for each bearing (m,)."""
        x, y = self.points
        result = np.empty(len(bearings))
        kernels.free_distances(
            x, y, np.ascontiguousarray(bearings, dtype=np.float64), radius, self.sensors.range, result
        )
        return result

    def to_odometry(self, x: float, y: float) -> tuple[float, float]:
        """A point of the robot's frame in the odometry frame [m]."""
        cos, sin = self._trig
        return self.pose[0] + cos * x - sin * y, self.pose[1] + sin * x + cos * y

    def to_robot(self, x: float, y: float) -> tuple[float, float]:
        """A point of the odometry frame in the robot's frame [m]."""
        cos, sin = self._trig
        dx, dy = x - self.pose[0], y - self.pose[1]
        return cos * dx + sin * dy, cos * dy - sin * dx


def ranges_together(views: Sequence[View]) -> NDArray[np.float64]:
    """The ranges (k, B) of some views [m]; they lie as they are to be where the scans were read at once."""
    scans = views[0].scans
    if scans is not None and len(scans.ranges) == len(views):
        for view in views:
            if view.scans is not scans:
                break
        else:
            return scans.ranges
    return np.concatenate([view.ranges for view in views]).reshape(len(views), -1)
