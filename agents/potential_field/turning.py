"""Inner and outer angle along a wall: when a robot that follows it faces the target past the wall's end.

Source: the paper on potential field and wall following, its conditions 1 to 3. Turning to the wall's side adds to the
inner angle, turning away to the outer one; Theta is their difference since the last reset, measured by the gyroscope.

    entry         phi_0 = angle from the heading along the wall to the target, towards the wall (90 degrees in theory)
    1, reset      Theta was outward and is back at zero: as at the entry, so begin anew with the angle of here
    2, angle      Theta >= phi_0: turned to the wall as far as the target lay to that side
    3, projection the way since the last reset has a part along the target's direction there
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.geometry import Point, wrap

ANGLE_SLACK = math.radians(7.0)
"""epsilon_theta: what the gyroscope may have lost and the wall follower leans [rad]."""

OUTWARD = math.radians(-30.0)
"""Theta below which an outward excursion is one, and no ripple of the steering [rad]."""

ALIGNED = math.radians(45.0)
"""Angle between the heading and the wall within which the robot goes along it [rad]."""


@dataclass
class Turning:
    """What a robot remembers of its turning along one wall."""

    side: int
    """+1: the wall is on the right; -1: on the left."""
    along: float
    """Direction along the wall where it was met, odometry frame [rad]."""
    place: Point
    """Where it was met, or the last reset was, odometry frame [m]."""
    course: float
    """Direction of travel, odometry frame [rad]."""
    target: float
    """Direction of the target, odometry frame [rad]."""
    is_aligned: bool = False
    """Whether the robot goes along the wall already: its turning counts from then on."""
    inner: float = 0.0
    """Inner angle since the last reset [rad]."""
    outer: float = 0.0
    """Outer angle since the last reset [rad]."""
    first: float = 0.0
    """phi_0, angle to the target, towards the wall, at the entry or the last reset [rad]."""
    first_target: float = 0.0
    """Direction of the target there, odometry frame [rad]."""
    lowest: float = 0.0
    """Smallest Theta since the last reset [rad]."""
    unwrapped: float = 0.0
    """xi, angle to the target, towards the wall, followed from the entry on without a jump [rad]."""
    total: float = 0.0
    """Turning toward the wall since the entry, resets or not [rad]."""
    target_turned: float = 0.0
    """How far the target's direction has turned toward the wall since the entry [rad]."""
    resets: int = 0
    """How often the angles were set to zero."""

    def __post_init__(self) -> None:
        self._begin(self.place)
        self.unwrapped = self.first

    @property
    def cumulative(self) -> float:
        """Theta, the relative cumulative angle [rad]."""
        return self.inner - self.outer

    def advance(self, place: Point, target: float, course: float, change: float, *, resets: bool) -> None:
        """Bring the angles up to the present.

        Args:
            place: own place, odometry frame [m].
            target: direction of the target, odometry frame [rad].
            course: direction of travel, odometry frame [rad].
            change: turning since the last decision, more than half a turn in a narrow wedge [rad].
            resets: whether condition 1 is looked at.
        """
        self._follow_target(target)
        self.course = course
        if not self.is_aligned:
            self._align(course)
        else:
            self._turn(-self.side * change)
        self.lowest = min(self.lowest, self.cumulative)
        if resets and self.lowest < OUTWARD and self.cumulative >= -ANGLE_SLACK:
            self.along = course
            self._begin(place)
            self.resets += 1

    def _begin(self, place: Point) -> None:
        """Set the angles to zero, here."""
        self.inner = self.outer = self.lowest = 0.0
        self.place, self.first_target = place, self.target
        self.first = self.side * wrap(self.along - self.target)
        if self.first == -math.pi:
            self.first = math.pi

    def _align(self, course: float) -> None:
        """Begin to count where the course comes near to the direction along the wall; until then nothing counts."""
        off = wrap(course - self.along)
        if abs(off) <= ALIGNED:
            self.is_aligned = True
            self._turn(-self.side * off)

    def _turn(self, inward: float) -> None:
        """Add a turning toward the wall [rad]."""
        self.inner += max(inward, 0.0)
        self.outer += max(-inward, 0.0)
        self.total += inward
        self.unwrapped -= inward

    def _follow_target(self, target: float) -> None:
        """Take note of how far the target's direction has turned."""
        inward = -self.side * wrap(target - self.target)
        self.target = target
        self.target_turned += inward
        self.unwrapped += inward

    def faces_target(self, *, unwrapped: bool) -> bool:
        """Condition 2, by the cumulative angle, or by the one that a moving target allows."""
        if not self.is_aligned:
            return False
        if unwrapped:
            return self.unwrapped <= ANGLE_SLACK
        return self.cumulative >= self.first - ANGLE_SLACK

    def has_come_nearer(self, place: Point, toward: float) -> bool:
        """The projection of condition 3: whether the way since the last reset has a part along a direction [rad]."""
        dx, dy = place[0] - self.place[0], place[1] - self.place[1]
        return dx * math.cos(toward) + dy * math.sin(toward) > 0.0
