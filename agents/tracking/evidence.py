"""What tells a mover from a still thing: it takes space that was seen free, and leaves space that is seen free now.

The view of a still thing may change so that its disc shifts, but it does neither. So some past scans are kept.
"""

from __future__ import annotations

import math

from bug_gym.agents.tracking.clusters import JUMP
from bug_gym.agents.tracking.filter import GATE, mahalanobis
from bug_gym.agents.tracking.layout import (
    ANGLE_STEP,
    EVIDENCE,
    FIRST_ANGLE,
    HEADING,
    ID,
    IS_CONFIRMED,
    IS_FULL_CIRCLE,
    IS_MOVING,
    NOISE,
    NOW,
    PAST_POSE,
    POSE_X,
    POSE_Y,
    RANGE,
    SCANS,
    SCANS_KEPT,
    TRACKS,
    VX,
    VXX,
    VXY,
    VY,
    VYY,
    Memory,
    Scan,
)
from bug_gym.compiling import called, inlined
from bug_gym.kernels.geometry import wrap
from bug_gym.kernels.layout import Floats, Integers

LEAST_SPEED = 0.1  # of a mover [m/s]
EVIDENT_SHARE = 0.2  # of a thing's hits that show motion when it moves
LAGS = (0.3, 0.6, 1.2)  # ages of the scans that say what was free [s]
SCAN_SPACING = 0.09  # least time between scans kept [s]


@inlined
def beam_toward(x: float, y: float, pose: Floats, settings: Floats) -> float:
    """Number among the beams of a scan, with a fraction, of the way to a place of the odometry frame."""
    bearing = wrap(math.atan2(y - pose[POSE_Y], x - pose[POSE_X]) - pose[HEADING]) - settings[FIRST_ANGLE]
    if settings[IS_FULL_CIRCLE] > 0.0 and bearing < 0.0:
        bearing += 2.0 * math.pi
    return float(bearing / settings[ANGLE_STEP])


@inlined
def is_free(x: float, y: float, ranges: Floats, pose: Floats, settings: Floats) -> bool:
    """Whether a scan saw past a place of the odometry frame, with both beams beside it and by a margin.

    The margin grows with the distance between the beams: a corner may have stood out between them.
    """
    beams = len(ranges)
    distance = math.hypot(x - pose[POSE_X], y - pose[POSE_Y])
    far = distance + JUMP + 3.0 * settings[NOISE] + 0.5 * distance * settings[ANGLE_STEP]
    if far >= settings[RANGE]:
        return False
    low = int(math.floor(beam_toward(x, y, pose, settings)))
    high = low + 1
    if settings[IS_FULL_CIRCLE] > 0.0:
        low, high = low % beams, high % beams
    elif low < 0 or high >= beams:
        return False
    return bool(ranges[low] > far and ranges[high] > far)


@inlined
def scan_of_age(poses: Floats, now: float, age: float) -> int:
    """Which of the scans kept is the youngest at least `age` old, -1 where none is."""
    best, best_age = -1, math.inf
    for k in range(SCANS):
        old = now - poses[k, NOW]
        if age - 1e-6 <= old < best_age:
            best, best_age = k, old
    return best


@called
def weigh_evidence(memory: Memory, scan: Scan, counts: Integers, hits: Integers) -> None:
    """Count for each track its hits in space that was free, and its old hits in space that is free now.

    A still thing has neither, but for some at its corners. EVIDENCE rises by one in an update that shows motion and
    falls where none does.

    Args:
        memory: of the tracks and past scans.
        scan: of now.
        counts, hits: scratch, of TRACKS or more.
    """
    counts[:] = 0
    hits[:] = 0
    for i in range(len(scan.owner)):
        if scan.owner[i] >= 0:
            hits[scan.owner[i]] += 1
    for lag in range(len(LAGS)):
        k = scan_of_age(memory.scan_poses, scan.pose[NOW], LAGS[lag])
        if k < 0:
            break
        count_signs(memory, scan, k, counts)
    for m in range(TRACKS):
        if memory.numbers[m, ID] > 0:
            change = 1.0 if counts[m] >= max(1.0, EVIDENT_SHARE * hits[m]) else -0.5
            memory.state[m, EVIDENCE] = min(max(memory.state[m, EVIDENCE] + change, 0.0), 5.0)


@inlined
def count_signs(memory: Memory, scan: Scan, k: int, counts: Integers) -> None:
    """Add what past scan k says of motion to the tracks' counts."""
    for i in range(len(scan.owner)):
        m = scan.owner[i]
        if m >= 0 and is_free(scan.place_x[i], scan.place_y[i], memory.scans[k], memory.scan_poses[k], scan.settings):
            counts[m] += 1
        mark = memory.scan_owners[k, i]
        if mark <= 0:
            continue
        m = mark % TRACKS
        if memory.numbers[m, ID] != mark // TRACKS:
            continue
        if is_free(memory.scan_points[k, 0, i], memory.scan_points[k, 1, i], scan.ranges, scan.pose, scan.settings):
            counts[m] += 1


@inlined
def is_mover(s: Floats, n: Integers) -> bool:
    """Whether a track moves: its speed is significant and the space it takes and leaves says so too."""
    speed = math.hypot(s[VX], s[VY])
    if n[IS_MOVING] > 0:
        return s[EVIDENCE] > 0.0 and speed > 0.5 * LEAST_SPEED
    significance = mahalanobis(s[VX], s[VY], s[VXX], s[VXY], s[VYY])
    # the more there is of the one, the less is needed of the other
    needed = GATE - s[EVIDENCE] + 1.0
    return n[IS_CONFIRMED] > 0 and speed > LEAST_SPEED and significance > needed and s[EVIDENCE] >= 1.0


@inlined
def keep_scan(memory: Memory, scan: Scan) -> None:
    """Keep the scan unless the last one kept is as good as of the same time."""
    counters, owner = memory.counters, scan.owner
    if (
        counters[SCANS_KEPT] > 0
        and scan.pose[NOW] - memory.scan_poses[(counters[SCANS_KEPT] - 1) % SCANS, NOW] < SCAN_SPACING
    ):
        return
    k = counters[SCANS_KEPT] % SCANS
    counters[SCANS_KEPT] += 1
    for i in range(len(owner)):
        memory.scans[k, i], memory.scan_points[k, 0, i], memory.scan_points[k, 1, i] = (
            scan.ranges[i],
            scan.place_x[i],
            scan.place_y[i],
        )
        memory.scan_owners[k, i] = memory.numbers[owner[i], ID] * TRACKS + owner[i] if owner[i] >= 0 else 0
    for column in range(PAST_POSE):
        memory.scan_poses[k, column] = scan.pose[column]
