"""Whether a collision among movers could have been avoided: the rule by which reproductions count it.

The episode is driven again up to two seconds before the collision. From that state 1,000 worlds go on, each with a
control sequence of its own: a desired velocity drawn anew every half second; 32 of them keep one direction at top speed,
and one stands. Movers go on by their laws, so those that look answer to what the robot does. The collision could have
been avoided when any of these robots is still whole a second after the time of the collision. The sequences know the
future, and also avoid who steps out of nowhere: those are told apart by `appeared`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.config import Scenario, load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.kinematics import Drive, steering
from bug_gym.view import Sensors

BEFORE, AFTER = 2.0, 1.0
"""How long before the collision the sequences begin, and how long after it they end [s]."""
SUDDEN = 1.0
"""Who came into the world less than this before the collision came out of nowhere [s]."""
SEQUENCES = 1000
HOLD = 0.5
"""How long a sequence keeps a velocity [s]."""
TOUCH = 1e-3
"""What is nearer than this touches [m]."""
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
    described = load(scenario)
    step = described.time.step
    back = min(max(round(BEFORE / step), 1), row.steps)
    rollout = driven(policy, described, row, row.steps - back)
    many = rollout.simulation.branches(SEQUENCES)
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


def appeared(policy: str | Mapping[str, Any], scenario: str | Mapping[str, Any] | Scenario, row: EpisodeRow) -> bool:
    """Whether the robot ran into somebody who was not yet in the world SUDDEN seconds before, so that no scan showed him.

    A recording knows people from where the camera sees them: that may be just where the robot is.

    Args, Raises: as `is_avoidable`.
    """
    described = load(scenario)
    back = min(max(round(SUDDEN / described.time.step), 1), row.steps)
    rollout = driven(policy, described, row, row.steps - back)
    world = rollout.simulation.world
    before = world.disc_position[0].copy()
    while not rollout.is_over:
        rollout.advance()
    gaps = np.hypot(*(world.disc_position[0] - world.pose[0, 0, :2]).T) - world.disc_radius[0]
    if not len(gaps) or gaps.min() > described.robot.reach + TOUCH:
        return False
    return bool(before[gaps.argmin(), 0] == kernels.AWAY)


def driven(policy: str | Mapping[str, Any], scenario: Scenario, row: EpisodeRow, steps: int) -> Rollout:
    """An episode that ended in a collision, driven again for so many steps.

    Raises:
        ValueError: it ended otherwise.
    """
    if row.outcome != "collision":
        raise ValueError(f"the episode ended with {row.outcome!r}, not in a collision")
    entry = ScenarioEntry(scenario.name, scenario, range(row.seed, row.seed + 1))
    rollout = Rollout(PolicyEntry.of(policy), entry, [row.seed])
    for _ in range(steps):
        rollout.advance()
    return rollout


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
