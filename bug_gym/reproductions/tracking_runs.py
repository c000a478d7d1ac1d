"""One episode of a robot that tracks what it sees, judged by the true places of what moves.

A plain driver takes the robot through a world; its tracker sees the same scans. In a still world any track that is
called moving is a ghost. Among movers the counts are those of multiple object tracking: misses, false tracks and
switched numbers, at each step, and MOTA = 1 - (misses + false + switches) / (times a mover was there to be known).

Source: Bernardin and Stiefelhagen 2008, Evaluating Multiple Object Tracking Performance: The CLEAR MOT Metrics.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.prediction.samples import NEAR, frame_of, movers_of
from bug_gym.agents.tracking.tracker import Tracker, Tracks
from bug_gym.config import Scenario
from bug_gym.geometry import F64
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

DRIVERS = ("bug2", "hd_bug_map")
"""Who drives: the first in worlds of even seeds, the other in those of odd ones."""
SECONDS = 45.0
"""How long an episode is watched, unless it ends before [s]."""
LEAST_SPEED = 0.2
"""Of what is to be known as a mover [m/s]."""
LEAST_HITS = 3
"""Beams that meet a thing in sight; they are at least half of those toward it too: it is not hidden for the most part."""
WHOLE_WITHIN = 0.9
"""Of the LIDAR's range: a thing in sight has its middle within it, farther off its ends are out of range."""
CONFIRMED_IN = 0.6
"""In this time after it came into sight a mover is to be known [s]."""
SETTLED = 1.0
"""Age from which a track's numbers are asked [s]: before, its speed is still being learnt."""
ON_OUTLINE = 0.05
"""How far a hit may lie from a body's outline beside three times the noise [m]."""


class Frame(NamedTuple):
    """What a robot saw at one time, and the truth."""

    time: float
    """[s]."""
    view: View
    places: F64
    """True places of what moves (M, 2), NaN where one isn't there, in the odometry frame [m]."""
    radii: F64
    """Outer radii (M,) [m]."""
    inner: F64
    """Inner radii (M,) [m]: a disc's is its radius."""


@dataclass
class Counts:
    """What is counted in one episode."""

    ghosts: set[int] = field(default_factory=set)
    """Numbers of moving tracks that were nothing that moves, at any time."""
    scans: int = 0
    """How many there were."""
    seen: int = 0
    """Times that a mover was in sight, and had been for CONFIRMED_IN."""
    misses: int = 0
    """Of these, those at which no moving track was its."""
    false: int = 0
    """Times that a moving track was nobody's."""
    switches: int = 0
    """Times that a mover's track had another number than before."""
    gaps: list[float] = field(default_factory=list)
    """Distances of tracks from the true centres [m]."""
    waits: list[float] = field(default_factory=list)
    """Times from coming into sight until known [s]; infinite: not known while it was in sight.

    Whatever comes into sight again counts again, known or not. One that was not known when it left sight sooner than
    CONFIRMED_IN does not count.
    """
    known_before: int = 0
    """How many of these had been known just before they came into sight."""
    firsts: int = 0
    """Movers that were in sight for CONFIRMED_IN without a break: each once, the first time."""
    firsts_known: int = 0
    """Of these, those that had been known by then, since they came into sight."""
    innovations: list[float] = field(default_factory=list)
    """Squared Mahalanobis distances of measured places."""
    errors: list[float] = field(default_factory=list)
    """Squared Mahalanobis distances of true centres."""
    sides: list[float] = field(default_factory=list)
    """Of discs: squared errors of how far off the side is that faces the robot, by their variance."""


def frames(
    scenario: Scenario | str | Mapping[str, Any],
    seed: int,
    driver: str,
    *,
    overrides: Mapping[str, Any] | None = None,
    seconds: float = SECONDS,
) -> Iterator[Frame]:
    """What a robot sees in one episode, with the truth."""
    simulation = Simulation(scenario, overrides=overrides)
    sensors = Sensors.of(simulation.scenario)
    policy, state = make_policy(driver, simulation), None
    observation = simulation.reset(seeds=[seed])[:, 0]
    to_start = frame_of(*simulation.world.pose[0, 0].tolist())
    inner = inner_radii(simulation)
    step = simulation.scenario.time.step
    for number in range(round(seconds / step)):
        places, radii = movers_of(simulation)
        yield Frame(number * step, View(observation[0].copy(), sensors), to_start(places), radii, inner)
        action, state = policy.predict(observation, state)
        transition = simulation.step(action[:, None])
        observation = transition.observation[:, 0]
        if transition.terminated.any() or transition.truncated.any():
            return


def inner_radii(simulation: Simulation) -> F64:
    """Distance of the outline of what moves in the first row from its place (M,) [m]."""
    found = []
    for mover in simulation.world.layout(0).movers:
        if mover.is_circle:
            found.append(float(mover.outline))
            continue
        corners = np.asarray(mover.outline, dtype=np.float64)
        sides = np.roll(corners, -1, axis=0) - corners
        across = np.abs(corners[:, 0] * sides[:, 1] - corners[:, 1] * sides[:, 0])
        found.append(float((across / np.hypot(*sides.T)).min()))
    return np.array(found, dtype=np.float64)


def hits_on_movers(frame: Frame) -> NDArray[np.bool_]:
    """Which beams met which of what moves (B, M)."""
    view = frame.view
    x, y, heading = view.pose
    bearings = heading + view.sensors.angles
    points = np.array([x, y]) + view.ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    away = np.hypot(*(points[:, None] - frame.places).transpose(2, 0, 1))
    slack = ON_OUTLINE + 3.0 * view.sensors.range_noise
    is_hit = (view.ranges < view.sensors.range)[:, None]
    met: NDArray[np.bool_] = is_hit & (away > frame.inner - slack) & (away < frame.radii + slack)
    return met


def is_in_sight(frame: Frame) -> NDArray[np.bool_]:
    """Whether enough beams meet each of what moves (M,)."""
    view, hits = frame.view, hits_on_movers(frame).sum(axis=0)
    x, y, heading = view.pose
    bearings = heading + view.sensors.angles
    dx, dy = (frame.places - [x, y]).T
    aside = np.abs(np.remainder(np.arctan2(dy, dx) - bearings[:, None] + math.pi, 2.0 * math.pi) - math.pi)
    toward = (aside < np.arcsin(np.minimum(frame.inner / np.maximum(np.hypot(dx, dy), 1e-9), 1.0))).sum(axis=0)
    enough: NDArray[np.bool_] = (
        (hits >= LEAST_HITS) & (2 * hits >= toward) & (np.hypot(dx, dy) < WHOLE_WITHIN * view.sensors.range)
    )
    return enough


def pairs(tracks: Tracks, frame: Frame) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of moving tracks seen now (T,) and of the movers (T,) within whose outlines they lie.

    Each has at most one of the other, the nearest; about a small mover NEAR will do.
    """
    chosen = np.flatnonzero(tracks.moving & (tracks.unseen == 0.0))
    gaps = np.hypot(*(tracks.position[chosen, None] - frame.places).transpose(2, 0, 1))
    gaps = np.where(gaps < np.maximum(NEAR, frame.radii), gaps, np.inf)
    found: list[tuple[int, int]] = []
    while gaps.size and np.isfinite(gaps.min()):
        row, mover = np.unravel_index(gaps.argmin(), gaps.shape)
        found.append((int(chosen[row]), int(mover)))
        gaps[row], gaps[:, mover] = np.inf, np.inf
    both = np.array(found, dtype=np.int64).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def sides(frame: Frame, tracks: Tracks, chosen: NDArray[np.int64], movers: NDArray[np.int64]) -> F64:
    """Squared errors of the sides that face the robot, by their variance, of those of some pairs that are discs (k,)."""
    chosen, movers = (index[frame.inner[movers] == frame.radii[movers]] for index in (chosen, movers))
    robot = np.array(frame.view.pose[:2])
    to_track, to_mover = tracks.position[chosen] - robot, frame.places[movers] - robot
    away = np.hypot(*to_track.T)
    sight = to_track / away[:, None]
    error = np.hypot(*to_mover.T) - frame.radii[movers] - (away - tracks.radius[chosen])
    variance = np.einsum("ti,tij,tj->t", sight, tracks.covariance[chosen][:, :2, :2], sight)
    squares: F64 = error**2 / variance
    return squares


class Judge:
    """Counts from frame to frame.

    Args:
        movers: how many there are.
    """

    def __init__(self, movers: int) -> None:
        self.counts = Counts()
        self._before: F64 | None = None
        self._since: F64 = np.full(movers, math.inf)
        """When each came into sight."""
        self._waiting = np.zeros(movers, dtype=np.bool_)
        self._known_before = np.zeros(movers, dtype=np.bool_)
        self._was_known = np.zeros(movers, dtype=np.bool_)
        """Whether each has been known since it came into sight."""
        self._stayed = np.zeros(movers, dtype=np.bool_)
        self._numbers: dict[int, int] = {}

    def take(self, frame: Frame, tracks: Tracks) -> None:
        """Count what holds at one time."""
        self.counts.scans += 1
        moving = tracks.moving & (tracks.unseen == 0.0)
        chosen, movers = pairs(tracks, frame)
        is_someones = np.zeros(len(tracks.id), dtype=np.bool_)
        is_someones[chosen] = True
        self._count_false(frame, tracks, moving & ~is_someones)
        self._count_switches(tracks.id[chosen], movers)
        self._count_known(frame, movers)
        gaps = frame.places[movers] - tracks.position[chosen]
        self.counts.gaps += np.hypot(*gaps.T).tolist()
        settled = (tracks.age[chosen] > SETTLED) & (tracks.unseen[chosen] == 0.0)
        self.counts.innovations += tracks.innovation[chosen][settled].tolist()
        inverse = np.linalg.inv(tracks.centre[chosen][settled])
        self.counts.errors += np.einsum("ti,tij,tj->t", gaps[settled], inverse, gaps[settled]).tolist()
        self.counts.sides += sides(frame, tracks, chosen[settled], movers[settled]).tolist()

    def _count_false(self, frame: Frame, tracks: Tracks, alone: NDArray[np.bool_]) -> None:
        self.counts.false += int(alone.sum())
        for index in np.flatnonzero(alone):
            away = np.hypot(*(frame.places - tracks.position[index]).T) - frame.radii
            if not (away < tracks.radius[index]).any():  # a second track of a mover is no ghost
                self.counts.ghosts.add(int(tracks.id[index]))

    def _count_switches(self, numbers: NDArray[np.int64], movers: NDArray[np.int64]) -> None:
        for number, mover in zip(numbers.tolist(), movers.tolist(), strict=True):
            self.counts.switches += self._numbers.get(mover, number) != number
            self._numbers[mover] = number

    def _count_known(self, frame: Frame, known: NDArray[np.int64]) -> None:
        step = frame.view.sensors.drive.step
        before = frame.places if self._before is None else self._before
        speeds = np.hypot(*(frame.places - before).T) / step
        self._before = frame.places
        in_sight = is_in_sight(frame) & (speeds >= LEAST_SPEED)
        is_known = np.zeros(len(in_sight), dtype=np.bool_)
        is_known[known] = True
        is_new = in_sight & ~np.isfinite(self._since)
        self._since[is_new] = frame.time
        self._waiting |= is_new
        lasted = frame.time - self._since
        for mover in np.flatnonzero(self._waiting & (is_known | ~in_sight)):
            if is_known[mover]:
                self.counts.waits.append(float(lasted[mover]))
            elif lasted[mover] > CONFIRMED_IN:
                self.counts.waits.append(math.inf)
        self._waiting &= in_sight & ~is_known
        self._since[~in_sight] = math.inf
        asked = in_sight & (lasted >= CONFIRMED_IN - 1e-9)
        self.counts.known_before += int((is_new & is_known & self._known_before).sum())
        self._known_before = is_known
        self._was_known = in_sight & (self._was_known | is_known)
        first = asked & ~self._stayed
        self._stayed |= first
        self.counts.firsts += int(first.sum())
        self.counts.firsts_known += int((first & self._was_known).sum())
        self.counts.seen += int(asked.sum())
        self.counts.misses += int((asked & ~is_known).sum())


def judge(seen: Iterable[Frame]) -> Counts:
    """Track what is seen, and count."""
    found: Judge | None = None
    for frame in seen:
        if found is None:
            found = Judge(len(frame.radii))
            tracker = Tracker(frame.view.sensors)
            memory = tracker.start()
        found.take(frame, tracker.update(memory, frame.view, frame.time))
    return found.counts if found is not None else Counts()
