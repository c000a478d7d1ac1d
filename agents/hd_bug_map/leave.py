"""The map planner leaves what creeps up on it, whether or not it is known to move.

Who drives past a thing that goes at 0.1 m/s is late to know that it does, and who brakes before it stands until it is run
over. But a robot that can stop at once is kept from things by its brake: where something is nearer than that, it has come up,
and to stand there is worse than to go. As long as nothing is known to move that is said of a robot that stands alone, as one
that drives may have come near itself, round a corner between two beams. Not for long bodies, cars and robots with inertia,
whose ways are others' to say (poses.py, manoeuvring.py, inertia.py).

Source: this package.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.hd_bug_map.poses import TURNING
from bug_gym.geometry import F64
from bug_gym.policy import Velocity, hidden_gap
from bug_gym.view import Sensors, View

PRESSED = 0.015
"""Nearer than this to something a robot does not come by itself, where ranges don't scatter [m]."""

STOOD = 1e-3
"""A robot that has gone less since the last decision stood [m]."""

MOST_NOISE = 0.03
"""Standard deviation of ranges above which something always seems as near [m]."""

AWAY = math.cos(math.radians(110.0))
"""Cosine of the angle from the nearest thing beyond which a holonomic robot leaves it."""

SHARE = 0.5
"""A way is one for the robot where it is free for this share of what it drives in a step."""

BEARINGS: F64 = np.linspace(-math.pi, math.pi, 72, endpoint=False)
"""Ways that a holonomic robot may take [rad]."""

AHEAD_OR_BEHIND: F64 = np.array([0.0, math.pi])
"""Those of a differential one [rad]."""


def can_leave(sensors: Sensors) -> bool:
    """Whether this is for the robot: a round one that stops at once, and whose ranges scatter little."""
    drive = sensors.drive
    is_agile = len(sensors.footprint) == 1 and drive.kinematics != "ackermann" and not drive.has_inertia
    return is_agile and sensors.range_noise <= MOST_NOISE


def is_pressed(view: View, *, knows_movers: bool) -> bool:
    """Whether something is nearer to the body than it comes to anything by itself.

    Ranges scatter, so one of them says so where it is shorter than that by two standard deviations, two by one, and three
    as they are; all of them by one more where nothing is known to have moved so far.

    Args:
        view: what it sees.
        knows_movers: whether something has been seen to move.
    """
    sensors = view.sensors
    gaps = np.sort(view.ranges)[:3] - sensors.radius
    least = PRESSED + (sensors.range_noise if knows_movers else 0.0)
    return bool((gaps < least - sensors.range_noise * np.array([2.0, 1.0, 0.0])[: len(gaps)]).any())


def sidestep(view: View, wanted: Velocity, speed: float) -> Velocity | None:
    """The velocity (2,) with which a holonomic robot leaves what is nearest [m/s]; None: there is no way.

    Of the ways that lead off it, that nearest to a wanted one.

    Args:
        view: what it sees.
        wanted: velocity that it would go with, robot's frame [m/s].
        speed: with which [m/s].
    """
    bearing, ways = _ways(view, BEARINGS)
    leads_off = np.cos(BEARINGS - bearing) < AWAY
    is_free = ways >= speed * view.sensors.drive.step
    good = np.flatnonzero(leads_off & is_free)
    if len(good) == 0:
        return None
    chosen = BEARINGS[good[np.argmax(wanted[0] * np.cos(BEARINGS[good]) + wanted[1] * np.sin(BEARINGS[good]))]]
    return speed * math.cos(chosen), speed * math.sin(chosen)


def arc_out(view: View, speed: float) -> Velocity:
    """Speed [m/s] and turn rate [rad/s] with which a differential robot leaves what is nearest.

    Ahead where nothing is in the way, and else back, where all round is seen; it turns away from it, on the spot where there
    is neither way.

    Args:
        view: what it sees.
        speed: with which it goes ahead [m/s].
    """
    drive = view.sensors.drive
    bearing, ways = _ways(view, AHEAD_OR_BEHIND)
    rate = -math.copysign(drive.max_turn_rate, bearing)
    ahead, behind = (ways / drive.step).tolist()
    if ahead >= SHARE * speed:
        return min(speed, ahead), rate
    back = drive.max_reverse
    if back > 0.0 and behind >= SHARE * back and view.sensors.is_full_circle:
        return -min(back, behind), 0.0
    return 0.0, rate


def start_of(arc: tuple[float, float], step: float) -> Velocity:
    """The velocity in the robot's frame [m/s] toward where an arc of speed and turn rate leads in a step [s]: see `arc_out`.

    That of a turn on the spot is as good as none, and points to its side.
    """
    speed, rate = arc
    if speed == 0.0:
        return 0.0, math.copysign(TURNING, rate)
    half = 0.5 * rate * step
    return speed * math.cos(half), speed * math.sin(half)


def _ways(view: View, bearings: F64) -> tuple[float, F64]:
    """Bearing of what is nearest [rad], and how far the body may go along some bearings (m,) [m].

    The disc is one that touches nothing yet, and stops before what is ahead as far as the scan may hide things.
    """
    nearest = int(view.ranges.argmin())
    body = float(view.ranges[nearest]) - 1e-3
    bearing = math.remainder(float(view.sensors.angles[nearest]), 2.0 * math.pi)
    return bearing, view.free_distances(bearings, body) - hidden_gap(view.sensors)
