"""How a robot feels the potential field and moves in it: obstacles with their velocities, forces, and the way they lead.

Sources: the paper on potential field and wall following, its APF mode; the field of Ge and Cui (2002). The velocity of an
obstacle relative to the robot is the difference of its places in two scans, the turning between them taken out by the
gyroscope; odometry has no part in it.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from bug_gym.agents.parameters import Length, Weight
from bug_gym.agents.potential_field.forces import Gains, attractive_force, repulsive_force
from bug_gym.agents.potential_field.nearest_points import find_nearest_points
from bug_gym.geometry import Point, velocity_along
from bug_gym.policy import CREEP, MisfitError, Velocity
from bug_gym.view import Sensors, View

LOOK_BACK = 0.5
"""Time between the two scans that velocities are taken from [s]."""

OTHER_CLUSTER = 0.5
"""Gap between neighbouring points of a scan at which another obstacle begins [m]."""

SAME_POINT = 0.5
"""How far an obstacle's nearest point may have moved between the two scans, beyond the robot's own way [m]."""

MOVES = 0.1
"""Speed toward or away from the robot, beyond what noise feigns, that makes an obstacle a moving one [m/s]."""

KEPT = 0.5
"""Share of a holonomic robot's velocity that a decision keeps."""

STRAIGHT_BACK = 0.02
"""Angle to straight back within which the force tells a robot that must turn no side [rad]; it turns left then."""


@dataclass(frozen=True)
class FieldParameters:
    """Parameters of the potential field."""

    attraction: Weight = 1.0
    """alpha_p, weight of the attraction of the target."""
    exponent: Literal[1, 2] = 1
    """m, power of the distance to the target in its potential, a number."""
    velocity_gain: Weight | None = None
    """alpha_v, weight of the velocity relative to the target [s^2/m^2]; None: at top speed a fifth of the attraction."""
    repulsion: Weight = 0.2
    """eta, weight of the repulsion of what comes nearer."""
    influence: Length = 1.0
    """rho_0, gap beyond the braking distance at which that repulsion begins [m]."""
    braking: Length | None = None
    """a_max, deceleration that braking is reckoned with [m/s^2]; None: what stops the robot in half the influence, or
    its limit, where that is less."""
    floor: Weight = 0.05
    """eta_s, weight of the repulsion of what is near, coming nearer or not."""
    floor_gap: Length = 0.5
    """rho_1, gap at which that one begins [m]."""
    slowing: Length = 1.0
    """Distance to the target at which the robot begins to slow down [m]."""


class Obstacle(NamedTuple):
    """What the field knows of an obstacle."""

    place: Point
    """Its nearest point in the robot's frame [m]."""
    velocity: Point
    """Velocity of the robot relative to it [m/s]."""
    is_moving: bool
    """Whether it comes nearer, or goes away, otherwise than by the robot's own motion."""

    @property
    def distance(self) -> float:
        """From the robot's centre [m]."""
        return math.hypot(*self.place)


class Glance(NamedTuple):
    """What was seen a moment ago."""

    heading: float
    """By the gyroscope [rad]."""
    goal: Point
    """In the robot's frame then [m]."""
    points: list[Point]
    """The obstacles' nearest points, in the robot's frame then [m]."""
    own: Point
    """Own velocity, in the robot's frame then [m/s]."""


class Forces(NamedTuple):
    """What pulls and pushes a robot, in its frame."""

    attraction: Point
    """By the target."""
    total: Point
    """Of everything together."""
    obstacles: list[Obstacle]
    """What was felt."""
    target_speed: float
    """Of the target [m/s]."""


@dataclass
class FieldMemory:
    """What a robot in a field remembers."""

    glances: deque[Glance] = field(default_factory=deque)
    """Of the last LOOK_BACK seconds, the oldest first."""
    forces: Forces | None = None
    """The last ones, to be drawn."""
    place: Point = (0.0, 0.0)
    """Where they were felt, odometry frame [m]."""
    heading: float = 0.0
    """The heading there [rad]."""


def checked_gains(own: FieldParameters, sensors: Sensors) -> Gains:
    """The constants of a field, for a robot.

    Raises:
        ValueError: a gain or a length that is not above zero or not finite, or an exponent other than 1 and 2.
        MisfitError: a scanner that sees less far than the influence.
    """
    numbers = ("attraction", "repulsion", "influence", "floor", "floor_gap", "slowing", "velocity_gain", "braking")
    for name in numbers:
        value = getattr(own, name)
        if value is not None and not (value > 0.0 and math.isfinite(value)):
            raise ValueError(f"{name} must be above 0{' and finite' if math.isinf(value) else ''}, got {value!r}")
    if own.exponent not in (1, 2):
        raise ValueError(f"exponent must be 1 or 2, got {own.exponent!r}")
    needed = own.influence + sensors.radius
    if sensors.range < needed:
        most = max(sensors.range - sensors.radius, 0.0)
        raise MisfitError(
            f"influence must lie within the scanner's range of {sensors.range:g} m less the body's radius, got "
            f"{own.influence:g} m: an influence of at most {most:g} m would do, or a lidar.range of {needed:g} m or more"
        )
    speed = sensors.drive.max_speed
    braking = min(speed**2 / own.influence, sensors.drive.max_acceleration) if own.braking is None else own.braking
    velocity = 0.1 * own.attraction / speed if own.velocity_gain is None else own.velocity_gain
    return Gains(
        attraction=own.attraction,
        exponent=own.exponent,
        velocity=velocity,
        repulsion=own.repulsion,
        influence=own.influence,
        acceleration=braking,
        floor=own.floor,
        floor_gap=own.floor_gap,
        radius=sensors.radius,
    )


def turned_back(place: Point, turn: float) -> Point:
    """A point of the robot's frame in its frame after a turn [rad]."""
    cos, sin = math.cos(turn), math.sin(turn)
    return cos * place[0] + sin * place[1], cos * place[1] - sin * place[0]


class Field:
    """The potential field about a robot.

    Raises:
        ValueError: what `checked_gains` refuses.
    """

    def __init__(self, own: FieldParameters, sensors: Sensors, *, safe_radius: float) -> None:
        self.gains = checked_gains(own, sensors)
        self.sensors = sensors
        self.slowing = own.slowing
        self.safe_radius = safe_radius
        """Of the disc that no step may bring into anything [m]."""
        braking = sensors.drive.max_speed**2 / (2.0 * self.gains.acceleration)
        felt, barred = sensors.radius + self.gains.influence + 2.0 * braking, safe_radius + sensors.step_length
        self.reach = min(max(felt, barred), sensors.range)
        """How far from the robot obstacles are felt [m]; what comes as fast as the robot is braked before twice, and what bars
        a step is felt by the smallest influence, too: a robot that nothing blocks would wait before it without end."""
        self.looks = max(round(LOOK_BACK / sensors.drive.step), 1)
        self.moves = MOVES + 3.0 * sensors.range_noise / (self.looks * sensors.drive.step)
        """Speed above which an obstacle is a moving one [m/s]."""

    def feel(self, view: View, memory: FieldMemory) -> Forces:
        """The forces of this moment; `memory` is brought up to it. Call once a decision."""
        points = self._nearest_points(view)
        before = memory.glances[0] if memory.glances else None
        time = len(memory.glances) * self.sensors.drive.step
        velocity = self._mean_velocity(view, memory)
        obstacles = [self._obstacle(view, place, before, time, velocity) for place in points]
        seen = before is not None and time > 0.5 * LOOK_BACK
        target = self._goal_velocity(view, before, time) if seen and before else (-velocity[0], -velocity[1])
        attraction = attractive_force(self.gains, view.goal, target)
        total = attraction
        for one in obstacles:
            push = repulsive_force(self.gains, one.place, one.velocity)
            total = total[0] + push[0], total[1] + push[1]
        memory.glances.append(Glance(view.heading, view.goal, points, view.own_velocity))
        if len(memory.glances) > self.looks:
            memory.glances.popleft()
        target_speed = math.hypot(target[0] + velocity[0], target[1] + velocity[1])
        memory.forces = Forces(attraction, total, obstacles, target_speed)
        memory.place, memory.heading = view.position, view.heading
        return memory.forces

    def _nearest_points(self, view: View) -> list[Point]:
        """The nearest point of each obstacle that is felt, none behind the goal, in the robot's frame [m]."""
        x, y = view.points
        found = np.empty((len(x), 2))
        reach = min(self.reach, view.goal_distance + self.gains.radius)
        count = find_nearest_points(x, y, reach, OTHER_CLUSTER, found)
        return [(place[0], place[1]) for place in found[:count].tolist() if place != [0.0, 0.0]]

    def _mean_velocity(self, view: View, memory: FieldMemory) -> Point:
        """Own velocity over the time that is looked back on, in the robot's frame now [m/s]."""
        if not memory.glances:
            return view.own_velocity
        each = [turned_back(one.own, view.heading - one.heading) for one in memory.glances][1:]
        each.append(view.own_velocity)
        return sum(x for x, _ in each) / len(each), sum(y for _, y in each) / len(each)

    def _goal_velocity(self, view: View, before: Glance, time: float) -> Point:
        """Velocity of the target relative to the robot [m/s]."""
        x, y = turned_back(before.goal, view.heading - before.heading)
        return (view.goal[0] - x) / time, (view.goal[1] - y) / time

    def _obstacle(self, view: View, place: Point, before: Glance | None, time: float, own: Point) -> Obstacle:
        """What is known of an obstacle by two looks at it; a still one has the robot's own velocity, turned round."""
        still = Obstacle(place, view.own_velocity, is_moving=False)
        if before is None or time < 0.5 * LOOK_BACK:
            return still
        turn = view.heading - before.heading
        expected = place[0] + own[0] * time, place[1] + own[1] * time
        seen = [turned_back(point, turn) for point in before.points]
        former = min(seen, key=lambda point: math.dist(point, expected), default=None)
        if former is None or math.dist(former, expected) > SAME_POINT:
            return still
        closing = (math.hypot(*former) - math.hypot(*place)) / time
        if abs(closing - (math.hypot(*expected) - math.hypot(*place)) / time) <= self.moves:
            return still
        return Obstacle(place, ((former[0] - place[0]) / time, (former[1] - place[1]) / time), is_moving=True)

    def velocity(self, view: View, forces: Forces) -> Velocity:
        """Where the forces lead, cut so that no step ends in something [m/s].

        Their sum gives the direction only. The speed falls with the distance to the target, not below the target's own.
        A robot that can turn round between two steps would go to and fro where the sum changes sign, so half its
        velocity is kept.
        """
        bearing = math.atan2(forces.total[1], forces.total[0])
        top = self.sensors.drive.max_speed
        speed = min(top, top * view.goal_distance / self.slowing + forces.target_speed)
        if self.sensors.drive.kinematics == "holonomic":
            (x, y), own = velocity_along(bearing, speed), view.velocity
            x, y = KEPT * own[0] + (1.0 - KEPT) * x, KEPT * own[1] + (1.0 - KEPT) * y
            bearing, speed = math.atan2(y, x), math.hypot(x, y)
        elif math.pi - abs(bearing) < STRAIGHT_BACK:
            bearing = math.pi - STRAIGHT_BACK
        return self.safe_step(view, bearing, speed)

    def safe_step(self, view: View, bearing: float, speed: float) -> Velocity:
        """A velocity along a bearing [rad], at most at a speed [m/s] and as far as the way of one step is free."""
        free = view.free_distance(bearing, self.safe_radius)
        return velocity_along(bearing, max(min(speed, free / self.sensors.drive.step), CREEP))

    def segments(self, memory: FieldMemory) -> list[tuple[float, float, float, float, str]]:
        """The forces as lines from the robot, odometry frame [m]; of unit length at most."""
        if memory.forces is None:
            return []
        attraction, total = memory.forces.attraction, memory.forces.total
        push = total[0] - attraction[0], total[1] - attraction[1]
        arrows = {"attraction": attraction, "repulsion": push, "force": total}
        return [self._arrow(memory, force, label) for label, force in arrows.items()]

    def _arrow(self, memory: FieldMemory, force: Point, label: str) -> tuple[float, float, float, float, str]:
        """One force as a line."""
        scale = 1.0 / max(math.hypot(*force), 1.0)
        x, y = turned_back((scale * force[0], scale * force[1]), -memory.heading)
        return (*memory.place, memory.place[0] + x, memory.place[1] + y, label)
