"""Dynamic window approach: of the velocities that can be reached and stopped from in time, the one worth most.

Source: Fox, Burgard and Thrun (1997), "The Dynamic Window Approach to Collision Avoidance". A velocity is a speed and a
turn rate, so a circle; it is worth alpha heading + beta distance + gamma speed, smoothed over its neighbours: how well
the robot looks at the goal afterwards, how far it can go before it meets something, and how fast it is. Sensing
assumed: the scan, the goal. Memory kept: which way it turns while it is stuck. States: driving, turning. Guarantee:
none; it may stand before a wall for ever. Length: no bound.

The paper's: velocities that can be reached within a decision; of them those that can be stopped from on the free part
of their circle, v <= sqrt(2 dist a); the three terms, each from 0 to 1; the heading where the robot comes to stand if it
brakes after the decision; the smoothing of their sum; turning on the spot where nothing else is left. The weights 2, 0.2
and 0.2 are handed down as those of its robot; they were not tuned here.

Chosen here:

- the way of the decision itself is added to that of the brake, and a robot whose scenario names no acceleration stops at
  once;
- turn rates are bounded by the drive alone, as robots here have no turning acceleration, so no window of them and no
  condition that they be stopped in time;
- 8 speeds, 17 turn rates, that which faces the goal among them, and a mean of three by three for the smoothing;
- free ways count up to `look`, and as whole where the goal comes before the obstacle; a circle is free for once round
  at most, where the paper has a large constant;
- standing has the free way along the heading that it then has: with a large constant, a robot that comes to little speed
  in a decision would rather stand than begin toward anything within `look`;
- who faces the goal and would stand begins as fast as he can: circles at little speed are short, so that a robot which comes
  to no more in a decision would stand for ever, in the open too;
- who has turned once round with the goal on the inner side all the while turns to it on the spot, and goes on from there;
- the side of the turn on the spot: to the nearest bearing whose free way counts as whole, or, where none does, to the one
  with the longest; as far round on both sides, to the goal's; it is kept until a velocity gets on;
- a robot that drives any way without turning has speeds and directions for velocities, and straight ways; any direction
  counts as reachable;
- an ackermann robot has speeds and curvatures, and may choose to stand at any speed; it cannot turn on the spot, so
  instead it turns in several moves, as bug_gym.manoeuvring has it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bug_gym import kernels
from bug_gym.agents.local.windows import Window, weigh_window
from bug_gym.agents.parameters import Length, Weight, require_numbers
from bug_gym.geometry import F64, velocity_along, wrap
from bug_gym.kinematics import TURN_GAIN, TURN_IN_PLACE
from bug_gym.policy import CREEP, Drawing, Memory, ScriptedPolicy, Velocity, braking_radius
from bug_gym.view import Sensors, View

SPEEDS, RATES, DIRECTIONS = 8, 17, 36
"""Velocities of a window: so many speeds above 0, turn rates, and directions of a robot that needs not turn."""
ROUNDED = 1e-9
"""Speeds are told apart by more than this [m/s]."""
LEAST = 0.02
"""A speed below this share of the greatest does not get the robot on."""
ALIKE = 1e-6
"""Lengths of left and right that differ by less are the same, as observations round them [m]."""
FACING = 0.01
"""Who has the goal less than this aside faces it [rad]."""
FACED = 0.1
"""Who turns to the goal because circles lead round it turns until it is less than this aside [rad]."""
BEHIND = math.radians(150.0)
"""Nowhere farther round than this is looked for room [rad]."""


@dataclass
class DWAMemory(Memory):
    """Memory of the dynamic window approach."""

    side: int = 0
    """Which way it turns while no velocity gets it on: 1 left, -1 right, 0 not at all."""
    velocity: Velocity = (0.0, 0.0)
    """Speed [m/s] and turn rate [rad/s], or direction [rad], that were chosen last."""
    is_free: bool = False
    """Whether an ackermann robot is to drive just that, not to turn in several moves."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where that was, odometry frame."""
    round: float = 0.0
    """How far it has turned to the side of the goal, which has been on that side all the while [rad]; left is positive."""


@dataclass(frozen=True)
class DWAParameters:
    """Parameters of the dynamic window approach."""

    heading_weight: Weight = 2.0
    """alpha, of the goal's bearing [-]."""
    distance_weight: Weight = 0.2
    """beta, of the free way [-]."""
    speed_weight: Weight = 0.2
    """gamma, of the speed [-]."""
    look: Length = 3.0
    """Free ways beyond this are all the same [m]."""

    def __post_init__(self) -> None:
        require_numbers(self, not_negative=("heading_weight", "distance_weight", "speed_weight"))
        if not 0.0 < self.look < math.inf:
            raise ValueError(f"look must be above 0 m, got {self.look!r}")


class DWA(ScriptedPolicy):
    """The dynamic window approach.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a negative weight, a look that is not above 0.
    """

    Parameters = DWAParameters
    parameters: DWAParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        drive = sensors.drive
        self.is_holonomic = drive.kinematics == "holonomic"
        self._begins = drive.kinematics == "differential" and math.isfinite(drive.max_acceleration)
        """Whether it may rather stand for want of speed than begin."""
        self.gain = min(TURN_GAIN, 1.0 / drive.step)
        rate = min(drive.max_turn_rate, 0.999 * self.gain * TURN_IN_PLACE)
        self.window = Window(
            radius=braking_radius(sensors) + 2.0 * sensors.range_noise + 0.01,
            max_speed=drive.max_speed,
            step=drive.step,
            acceleration=drive.max_acceleration,
            turn_rate=rate,
            gain=self.gain,
            look=min(self.parameters.look, sensors.range),
            heading_weight=self.parameters.heading_weight,
            distance_weight=self.parameters.distance_weight,
            speed_weight=self.parameters.speed_weight,
            is_holonomic=self.is_holonomic,
            is_steered=drive.kinematics == "ackermann",
        )

    def start(self) -> DWAMemory:
        """Memory of a new episode."""
        return DWAMemory(mode="driving")

    def act(self, view: View, memory: DWAMemory) -> Velocity:
        """One decision."""
        speeds, seconds = self._reachable(view)
        scores = np.empty((len(speeds), len(seconds)))
        x, y = view.points
        weigh_window(self.window, speeds, seconds, x, y, *view.goal, scores)
        if not self.window.is_steered:
            scores = self._within_reach(view, speeds, seconds, scores)
        i, j = np.unravel_index(int(smoothed(scores, is_round=self.is_holonomic).argmax()), scores.shape)
        speed, second = float(speeds[i]), float(seconds[j])
        if speed == 0.0 and self._begins and abs(view.goal_bearing) < FACING:
            speed = float(speeds[np.flatnonzero(np.isfinite(scores[:, j]))[-1]])
        memory.round, memory.pose = self._gone_round(view, memory), view.pose
        if self.is_holonomic:
            memory.velocity = speed, second
            return velocity_along(second, speed)
        if self.window.is_steered:
            return self._steered(view, memory, speeds, scores, (speed, speed * second))
        if abs(memory.round) >= 2.0 * math.pi and memory.side == 0:
            speed, second = 0.0, min(max(self.gain * view.goal_bearing, -self.window.turn_rate), self.window.turn_rate)
        turns_on = memory.side != 0 and speed < min(LEAST * self.sensors.drive.max_speed, float(speeds[-1]))
        if self._is_stuck(view, memory, speeds, scores) or turns_on:
            memory.mode = "turning"
            speed, second = 0.0, memory.side * self.window.turn_rate
        else:
            memory.mode, memory.side = "driving", 0
        error = second / self.gain
        memory.velocity = speed * math.cos(error), second
        return velocity_along(error, max(speed, CREEP))

    def _gone_round(self, view: View, memory: DWAMemory) -> float:
        """How far it has turned to the side of the goal, which has been on that side all the while [rad]; left is positive.

        Once round it is to face the goal before it counts anew.
        """
        if abs(memory.round) >= 2.0 * math.pi:
            return memory.round if abs(view.goal_bearing) > FACED else 0.0
        turned, side = wrap(view.heading - memory.pose[2]), view.goal[1]
        return memory.round + turned if turned * side >= 0.0 and memory.round * side >= 0.0 else 0.0

    def _steered(self, view: View, memory: DWAMemory, speeds: F64, scores: F64, chosen: Velocity) -> Velocity:
        """What an ackermann robot goes toward: along what was chosen (`arc`), or about, in several moves."""
        memory.velocity = chosen
        is_stuck = self._is_stuck(view, memory, speeds, scores) or (
            memory.side != 0 and not self._gets_on(view, chosen)
        )
        memory.is_free = not is_stuck and chosen[0] > 0.0
        if is_stuck:
            memory.mode = "turning"
            return velocity_along(memory.side * 0.5 * math.pi, CREEP)
        memory.mode, memory.side = "driving", 0
        return velocity_along(view.goal_bearing, max(chosen[0], CREEP))

    def _gets_on(self, view: View, chosen: Velocity) -> bool:
        """Whether an arc leads farther than the robot needs to turn in: a turn of several moves is not broken off before."""
        speed, rate = chosen
        if speed <= LEAST * self.sensors.drive.max_speed:
            return False
        x, y = view.points
        need = min(2.0 * self.sensors.drive.least_bend, view.goal_distance)
        margin = self.window.radius - self.sensors.radius
        return bool(kernels.free_arc(x, y, self.sensors.circles, margin, 1, rate / speed, need) >= need)

    def arc(self, view: View, memory: DWAMemory) -> Velocity | None:
        """What was chosen, for an ackermann robot."""
        return memory.velocity if memory.is_free else None

    def _reachable(self, view: View) -> tuple[F64, F64]:
        """Speeds (v,) and turn rates or directions (w,) of the window; standing is one of them."""
        own, drive = math.hypot(*view.own_velocity), self.sensors.drive
        change = drive.max_acceleration * drive.step
        # A goal nearer than a step at full speed is not driven past.
        most = min(drive.max_speed, own + change, max(view.goal_distance / drive.step, CREEP))
        least = max(own - change, 0.0)
        speeds = np.concatenate([[0.0], np.linspace(min(least, most), most, SPEEDS + 1)[1:]])
        if self.is_holonomic:
            directions = view.goal_bearing + 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
            return speeds, directions
        if self.window.is_steered:
            most_bent = 1.0 / drive.least_bend
            through = 2.0 * view.goal[1] / max(view.goal_distance**2, 1e-6)  # the arc that meets the goal
            return speeds, _with(np.linspace(-most_bent, most_bent, RATES), through)
        exact = min(max(self.gain * view.goal_bearing, -self.window.turn_rate), self.window.turn_rate)
        return speeds, _with(np.linspace(-self.window.turn_rate, self.window.turn_rate, RATES), exact)

    def _within_reach(self, view: View, speeds: F64, seconds: F64, scores: F64) -> F64:
        """The scores (v, w) without velocities slower than the robot can come to, unless all that is left is to brake.

        A robot that turns goes ahead by the cosine of its heading error: slower than it is steered with.
        """
        drive = self.sensors.drive
        least = math.hypot(*view.own_velocity) - drive.max_acceleration * drive.step
        share = np.ones(len(seconds)) if self.is_holonomic else np.cos(seconds / self.gain)
        reached = np.where(speeds[:, None] * share >= least - ROUNDED, scores, -math.inf)
        return reached if np.isfinite(reached).any() else scores

    def _is_stuck(self, view: View, memory: DWAMemory, speeds: F64, scores: F64) -> bool:
        """Whether no velocity gets the robot on though it looks at the goal; it goes on turning until one does."""
        moves = speeds >= LEAST * self.sensors.drive.max_speed
        if not moves.any() or np.isfinite(scores[moves]).any():
            return False
        if memory.side == 0:
            memory.side = self._freer_side(view)
        return True

    def _freer_side(self, view: View) -> int:
        """Which way to turn: to the nearest bearing with room for a look, or as far as the goal; else with the most room.

        Where that is as far round on both sides, the goal's side, and left of one straight ahead or behind.
        """
        turns = np.linspace(0.0, BEHIND, 16)
        left = view.free_distances(turns, self.window.radius)
        right = view.free_distances(-turns, self.window.radius)
        room = min(self.window.look, view.goal_distance, max(left.max(), right.max())) - ALIKE
        to_left, to_right = (min(turns[free >= room], default=math.inf) for free in (left, right))
        if to_left != to_right:
            return 1 if to_left < to_right else -1
        return -1 if view.goal[1] < -ALIKE else 1

    def draw(self, memory: DWAMemory) -> Drawing:
        """The way that was chosen, for a second and a half."""
        x, y, heading = memory.pose
        speed, second = memory.velocity
        times = np.linspace(0.0, 1.5, 13)
        if self.is_holonomic:
            heading, turned = heading + second, 0.0 * times
        else:
            turned = second * times
        along = heading + 0.5 * turned
        chord = speed * times * np.sinc(0.5 * turned / np.pi)
        places = np.stack([x + chord * np.cos(along), y + chord * np.sin(along)], axis=1).tolist()
        return Drawing(segments=[(*a, *b, "path") for a, b in zip(places[:-1], places[1:], strict=True)])


def _with(rates: F64, exact: float) -> F64:
    """Turn rates or curvatures (w,) from least to most; that which leads to the goal is one, in the place of the nearest."""
    exact = min(max(exact, rates[0]), rates[-1])
    rates[int(np.abs(rates - exact).argmin())] = exact
    return rates


def smoothed(scores: F64, *, is_round: bool) -> F64:
    """The mean of each score and those beside it; one that is no velocity stays none and counts for nothing.

    Args:
        scores: (v, w), minus infinity where there is no velocity.
        is_round: whether the last column lies beside the first.
    """
    known = np.isfinite(scores)
    worth = np.where(known, scores, 0.0)
    padded, there = (_bordered(one, is_round=is_round) for one in (worth, known.astype(float)))
    total, count = np.zeros_like(scores), np.zeros_like(scores)
    rows, columns = scores.shape
    for i in range(3):
        for j in range(3):
            total += padded[i : i + rows, j : j + columns]
            count += there[i : i + rows, j : j + columns]
    return np.where(known, total / np.maximum(count, 1.0), -np.inf)


def _bordered(table: F64, *, is_round: bool) -> F64:
    """A table (v + 2, w + 2) with zeros around, or beside its first and last columns each other's."""
    wide = np.pad(table, ((1, 1), (1, 1)))
    if is_round:
        wide[1:-1, 0], wide[1:-1, -1] = table[:, -1], table[:, 0]
    return wide
