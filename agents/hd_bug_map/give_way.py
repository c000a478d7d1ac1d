"""A long body among movers while it turns: it goes on with its poses only where nothing that moves will be met on the way.

Its circles are swept along the poses that it would take, turns included, against the discs that are predicted. Where they
would meet one it waits, or goes straight back or on where standing would be hit, too: of these what is touched last.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.agents.hd_bug.roll_out import Movers
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import Measures
from bug_gym.agents.hd_bug_map.perceive import Scene
from bug_gym.agents.hd_bug_map.poses import Pose, Turns, is_open, turn_to
from bug_gym.geometry import F64
from bug_gym.kinematics import TURN_GAIN, Drive
from bug_gym.policy import Velocity

KEPT = 0.1
"""What is kept between the body and a predicted disc [m]."""

SPREAD_OUT = 0.05
"""Time between two poses of a motion at which it is looked at, at most [s]: discs and body move a few centimetres in it."""


class Motion(NamedTuple):
    """What a long body may do next."""

    velocity: Velocity
    """In the robot's frame [m/s]."""
    poses: F64
    """Where it is at the times that are looked at (K, 3): x, y [m], heading [rad]."""
    is_backing: bool = False
    """Whether it drives straight back."""


def give_way(
    scene: Scene,
    memory: HDBugMapMemory,
    turns: Turns,
    velocity: Velocity,
    movers: Movers,
    times: F64,
    measures: Measures,
) -> Velocity:
    """The velocity of a long body that would follow its poses, among movers [m/s]; sets whether it backs out.

    Args:
        scene: what is there.
        memory: of the policy.
        turns: the poses it follows.
        velocity: with which it would follow them, robot's frame [m/s].
        movers: where they are predicted.
        times: when they are there (K,), evenly spaced, the first one spacing from now [s].
        measures: of the robot.
    """
    drive, pose = scene.view.sensors.drive, scene.view.pose
    going_on = Motion(velocity, followed(drive, pose, turns.poses[1:], measures.slow, times))
    if math.isinf(time_of_contact(measures.footprint, going_on.poses, movers, times)):
        return velocity
    memory.mode, memory.forecast = "giving_way", movers.places
    choices = [standing(pose, times), going_on, *straight_ways(drive, pose, turns, measures, times)]
    met = [time_of_contact(measures.footprint, motion.poses, movers, times) for motion in choices]
    chosen = choices[int(np.argmax(met))]
    memory.is_backing = chosen.is_backing
    return chosen.velocity


def standing(pose: Pose, times: F64) -> Motion:
    """To stay where it is."""
    return Motion((0.0, 0.0), np.tile(np.array(pose), (len(times), 1)))


def straight_ways(drive: Drive, pose: Pose, turns: Turns, measures: Measures, times: F64) -> list[Motion]:
    """Straight back and straight on, each as far as it is free of what stands still; none that is not free for a step."""
    x, y, heading = pose
    found = []
    for speed in (-drive.max_reverse, measures.slow):
        far = abs(speed) * float(times[-1])
        way = far
        while way >= abs(speed) * drive.step and not _is_free(turns, measures, pose, math.copysign(way, speed)):
            way *= 0.5
        if way < abs(speed) * drive.step or speed == 0.0:
            continue
        gone = math.copysign(1.0, speed) * np.minimum(abs(speed) * times, way)
        poses = np.column_stack(
            [x + gone * math.cos(heading), y + gone * math.sin(heading), np.full(len(times), heading)]
        )
        found.append(Motion((speed, 0.0), poses, is_backing=speed < 0.0))
    return found


def _is_free(turns: Turns, measures: Measures, pose: Pose, way: float) -> bool:
    """Whether the body may go straight on, or back where the way [m] is negative."""
    x, y, heading = pose
    ends = np.array([[x, y, heading], [x + way * math.cos(heading), y + way * math.sin(heading), heading]])
    return is_open(turns.grid, measures.footprint, ends)


def followed(drive: Drive, pose: Pose, poses: F64, speed: float, times: F64) -> F64:
    """Where a body that follows poses (k, 3) from a pose at a speed [m/s] is at some times: (K, 3).

    It turns on the spot where the next heading is another one, as fast as it is steered, and goes straight there.
    """
    marks, when = [np.array(pose)], [0.0]
    for x, y, heading in poses.tolist():
        before, turn = marks[-1], turn_to(float(marks[-1][2]), heading)
        marks += [np.array([before[0], before[1], before[2] + turn]), np.array([x, y, before[2] + turn])]
        when.append(when[-1] + turning_time(drive, abs(turn)))
        when.append(when[-1] + math.dist(before[:2], (x, y)) / speed)
    path = np.array(marks)
    return np.column_stack([np.interp(times, when, path[:, axis]) for axis in range(3)])


def turning_time(drive: Drive, turn: float) -> float:
    """How long a turn on the spot [rad] takes [s]: at the greatest rate, and slower by the gain of steering toward its end."""
    if turn == 0.0 or drive.max_turn_rate <= 0.0:
        return 0.0
    return turn / drive.max_turn_rate + 1.0 / TURN_GAIN


def time_of_contact(footprint: F64, poses: F64, movers: Movers, times: F64) -> float:
    """When a body that is at poses (K, 3) at some times first comes nearer than KEPT to a mover [s]; infinite: never."""
    x, y, heading = finer(poses, times).T
    cos, sin = np.cos(heading), np.sin(heading)
    when = finer(times[:, None], times)[:, 0]
    first = math.inf
    for ahead, left, radius in footprint.tolist():
        places = np.column_stack([x + cos * ahead - sin * left, y + sin * ahead + cos * left])
        for track, radii in zip(movers.places, movers.radii, strict=True):
            gaps = np.hypot(*(finer(track, times) - places).T) - finer(radii[:, None], times)[:, 0] - radius
            met = np.flatnonzero(gaps < KEPT)
            first = min(first, float(when[met[0]])) if len(met) else first
    return first


def finer(values: F64, times: F64) -> F64:
    """Values (K, n) at times at most SPREAD_OUT apart, straight between them."""
    count = max(math.ceil(float(times[0]) / SPREAD_OUT), 1) * (len(times) - 1) + 1
    at = np.linspace(times[0], times[-1], count)
    return np.column_stack([np.interp(at, times, values[:, axis]) for axis in range(values.shape[1])])
