"""Which robots no scripted policy can drive past still things, whatever care it takes: those that are shown them too late.

A policy knows of the world what the scanner tells. Whatever it does, the robot needs a way to come to stand: its commands act
after a step and the latency, then it brakes. What is not seen before the body is so near cannot be kept clear of. Three things
can hide something: that it is out of range, that the scanner does not look there, that it lies between two beams. Each gives
a bound in closed form; beyond it there are worlds in which anybody who goes at top speed touches something.

What following walls needs beside that, bugs ask themselves (walls/boundary.py).

Not asked: who keeps to a way on the world's map, who takes no care of anything (the floors), learned policies, whose robot is
that of their training, and policies from outside, which know best what they need.
"""

from __future__ import annotations

import math

from bug_gym import kernels
from bug_gym.config import Scenario
from bug_gym.inertia import speed_within
from bug_gym.kinematics import Drive
from bug_gym.policy import MisfitError
from bug_gym.schema.ranges import least_of
from bug_gym.view import Sensors

LEAST_FIELD_OF_VIEW = math.pi
"""Of a robot that turns toward where it goes [rad]: what its body will meet straight ahead may lie anywhere before it."""

DIGITS = 100.0
"""What would do is told in hundredths, on the safe side."""

ROUNDING = 1e-9
"""Slack of the bounds."""


def require_sight(scenario: Scenario, told: str) -> None:
    """Refuse a robot that cannot be shown in time what stands in its way.

    Args:
        scenario: whose robot and scanner; of numbers that are drawn for each episode, the ends with which it is safe.
        told: what errors call the policy.

    Raises:
        MisfitError: the scanner does not look where the robot goes, ends before the way that it needs to come to stand, or
            has so few beams that a thing as wide as the body is not met on that way.
    """
    sensors = Sensors.of(scenario)
    reason = _unseen_sides(scenario, sensors) or _beyond_sight(scenario, sensors) or _between_beams(scenario, sensors)
    if reason:
        raise MisfitError(f"{told} cannot keep this robot clear of things: {reason}")


def way_to_stand(drive: Drive) -> float:
    """The way [m] of a robot at top speed from what it sees to its standing: a step, its latency, and braking.

    Braking takes v^2 / 2 a and less, as it begins within the step.
    """
    steps = 1 + drive.latency
    return drive.max_speed * drive.step * steps + float(
        kernels.stopping_way(drive.max_speed, drive.max_acceleration, drive.step)
    )


def _unseen_sides(scenario: Scenario, sensors: Sensors) -> str:
    """Why the scanner does not look where the robot goes; "" where it does."""
    lidar = scenario.lidar
    if lidar.is_full_circle:
        return ""
    if sensors.drive.kinematics == "holonomic":
        return (
            f"it is holonomic, so that it does not turn, and goes to where a scanner of {math.degrees(lidar.fov):.4g} degrees "
            "does not look: expected a lidar.fov of 2 pi, or a robot.kinematics that turns"
        )
    if lidar.fov < LEAST_FIELD_OF_VIEW - ROUNDING:
        return (
            f"its scanner looks over {math.degrees(lidar.fov):.4g} degrees, and beside that lie things that its body meets "
            "straight ahead: expected a lidar.fov of at least pi"
        )
    return ""


def _beyond_sight(scenario: Scenario, sensors: Sensors) -> str:
    """Why the robot cannot stand before what comes into range; "" where it can."""
    sight, way = least_of(scenario.lidar.range), way_to_stand(sensors.drive)
    needed = sensors.radius + way
    if sight >= needed - ROUNDING:
        return ""
    return (
        f"at {sensors.drive.max_speed:g} m/s it needs {way:.3g} m to come to stand, its body reaches {sensors.radius:.3g} m "
        f"and its scanner {sight:g} m: expected a lidar.range of at least {_above(needed)} m"
        + _or_slower(sensors.drive, sight - sensors.radius)
    )


def _between_beams(scenario: Scenario, sensors: Sensors) -> str:
    """Why a thing as wide as the body may be met by no beam until it is too near; "" where it is met.

    Between two beams, an angle A apart, a disc of radius R may lie as near as R / sin(A / 2) and be met by neither. The robot,
    of radius R too, must see it from 2 R and its way to stand.
    """
    lidar, wide, way = scenario.lidar, sensors.radius, way_to_stand(sensors.drive)
    half = min(0.5 * sensors.beam_spacing, 0.5 * math.pi)
    met = wide / math.sin(half)
    needed = 2.0 * wide + way
    if met >= needed - ROUNDING:
        return ""
    apart = 2.0 * math.asin(wide / needed)
    beams = math.ceil(lidar.fov / apart - ROUNDING) + (0 if lidar.is_full_circle else 1)
    return (
        f"a thing as wide as its body may be unmet by all of {lidar.beams} beams until it is {met:.3g} m away, and at "
        f"{sensors.drive.max_speed:g} m/s must be met {needed:.3g} m away: expected at least {beams} lidar.beams"
        + _or_slower(sensors.drive, met - 2.0 * wide)
    )


def _or_slower(drive: Drive, way: float) -> str:
    """What top speed would do instead, to come to stand within a way [m]; "" where none does."""
    steps = drive.step * (1 + drive.latency)
    speed = speed_within(drive, max(way, 0.0)) if drive.has_inertia else max(way, 0.0) / steps
    speed = math.floor(speed * DIGITS + ROUNDING) / DIGITS
    return f", or a robot.max_speed of at most {speed:g} m/s" if speed > 0.0 else ""


def _above(length: float) -> str:
    """A length [m], rounded up."""
    return f"{math.ceil(length * DIGITS - ROUNDING) / DIGITS:g}"
