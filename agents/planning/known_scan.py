"""A noisy scan put right by the map: what a beam shows of something that stands there is as far as the map says.

Who has the map and stops before what a noisy scan shows of it stands for good in places where the body passes: of some
hundred beams one always shows the wall too near. What moves is no part of the map and stays as it was seen.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.planning.gaps import to_obstacles
from bug_gym.agents.planning.map import Pose
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.geometry import F64
from bug_gym.view import Sensors

ERRORS = 4.0
"""Standard deviations of a range by which it may differ from what the map says."""

BEYOND = 1.0
"""How much farther than a robot brakes its scan is looked at [m]."""


def looked_at(sensors: Sensors) -> float:
    """How far away what a beam meets may matter to the next step [m]."""
    drive = sensors.drive
    braking = 0.5 * drive.max_speed**2 / drive.max_acceleration if math.isfinite(drive.max_acceleration) else 0.0
    return sensors.radius + (1 + drive.latency) * sensors.step_length + braking + BEYOND


def put_right(ranges: F64, sensors: Sensors, pose: Pose, solids: Solids, noise: float) -> F64:
    """Ranges (B,) [m] in which those of near things that stand are as the map says.

    Args:
        ranges: as they were seen [m].
        sensors: of the robot.
        pose: of the robot, true.
        solids: what stands, in the frame of the pose.
        noise: standard deviation of a range [m].
    """
    far, error = min(looked_at(sensors), sensors.range), ERRORS * noise
    beams = np.flatnonzero(ranges < far)
    _, away = to_obstacles(np.array([pose[:2]]), solids)
    is_near = away[0] < far + error
    edges, discs = solids.edges[is_near[: len(solids.edges)]], solids.discs[is_near[len(solids.edges) :]]
    angles = sensors.angles[beams] + pose[2]
    told = along_rays(np.column_stack([np.cos(angles), np.sin(angles)]), pose, edges, discs)
    result, is_known = ranges.copy(), np.abs(told - ranges[beams]) <= error
    result[beams[is_known]] = told[is_known]
    return result


def along_rays(ways: F64, pose: Pose, edges: F64, discs: F64) -> F64:
    """How far away rays (n, 2) from a pose first meet edges (e, 4) or discs (d, 3) (n,) [m]; inf where they meet none."""
    x, y, _ = pose
    to_x, to_y = discs[:, 0] - x, discs[:, 1] - y
    along = ways[:, :1] * to_x + ways[:, 1:] * to_y
    square = along**2 - (to_x**2 + to_y**2 - discs[:, 2] ** 2)
    to_discs = np.where((square >= 0.0) & (along > 0.0), along - np.sqrt(np.maximum(square, 0.0)), np.inf)
    from_x, from_y = edges[:, 0] - x, edges[:, 1] - y
    run_x, run_y = edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1]
    across = ways[:, :1] * run_y - ways[:, 1:] * run_x
    safe = np.where(across == 0.0, 1.0, across)
    reach = (from_x * run_y - from_y * run_x) / safe
    share = (from_x * ways[:, 1:] - from_y * ways[:, :1]) / safe
    is_met = (across != 0.0) & (reach >= 0.0) & (share >= 0.0) & (share <= 1.0)
    to_edges = np.where(is_met, reach, np.inf)
    met = np.concatenate([to_discs, to_edges], axis=1)
    nearest: F64 = met.min(axis=1, initial=np.inf)
    return nearest
