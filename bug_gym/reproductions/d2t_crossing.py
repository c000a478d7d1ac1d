"""The paper's dynamic scene: across the beach, and two pedestrians who cross the planned way one after the other.

The paper reports that the robot slows down first, keeps about 1.2 m, deviates less for the second and comes back to the
way smoothly. It does not say between what the 1.2 m are; here the robot is asked to keep them between the bodies.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from bug_gym.agents import make_policy
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.route import distances_to_chain
from bug_gym.config import load
from bug_gym.geometry import F64
from bug_gym.reproductions import d2t_worlds
from bug_gym.simulation import Simulation

GAP = 1.2
"""Asked for between robot and pedestrian [m]."""
DRIVER: dict[str, Any] = {"name": "d2t_eaco", "parameters": {"mover_margin": GAP, "optimiser": "eaco_refined"}}
"""Who drives, as a policy of a suite."""
TURNED, SLOWED = math.radians(5.0), 0.95
"""A robot has turned by more than this, and slowed down below this share of its speed."""
ENOUGH_STEPS = 2500


class Crossing(NamedTuple):
    """What was seen."""

    outcome: str
    gap: float
    """Least distance between robot and pedestrians, surface to surface [m]."""
    between_centres: float
    """The same between centres [m]."""
    slowed: int
    """Step at which it slowed down first."""
    turned: int
    """Step at which it turned first."""
    deviations: tuple[float, float]
    """Greatest distance from the way at the first and at the second [m]."""


def crossings() -> list[float]:
    """How far from the start the walkers cross the straight way to the goal, one after the other [m]."""
    world: Any = load(d2t_worlds.BEACH).world
    return [mover.at[1] - world.start[1] for mover in world.movers]


def cross() -> Crossing:
    """Drive once."""
    simulation = Simulation(d2t_worlds.BEACH)
    policy = make_policy(DRIVER["name"], simulation, **DRIVER["parameters"])
    observation, state = simulation.reset(seeds=[0]), None
    live = Maps(simulation).of_robot(0)
    places, gaps, centres = [], [], []
    way: F64 | None = None
    for _ in range(ENOUGH_STEPS):
        action, state = policy.predict(observation[:, 0], state)
        assert state is not None
        way = state[0].route.places if way is None else way
        step = simulation.step(action[:, None])
        observation = step.observation
        moving = live.movers()
        away = np.hypot(*(moving.discs[:, :2] - live.pose[:2]).T)
        places.append(live.pose[:2])
        centres.append(float(away.min()))
        gaps.append(float((away - moving.discs[:, 2]).min()) - d2t_worlds.RADIUS)
        if step.terminated.any() or step.truncated.any():
            break
    assert way is not None
    return seen(np.array(places), way, min(gaps), min(centres), str(simulation.info()["outcome"][0, 0]))


def seen(places: F64, way: F64, gap: float, between: float, outcome: str) -> Crossing:
    """What a drive (t, 2) along a planned way (k, 2) shows."""
    from_way = distances_to_chain(way, places)
    steps = np.diff(places, axis=0)
    speed = np.hypot(*steps.T) / 0.1
    near = [np.abs(places[:, 0] - ahead) < 8.0 for ahead in crossings()]
    first = int(np.flatnonzero(near[0])[0])
    heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))[first:]
    turned = int(np.argmax(np.abs(heading - heading[0]) > TURNED))
    slowed = int(np.argmax(speed[first:] < SLOWED))
    deviations = tuple(float(from_way[mask].max()) for mask in near)
    return Crossing(outcome, gap, between, slowed, turned, (deviations[0], deviations[1]))
