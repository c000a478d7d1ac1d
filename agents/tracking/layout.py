"""The layout of a tracker's numbers: columns of its arrays, their sizes, and the records that its kernels take."""

from __future__ import annotations

from typing import NamedTuple

from bug_gym.kernels.layout import Flags, Floats, Integers

TRACKS = 96
"""Places for tracks in a memory."""
HISTORY = 32
"""Measured centres kept for each track."""
SCANS = 16
"""Past scans kept, for the space seen free."""

# Columns of a track's state. PXX to PYY: covariance of the place, CXX to CYY: of place (first letter) and velocity,
# VXX to VYY: of the velocity. EVIDENCE: log odds that it moves. SHAPE_VARIANCE: of its hits about a circle, as far as noise
# doesn't explain it [m^2].
X, Y, VX, VY, PXX, PXY, PYY, CXX, CXY, CYX, CYY, VXX, VXY, VYY = range(14)
RADIUS, RADIUS_VARIANCE, EVIDENCE, BORN, SEEN, INNOVATION, SHAPE_VARIANCE = range(14, 21)
STATE = 21

# Columns of a track's integers. ID 0: no track here. HITS: one bit an update, the last one lowest. WHOLE: at how many of
# its last measurements without a break both its ends were seen. OWN_ENDS, HIDDEN_ENDS: how many of its two ends are its
# outline, and how many another thing hides. BEAMS: how many of this scan's hits are its. HAS_MOVED: whether it was a mover.
ID, HITS, IS_CONFIRMED, IS_MOVING, CENTRES, CLUSTER, WHOLE, OWN_ENDS, HIDDEN_ENDS, BEAMS, HAS_MOVED = range(11)
NUMBERS = 11

# Columns of what an update tells of a track's motion, see motion.finish_clues. Three of each of the first five, for past
# scans from the youngest on: how far hits lie from its hits if the thing stood and if it moved as it is said to, which share
# of them lies where something was, and the beams that passed then where the thing is now, and now where it was then.
STOOD_OFF, MOVED_OFF, EXPLAINED, PASSED_NOW, PASSED_THEN = range(0, 15, 3)
COMPARED_SCANS = 3
(
    SPEED,
    SIGNIFICANCE,
    SPEED_ALONG,
    SPEED_ACROSS,
    SPREAD_ALONG,
    SPREAD_ACROSS,
    ROBOT_ALONG,
    ROBOT_ACROSS,
    DISTANCE,
    SPACING,
    NOISE_OF,
    BEAMS_OF,
    OWN_ENDS_OF,
    HIDDEN_ENDS_OF,
    WHOLE_OF,
    SHAPE_OF,
    RADIUS_OF,
    RADIUS_SPREAD,
    AGE,
    HITS_OF_FIVE,
    INNOVATION_OF,
    STEP_OF,
) = range(15, 37)
CLUES = 37

# Columns of what is told of a mover: X to VY, as of a track, and the radius of its disc [m].
DISC = 4
MOVER = 5

# Rows of what is told of the things that are there: number of the track, place, velocity, radius of its disc [m], time since
# it was last seen [s], and 1 where it moves.
NUMBER, AT_X, AT_Y, GOES_X, GOES_Y, OF_RADIUS, UNSEEN, MOVES = range(8)
THING_ROWS = 8

# Columns of a memory's counters: number of the last track, and how many scans were kept.
LAST_ID, SCANS_KEPT = range(2)
COUNTERS = 2

# Constants of a robot's scanner and of the filter, packed.
(RANGE, FIRST_ANGLE, ANGLE_STEP, NOISE, IS_FULL_CIRCLE) = range(5)
SETTINGS = 5

# Columns of a pose: odometry x, y, heading, the time, and the time since the last update. A past scan keeps the first
# four.
POSE_X, POSE_Y, HEADING, NOW, PASSED = range(5)
POSE = 5
PAST_POSE = 4

# Columns of a fitted disc: place relative to the scanner, radius and its variance; Z*: the variances of the place if
# the radius is known; M*: if it isn't. SHAPE: the variance of the hits about the circle that the noise of a range
# doesn't explain.
FX, FY, FR, FR_VARIANCE, ZXX, ZXY, ZYY, MXX, MXY, MYY, SHAPE = range(11)
FIT = 11

# Rows of an update's working memory, by the field of Hits, Scan or Clusters that they stand for; COUNTS: of each track;
# TOWARD: where hits lie among the beams of another scan; IN_RUN: the same for hits side by side.
HIT_X, HIT_Y, PLACE_X, PLACE_Y, BEARINGS, SQUARES, TOWARD, IN_RUN = range(8)
FLOAT_ROWS = 8
MEMBERS, BEGINS, CHOSEN, NEAREST, COUNTS = range(5)
INTEGER_ROWS = 5
HIT_FLAGS, THING_FLAGS = range(2)
FLAG_ROWS = 2


class Memory(NamedTuple):
    """What is kept of an episode: the tracks, and some past scans in a ring."""

    state: Floats
    """Numbers of the tracks (TRACKS, STATE)."""
    numbers: Integers
    """Integers of the tracks (TRACKS, NUMBERS)."""
    history: Floats
    """Measured centres x, y [m] and their times [s] in a ring (TRACKS, HISTORY, 3)."""
    counters: Integers
    """(COUNTERS,)."""
    scans: Floats
    """Past scans (SCANS, B) [m]."""
    scan_points: Floats
    """Places of their hits, odometry frame (SCANS, 2, B) [m]."""
    scan_poses: Floats
    """Where and when they were taken (SCANS, PAST_POSE)."""
    scan_owners: Integers
    """Whose their hits were (SCANS, B): number of the track times TRACKS and its place; 0 nobody's."""


class Hits(NamedTuple):
    """A scan as points, and the beams of its clusters."""

    x: Floats
    """Hits relative to the scanner, in the odometry frame's axes, x (B,) and y (B,) [m]."""
    y: Floats
    bearings: Floats
    """Bearings of the beams in the same axes (B,) [rad]."""
    ranges: Floats
    """(B,) [m]."""
    members: Integers
    """Numbers of beams; a cluster is a run of them, counter-clockwise."""
    settings: Floats
    """Constants of the scanner (SETTINGS,)."""


class Scan(NamedTuple):
    """A scan in the odometry frame, and whose its hits are."""

    ranges: Floats
    """(B,) [m]."""
    place_x: Floats
    """Places of the hits, x (B,) and y (B,) [m]."""
    place_y: Floats
    is_hit: Flags
    """Whether a beam met something in range (B,)."""
    owner: Integers
    """Place of the track that a hit belongs to (B,), -1 none."""
    pose: Floats
    """Where and when it was taken (POSE,)."""
    settings: Floats
    """Constants of the scanner (SETTINGS,)."""


class Clusters(NamedTuple):
    """The clusters of a scan, K of them, at most as many as beams; and which track each one measures."""

    begins: Integers
    """Cluster k is the beams Hits.members[begins[k] : begins[k + 1]]."""
    is_thing: Flags
    """Whether it may be a track's measurement."""
    fits: Floats
    """A disc for each thing (K, FIT)."""
    chosen: Integers
    """The place of its track, -1 none."""
    nearest: Integers
    """The place of the free track nearest to it."""
    squares: Floats
    """Squared Mahalanobis distance of that."""
