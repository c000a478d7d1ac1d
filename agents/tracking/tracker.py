"""Tracking of what moves, out of scans alone: clusters, discs, gating, a Kalman filter for each thing seen.

A tracker knows the scan and the odometry of its robot, nothing else. Each cluster of hits is taken for a disc whose
radius is learnt; a thing is a mover once its speed is significant and it also takes space that was seen free, or leaves
space that is seen free now: the view of a still thing may change so that its disc shifts, but it does neither. Long
clusters are walls, and what is cut off on both sides is a piece of something behind: neither is tracked.

Source: the constant-velocity filter and the gate are the textbook's (Bar-Shalom, Li and Kirubarajan 2001).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.tracking.layout import (
    CLUES,
    COUNTERS,
    FIT,
    FLAG_ROWS,
    FLOAT_ROWS,
    HEADING,
    HISTORY,
    INNOVATION,
    INTEGER_ROWS,
    MOVER,
    NOW,
    NUMBERS,
    PASSED,
    PAST_POSE,
    POSE,
    POSE_X,
    POSE_Y,
    RADIUS,
    SCANS,
    STATE,
    THING_ROWS,
    TRACKS,
    VX,
    VY,
    Memory,
    X,
    Y,
)
from bug_gym.agents.tracking.motion import Network, Weighing, shipped
from bug_gym.agents.tracking.told import gather_tracks, tell_things
from bug_gym.agents.tracking.update import update_tracks
from bug_gym.geometry import F64
from bug_gym.view import Sensors, View


class Tracks(NamedTuple):
    """The things seen often enough to be there, T of them; places in the odometry frame [m]."""

    id: NDArray[np.int64]
    """Number of each track (T,), from 1 on; no number is used twice in an episode."""
    position: F64
    """Centres (T, 2) [m]."""
    velocity: F64
    """Velocities (T, 2) [m/s]."""
    radius: F64
    """Radii of the discs that the things are taken for (T,) [m]."""
    covariance: F64
    """Of x, y, and the velocity, the radius as it is said (T, 4, 4): the filter's own, and UNROUND. So well is the side known
    that faces the robot, which is what it may touch."""
    centre: F64
    """Of x, y, whatever the radius is (T, 2, 2) [m^2]: a thing that is larger than thought lies farther off, and its side that
    faces the robot where it was."""
    moving: NDArray[np.bool_]
    """Whether it moves (T,)."""
    age: F64
    """Time since it was first seen (T,) [s]."""
    unseen: F64
    """Time since it was last seen (T,) [s]; 0: in this scan."""
    innovation: F64
    """Squared Mahalanobis distance of its last measurement from where it was expected (T,)."""
    history: F64
    """Its last measured centres (T, H, 2) [m], the oldest first; one with fewer repeats its oldest."""
    history_times: F64
    """Times of these (T, H) [s]."""
    beam_track: NDArray[np.int64]
    """Index of the track that each beam's hit belongs to (B,), -1 none."""
    ranges: F64
    """The scan (B,) [m]."""
    pose: tuple[float, float, float]
    """Where the robot saw it from: x, y [m], heading [rad]."""

    def select(self, chosen: NDArray[np.int64]) -> Tracks:
        """The tracks of some indices (k,) alone."""
        index = np.full(len(self.id) + 1, -1)
        index[chosen] = np.arange(len(chosen))
        per_track = {name: getattr(self, name)[chosen] for name in self._fields[: self._fields.index("beam_track")]}
        return self._replace(**per_track, beam_track=index[self.beam_track])


@dataclass
class TrackerMemory:
    """What a tracker keeps of one episode: plain arrays, see layout for their columns."""

    scans: F64
    """Past scans (SCANS, B) [m]."""
    scan_points: F64
    """Places of their hits, odometry frame (SCANS, 2, B) [m]."""
    scan_owners: NDArray[np.int64]
    """Whose the hits of the past scans were (SCANS, B)."""
    scan_poses: F64 = field(default_factory=lambda: np.full((SCANS, PAST_POSE), np.inf))
    """Odometry x, y [m], heading [rad] and time [s] of these (SCANS, PAST_POSE)."""
    state: F64 = field(default_factory=lambda: np.zeros((TRACKS, STATE)))
    """Numbers of the tracks (TRACKS, STATE)."""
    numbers: NDArray[np.int64] = field(default_factory=lambda: np.zeros((TRACKS, NUMBERS), dtype=np.int64))
    """Integers of the tracks (TRACKS, NUMBERS)."""
    history: F64 = field(default_factory=lambda: np.zeros((TRACKS, HISTORY, 3)))
    """Measured centres x, y [m] and their times [s] in a ring (TRACKS, HISTORY, 3)."""
    counters: NDArray[np.int64] = field(default_factory=lambda: np.zeros(COUNTERS, dtype=np.int64))
    """Number of the last track, and how many scans were kept (COUNTERS,)."""
    time: float = -math.inf
    """Time of the last update [s]."""

    def arrays(self) -> Memory:
        """The arrays as the compiled step takes them; it changes them in place."""
        return Memory(
            self.state,
            self.numbers,
            self.history,
            self.counters,
            self.scans,
            self.scan_points,
            self.scan_poses,
            self.scan_owners,
        )


class Tracker:
    """Follows what is seen from scan to scan.

    Args:
        sensors: what a driver knows of the robot.
        network: what weighs whether a track moves; None: the one that is shipped.
    """

    clues: F64
    """What the last update told of the motion of each place of a track (TRACKS, CLUES), see layout."""
    owner: NDArray[np.int64]
    """Place of the track that each hit of the last scan belongs to (B,), -1 none."""

    def __init__(self, sensors: Sensors, network: Network | None = None) -> None:
        angles = np.ascontiguousarray(sensors.angles, dtype=np.float64)
        beams = len(angles)
        step = float(angles[1] - angles[0]) if beams > 1 else 2.0 * math.pi
        is_full_circle = beams > 1 and abs(beams * step - 2.0 * math.pi) < 1e-6
        self.angles = angles
        self._settings = np.array([sensors.range, angles[0], step, sensors.range_noise, float(is_full_circle)])
        self._pose = np.zeros(POSE)
        self._floats = np.zeros((FLOAT_ROWS, beams))
        self._fits = np.zeros((beams + 1, FIT))
        self._integers = np.zeros((INTEGER_ROWS, 2 * beams + TRACKS), dtype=np.int64)
        self._flags = np.zeros((FLAG_ROWS, beams), dtype=np.bool_)
        weights = shipped() if network is None else network
        self.clues = np.zeros((TRACKS, CLUES))
        self._robot = np.zeros(2)
        self._weighing = Weighing(self.clues, np.zeros((2, len(weights.last))), self._robot, weights)
        self.owner = np.zeros(beams, dtype=np.int64)
        self._movers = np.empty((TRACKS, MOVER))
        self._places = np.empty(TRACKS, dtype=np.int64)

    def start(self) -> TrackerMemory:
        """Memory of a new episode."""
        beams = len(self.angles)
        owners = np.zeros((SCANS, beams), dtype=np.int64)
        return TrackerMemory(np.zeros((SCANS, beams)), np.zeros((SCANS, 2, beams)), owners)

    def update(self, memory: TrackerMemory, view: View, time: float) -> Tracks:
        """Take in a scan; call it once a step. `memory` is changed in place.

        Args:
            memory: of this episode.
            view: what the robot sees now.
            time: now [s], later than at the last update.

        Raises:
            ValueError: a time that is not later, or a scan of another number of beams.
        """
        self.take_in(memory, view, time, self._movers)
        return self._tracks(memory, view, time)

    def things(self, memory: TrackerMemory, view: View, time: float) -> tuple[F64, NDArray[np.int64]]:
        """What `update` does, for who asks for places and velocities alone.

        Returns:
            What is told of each of `update`'s tracks, a row for each number (THING_ROWS, T), see layout; and which of
            them each beam ended at (B,), -1 none.

        Raises:
            ValueError: see there.
        """
        self.take_in(memory, view, time, self._movers)
        things, beam_thing = np.empty((THING_ROWS, TRACKS)), np.empty_like(self.owner)
        count = tell_things(memory.arrays(), self.owner, time, things, self._places, beam_thing)
        return things[:, :count], beam_thing

    def take_in(self, memory: TrackerMemory, view: View, time: float, movers: F64) -> int:
        """What `update` does, for who asks for what is there and moves alone.

        Args:
            memory, view, time: see there.
            movers: (TRACKS, MOVER), of which the first lines are filled: place and velocity in the odometry frame
                [m, m/s], and radius [m], in the order of `update`'s tracks.

        Returns:
            How many there are.
        """
        if not time > memory.time:
            raise ValueError(f"tracks go forward in time: got {time} s after {memory.time} s")
        if len(view.ranges) != len(self.angles):
            raise ValueError(f"this tracker was made for {len(self.angles)} beams, the scan has {len(view.ranges)}")
        passed = time - memory.time if math.isfinite(memory.time) else 0.0
        self._pose[POSE_X], self._pose[POSE_Y], self._pose[HEADING] = view.pose
        self._pose[NOW], self._pose[PASSED] = time, passed
        ahead, aside = view.own_velocity
        cos, sin = math.cos(view.pose[2]), math.sin(view.pose[2])
        self._robot[:] = cos * ahead - sin * aside, sin * ahead + cos * aside
        memory.time = time
        count: int = update_tracks(
            view.ranges,
            self.angles,
            self._pose,
            self._settings,
            self.owner,
            memory.arrays(),
            self._floats,
            self._fits,
            self._integers,
            self._flags,
            self._weighing,
            movers,
        )
        return count

    def _tracks(self, memory: TrackerMemory, view: View, time: float) -> Tracks:
        """The confirmed tracks of a memory."""
        number, moving, beam_track = np.empty(TRACKS, np.int64), np.empty(TRACKS, np.bool_), np.empty_like(self.owner)
        state, covariance, centre = np.empty((TRACKS, STATE)), np.empty((TRACKS, 4, 4)), np.empty((TRACKS, 2, 2))
        times, history = np.empty((2, TRACKS)), np.empty((TRACKS, HISTORY, 3))
        count = gather_tracks(
            memory.arrays(),
            self.owner,
            self._pose,
            number,
            moving,
            state,
            covariance,
            centre,
            times,
            history,
            self._places,
            beam_track,
        )
        state, history = state[:count], history[:count]
        return Tracks(
            id=number[:count],
            position=state[:, X : Y + 1],
            velocity=state[:, VX : VY + 1],
            radius=state[:, RADIUS],
            covariance=covariance[:count],
            centre=centre[:count],
            moving=moving[:count],
            age=times[0, :count],
            unseen=times[1, :count],
            innovation=state[:, INNOVATION],
            history=history[:, :, :2],
            history_times=history[:, :, 2],
            beam_track=beam_track,
            ranges=view.ranges,
            pose=view.pose,
        )
