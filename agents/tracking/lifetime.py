"""How a track begins, is confirmed, and ends."""

from __future__ import annotations

import math

from bug_gym.agents.tracking.evidence import beam_toward
from bug_gym.agents.tracking.layout import (
    BORN,
    CENTRES,
    CLUSTER,
    FR,
    FR_VARIANCE,
    FX,
    FY,
    HAS_MOVED,
    HITS,
    ID,
    IS_CONFIRMED,
    IS_FULL_CIRCLE,
    IS_MOVING,
    NOW,
    POSE_X,
    POSE_Y,
    PXX,
    PXY,
    PYY,
    RADIUS,
    RADIUS_VARIANCE,
    RANGE,
    SEEN,
    TRACKS,
    VXX,
    VYY,
    ZXX,
    ZXY,
    ZYY,
    Memory,
    Scan,
    X,
    Y,
)
from bug_gym.agents.tracking.motion import bits, is_mover
from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Floats, Integers

NEW_SPEED = 1.0  # of a thing not seen before, one standard deviation [m/s]
# how long a track stays where its place is seen empty, for a mover, and where it isn't seen [s]
SEEN_AWAY, MOVER_SEEN_AWAY, HIDDEN_AWAY = 1.0, 0.5, 3.0


@inlined
def begin_track(
    s: Floats, n: Integers, fit: Floats, history: Floats, px: float, py: float, now: float, number: int
) -> None:
    """Begin a track with a disc fitted to a new cluster."""
    s[:] = 0.0
    s[X], s[Y] = fit[FX] + px, fit[FY] + py
    s[PXX], s[PXY], s[PYY] = fit[ZXX], fit[ZXY], fit[ZYY]
    s[VXX] = s[VYY] = NEW_SPEED * NEW_SPEED
    s[RADIUS], s[RADIUS_VARIANCE] = fit[FR], fit[FR_VARIANCE]
    s[BORN] = s[SEEN] = now
    n[:] = 0
    n[ID], n[HITS], n[CENTRES] = number, 1, 1
    history[0, 0], history[0, 1], history[0, 2] = s[X], s[Y], now


@inlined
def worst_track(memory: Memory, px: float, py: float, distance: float) -> int:
    """A place for a new track at a distance [m]: free, or that of the farthest still thing out of sight, else -1."""
    state, numbers = memory.state, memory.numbers
    worst, far = -1, distance
    for m in range(TRACKS):
        if numbers[m, ID] == 0:
            return m
        away = math.hypot(state[m, X] - px, state[m, Y] - py)
        if numbers[m, IS_MOVING] == 0 and numbers[m, CLUSTER] < 0 and away > far:
            worst, far = m, away
    return worst


@called
def close_update(memory: Memory, scan: Scan) -> None:
    """Confirm tracks, tell movers, and let go of tracks that are gone or double."""
    for m in range(TRACKS):
        n, s = memory.numbers[m], memory.state[m]
        if n[ID] == 0:
            continue
        if bits(n[HITS]) >= 3:
            n[IS_CONFIRMED] = 1
        if is_gone(s, n, scan):
            n[ID] = 0  # it has no hits in this scan
            continue
        n[IS_MOVING] = 1 if is_mover(s, n) else 0
        n[HAS_MOVED] = max(n[HAS_MOVED], n[IS_MOVING])
        join_doubles(memory, m, scan.owner)


@inlined
def is_gone(s: Floats, n: Integers, scan: Scan) -> bool:
    """Whether a track has been out of sight for too long, or was hardly ever seen."""
    unseen = scan.pose[NOW] - s[SEEN]
    if unseen <= 0.0:
        return False
    limit = HIDDEN_AWAY
    if is_seen_empty(s, scan.ranges, scan.pose, scan.settings):
        limit = MOVER_SEEN_AWAY if n[IS_MOVING] > 0 else SEEN_AWAY
    return bool(unseen > limit or (n[IS_CONFIRMED] == 0 and (n[HITS] & 7) == 0))


@inlined
def is_seen_empty(s: Floats, ranges: Floats, pose: Floats, settings: Floats) -> bool:
    """Whether the beam toward a track's centre goes past it."""
    beams = len(ranges)
    distance = math.hypot(s[X] - pose[POSE_X], s[Y] - pose[POSE_Y])
    if distance > settings[RANGE]:
        return True  # out of reach, it is let go as soon
    beam = int(round(beam_toward(s[X], s[Y], pose, settings)))
    if settings[IS_FULL_CIRCLE] > 0.0:
        beam = beam % beams
    elif beam < 0 or beam >= beams:
        return False
    return bool(ranges[beam] > distance)


@inlined
def join_doubles(memory: Memory, m: int, owner: Integers) -> None:
    """Keep one of track m and each earlier one at the same place: that seen last, then the older."""
    n, s = memory.numbers[m], memory.state[m]
    for other in range(m):
        o, t = memory.numbers[other], memory.state[other]
        if o[ID] == 0:
            continue
        near = 0.5 * max(s[RADIUS], t[RADIUS])
        if abs(s[X] - t[X]) < near and math.hypot(s[X] - t[X], s[Y] - t[Y]) < near:
            keeps_other = t[SEEN] > s[SEEN] or (t[SEEN] == s[SEEN] and o[ID] < n[ID])
            lost, kept = (m, other) if keeps_other else (other, m)
            memory.numbers[lost, ID] = 0
            for i in range(len(owner)):
                if owner[i] == lost:
                    owner[i] = kept
            if keeps_other:
                return
