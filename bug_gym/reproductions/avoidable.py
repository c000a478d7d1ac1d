"""Whether a collision among movers could have been avoided: the rule by which reproductions count it.

The episode is driven again up to two seconds before the collision. From that state 1,000 worlds go on, each with a
control sequence of its own: a desired velocity drawn anew every half second; 32 of them keep one direction at top speed,
and one stands. Movers go on by their laws, so those that look answer to what the robot does. The collision could have
been avoided when any of these robots is still whole a second after the time of the collision.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.config import Scenario, load
from bug_gym.kinematics import Drive, steering
from bug_gym.metrics import EpisodeRow
from bug_gym.observation import Sensors
from bug_gym.policy import Policy
from bug_gym.simulation import Simulation
from bug_gym.suites import PolicyEntry

BEFORE, AFTER = 2.0, 1.0
"""How long before the collision the sequences begin, and how long after it they end [s]."""
SEQUENCES = 1000
HOLD = 0.5
"""How long a sequence keeps a velocity [s]."""
DIRECTIONS = 32
"""Sequences that keep one direction at top speed."""


def is_avoidable(
    policy: str | Mapping[str, Any], scenario: str | Mapping[str, Any] | Scenario, row: EpisodeRow
) -> bool:
    """Whether any of the sequences survives.

    Args:
        policy: a name, or a mapping with `name` and `parameters`.
        scenario: of the episode.
        row: of the episode, which ended in a collision.

    Raises:
        ValueError: it ended otherwise.
    """
    if row.outcome != "collision":
        raise ValueError(f"the episode ended with {row.outcome!r}, not in a collision")
    described = load(scenario)
    step = described.time.step
    back = min(max(round(BEFORE / step), 1), row.steps)
    simulation = Simulation(described)
    simulation.reset(seeds=[row.seed])
    _drive(simulation, PolicyEntry.of(policy).make(simulation), row.steps - back)
    snapshot, seeded = simulation.save()
    many = Simulation(described, SEQUENCES)
    copies = snapshot._replace(
        floats=np.repeat(snapshot.floats, SEQUENCES, axis=0),
        ints=np.repeat(snapshot.ints, SEQUENCES, axis=0),
        observation=np.repeat(snapshot.observation, SEQUENCES, axis=0),
    )
    many.restore((copies, np.repeat(seeded, SEQUENCES)))
    drive = Sensors.of(described).drive
    rng = np.random.default_rng(row.seed)
    hold = max(round(HOLD / step), 1)
    whole = np.ones(SEQUENCES, dtype=np.bool_)
    velocities = first_velocities(drive, rng)
    for number in range(back + round(AFTER / step)):
        if number % hold == 0 and number:
            velocities[DIRECTIONS + 1 :] = drawn_velocities(drive, rng, SEQUENCES - DIRECTIONS - 1)
        headings = many.world.array("pose").reshape(SEQUENCES, -1, 3)[:, 0, 2]
        actions = np.stack([steering(drive, turned(v, h)) for v, h in zip(velocities, headings, strict=True)])
        many.step(actions[:, None])
        whole &= ~many.info()["collision"][:, 0]
        if not whole.any():
            return False
    return True


def _drive(simulation: Simulation, policy: Policy, steps: int) -> None:
    """Go on for so many steps of the first row."""
    state: tuple[Any, ...] | None = None
    for _ in range(steps):
        action, state = policy.predict(simulation.observations()[0, 0], state, deterministic=True)
        simulation.step(np.asarray(action)[None, None])


def first_velocities(drive: Drive, rng: np.random.Generator) -> NDArray[np.float64]:
    """Desired velocities (SEQUENCES, 2) in the world's frame: all directions at top speed, standing, and drawn ones."""
    angles = np.arange(DIRECTIONS) * (2.0 * math.pi / DIRECTIONS)
    straight = drive.max_speed * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([straight, np.zeros((1, 2)), drawn_velocities(drive, rng, SEQUENCES - DIRECTIONS - 1)])


def drawn_velocities(drive: Drive, rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Velocities (count, 2), evenly over the disc of what the robot can do."""
    angles = rng.uniform(-math.pi, math.pi, count)
    speeds = drive.max_speed * np.sqrt(rng.uniform(0.0, 1.0, count))
    return np.column_stack([speeds * np.cos(angles), speeds * np.sin(angles)])


def turned(velocity: NDArray[np.float64], heading: float) -> tuple[float, float]:
    """A velocity of the world's frame in that of a robot with this heading."""
    cos, sin = math.cos(heading), math.sin(heading)
    return float(cos * velocity[0] + sin * velocity[1]), float(cos * velocity[1] - sin * velocity[0])
