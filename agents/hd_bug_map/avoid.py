"""The map planner avoids what moves: two velocities, one held after the other, are judged in sampled futures of movers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.agents.hd_bug.frames import direction_to, in_odometry
from bug_gym.agents.hd_bug.futures import Futures, sample_futures
from bug_gym.agents.hd_bug.roll_out import Movers, Velocities
from bug_gym.agents.hd_bug.sequences import Sequences, Surroundings, judge_sequences
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import HDBugMapParameters, Measures
from bug_gym.agents.hd_bug_map.perceive import Scene
from bug_gym.agents.hd_bug_map.poses import TURNING
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.geometry import F64
from bug_gym.view import Sensors

FIRST: F64 = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
"""Headings of the first velocities, from that of the way on [rad]."""

SECOND: F64 = FIRST[::2]
"""Headings of the second ones [rad]: those of the first, so that what may be planned for later may be done now."""

PACES = (1.0, 0.5)
"""Speeds of the first velocities, as shares of the top speed; it may also stand."""

HELD = 0.4
"""How long the first velocity is held [s]."""

HIT, HABIT = 24.0, 0.1
"""Weights of a hit [m], and of a turn [m/rad]."""


class Proposal(NamedTuple):
    """A first velocity from elsewhere, such as a network's; a speed below 0 is straight back."""

    direction: float
    """Where the robot faces as it is held [rad]."""
    speed: float
    """[m/s]."""
    credit: float
    """By so much it may cost more than the cheapest sequence, and is driven all the same [m]."""


class Chosen(NamedTuple):
    """What is to be driven among movers."""

    direction: float
    """[rad]."""
    speed: float
    """[m/s]."""
    is_proposed: bool
    """Whether it is what was proposed."""


class Near(NamedTuple):
    """The movers that could be met within the horizon."""

    movers: Movers
    """Where they are predicted."""
    futures: Futures
    """Where they may be."""


class Avoidance:
    """The choice of a velocity among movers.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of the policy.
        measures: of the robot.
    """

    def __init__(self, sensors: Sensors, parameters: HDBugMapParameters, measures: Measures) -> None:
        self.parameters = parameters
        self.measures = measures
        self.drive = sensors.drive
        self.spacing = max(0.1, sensors.drive.step)
        """Time between two that are looked at [s]."""
        count = max(round(parameters.horizon / self.spacing), 2)
        self.times: F64 = self.spacing * np.arange(1, count + 1, dtype=np.float64)
        """The times up to the horizon (K,) [s]."""
        self.held = min(max(round(HELD / self.spacing), 1), count - 1)
        """For how many of them the first velocity is held."""
        self.speeds: F64 = np.append(np.repeat(measures.top * np.array(PACES), len(FIRST)), 0.0)
        """Speeds of the first velocities [m/s]."""
        farthest = measures.top * count * self.spacing
        self.second = Velocities(
            np.append(SECOND, 0.0),
            np.append(np.full(len(SECOND), measures.top), 0.0),
            np.full(len(SECOND) + 1, farthest),
        )
        """The second velocities; their headings are counted from where the way then leads."""

    def near_movers(self, scene: Scene, predictor: Predictor) -> Near | None:
        """The movers that could be met within the horizon; None: there are none."""
        tracks, parameters = scene.tracks, self.parameters
        if not tracks.moving.any():
            return None
        gaps = np.hypot(*(tracks.position - np.array(scene.view.position)).T) - tracks.radius - self.measures.radius
        closing = (np.hypot(*tracks.velocity.T) + self.measures.top) * parameters.horizon + parameters.margin
        near = np.flatnonzero(tracks.moving & (gaps < closing))
        if len(near) == 0:
            return None
        chosen = tracks.select(near)
        radii = chosen.radius[:, None] + parameters.spread * self.times[None, :]
        places = predictor.predict(chosen, self.times).places
        where = chosen.position, chosen.velocity
        futures = sample_futures(chosen.id, *where, places, radii, self.spacing, parameters.mover_turns)
        return Near(Movers(places, radii), futures)

    def avoid(
        self, scene: Scene, memory: HDBugMapMemory, way: Way, near: Near, proposal: Proposal | None = None
    ) -> Chosen:
        """The first velocity of the sequence that costs least among movers, or the one proposed."""
        memory.mode, memory.forecast = "avoidance", near.movers.places
        first = self._first_velocities(scene, way)
        proposed = None
        if proposal is not None and proposal.speed >= 0.0:
            proposed = len(first.directions)
            first = joined(first, self._proposed(scene, proposal))
        behind = self._back_out(scene)
        if behind is not None:
            first = joined(first, behind)
            if proposal is not None and proposal.speed < 0.0:
                proposed = len(first.directions) - 1
        found = self._judge(scene, memory, way, near.futures, first, is_backing=behind is not None)
        costs = self._costs(scene, way, found)
        second = costs.argmin(axis=1)
        number = np.arange(len(second))
        turned = np.abs(np.angle(np.exp(1j * (first.directions - memory.direction))))
        cost = costs[number, second] + self.parameters.beta * HABIT * turned
        if proposed is not None and proposal is not None:
            cost[proposed] = costs[proposed].min() - proposal.credit  # who proposes has habits of its own
        best = int(cost.argmin())
        memory.is_backing = behind is not None and best == len(cost) - 1
        memory.candidates, memory.costs = found.end[number, second], cost
        memory.chosen = float(memory.candidates[best, 0]), float(memory.candidates[best, 1])
        speed = min(float(first.speeds[best]), float(first.free[best]) / self.drive.step)
        return Chosen(float(first.directions[best]), max(speed, TURNING), best == proposed)

    def _first_velocities(self, scene: Scene, way: Way) -> Velocities:
        """Headings about the next node at each pace, and to stand and turn toward it."""
        toward = direction_to(scene.view, way.places[1])
        directions = toward + FIRST
        free = np.maximum(scene.light.free(directions - scene.view.heading), 0.0)
        return Velocities(
            np.append(np.tile(directions, len(PACES)), toward), self.speeds, np.append(np.tile(free, len(PACES)), 0.0)
        )

    @staticmethod
    def _proposed(scene: Scene, proposal: Proposal) -> Velocities:
        """What is proposed, as far as it is free."""
        direction = np.array([proposal.direction])
        free = np.maximum(scene.light.free(direction - scene.view.heading), 0.0)
        return Velocities(direction, np.array([proposal.speed]), free)

    def _back_out(self, scene: Scene) -> Velocities | None:
        """To drive straight back; None for a robot that doesn't, or has no room to."""
        speed = self.drive.max_reverse
        if self.drive.kinematics == "holonomic" or speed <= 0.0:
            return None
        direction = np.array([scene.view.heading + math.pi])
        free = scene.light.free(direction - scene.view.heading)
        if free[0] < speed * self.drive.step:
            return None
        # That there is room for a step has been looked at.
        return Velocities(direction, np.array([speed]), np.array([np.inf]))

    def _judge(
        self,
        scene: Scene,
        memory: HDBugMapMemory,
        way: Way,
        futures: Futures,
        first: Velocities,
        *,
        is_backing: bool,
    ) -> Sequences:
        """What comes of each first velocity (m,) and each second one (n,)."""
        view, light, cells = scene.view, scene.light, scene.grid.cells
        x, y = in_odometry(view.pose, np.column_stack([light.x, light.y])).T
        # As far as it goes in a step it may go past a goal that is nearer than that.
        near_goal = max(memory.goal_radius, 0.5 * self.measures.top * self.spacing)
        around = Surroundings(
            np.ascontiguousarray(x),
            np.ascontiguousarray(y),
            light.radius,
            way.places[1:],
            memory.goal,
            near_goal,
            (cells.x, cells.y),
            cells.size,
            cells.blocked,
        )
        return judge_sequences(
            self.drive,
            view.pose,
            self.measures.radius,
            first,
            is_backing,
            self.held,
            self.second,
            around,
            futures,
            self.parameters.margin,
            self.spacing,
        )

    def _costs(self, scene: Scene, way: Way, found: Sequences) -> F64:
        """Costs (m, n) of the sequences: what is left to go, and the risk [m]."""
        ends = found.end.reshape(-1, 2)
        straight_back = np.hypot(*(ends - scene.view.position).T) + float(way.rest[0])
        rest = np.minimum(scene.grid.rest_distances(ends, way), straight_back).reshape(found.risk.shape)
        rest = np.where(found.early > 0.0, -self.measures.top * found.early, rest)
        cost: F64 = self.parameters.alpha * rest + self.parameters.beta * HIT * found.risk
        return cost


def joined(first: Velocities, more: Velocities) -> Velocities:
    """Some velocities and more of them."""
    return Velocities(*map(np.concatenate, zip(first, more, strict=True)))
