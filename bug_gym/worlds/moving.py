"""What moves where worlds are written down: directions that are drawn, and goals that move."""

from __future__ import annotations

import math

from bug_gym.schema.motions import Bounce, Motion
from bug_gym.schema.movers import Target
from bug_gym.schema.values import Region
from bug_gym.worlds.family import Crew, Family, Rng


def with_direction(motion: Motion | None, rng: Rng) -> Motion | None:
    """The motion with its direction drawn where it has only a speed."""
    if isinstance(motion, Bounce) and motion.velocity is None and motion.speed is not None:
        angle = rng.uniform(-math.pi, math.pi)
        return Bounce(law="bounce", velocity=(motion.speed * math.cos(angle), motion.speed * math.sin(angle)))
    return motion


def target_place(world: Family, goal: object, target: Target | None) -> object:
    """Where the goal is, or where it is drawn from: the world's goal or its target's start."""
    if target is None:
        return goal
    return target.at if target.at is not None else Region(region=target.region or world.box)


def goal_room(crew: Crew, target: Target | None) -> float:
    """Distance that a moving goal keeps from still obstacles [m]: unless told, the robot can always reach it."""
    return crew.goal_room if target is None or target.room is None else target.room


def drawn_goal_room(crew: Crew, target: Target | None) -> float:
    """Clearance of a goal that is drawn [m]; one that moves begins with the room that it keeps."""
    return crew.robot.reach if target is None else goal_room(crew, target)


def target_motion(target: Target | None, rng: Rng) -> Motion | None:
    """How the goal moves."""
    return None if target is None else with_direction(target.motion, rng)
