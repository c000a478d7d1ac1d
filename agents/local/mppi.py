"""MPPI: many plans drawn about the last one are tried in a model, and weighed by what comes of them.

Source: Williams, Wagener, Goldfain, Drews, Rehg, Boots and Theodorou (2017), "Information Theoretic MPC for Model-Based
Reinforcement Learning", algorithm 2: a plan u is changed by noise, each sample k costs S_k, and the next plan is
u + sum_k w_k e_k with w_k = exp(-(S_k - min S) / lambda) / (their sum). Williams, Drews, Goldfain, Rehg and Theodorou
(2018), "Information-Theoretic Model Predictive Control", for the share of lambda that a plan's own size costs. Beside the
noise some samples are plain ways, held all the time (as Trevisan and Alonso-Mora 2024, "Biased-MPPI", do with other
controllers' plans), for which nothing is charged: noise alone seldom turns a robot
round. The model is a Simulation of what has been seen (known_world.py).

Sensing assumed: the scan, the goal; movers through the tracker (agents/tracking). Memory kept: the plan, points of still
things, the tracks. States: planning. Guarantee: none; it looks a horizon ahead, so that what has to be gone back from
(u_trap) holds it for ever. Length: no bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from bug_gym.agents.local.known_world import KnownWorld, RollOut, Worth
from bug_gym.agents.local.navigator import in_robot_frame
from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.movers import beams_on_still, forget_movers
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.parameters import AtMost, Length, Weight
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory, Tracks
from bug_gym.geometry import F64, velocity_along
from bug_gym.kinematics import TURN_GAIN, TURN_IN_PLACE, Drive
from bug_gym.manoeuvring import sees_behind
from bug_gym.policy import CREEP, Drawing, Memory, ScriptedPolicy, Velocity, braking_radius
from bug_gym.view import Sensors, View

KNOTS = 6
"""Controls of a plan, evenly spread over the horizon; between them it is straight."""
STEPS = 16
"""Steps of the model over the horizon."""
CELL = 0.12
"""Still points are remembered no denser than this [m]."""
MOST_DISCS = 96
"""Of the still points so many are planned with, the nearest."""
GROWN = 0.06
"""Radius of the disc that stands for a still point [m]: what it belongs to lies about it."""
MOVER_GROWN = 0.15
"""What a mover is larger by, as nobody knows where it will turn [m]."""
ROOM = 0.01
"""What the first step of a plan keeps from the scan [m]."""
CONTACT_WEIGHT = 20.0
"""What a second of the horizon after a contact costs, in metres farther from the goal for as long [m]."""
LEAST: dict[str, float] = {
    "samples": 1,
    "iterations": 1,
    "horizon": 0.01,
    "temperature": 1e-6,
    "noise": 1e-3,
    "control_weight": 0.0,
    "keep": 1e-6,
    "clearance_weight": 0.0,
    "seed": 0,
}
"""The least value of each parameter."""
SHOWN = 24
"""Sampled ways that a picture shows."""


@dataclass
class MPPIMemory(Memory):
    """Memory of MPPI."""

    tracker: TrackerMemory | None = None
    """The tracks."""
    map: PointMap | None = None
    """Points of what stands, odometry frame."""
    plan: F64 | None = None
    """Controls (KNOTS, 2) to come, see Controls."""
    steps: int = 0
    """Decisions so far."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the last plan was made, odometry frame."""
    ways: F64 | None = None
    """Some ways that were tried there (STEPS + 1, n, 2), the chosen one last, robot's frame [m]."""
    control: tuple[float, float] = (0.0, 0.0)
    """The first of the plan, see Controls."""


@dataclass(frozen=True)
class MPPIParameters:
    """Parameters of MPPI."""

    samples: Annotated[int, AtMost(10_000)] = 256
    """K, plans that are tried for a decision."""
    iterations: Annotated[int, AtMost(20)] = 1
    """How often a decision draws and weighs."""
    horizon: Length = 2.5
    """How far ahead it plans [s]."""
    temperature: Annotated[float, AtMost(1e6)] = 0.05
    """lambda: a sample that costs so much more has 1/e of the weight [m s]."""
    noise: Annotated[float, AtMost(100.0)] = 0.4
    """Standard deviation of the noise, as a share of the greatest control."""
    control_weight: Weight = 0.01
    """Share of lambda that a plan's own size costs (1 - alpha)."""
    keep: Length = 0.4
    """A clearance below this costs [m]."""
    clearance_weight: Weight = 3.0
    """What a second at clearance 0 costs, in metres farther from the goal for as long [m]."""
    seed: Annotated[int, AtMost(2**63 - 1)] = 0
    """Of the noise, with the number of the decision."""

    def __post_init__(self) -> None:
        for name, least in LEAST.items():
            if not least <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be at least {least:g}, got {getattr(self, name)!r}")


class MPPI(ScriptedPolicy):
    """Model predictive path integral control.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a parameter below its least value.
    """

    Parameters = MPPIParameters
    parameters: MPPIParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        self.controls = Controls(sensors.drive, own.horizon, may_back=sees_behind(sensors))
        self.plain = self.controls.plain_plans()
        worth = Worth(own.keep, own.clearance_weight, CONTACT_WEIGHT)
        count = own.samples + len(self.plain)
        self.model = KnownWorld(sensors, count, STEPS, own.horizon / STEPS, worth)
        self.tracker = Tracker(sensors)
        self.search = Search()

    def start(self) -> MPPIMemory:
        """Memory of a new episode."""
        return MPPIMemory(mode="planning", tracker=self.tracker.start(), plan=np.zeros((KNOTS, 2)))

    def act(self, view: View, memory: MPPIMemory) -> Velocity:
        """One decision."""
        assert memory.tracker is not None and memory.plan is not None
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        moving = tracks.moving
        movers = in_robot_frame(view, tracks.position[moving], tracks.velocity[moving], tracks.radius[moving])
        movers[:, 4] += MOVER_GROWN
        self.model.begin(view, self._still(view, memory, tracks), movers)
        plan, tried = memory.plan, None
        for iteration in range(self.parameters.iterations):
            number = memory.steps * self.parameters.iterations + iteration
            plan, tried, best = self.improved(plan, number)
        assert tried is not None
        chosen = self.model.try_one(self.controls.actions(plan[None]))
        if chosen.touches[0] and not tried.touches[tried.costs.argmin()]:
            # The mean of two ways round a thing leads into it.
            plan = best
        memory.steps += 1
        memory.pose, memory.ways = view.pose, np.concatenate([tried.places, chosen.places], axis=1)
        first, second = plan[0].tolist()
        memory.control, memory.plan = (first, second), self.controls.later(plan)
        return self._free(view, self.controls.velocity(plan[0]))

    def arc(self, view: View, memory: MPPIMemory) -> Velocity | None:
        """What the plan begins with, for an ackermann robot."""
        return self.controls.arc(memory.control)

    def improved(self, plan: F64, number: int) -> tuple[F64, RollOut, F64]:
        """A plan (KNOTS, 2) after one iteration: draw, try in the model as it stands, weigh.

        Args:
            plan: the one before.
            number: of the draw.

        Returns:
            The weighted mean, what came of the samples, and the best of these.
        """
        own = self.parameters
        drawn = np.random.Generator(np.random.Philox(key=np.array([own.seed, number], dtype=np.uint64)))
        noise = own.noise * drawn.standard_normal((own.samples, KNOTS, 2))
        noise[0] = 0.0  # the plan itself
        samples = np.concatenate([self.controls.limited(plan + noise), self.plain])
        tried = self.model.try_all(self.controls.actions(samples), min(SHOWN, len(samples)))
        costs = tried.costs.copy()
        size = ((samples[: own.samples] - plan) * plan).sum(axis=(1, 2)) / (own.noise * own.noise)
        costs[: own.samples] += own.temperature * own.control_weight * size
        weights = weights_of(costs, own.temperature)
        mean = np.tensordot(weights, samples, axes=1)
        return mean, tried, samples[tried.costs.argmin()]

    def _still(self, view: View, memory: MPPIMemory, tracks: Tracks) -> F64:
        """Discs (n, 3) for the still points that a plan may meet, robot's frame [m]."""
        sensors, own = self.sensors, self.parameters
        if memory.map is None:
            memory.map = PointMap(view.position, sensors.range + 4.0, CELL, sensors.radius, self.search)
        is_still = beams_on_still(tracks)
        memory.map.add_scan(
            view.position, view.heading, sensors.angles, view.ranges, sensors.range, sensors.range_noise, is_still
        )
        forget_movers(memory.map, tracks)
        x, y = (memory.map.points() - view.position).T
        away = np.hypot(x, y)
        reach = sensors.drive.max_speed * own.horizon + sensors.radius + own.keep + GROWN
        near = np.argsort(away)[:MOST_DISCS]
        near = near[away[near] < reach]
        cos, sin = math.cos(view.heading), math.sin(view.heading)
        x, y = x[near], y[near]
        radii = np.full(len(near), GROWN + sensors.range_noise)
        return np.column_stack([cos * x + sin * y, cos * y - sin * x, radii])

    def _free(self, view: View, velocity: Velocity) -> Velocity:
        """The velocity, no faster than it leads up to what is seen in this step."""
        speed = math.hypot(*velocity)
        if speed <= CREEP or self.sensors.drive.kinematics != "holonomic":
            return velocity  # `brake` does as much for a robot that has to turn
        free = view.free_distance(math.atan2(velocity[1], velocity[0]), braking_radius(self.sensors) + ROOM)
        share = min(1.0, max(free - ROOM, 0.0) / (speed * self.sensors.drive.step))
        return share * velocity[0], share * velocity[1]

    def draw(self, memory: MPPIMemory) -> Drawing:
        """Some of the ways that were tried, and the chosen one."""
        if memory.ways is None:
            return Drawing()
        x, y, heading = memory.pose
        cos, sin = math.cos(heading), math.sin(heading)
        ways = memory.ways @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        segments = []
        for number in range(ways.shape[1]):
            label = "chosen" if number == ways.shape[1] - 1 else "candidate"
            places = ways[:, number].tolist()
            segments += [(*a, *b, label) for a, b in zip(places[:-1], places[1:], strict=True)]
        return Drawing(segments=segments)


def weights_of(costs: F64, temperature: float) -> F64:
    """Weights (K,) of samples, exp(-(S - min S) / lambda) over their sum.

    Args:
        costs: S (K,).
        temperature: lambda, above 0.
    """
    weights = np.exp((costs.min() - costs) / temperature)
    return np.asarray(weights / weights.sum())


class Controls:
    """Plans of a robot: KNOTS controls, pairs of shares of the greatest, and straight lines between them.

    Of a holonomic robot: the velocity ahead and to the left, together at most 1. Of a differential one: speed from 0 to 1,
    and turn rate from -1 to 1; who steers as bug_gym.kinematics goes ahead by the cosine of the heading error only. Of an
    ackermann one: speed from -1, back, to 1, and the steering angle from -1 to 1.

    Args:
        drive: the robot's limits.
        horizon: what a plan covers [s].
        may_back: whether an ackermann robot may drive backwards.
    """

    def __init__(self, drive: Drive, horizon: float, *, may_back: bool = True) -> None:
        self.drive = drive
        self.is_holonomic = drive.kinematics == "holonomic"
        self.is_steered = drive.kinematics == "ackermann"
        self.slowest = -1.0 if self.is_steered and may_back else 0.0
        self.gain = min(TURN_GAIN, 1.0 / drive.step)
        self.rate = min(drive.max_turn_rate, 0.999 * self.gain * TURN_IN_PLACE)
        """Largest turn rate at which it still drives ahead [rad/s]."""
        spacing = horizon / (KNOTS - 1)
        self._between = interpolation(np.linspace(0.5, STEPS - 0.5, STEPS) * horizon / STEPS / spacing)
        self._later = interpolation(np.linspace(0.0, KNOTS - 1.0, KNOTS) + drive.step / spacing)

    def limited(self, plans: F64) -> F64:
        """Plans (..., 2) cut to what the robot can do."""
        if self.is_holonomic:
            return np.asarray(plans / np.maximum(np.hypot(plans[..., :1], plans[..., 1:]), 1.0))
        turn = np.clip(plans[..., 1], -1.0, 1.0)
        if self.is_steered:
            return np.stack([np.clip(plans[..., 0], self.slowest, 1.0), turn], axis=-1)
        return np.stack([np.clip(plans[..., 0], 0.0, np.cos(turn * self.rate / self.gain)), turn], axis=-1)

    def actions(self, plans: F64) -> F64:
        """Actions (n, STEPS, 2) of plans (n, KNOTS, 2)."""
        controls = self._between @ plans
        if self.is_holonomic:
            return np.asarray(controls)
        top, back = self.drive.max_speed, self.drive.max_reverse
        if self.is_steered:
            speed = np.where(controls[..., 0] > 0.0, top, back) * controls[..., 0]
            return np.stack([2.0 * (speed + back) / (top + back) - 1.0, controls[..., 1]], axis=-1)
        forward = 2.0 * (top * controls[..., 0] + back) / (top + back) - 1.0
        turn = controls[..., 1] * self.rate / self.drive.max_turn_rate
        return np.stack([forward, turn], axis=-1)

    def velocity(self, control: F64) -> Velocity:
        """The velocity to ask for [m/s], robot's frame, so that it is driven as a control (2,) says."""
        first, second = control.tolist()
        if self.is_holonomic:
            return self.drive.max_speed * first, self.drive.max_speed * second
        if self.is_steered:
            return velocity_along(0.0 if first >= 0.0 else math.pi, max(abs(self.arc((first, second))[0]), CREEP))
        error = second * self.rate / self.gain
        return velocity_along(error, max(self.drive.max_speed * first / math.cos(error), CREEP))

    def arc(self, control: tuple[float, float]) -> Velocity:
        """Speed [m/s] and turn rate [rad/s] of an ackermann robot's control."""
        speed = control[0] * (self.drive.max_speed if control[0] > 0.0 else self.drive.max_reverse)
        return speed, speed * math.tan(control[1] * self.drive.max_steering) / self.drive.wheelbase

    def later(self, plan: F64) -> F64:
        """What is left of a plan (KNOTS, 2) a step of the robot later; it ends as it ended."""
        return np.asarray(self._later @ plan)

    def plain_plans(self) -> F64:
        """Plans (n, KNOTS, 2) that hold one control all the time."""
        if self.is_holonomic:
            angles = 2.0 * np.pi * np.arange(24) / 24
            held = np.concatenate([[[0.0, 0.0]], np.stack([np.cos(angles), np.sin(angles)], axis=1)])
        else:
            rates = np.linspace(-1.0, 1.0, 9)
            speeds = (*((-1.0,) if self.slowest < 0.0 else ()), 0.0, 0.5, 1.0)
            held = np.concatenate([[[speed, rate] for rate in rates] for speed in speeds])
        return np.repeat(self.limited(held)[:, None], KNOTS, axis=1)


def interpolation(at: F64) -> F64:
    """Matrix (n, KNOTS) that takes knots to straight lines between them, at places (n,) counted in knots."""
    within = np.minimum(at, KNOTS - 1.0)
    return np.maximum(1.0 - np.abs(within[:, None] - np.arange(KNOTS)), 0.0)
