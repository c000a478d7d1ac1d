"""The map planner avoids what moves: candidate velocities are rolled out against what is predicted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bug_gym.agents.hd_bug.frames import direction_to, in_odometry
from bug_gym.agents.hd_bug.roll_out import Movers, RollOut, Velocities, roll_out
from bug_gym.agents.hd_bug.sudden_turns import Turning, turn_risks, turning
from bug_gym.agents.hd_bug_map.follow_way import HEADINGS
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import HDBugMapParameters, Measures
from bug_gym.agents.hd_bug_map.perceive import Scene
from bug_gym.agents.hd_bug_map.poses import TURNING
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.geometry import F64
from bug_gym.view import Sensors

RINGS = 4
"""Speeds of the candidates at each heading, beside to stand."""

SHADOW_RISK, SHADOW_SPEED, SHADOW_STEPS = 0.5, 0.3, 10
"""Weight of what may come out of the shadow [m], how fast it comes [m/s], and for how many steps it is feared."""

RISK, HABIT, CONTACT = 6.0, 0.1, 2.0
"""Weights of a near miss [m], of a turn [m/rad], and of a contact, for each second that it comes sooner [m/s]."""

TURN_RISK = 12.0
"""Weight of the chance to be hit by a mover that turns [m]."""


class Near(NamedTuple):
    """The movers that could be met within the horizon."""

    movers: Movers
    """Where they are predicted."""
    turning: Turning
    """Where they may turn."""


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
        self.backward = replace(sensors.drive, kinematics="holonomic")
        """The robot as it drives straight back."""
        self.spacing = max(0.1, sensors.drive.step)
        """Time between two that are looked at [s]."""
        count = max(round(parameters.horizon / self.spacing), 2)
        self.times: F64 = self.spacing * np.arange(1, count + 1, dtype=np.float64)
        """The times up to the horizon (K,) [s]."""
        self.speeds: F64 = np.tile(measures.top * np.arange(1, RINGS + 1) / RINGS, len(HEADINGS))
        """Speed of each candidate that goes on [m/s]."""

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
        places, speeds = predictor.predict(chosen, self.times).places, np.hypot(*chosen.velocity.T)
        may_turn = turning(chosen.position, chosen.radius, speeds, places, self.spacing, parameters.mover_turns)
        return Near(Movers(places, radii, parameters.margin), may_turn)

    def avoid(self, scene: Scene, memory: HDBugMapMemory, way: Way, near: Near) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] of the candidate velocity that costs least among movers."""
        memory.mode, memory.forecast = "avoidance", near.movers.places
        behind = self._back_out(scene)
        velocities, result = self._roll_out(scene, memory, way, near.movers, behind)
        cost = self._costs(scene, memory, way, velocities, result)
        if self.parameters.mover_turns > 0.0:
            cost += self.parameters.beta * TURN_RISK * self._turn_risks(scene, velocities, behind, near.turning)
        best = int(cost.argmin())
        memory.is_backing = behind is not None and best == len(cost) - 1
        memory.candidates, memory.costs = result.end, cost
        memory.chosen = float(result.end[best, 0]), float(result.end[best, 1])
        speed = min(float(velocities.speeds[best]), float(velocities.free[best]) / self.drive.step)
        return float(velocities.directions[best]), max(speed, TURNING)

    def _roll_out(
        self, scene: Scene, memory: HDBugMapMemory, way: Way, movers: Movers, behind: Velocities | None
    ) -> tuple[Velocities, RollOut]:
        """The candidate velocities, the one straight back as the last of them, and what comes of each."""
        pose, radius = scene.view.pose, self.measures.radius
        compare = min(max(round(scene.light.reach / self.measures.top / self.spacing), 3), len(self.times)) - 1
        velocities = self._velocity_candidates(scene, memory, way)
        result = roll_out(self.drive, pose, radius, velocities, movers, self.times, compare)
        if behind is None:
            return velocities, result
        back = roll_out(self.backward, pose, radius, behind, movers, self.times, compare)
        # That there is room for a step has been looked at.
        behind = behind._replace(free=np.array([np.inf]))
        return (
            Velocities(*map(np.concatenate, zip(velocities, behind, strict=True))),
            RollOut(*map(np.concatenate, zip(result, back, strict=True))),
        )

    def _turn_risks(self, scene: Scene, velocities: Velocities, behind: Velocities | None, turning: Turning) -> F64:
        """Chance (m,) to be hit by a mover that turns; the last candidate is the one straight back, if there is one."""
        pose, radius = scene.view.pose, self.measures.radius
        risks = turn_risks(self.drive, pose, radius, velocities, turning)
        if behind is not None:
            risks[-1:] = turn_risks(self.backward, pose, radius, behind, turning)
        return risks

    def _velocity_candidates(self, scene: Scene, memory: HDBugMapMemory, way: Way) -> Velocities:
        """The candidates among movers: headings about the next node at each speed, and to stand."""
        directions = direction_to(scene.view, way.places[1]) + HEADINGS
        free = np.maximum(scene.light.free(directions - scene.view.heading), 0.0)
        return Velocities(
            np.append(np.repeat(directions, RINGS), memory.direction),
            np.append(self.speeds, 0.0),
            np.append(np.repeat(free, RINGS), 0.0),
        )

    def _back_out(self, scene: Scene) -> Velocities | None:
        """To drive straight back; None for a robot that doesn't, or has no room to."""
        speed = self.drive.max_reverse
        if self.drive.kinematics == "holonomic" or speed <= 0.0:
            return None
        direction = np.array([scene.view.heading + math.pi])
        free = scene.light.free(direction - scene.view.heading)
        if free[0] < speed * self.drive.step:
            return None
        return Velocities(direction, np.array([speed]), free)

    def _costs(self, scene: Scene, memory: HDBugMapMemory, way: Way, velocities: Velocities, result: RollOut) -> F64:
        """Costs (m,) of the candidate velocities: what is left to go, and the risk [m]."""
        parameters, ends = self.parameters, result.end
        straight_on = np.hypot(*(ends - scene.view.position).T) + float(way.rest[0])
        rest = np.minimum(scene.grid.rest_distances(ends, way), straight_on)
        turned = np.abs(np.angle(np.exp(1j * (velocities.directions - memory.direction))))
        cost: F64 = parameters.alpha * rest + parameters.beta * (RISK * result.nearness + HABIT * turned)
        cost += CONTACT * np.where(np.isfinite(result.contact), parameters.horizon - result.contact, 0.0)
        if parameters.use_shadow:
            cost += parameters.beta * SHADOW_RISK * self._shadow_risk(scene, velocities)
        return cost

    def _shadow_risk(self, scene: Scene, velocities: Velocities) -> F64:
        """Nearness (m,) to movers that could come out of the shadow beside the ends of what is seen."""
        view, light = scene.view, scene.light
        edges = light.edges()
        edges = edges[np.hypot(*edges.T) < light.reach]
        if len(edges) == 0:
            return np.zeros(len(velocities.directions))
        times = self.times[:SHADOW_STEPS]
        places = np.repeat(in_odometry(view.pose, edges)[:, None], len(times), axis=1)
        radii = np.tile(SHADOW_SPEED * times, (len(edges), 1))
        hidden = Movers(places, radii, self.parameters.margin)
        return roll_out(self.drive, view.pose, self.measures.radius, velocities, hidden, times, 0).nearness
