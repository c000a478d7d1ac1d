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

from bug_gym.agents.tracking import tracking_kernels as kernels
from bug_gym.geometry import F64
from bug_gym.view import Sensors, View

COVARIANCE = np.array(
    [
        [kernels.PXX, kernels.PXY, kernels.CXX, kernels.CXY],
        [kernels.PXY, kernels.PYY, kernels.CYX, kernels.CYY],
        [kernels.CXX, kernels.CYX, kernels.VXX, kernels.VXY],
        [kernels.CXY, kernels.CYY, kernels.VXY, kernels.VYY],
    ]
)
"""Columns of a track's state that make up its covariance (4, 4)."""


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
    """Of x, y, and the velocity (T, 4, 4)."""
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
    """What a tracker keeps of one episode: plain arrays, see tracking_kernels for their columns."""

    scans: F64
    """Past scans (SCANS, B) [m]."""
    scan_points: F64
    """Places of their hits, odometry frame (SCANS, 2, B) [m]."""
    scan_owners: NDArray[np.int64]
    """Whose the hits of the past scans were (SCANS, B)."""
    scan_poses: F64 = field(default_factory=lambda: np.full((kernels.SCANS, 4), np.inf))
    """Odometry x, y [m], heading [rad] and time [s] of these (SCANS, 4)."""
    state: F64 = field(default_factory=lambda: np.zeros((kernels.TRACKS, kernels.STATE)))
    """Numbers of the tracks (TRACKS, STATE)."""
    numbers: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((kernels.TRACKS, kernels.NUMBERS), dtype=np.int64)
    )
    """Integers of the tracks (TRACKS, NUMBERS)."""
    history: F64 = field(default_factory=lambda: np.zeros((kernels.TRACKS, kernels.HISTORY, 3)))
    """Measured centres x, y [m] and their times [s] in a ring (TRACKS, HISTORY, 3)."""
    counters: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, dtype=np.int64))
    """Number of the last track, and how many scans were kept (2,)."""
    time: float = -math.inf
    """Time of the last update [s]."""


class Tracker:
    """Follows what is seen from scan to scan.

    Args:
        sensors: what a driver knows of the robot.
    """

    def __init__(self, sensors: Sensors) -> None:
        angles = np.ascontiguousarray(sensors.angles, dtype=np.float64)
        beams = len(angles)
        step = float(angles[1] - angles[0]) if beams > 1 else 2.0 * math.pi
        is_full_circle = beams > 1 and abs(beams * step - 2.0 * math.pi) < 1e-6
        self.angles = angles
        self._settings = np.array([sensors.range, angles[0], step, sensors.range_noise, float(is_full_circle)])
        self._pose = np.zeros(5)
        self._work = np.zeros((6, beams))
        self._fits = np.zeros((beams + 1, kernels.FIT))
        self._lists = np.zeros((5, 2 * beams + kernels.TRACKS), dtype=np.int64)
        self._flags = np.zeros((2, beams), dtype=np.bool_)
        self._owner = np.zeros(beams, dtype=np.int64)

    def start(self) -> TrackerMemory:
        """Memory of a new episode."""
        beams = len(self.angles)
        scans = kernels.SCANS
        owners = np.zeros((scans, beams), dtype=np.int64)
        return TrackerMemory(np.zeros((scans, beams)), np.zeros((scans, 2, beams)), owners)

    def update(self, memory: TrackerMemory, view: View, time: float) -> Tracks:
        """Take in a scan; call it once a step. `memory` is changed in place.

        Args:
            memory: of this episode.
            view: what the robot sees now.
            time: now [s], later than at the last update.

        Raises:
            ValueError: a time that is not later, or a scan of another number of beams.
        """
        if not time > memory.time:
            raise ValueError(f"tracks go forward in time: got {time} s after {memory.time} s")
        if len(view.ranges) != len(self.angles):
            raise ValueError(f"this tracker was made for {len(self.angles)} beams, the scan has {len(view.ranges)}")
        passed = time - memory.time if math.isfinite(memory.time) else 0.0
        self._pose[:] = (*view.pose, time, passed)
        memory.time = time
        kernels.update_tracks(
            view.ranges,
            self.angles,
            self._pose,
            self._settings,
            memory.state,
            memory.numbers,
            memory.history,
            memory.scans,
            memory.scan_points,
            memory.scan_poses,
            memory.scan_owners,
            memory.counters,
            self._owner,
            self._work,
            self._fits,
            self._lists,
            self._flags,
        )
        return self._tracks(memory, view, time)

    def _tracks(self, memory: TrackerMemory, view: View, time: float) -> Tracks:
        """The confirmed tracks of a memory."""
        numbers = memory.numbers
        places = np.flatnonzero((numbers[:, kernels.ID] > 0) & (numbers[:, kernels.IS_CONFIRMED] > 0))
        state, chosen = memory.state[places], numbers[places]
        index = np.full(kernels.TRACKS + 1, -1)
        index[places] = np.arange(len(places))
        centres = chosen[:, kernels.CENTRES, None]
        newest = np.arange(-kernels.HISTORY, 0)
        kept = memory.history[places[:, None], np.maximum(centres + newest, 0) % kernels.HISTORY]
        return Tracks(
            id=chosen[:, kernels.ID],
            position=state[:, kernels.X : kernels.Y + 1],
            velocity=state[:, kernels.VX : kernels.VY + 1],
            radius=state[:, kernels.RADIUS],
            covariance=state[:, COVARIANCE],
            moving=chosen[:, kernels.IS_MOVING] > 0,
            age=time - state[:, kernels.BORN],
            unseen=time - state[:, kernels.SEEN],
            innovation=state[:, kernels.INNOVATION],
            history=kept[:, :, :2],
            history_times=kept[:, :, 2],
            beam_track=index[self._owner],
            ranges=view.ranges,
            pose=view.pose,
        )
