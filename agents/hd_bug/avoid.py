"""HD-BUG avoids what moves, in two phases: it goes where a hit is unlikely, and gives way when it is near.

Source: Hasibuzzaman, Jan and Wu name prediction, two-phase collision avoidance and tangential circumnavigation of what
moves, without a rule; the rules are ours.

Phase 1, anticipation: something predicted will pass nearer than the margin within the horizon. Candidates are 32 headings
x 4 speeds about the one that it wants; their cost is what is left to go and to turn, and the chance to be hit, which the
prediction's spread weighs; to pass behind a mover is worth a share of the detection radius.

Phase 2, reaction: something that comes nearer is nearer than the margin and half a second's way, and no velocity of the
first phase is likely to get by. Then only headings within 15 degrees of a right angle to the line of sight count, on the
side away from the mover's motion; else those of the other side, else it stands, else it backs out.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.drive import TURNING, Motion
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.hd_bug.parameters import HDBugParameters
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.agents.hd_bug.roll_out import RollOut, Velocities, hit_risks
from bug_gym.agents.prediction import make_predictor
from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import F64, Point
from bug_gym.view import Sensors

HEADINGS: F64 = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
"""Headings of the grid of candidates (Procedure 3) [rad]."""

RINGS = 4
"""Radii of that grid: speeds of a candidate."""

SIDEWAYS: F64 = np.radians([-15.0, -7.5, 0.0, 7.5, 15.0])
"""How far from a right angle to the line of sight the second phase looks [rad]."""

RISK, HABIT, BEHIND = 32.0, 0.1, 0.2
"""Weights of the chance of a hit [m], of a turn [m/rad], and what it is worth to pass behind, in detection radii."""

TURN = 0.25
"""Which share of the way that it could go while it turns to its place counts as way: without, it turns to and fro."""

LIKELY = 0.5
"""A chance of a hit, fading with time, above which the first phase has failed."""

REACTION = 0.5
"""Time whose way is added to the margin of the second phase [s]."""

CERTAIN = 0.02
"""Least spread of a prediction [m]."""


class Movers(NamedTuple):
    """What may be met within the horizon, T of them, at K times."""

    tracks: Tracks
    places: F64
    """Predicted centres (T, K, 2), odometry frame [m]."""
    spread: F64
    """Their standard deviation (T, K) [m]."""


class Avoidance:
    """The choice of a velocity among movers.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of HD-BUG.
        motion: how it drives where nothing moves.
    """

    def __init__(self, sensors: Sensors, parameters: HDBugParameters, motion: Motion) -> None:
        self.sensors = sensors
        self.parameters = parameters
        self.without = parameters.without
        self.motion = motion
        self.drive = sensors.drive
        name = "none" if self.without == "prediction" else parameters.predictor
        self.predictor: Predictor = make_predictor(name, sensors)
        self.backward = replace(sensors.drive, kinematics="holonomic")
        """The robot as it drives straight back."""
        spacing = max(0.1, sensors.drive.step)
        count = max(round(parameters.horizon / spacing), 2)
        self.times: F64 = spacing * np.arange(1, count + 1, dtype=np.float64)
        """The times up to the horizon (K,) [s]."""

    def near_movers(self, scene: Scene) -> Movers | None:
        """The movers that could be met within the horizon; None: there are none."""
        tracks = scene.tracks
        if not tracks.moving.any():
            return None
        gaps = self._gaps(scene, tracks)
        closing = np.hypot(*tracks.velocity.T) + self.drive.max_speed
        reach = closing * self.parameters.horizon + self.parameters.margin
        near = np.flatnonzero(tracks.moving & (gaps < reach))
        if len(near) == 0:
            return None
        chosen = tracks.select(near)
        prediction = self.predictor.predict(chosen, self.times)
        spread = np.maximum(prediction.spread, CERTAIN)
        if self.without == "spread":
            spread = np.full_like(spread, CERTAIN)
        return Movers(chosen, prediction.places, spread)

    def _gaps(self, scene: Scene, tracks: Tracks) -> F64:
        """Gaps (T,) between the robot and things [m]."""
        away = np.hypot(*(tracks.position - np.array(scene.view.position)).T)
        gaps: F64 = away - tracks.radius - self.sensors.radius
        return gaps

    # ------------------------------------------------------------------------------------------------- both phases

    def avoid(
        self, scene: Scene, memory: HDBugMemory, movers: Movers, desired: tuple[float, float], place: Point
    ) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] among movers.

        Args:
            scene: what it sees.
            memory: what it decides is noted there.
            movers: what may be met.
            desired: direction and speed that it would take if nothing moved.
            place: where that leads, odometry frame [m].
        """
        memory.forecast = movers.places
        chosen, risk = self._as_desired(scene, movers, desired)
        if self.without != "phase_1" and self._is_near_miss(scene, movers, desired):
            memory.mode = "anticipation"
            chosen, risk = self._anticipate(scene, memory, movers, desired, place)
        if self.without != "phase_2" and risk > LIKELY:
            threat = self._threat(scene, movers, chosen[1])
            if threat is not None:
                memory.mode = "reaction"
                chosen = self._react(scene, memory, movers, threat)
        return chosen

    def _as_desired(
        self, scene: Scene, movers: Movers, desired: tuple[float, float]
    ) -> tuple[tuple[float, float], float]:
        """The velocity that it would take anyhow, and the chance of a hit."""
        direction, speed = desired
        velocities = Velocities(np.array([direction]), np.array([speed]), np.array([np.inf]))
        return desired, float(self._roll_out(scene, velocities, movers, 0).nearness[0])

    def _is_near_miss(self, scene: Scene, movers: Movers, desired: tuple[float, float]) -> bool:
        """Whether a mover passes nearer than the margin within the horizon, as both go now (closest approach)."""
        tracks, (direction, speed) = movers.tracks, desired
        own = speed * np.array([math.cos(direction), math.sin(direction)])
        apart, relative = tracks.position - np.array(scene.view.position), tracks.velocity - own
        square = np.maximum((relative**2).sum(axis=1), 1e-9)
        when = np.clip(-(apart * relative).sum(axis=1) / square, 0.0, self.parameters.horizon)
        missed = np.hypot(*(apart + when[:, None] * relative).T) - tracks.radius - self.sensors.radius
        return bool((missed < self.parameters.margin).any())

    def _roll_out(self, scene: Scene, velocities: Velocities, movers: Movers, compare: int) -> RollOut:
        """What comes of velocities among movers."""
        return hit_risks(
            self.drive, scene.view.pose, self.sensors.radius, velocities, movers.places, movers.tracks.radius,
            movers.spread, self.times, compare, self._goal(scene),
        )  # fmt: skip

    def _goal(self, scene: Scene) -> tuple[float, float, float]:
        """Where it is, and its radius [m]."""
        return *scene.view.goal_position, self.sensors.goal_radius

    # ------------------------------------------------------------------------------------------------- phase 1

    def _anticipate(
        self, scene: Scene, memory: HDBugMemory, movers: Movers, desired: tuple[float, float], place: Point
    ) -> tuple[tuple[float, float], float]:
        """The candidate velocity of least cost, and its chance of a hit."""
        velocities = self._candidates(scene, memory, desired)
        spacing = float(self.times[0])
        compare = min(max(round(memory.reach / self.motion.speeds[0] / spacing), 3), len(self.times)) - 1
        result = self._roll_out(scene, velocities, movers, compare)
        rest = self._rest(result, place)
        turned = np.abs(np.angle(np.exp(1j * (velocities.directions - memory.direction))))
        cost = self.parameters.alpha * rest + self.parameters.beta * (RISK * result.nearness + HABIT * turned)
        cost -= BEHIND * memory.reach * self._is_behind(scene, movers, velocities)
        best = int(cost.argmin())
        memory.candidates, memory.costs = result.end[:, :2], cost
        memory.chosen = float(result.end[best, 0]), float(result.end[best, 1])
        speed = min(float(velocities.speeds[best]), float(velocities.free[best]) / self.drive.step)
        return (float(velocities.directions[best]), max(speed, TURNING)), float(result.nearness[best])

    def _rest(self, result: RollOut, place: Point) -> F64:
        """What is left to go to a place (m,) [m], the time to turn to it taken for a way; less than none from the goal on."""
        top = self.motion.speeds[0]
        dx, dy = place[0] - result.end[:, 0], place[1] - result.end[:, 1]
        rest = np.hypot(dx, dy)
        if self.drive.kinematics != "holonomic":
            turn = np.abs(np.angle(np.exp(1j * (np.arctan2(dy, dx) - result.end[:, 2]))))
            rest += TURN * top * turn / self.drive.max_turn_rate
        left: F64 = np.where(result.early > 0.0, -top * result.early, rest)
        return left

    def _candidates(self, scene: Scene, memory: HDBugMemory, desired: tuple[float, float]) -> Velocities:
        """The grid of velocities about the desired direction, each as fast as eq. (9) allows, and to stand."""
        view = scene.view
        directions = desired[0] + HEADINGS
        bearings = directions - view.heading
        free = np.maximum(view.free_distances(bearings, self.motion.radius_for(view)), 0.0)
        top = np.array(
            [self.motion.rule(view, bearing, way, memory.reach) for bearing, way in zip(bearings, free, strict=True)]
        )
        shares = np.arange(1, RINGS + 1) / RINGS
        return Velocities(
            np.append(np.repeat(directions, RINGS), memory.direction),
            np.append((top[:, None] * shares).ravel(), 0.0),
            np.append(np.repeat(free, RINGS), 0.0),
        )

    def _is_behind(self, scene: Scene, movers: Movers, velocities: Velocities) -> NDArray[np.bool_]:
        """Which velocities (m,) lead past the nearest mover that crosses on the side that it comes from."""
        tracks = movers.tracks
        nearest = int(self._gaps(scene, tracks).argmin())
        dx, dy = tracks.position[nearest] - np.array(scene.view.position)
        vx, vy = tracks.velocity[nearest]
        across = dx * vy - dy * vx
        sideways = dx * np.sin(velocities.directions) - dy * np.cos(velocities.directions)
        ahead = dx * np.cos(velocities.directions) + dy * np.sin(velocities.directions)
        behind: NDArray[np.bool_] = (sideways * across < 0.0) & (ahead > 0.0) & (velocities.speeds > 0.0)
        return behind

    # ------------------------------------------------------------------------------------------------- phase 2

    def _threat(self, scene: Scene, movers: Movers, speed: float) -> int | None:
        """Number of the nearest mover that comes nearer, within the margin and half a second's way; None: there is none."""
        tracks = movers.tracks
        apart = tracks.position - np.array(scene.view.position)
        gaps = self._gaps(scene, tracks)
        comes = (apart * tracks.velocity).sum(axis=1) < 0.0
        pace = speed + np.hypot(*tracks.velocity.T)
        near = np.flatnonzero(comes & (gaps < self.parameters.margin + REACTION * pace))
        return int(near[gaps[near].argmin()]) if len(near) else None

    def _react(self, scene: Scene, memory: HDBugMemory, movers: Movers, threat: int) -> tuple[float, float]:
        """Give way to a mover: at a right angle to the line of sight, away from its motion; else stand, or back out."""
        view, tracks = scene.view, movers.tracks
        dx, dy = tracks.position[threat] - np.array(view.position)
        vx, vy = tracks.velocity[threat]
        sight = math.atan2(dy, dx)
        side = -math.copysign(1.0, dx * vy - dy * vx)
        directions = np.concatenate([sight + side * 0.5 * math.pi + SIDEWAYS, sight - side * 0.5 * math.pi + SIDEWAYS])
        free = np.maximum(view.free_distances(directions - view.heading, self.motion.radius_for(view)), 0.0)
        speeds = np.full(len(directions), self.motion.speeds[0])
        velocities = Velocities(
            np.append(directions, view.heading), np.append(speeds, 0.0), np.append(free, 0.0)
        )  # fmt: skip
        chances = self._roll_out(scene, velocities, movers, 0).nearness
        step = self.motion.speeds[0] * self.drive.step
        half = len(SIDEWAYS)
        for few in (slice(0, half), slice(half, 2 * half)):
            open_ones = np.flatnonzero(free[few] >= step) + few.start
            if len(open_ones) and chances[open_ones].min() < LIKELY:
                best = int(open_ones[chances[open_ones].argmin()])
                return float(directions[best]), float(speeds[best])
        memory.is_backing = self._can_back_out(scene, movers, float(chances[-1]))
        return view.heading, 0.0

    def _can_back_out(self, scene: Scene, movers: Movers, standing: float) -> bool:
        """Whether a robot that drives backward has room to, and is hit less likely than standing."""
        speed = self.drive.max_reverse
        if self.drive.kinematics == "holonomic" or speed <= 0.0:
            return False
        view = scene.view
        if view.free_distance(math.pi, self.motion.radius_for(view)) < speed * self.drive.step:
            return False
        back = Velocities(np.array([view.heading + math.pi]), np.array([speed]), np.array([np.inf]))
        result = hit_risks(
            self.backward, view.pose, self.sensors.radius, back, movers.places, movers.tracks.radius, movers.spread,
            self.times, 0, self._goal(scene),
        )  # fmt: skip
        return float(result.nearness[0]) < standing
