"""What tells a mover from a still thing: beams went through where it is, or go now through where it was.

Some past scans are kept, and each two are compared both ways: what one saw of a thing is a run of hits, and a beam of the
other that went between them and on, beyond noise, slant and what the other point of view may change, says that the thing
came or left. The end of a wall that slides along as the robot moves says nothing: no beam goes through what was seen. And
hits that lie where something was while the track, by its speed, was elsewhere, say that it stands. What is hollow (a pallet,
a rack) lets beams through though it stands: a beam counts only where the disc, moved back to the time of the beam, lets it
pass or stops it, and the hits have to lie nearer to one another moved than left in place.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.agents.tracking.filter import GATE, mahalanobis
from bug_gym.agents.tracking.layout import (
    ANGLE_STEP,
    AS_MOVED,
    AS_STILL,
    BEAMS,
    BORN,
    EVIDENCE,
    FIRST_ANGLE,
    HEADING,
    HITS,
    ID,
    IS_CONFIRMED,
    IS_FULL_CIRCLE,
    IS_MOVING,
    NOISE,
    NOW,
    PAST_POSE,
    POSE_X,
    POSE_Y,
    RADIUS,
    RANGE,
    SCANS,
    SCANS_KEPT,
    STOOD,
    TRACKS,
    VX,
    VXX,
    VXY,
    VY,
    VYY,
    WHOLE,
    Memory,
    Scan,
    X,
    Y,
)
from bug_gym.compiling import called, inlined
from bug_gym.kernels.geometry import wrap
from bug_gym.kernels.layout import Floats, Integers

LEAST_SPEED = 0.1  # of a mover [m/s]
SURE = 0.02  # how sure a place is across the line of sight it was seen along [m]
CLOSE = 0.04  # a beam that went on for less behind a thing may have met it [m]
NOISES = 4.0  # and this many standard deviations of a range
SURELY = 2.0  # and where it is one beam alone this many more
SAG = 1.0  # how far one surface may bend back between two hits, over the distance from the nearer
ASLANT = 2.0  # a surface seen more aslant than this, in range over distance across, may be two
LONGEST = 0.6  # hits farther from one another may be of two things [m]
# evidence: what one update may add, what a mover needs, the most there is, and what does where the speed is sure
MOST_AT_ONCE, NEEDED, MOST, SOME = 2.0, 1.0, 4.0, 0.5
# A thing met by fewer beams than FEW may be the edge of something with holes: it needs more evidence, and the way that it
# is said to have gone must bring its hits this many times nearer to where it was seen than if it had stood.
FEW, NEEDED_OF_FEW, NEARER, NEARER_OF_FEW = 3, 2.0, 1.2, 0.8
SURE_SPEED = 16.0  # significance of a speed that is sure, of a thing both of whose ends were seen
WHOLE_FOR = 3  # so many times without a break
# Hits say that a thing moved which was whole for so long, by so many beams, where they lie so far from where it was seen [m],
# and this many standard deviations of a range, and, if it moved, this share of that; and what an update adds then.
LONG_WHOLE, ENOUGH, OFF, OFF_NOISES, OFF_MOVED, OF_FIT = 5, 4, 0.02, 1.5, 0.75, 0.5
PLACE = 0.05  # a hit as near as this, and twice the noise, to an old one lies where something was [m]
ELSEWHERE = 2.5  # a track was elsewhere if it went so many times this far
STOOD_SHARE = 0.6  # of a thing's hits that lie where something was when it stands
TOO_FAR_ASIDE = 0.5  # a view from farther aside than this share of the distance is another view
NEAR_HIT = 0.1  # between two hits on one surface there may be a gap, farther from both than this [m]
ON_OUTLINE = 0.05  # a hit as near as this, and twice the noise, to where a disc's outline would be lies on it [m]
FAR = 0.5  # two places farther apart have nothing to do with one another [m]
COMPARED = 0.7  # greatest age of a scan in which a thing is looked for where it was by its speed [s]
LAGS = (0.2, 0.5, 1.2)  # ages of the scans that say what was free [s]
COMPARISONS = sum(lag < COMPARED for lag in LAGS)  # in so many of these a thing is looked for
SCAN_SPACING = 0.09  # least time between scans kept [s]


class Surface(NamedTuple):
    """A scan, as what it saw and as the beams that saw it."""

    ranges: Floats
    """(B,) [m]."""
    x: Floats
    """Places of the hits, x (B,) and y (B,), odometry frame [m]."""
    y: Floats
    owner: Integers
    """Place of the track that a hit belongs to (B,), -1 none."""
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
def weigh_evidence(memory: Memory, scan: Scan, owners: Integers, counts: Integers, toward: Floats) -> None:
    """Count for each track the beams that passed where it is now, and those that pass now where it was.

    A still thing has neither, and its hits lie where there were hits before. EVIDENCE rises in an update that shows
    motion and falls where none does.

    Args:
        memory: of the tracks and past scans.
        scan: of now.
        owners, counts, toward: scratch, of as many as beams, of TRACKS or more, and of as many as beams.
    """
    counts[:] = 0
    now = Surface(scan.ranges, scan.place_x, scan.place_y, scan.owner, scan.pose)
    for m in range(TRACKS):
        memory.numbers[m, STOOD] = memory.numbers[m, BEAMS] = 0
        memory.state[m, AS_STILL] = memory.state[m, AS_MOVED] = 0.0
    for i in range(len(scan.owner)):
        if scan.owner[i] >= 0:
            memory.numbers[scan.owner[i], BEAMS] += 1
    for lag in range(len(LAGS)):
        k = scan_of_age(memory.scan_poses, scan.pose[NOW], LAGS[lag])
        if k < 0:
            break
        points = memory.scan_points[k]
        for i in range(len(scan.owner)):
            mark = memory.scan_owners[k, i]
            m = mark % TRACKS
            owners[i] = m if mark > 0 and memory.numbers[m, ID] == mark // TRACKS else -1
        past = Surface(memory.scans[k], points[0], points[1], owners, memory.scan_poses[k])
        count_passes(memory, now, past, scan.settings, counts, toward)
        count_passes(memory, past, now, scan.settings, counts, toward)
        tell_still(memory, now, past, scan.settings)
    for m in range(TRACKS):
        n = memory.numbers[m]
        if n[ID] > 0:
            change = min(0.5 * counts[m], MOST_AT_ONCE) if counts[m] > 1 else -0.5
            if change < 0.0 and is_nearer_moved(memory.state[m], n, scan.settings[NOISE]):
                change = OF_FIT
            if n[STOOD] > 0:
                change = -1.0
            elif change < 0.0 and (n[HITS] & 1) == 0:
                change = 0.0  # nothing is seen of it
            memory.state[m, EVIDENCE] = min(max(memory.state[m, EVIDENCE] + change, 0.0), MOST)


@called
def tell_still(memory: Memory, now: Surface, past: Surface, settings: Floats) -> None:
    """Mark tracks whose hits lie where the past scan had hits, though by their speed they were elsewhere then.

    And add up how far the hits lie from those of the past scan, if the thing stood and if it moved as it is said to.
    """
    beams, begin = len(now.ranges), 0
    while begin < beams:
        m, end = now.owner[begin], begin + 1
        while end < beams and now.owner[end] == m:
            end += 1
        if m >= 0:
            tell_still_run(memory, m, now, past, begin, end, settings)
        begin = end


@inlined
def tell_still_run(memory: Memory, m: int, now: Surface, past: Surface, begin: int, end: int, settings: Floats) -> None:
    """The same for a run of a track's hits, as far as it may change what the track is taken for."""
    s, n, room = memory.state[m], memory.numbers[m], PLACE + 2.0 * settings[NOISE]
    if n[STOOD] > 0:
        return
    age = now.pose[NOW] - past.pose[NOW]
    was_elsewhere = math.hypot(s[VX], s[VY]) * age > ELSEWHERE * room
    is_asked = n[IS_MOVING] > 0 or may_begin_to_move(s, n)
    is_compared = age < COMPARED and now.pose[NOW] - s[BORN] >= age - 1e-6 and is_asked
    needed, explained = STOOD_SHARE * (end - begin), 0
    for i in range(begin, end):
        if not is_compared and (not was_elsewhere or explained >= needed or explained + end - i < needed):
            break
        stood = gap_of(memory, now.x[i], now.y[i], past, settings)
        explained += stood < room
        if is_compared:
            s[AS_STILL] += stood
            s[AS_MOVED] += gap_of(memory, now.x[i] - age * s[VX], now.y[i] - age * s[VY], past, settings)
    if was_elsewhere and explained >= needed:
        n[STOOD] = 1


@inlined
def is_nearer_moved(s: Floats, n: Integers, noise: float) -> bool:
    """Whether what is seen of a thing lies off where it was seen, and nearer to that if it moved as it is said to.

    Little noise hides how a mover that comes straight on takes space: its beams pass through nothing.
    """
    if (n[HITS] & 31) != 31 or n[BEAMS] < ENOUGH or n[WHOLE] < LONG_WHOLE:
        return False
    is_off = s[AS_STILL] > COMPARISONS * n[BEAMS] * (OFF + OFF_NOISES * noise)
    return bool(is_off and s[AS_MOVED] < OFF_MOVED * s[AS_STILL])


@inlined
def may_begin_to_move(s: Floats, n: Integers) -> bool:
    """Whether a track that is still so far may be a mover after this update, whatever its evidence comes to."""
    return (n[HITS] & 7) == 7 and is_fast(s, n, min(s[EVIDENCE] + MOST_AT_ONCE, MOST), True)


@inlined
def gap_of(memory: Memory, x: float, y: float, past: Surface, settings: Floats) -> float:
    """How far from a place a past scan met something still [m], at most FAR."""
    beams, best = len(past.ranges), FAR
    middle = int(round(beam_toward(x, y, past.pose, settings)))
    for ray in range(middle - 1, middle + 1):
        h, i = ray % beams, (ray + 1) % beams
        if past.ranges[h] >= settings[RANGE] or past.ranges[i] >= settings[RANGE]:
            h = i = h if past.ranges[h] < settings[RANGE] else i
        if past.ranges[i] >= settings[RANGE]:
            continue
        m = past.owner[i]
        if m >= 0 and memory.numbers[m, IS_MOVING] > 0:
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
    memory: Memory, surface: Surface, other: Surface, settings: Floats, counts: Integers, toward: Floats
) -> None:
    """Count for each track the beams of another scan that went through what one scan saw of it, as long as it matters."""
    beams = len(surface.ranges)
    begin = 0
    while begin < beams:
        end = begin + 1
        m = surface.owner[begin]
        if m < 0:
            begin = end
            continue
        while end < beams and surface.owner[end] == m and is_joined(surface, end, settings):
            end += 1
        more = most_passes(memory.state[m]) - counts[m]
        if more > 0:
            counts[m] += passes_of(memory.state[m], surface, begin, end, other, settings, more, toward)
        begin = end


@inlined
def most_passes(s: Floats) -> int:
    """From how many beams on more of them change nothing in what an update makes of a track's evidence."""
    return max(int(math.ceil(2.0 * min(MOST_AT_ONCE, MOST - s[EVIDENCE]))), 2)


@inlined
def is_joined(surface: Surface, i: int, settings: Floats) -> bool:
    """Whether beam i and the one before it met one surface, as far as it can be told, and one seen not too aslant."""
    one, other = surface.ranges[i], surface.ranges[i - 1]
    spacing = min(one, other) * settings[ANGLE_STEP]
    if abs(one - other) > ASLANT * spacing + 3.0 * settings[NOISE]:
        return False
    return math.hypot(surface.x[i] - surface.x[i - 1], surface.y[i] - surface.y[i - 1]) < LONGEST


@called
def passes_of(
    s: Floats, surface: Surface, begin: int, end: int, other: Surface, settings: Floats, most: int, toward: Floats
) -> int:
    """How many beams of `other` went through the run of hits begin:end of a surface; it counts as far as `most`."""
    x, y, pose, step, noise = surface.x, surface.y, other.pose, settings[ANGLE_STEP], settings[NOISE]
    full = 2.0 * math.pi / step
    toward[begin] = beam_toward(x[begin], y[begin], pose, settings)
    low, high = toward[begin], toward[begin]
    for i in range(begin + 1, end):
        toward[i] = unwrapped(beam_toward(x[i], y[i], pose, settings), toward[i - 1], full)
        low, high = min(low, toward[i]), max(high, toward[i])
    baseline = math.hypot(surface.pose[POSE_X] - pose[POSE_X], surface.pose[POSE_Y] - pose[POSE_Y])
    newest = max(surface.pose[NOW], other.pose[NOW])
    count = 0
    tb = math.hypot(x[begin] - pose[POSE_X], y[begin] - pose[POSE_Y])
    for i in range(begin, max(end - 1, begin + 1)):
        j = min(i + 1, end - 1)
        a, b, ta = toward[i], toward[j], tb
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
def is_mover(s: Floats, n: Integers) -> bool:
    """Whether a track moves: its speed is significant and the space it takes and leaves says so too."""
    if n[IS_MOVING] > 0:
        speed = math.hypot(s[VX], s[VY])
        return speed > 0.5 * LEAST_SPEED and (s[EVIDENCE] > 0.0 or (n[STOOD] == 0 and significance_of(s) > SURE_SPEED))
    nearer = NEARER_OF_FEW if n[BEAMS] < FEW else NEARER
    if n[STOOD] > 0 or (n[HITS] & 7) != 7 or s[AS_MOVED] > nearer * s[AS_STILL]:
        return False
    return is_fast(s, n, s[EVIDENCE], n[IS_CONFIRMED] > 0)


@inlined
def is_fast(s: Floats, n: Integers, evidence: float, is_confirmed: bool) -> bool:
    """Whether a track's speed is that of a mover for which there is so much evidence; the more, the rather."""
    significance = significance_of(s)
    if math.hypot(s[VX], s[VY]) <= LEAST_SPEED:
        return False
    if n[WHOLE] >= WHOLE_FOR and evidence >= SOME and significance > SURE_SPEED:
        return True
    # the more there is of the one, the less is needed of the other
    significant = significance > GATE - 2.0 * evidence + 1.0
    return is_confirmed and significant and evidence >= (NEEDED_OF_FEW if n[BEAMS] < FEW else NEEDED)


@inlined
def significance_of(s: Floats) -> float:
    """Squared Mahalanobis distance of a track's velocity from standing."""
    return mahalanobis(s[VX], s[VY], s[VXX], s[VXY], s[VYY])


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
