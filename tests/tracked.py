"""Episodes of a robot that tracks what it sees."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from bug_gym.agents import make_policy
from bug_gym.agents.tracking.layout import CLUES
from bug_gym.agents.tracking.motion import Network
from bug_gym.agents.tracking.tracker import Tracker, Tracks
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

STEP = 0.1


def world_of(
    movers: list[dict[str, Any]], *, beams: int = 180, noise: float = 0.0, circles: Any = (), **world: Any
) -> dict[str, Any]:
    """A scenario of movers about a robot at the origin, which is also the frame of its start."""
    return {
        "name": "movers",
        "lidar": {"beams": beams, "range": 10.0, "noise": noise},
        "time": {"step": STEP, "limit": 60.0},
        "world": {
            "family": "explicit",
            "bounds": [-12.0, -12.0, 12.0, 12.0],
            "circles": list(circles),
            "movers": movers,
            "start": [0.0, 0.0, 0.0],
            "goal": [11.0, 11.0],
            **world,
        },
    }


def disc(at: tuple[float, float], velocity: tuple[float, float], radius: float = 0.3) -> dict[str, Any]:
    """A disc that goes straight until it meets the border."""
    return {"shape": {"circle": radius}, "at": list(at), "motion": {"law": "bounce", "velocity": list(velocity)}}


def constant_network(log_odds: float, gate: float = math.inf) -> Network:
    """A tracker's network that says the same of everything."""
    first, second = (np.zeros((CLUES, 1)), np.zeros(1)), (np.zeros((1, 1)), np.zeros(1))
    return Network(*first, *second, np.zeros((1, 2)), np.array([log_odds, gate]))


def track(
    scenario: Any,
    seconds: float,
    *,
    seed: int = 0,
    policy: str | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> Iterator[tuple[Simulation, View, Tracks]]:
    """Steps of an episode with what a tracker makes of them; without a policy the robot stands."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    agent = make_policy(policy, simulation) if policy else None
    observation = simulation.reset(seeds=[seed])
    sensors = Sensors.of(simulation.scenario)
    tracker, state = Tracker(sensors), None
    memory = tracker.start()
    steps = round(seconds / simulation.scenario.time.step)
    for number in range(steps + 1):
        view = View(observation[0, 0], sensors)
        yield simulation, view, tracker.update(memory, view, float(simulation.world.time[0]))
        if number == steps:
            return
        action = np.zeros((1, 2))
        if agent is not None:
            action, state = agent.predict(observation[:, 0], state)
        step = simulation.step(action[:, None])
        observation = step.observation
        if step.terminated.any() or step.truncated.any():
            return


def last_tracks(scenario: Any, seconds: float, **options: Any) -> Tracks:
    """The tracks at the end of an episode."""
    *_, (_, _, tracks) = track(scenario, seconds, **options)
    return tracks
