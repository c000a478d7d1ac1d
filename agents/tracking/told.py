"""What a tracker tells of its tracks, gathered out of its memory."""

from __future__ import annotations

import math

from bug_gym.agents.tracking.discs import LEAST_SHAPE
from bug_gym.agents.tracking.layout import (
    AT_X,
    AT_Y,
    BORN,
    CENTRES,
    CXX,
    CXY,
    CYX,
    CYY,
    GOES_X,
    GOES_Y,
    HISTORY,
    ID,
    IS_CONFIRMED,
    IS_MOVING,
    MOVES,
    NOW,
    NUMBER,
    OF_RADIUS,
    OWN_ENDS,
    POSE_X,
    POSE_Y,
    PXX,
    PXY,
    PYY,
    RADIUS,
    RADIUS_VARIANCE,
    SEEN,
    SHAPE_VARIANCE,
    STATE,
    TRACKS,
    UNSEEN,
    VX,
    VXX,
    VXY,
    VY,
    VYY,
    Memory,
    X,
    Y,
)
from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Flags, Floats, Integers

COVARIANCE = (
    (PXX, PXY, CXX, CXY),
    (PXY, PYY, CYX, CYY),
    (CXX, CYX, VXX, VXY),
    (CXY, CYY, VXY, VYY),
)
"""Columns of a track's state that make up its covariance (4, 4)."""
UNROUND = 0.02
"""How far the side of a thing that faces the robot lies from the disc fitted to what is seen of it [m]; it stays so from scan
to scan, so that the filter can't average it out. Measured: see the reproduction `tracking`."""

RADIUS_MOVES, OUTLINE_DEEP, OUTLINE_WIDE, UNSEEN_END = 0.6, 3.35, 1.9, 0.04
"""What moves a thing's middle but not the side that faces the robot, one standard deviation: of the radius's, and of the
outline's from a circle, along the line of sight and across it; and where an end of it isn't seen [m]. By most likely fit to
24 worlds of each family of movers in the reproduction `tracking`, from 7,000,000 on."""


@inlined
def write_centre(s: Floats, ends: int, px: float, py: float, centre: Floats) -> None:
    """Write the covariance of a track's middle.

    Args:
        s: the track's state (STATE,).
        ends: how many of its two ends are its outline.
        px, py: where the robot is [m].
        centre: where to write it (2, 2) [m^2].
    """
    dx, dy = s[X] - px, s[Y] - py
    away = max(math.hypot(dx, dy), 1e-6)
    ux, uy = dx / away, dy / away
    shape = max(s[SHAPE_VARIANCE] - LEAST_SHAPE * LEAST_SHAPE, 0.0)
    hidden = UNSEEN_END * UNSEEN_END if ends < 2 else 0.0
    deep = RADIUS_MOVES * RADIUS_MOVES * s[RADIUS_VARIANCE] + OUTLINE_DEEP * OUTLINE_DEEP * shape + hidden
    wide = OUTLINE_WIDE * OUTLINE_WIDE * shape + hidden
    centre[0, 0] = s[PXX] + deep * ux * ux + wide * uy * uy
    centre[0, 1] = s[PXY] + (deep - wide) * ux * uy
    centre[1, 0] = centre[0, 1]
    centre[1, 1] = s[PYY] + deep * uy * uy + wide * ux * ux


@kernel
def gather_tracks(
    memory: Memory,
    owner: Integers,
    pose: Floats,
    number: Integers,
    moving: Flags,
    state: Floats,
    covariance: Floats,
    centre: Floats,
    times: Floats,
    history: Floats,
    place: Integers,
    beam_track: Integers,
) -> int:
    """Write the confirmed tracks side by side; returns how many these are.

    Args:
        memory: of the episode.
        owner: place of the track that each hit belongs to (B,), -1 none.
        pose: where the robot is, and when (POSE,).
        number, moving: of each (TRACKS,).
        state: numbers of each (TRACKS, STATE).
        covariance: of place and velocity, the radius as it is said (TRACKS, 4, 4).
        centre: of the middle, whatever the radius is (TRACKS, 2, 2).
        times: since each was first seen, and since it was last seen (2, TRACKS) [s].
        history: last measured centres and their times, the oldest first (TRACKS, HISTORY, 3) [m, s].
        place: working memory (TRACKS,).
        beam_track: which of these each hit belongs to (B,), -1 none.
    """
    count, now = 0, pose[NOW]
    for m in range(TRACKS):
        n = memory.numbers[m]
        place[m] = -1
        if n[ID] <= 0 or n[IS_CONFIRMED] == 0:
            continue
        number[count], moving[count] = n[ID], n[IS_MOVING] > 0
        for column in range(STATE):
            state[count, column] = memory.state[m, column]
        times[0, count], times[1, count] = now - memory.state[m, BORN], now - memory.state[m, SEEN]
        for i in range(4):
            for j in range(4):
                covariance[count, i, j] = memory.state[m, COVARIANCE[i][j]]
        for i in range(2):
            covariance[count, i, i] += UNROUND * UNROUND
        write_centre(memory.state[m], n[OWN_ENDS], pose[POSE_X], pose[POSE_Y], centre[count])
        for k in range(HISTORY):
            kept = memory.history[m, max(n[CENTRES] - HISTORY + k, 0) % HISTORY]
            history[count, k, 0], history[count, k, 1], history[count, k, 2] = kept[0], kept[1], kept[2]
        place[m] = count
        count += 1
    for i in range(len(owner)):
        beam_track[i] = place[owner[i]] if owner[i] >= 0 else -1
    return count


@kernel
def tell_things(
    memory: Memory, owner: Integers, now: float, things: Floats, place: Integers, beam_thing: Integers
) -> int:
    """Write what is there, the confirmed tracks in the same order, without their spreads and histories; returns how many.

    Args:
        memory: of the episode.
        owner: place of the track that each hit belongs to (B,), -1 none.
        now: [s].
        things: what is told of each (THING_ROWS, TRACKS).
        place: working memory (TRACKS,).
        beam_thing: which of these each hit belongs to (B,), -1 none.
    """
    count = 0
    for m in range(TRACKS):
        n, s = memory.numbers[m], memory.state[m]
        place[m] = -1
        if n[ID] <= 0 or n[IS_CONFIRMED] == 0:
            continue
        things[NUMBER, count], things[OF_RADIUS, count] = n[ID], s[RADIUS]
        things[AT_X, count], things[AT_Y, count] = s[X], s[Y]
        things[GOES_X, count], things[GOES_Y, count] = s[VX], s[VY]
        things[UNSEEN, count], things[MOVES, count] = now - s[SEEN], 1.0 if n[IS_MOVING] > 0 else 0.0
        place[m] = count
        count += 1
    for i in range(len(owner)):
        beam_thing[i] = place[owner[i]] if owner[i] >= 0 else -1
    return count
