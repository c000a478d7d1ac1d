"""What past scans say of a track's motion: beams went through where it is, or go now through where it was.

Some past scans are kept, and each is compared with that of now both ways: what one saw of a thing is a run of hits, and a
beam of the other that went between them and on, beyond noise, slant and what the other point of view may change, says that
the thing came or left. The end of a wall that slides along as the robot moves says nothing: no beam goes through what was
seen. What is hollow (a pallet, a rack) lets beams through though it stands: a beam counts only where the disc, moved back
to the time of the beam, lets it pass or stops it. Beside that, hits lie so far from those of past scans if the thing
stood, and so far if it moved as it is said to. What all this is worth, `motion` weighs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.agents.tracking.layout import (
    ANGLE_STEP,
    BEAMS,
    COMPARED_SCANS,
    EXPLAINED,
    FIRST_ANGLE,
    HEADING,
    ID,
    IS_FULL_CIRCLE,
    IS_MOVING,
    MOVED_OFF,
    NOISE,
    NOW,
    PASSED_NOW,
    PASSED_THEN,
    PAST_POSE,
    POSE_X,
    POSE_Y,
    RADIUS,
    RANGE,
    SCANS,
    SCANS_KEPT,
    STOOD_OFF,
    TRACKS,
    VX,
    VY,
    Memory,
    Scan,
    X,
    Y,
)
from bug_gym.agents.tracking.motion import Weighing, may_move, sum_up
from bug_gym.compiling import called, inlined
from bug_gym.kernels.geometry import wrap
from bug_gym.kernels.layout import Floats, Integers

SURE = 0.02  # how sure a place is across the line of sight it was seen along [m]
CLOSE = 0.04  # a beam that went on for less behind a thing may have met it [m]
NOISES = 4.0  # and this many standard deviations of a range
SURELY = 2.0  # and where it is one beam alone this many more
SAG = 1.0  # how far one surface may bend back between two hits, over the distance from the nearer
ASLANT = 2.0  # a surface seen more aslant than this, in range over distance across, may be two
LONGEST = 0.6  # hits farther from one another may be of two things [m]
MOST_PASSES = 8  # more beams that passed tell no more
PLACE = 0.05  # a hit as near as this, and twice the noise, to an old one lies where something was [m]
TOO_FAR_ASIDE = 0.5  # a view from farther aside than this share of the distance is another view
NEAR_HIT = 0.1  # between two hits on one surface there may be a gap, farther from both than this [m]
ON_OUTLINE = 0.05  # a hit as near as this, and twice the noise, to where a disc's outline would be lies on it [m]
FAR = 0.5  # two places farther apart have nothing to do with one another [m]
LAGS = (0.2, 0.5, 1.2)  # ages of the scans that say what was free, COMPARED_SCANS of them [s]
SCAN_SPACING = 0.09  # least time between scans kept [s]


class Surface(NamedTuple):
    """A scan, as what it saw and as the beams that saw it."""

    ranges: Floats
    """(B,) [m]."""
    x: Floats
    """Places of the hits, x (B,) and y (B,), odometry frame [m]."""
    y: Floats
    owner: Integers
    """Place of the track that a hit belongs to, -1 none; (B,) or longer."""
    pose: Floats
    """Where and when it was taken (PAST_POSE,)."""


@inlined
def beam_toward(x: float, y: float, pose: Floats, settings: Floats) -> float:
    """Number among the beams of a scan, with a fraction, of the way to a place of the odometry frame."""
    bearing = wrap(math.atan2(y - pose[POSE_Y], x - pose[POSE_X]) - pose[HEADING]) - settings[FIRST_ANGLE]
    if settings[IS_FULL_CIRCLE] > 0.0 and bearing < 0.0:
        bearing += 2.0 * math.pi
    return float(bearing / settings[ANGLE_STEP])


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
def weigh_evidence(
    memory: Memory, scan: Scan, owners: Integers, toward: Floats, in_run: Floats, weighing: Weighing
) -> None:
    """Compare the scan with past ones, and add to each track's evidence what that says.

    Args:
        memory: of the tracks and past scans.
        scan: of now.
        owners, toward, in_run: scratch, of as many as beams.
        weighing: where to write what is told of each track, and what weighs it.
    """
    clues = weighing.clues
    clues[:] = 0.0
    now = Surface(scan.ranges, scan.place_x, scan.place_y, scan.owner, scan.pose)
    for m in range(TRACKS):
        memory.numbers[m, BEAMS] = 0
    for i in range(len(scan.owner)):
        if scan.owner[i] >= 0:
            memory.numbers[scan.owner[i], BEAMS] += 1
    for lag in range(COMPARED_SCANS):
        k = scan_of_age(memory.scan_poses, scan.pose[NOW], LAGS[lag])
        if k < 0:
            break
        points = memory.scan_points[k]
        for i in range(len(scan.owner)):
            mark = memory.scan_owners[k, i]
            m = mark % TRACKS
            owners[i] = m if mark > 0 and memory.numbers[m, ID] == mark // TRACKS else -1
        past = Surface(memory.scans[k], points[0], points[1], owners, memory.scan_poses[k])
        tell_beams(memory, past, now, scan.settings, toward)
        count_passes(memory, past, now, scan.settings, clues, PASSED_THEN + lag, toward, in_run)
        tell_beams(memory, now, past, scan.settings, toward)
        count_passes(memory, now, past, scan.settings, clues, PASSED_NOW + lag, toward, in_run)
        lay_side_by_side(memory, now, past, scan.settings, clues, lag, toward)
    for m in range(TRACKS):
        if memory.numbers[m, ID] > 0:
            sum_up(memory.state[m], memory.numbers[m], clues[m], scan, weighing)


@inlined
def tell_beams(memory: Memory, surface: Surface, other: Surface, settings: Floats, toward: Floats) -> None:
    """Write at which beams of another scan the hits lie of what may move (B,)."""
    for i in range(len(surface.ranges)):
        m = surface.owner[i]
        if m >= 0 and may_move(memory.state[m], memory.numbers[m]):
            toward[i] = beam_toward(surface.x[i], surface.y[i], other.pose, settings)


@called
def lay_side_by_side(
    memory: Memory, now: Surface, past: Surface, settings: Floats, clues: Floats, lag: int, toward: Floats
) -> None:
    """Add up for each track how far its hits lie from those of a past scan, if it stood and if it moved.

    And how many lie where something was. `toward`: at which beams of the past scan the hits lie (B,).
    """
    room, age = PLACE + 2.0 * settings[NOISE], now.pose[NOW] - past.pose[NOW]
    for i in range(len(now.ranges)):
        m = now.owner[i]
        if m < 0 or not may_move(memory.state[m], memory.numbers[m]):
            continue
        s = memory.state[m]
        stood = gap_of(memory, m, now.x[i], now.y[i], toward[i], past, settings)
        x, y = now.x[i] - age * s[VX], now.y[i] - age * s[VY]
        clues[m, STOOD_OFF + lag] += stood
        clues[m, MOVED_OFF + lag] += gap_of(memory, m, x, y, beam_toward(x, y, past.pose, settings), past, settings)
        clues[m, EXPLAINED + lag] += 1.0 if stood < room else 0.0


@inlined
def gap_of(memory: Memory, track: int, x: float, y: float, beam: float, past: Surface, settings: Floats) -> float:
    """How far from a place at one of its beams a past scan met a track, or something that stands [m], at most FAR."""
    beams, best = len(past.ranges), FAR
    middle = int(round(beam))
    for ray in range(middle - 1, middle + 1):
        h, i = ray % beams, (ray + 1) % beams
        if past.ranges[h] >= settings[RANGE] or past.ranges[i] >= settings[RANGE]:
            h = i = h if past.ranges[h] < settings[RANGE] else i
        if past.ranges[i] >= settings[RANGE]:
            continue
        m = past.owner[i]
        if m >= 0 and m != track and memory.numbers[m, IS_MOVING] > 0:
            continue
        sx, sy = past.x[i] - past.x[h], past.y[i] - past.y[h]
        square = sx * sx + sy * sy
        dx, dy = x - past.x[h], y - past.y[h]
        along = min(max((dx * sx + dy * sy) / square, 0.0), 1.0) if square > 0.0 else 0.0
        if square > LONGEST * LONGEST:
            along = round(along)
        best = min(best, math.hypot(dx - along * sx, dy - along * sy))
    return best


@called
def count_passes(
    memory: Memory,
    surface: Surface,
    other: Surface,
    settings: Floats,
    clues: Floats,
    column: int,
    toward: Floats,
    in_run: Floats,
) -> None:
    """Count for each track the beams of another scan that went through what one scan saw of it, as far as MOST_PASSES."""
    beams, first = len(surface.ranges), 0
    if settings[IS_FULL_CIRCLE] > 0.0:
        while first < beams and continues(surface, first, settings):
            first += 1
        first = first % beams
    begin = first
    while begin < first + beams:
        end, m = begin + 1, surface.owner[begin % beams]
        if m < 0:
            begin = end
            continue
        while end < first + beams and continues(surface, end % beams, settings):
            end += 1
        more = MOST_PASSES - int(clues[m, column])
        if more > 0 and may_move(memory.state[m], memory.numbers[m]):
            passes = passes_of(memory.state[m], surface, begin, end, other, settings, more, toward, in_run)
            clues[m, column] += min(passes, more)
        begin = end


@inlined
def continues(surface: Surface, i: int, settings: Floats) -> bool:
    """Whether beam i and the one before it met one surface of one track."""
    m, h = surface.owner[i], (i if i > 0 else len(surface.ranges)) - 1
    return bool(m >= 0 and surface.owner[h] == m and is_joined(surface, h, i, settings))


@inlined
def is_joined(surface: Surface, h: int, i: int, settings: Floats) -> bool:
    """Whether two beams, h and then i, met one surface, as far as it can be told, and one seen not too aslant."""
    one, other = surface.ranges[i], surface.ranges[h]
    spacing = min(one, other) * settings[ANGLE_STEP]
    if abs(one - other) > ASLANT * spacing + 3.0 * settings[NOISE]:
        return False
    return math.hypot(surface.x[i] - surface.x[h], surface.y[i] - surface.y[h]) < LONGEST


@called
def passes_of(
    s: Floats,
    surface: Surface,
    begin: int,
    end: int,
    other: Surface,
    settings: Floats,
    most: int,
    toward: Floats,
    in_run: Floats,
) -> int:
    """How many beams of `other` went through a run of hits of a surface; it counts as far as `most`.

    Args:
        begin, end: of the run; numbers of beams, which go on after the last one with the first.
        toward: at which beams of `other` the hits lie (B,).
        in_run: scratch for the same without a jump at the first beam (B,).
    """
    x, y, pose, step, noise = surface.x, surface.y, other.pose, settings[ANGLE_STEP], settings[NOISE]
    full = 2.0 * math.pi / step
    beams, hits = len(x), end - begin
    first = begin % beams
    in_run[0] = toward[first]
    low, high = in_run[0], in_run[0]
    for k in range(1, hits):
        i = (begin + k) % beams
        in_run[k] = unwrapped(toward[i], in_run[k - 1], full)
        low, high = min(low, in_run[k]), max(high, in_run[k])
    baseline = math.hypot(surface.pose[POSE_X] - pose[POSE_X], surface.pose[POSE_Y] - pose[POSE_Y])
    newest = max(surface.pose[NOW], other.pose[NOW])
    count = 0
    tb = math.hypot(x[first] - pose[POSE_X], y[first] - pose[POSE_Y])
    for k in range(max(hits - 1, 1)):
        after = min(k + 1, hits - 1)
        i, j = (begin + k) % beams, (begin + after) % beams
        a, b, ta = in_run[k], in_run[after], tb
        tb = math.hypot(x[j] - pose[POSE_X], y[j] - pose[POSE_Y])
        near = min(ta, tb)
        if baseline > TOO_FAR_ASIDE * near:
            continue
        # a place is as sure as its range across the line of sight
        unsure = baseline / near * (SURE + 3.0 * noise)
        side = unsure / (near * step) - 1e-3
        ray = int(math.ceil(max(min(a, b), low + side) - 1e-3))
        last = min(max(a, b), high - side) + 1e-3
        if ray > last:
            continue
        length = math.hypot(x[i] - x[j], y[i] - y[j])
        slope = abs(ta - tb) / max(abs(a - b) * step * near, 1e-3)
        margin = CLOSE + NOISES * noise + slope * unsure
        while ray <= last:
            f = min(max((ray - a) / (b - a), 0.0), 1.0) if abs(b - a) > 1e-6 else 0.0
            off = min(f, 1.0 - f) * length
            if off <= NEAR_HIT:
                away = 1.0 / ((1.0 - f) / ta + f / tb) + margin + SAG * off
                if goes_beyond(other.ranges, ray, away, settings) and fits_motion(s, ray, newest, other, settings):
                    count += 1
                    if goes_beyond(other.ranges, ray, away + SURELY * noise, settings):
                        count += 1
                    if count >= most:
                        return count
            ray += 1
    return count


@inlined
def fits_motion(s: Floats, ray: int, newest: float, other: Surface, settings: Floats) -> bool:
    """Whether a beam that went through what was seen of a track could do so, by where its motion had it then.

    It passes the disc by, or it ends at its outline: the thing was farther off then. One that ends inside it went into a
    hollow of something that is no disc, such as a pallet or a rack, and shows no motion. `newest` is now [s].
    """
    lag = newest - other.pose[NOW]
    bearing = other.pose[HEADING] + settings[FIRST_ANGLE] + ray * settings[ANGLE_STEP]
    dx, dy = s[X] - lag * s[VX] - other.pose[POSE_X], s[Y] - lag * s[VY] - other.pose[POSE_Y]
    along_x, along_y = math.cos(bearing), math.sin(bearing)
    across = abs(dy * along_x - dx * along_y)
    if across >= s[RADIUS] - ON_OUTLINE:
        return True
    enters = dx * along_x + dy * along_y - math.sqrt(max(s[RADIUS] * s[RADIUS] - across * across, 0.0))
    distance = other.ranges[ray % len(other.ranges)]
    return bool(abs(distance - enters) < ON_OUTLINE + 2.0 * settings[NOISE])


@inlined
def unwrapped(beam: float, first: float, full: float) -> float:
    """A bearing in beams, by whole turns nearest to `first`."""
    if beam - first > 0.5 * full:
        return beam - full
    if first - beam > 0.5 * full:
        return beam + full
    return beam


@inlined
def goes_beyond(ranges: Floats, ray: int, distance: float, settings: Floats) -> bool:
    """Whether a beam, and where it met nothing one beside it too, went farther than a distance."""
    beams = len(ranges)
    is_full = settings[IS_FULL_CIRCLE] > 0.0
    i = ray % beams if is_full else ray
    if i < 0 or i >= beams or distance >= settings[RANGE] or ranges[i] <= distance:
        return False
    if ranges[i] < settings[RANGE]:
        return True
    h, j = i - 1, i + 1
    if is_full:
        h, j = h % beams, j % beams
    return bool((h >= 0 and ranges[h] > distance) or (j < beams and ranges[j] > distance))


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
