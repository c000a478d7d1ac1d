"""What a robot ran into, and who of the two was closing in: read from a world right after a collision."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bug_gym.geometry import F64
from bug_gym.world import World

CLOSING = 0.05
"""Speed [m/s] toward the other from which one counts as closing in."""

KINDS = ("still", "mover, robot closing", "mover, both closing", "mover, it closing")
"""What was touched, and of a mover who was closing in."""


class Contact(NamedTuple):
    """The obstacle nearest to a robot, and how fast the two came together."""

    moves: bool
    """Whether it is a mover."""
    own_speed: float
    """Speed of the robot toward it [m/s]."""
    its_speed: float
    """Its speed toward the robot [m/s]."""

    @property
    def kind(self) -> str:
        """One of KINDS."""
        if not self.moves:
            return "still"
        if self.own_speed < CLOSING:
            return "mover, it closing"
        return "mover, robot closing" if self.its_speed < CLOSING else "mover, both closing"


def contact(world: World, row: int, before: F64) -> Contact:
    """What the first robot of a row touches.

    Args:
        world: the worlds, as they stand after the collision.
        row: number of the row.
        before: the robot's place (2,) one step ago [m].

    Raises:
        ValueError: there is nothing in the world.
    """
    place = world.pose[row, 0, :2]
    discs, walls = int(world.disc_count[row]), int(world.wall_count[row])
    if discs + walls == 0:
        raise ValueError("the world is empty: there is nothing to touch")
    centres, radii = world.disc_position[row, :discs], world.disc_radius[row, :discs]
    segments = world.wall[row, :walls]
    nearest = np.concatenate([centres, _nearest_points(segments, place)])
    gaps = np.hypot(*(nearest - place).T) - np.concatenate([radii, np.zeros(walls)])
    which = int(gaps.argmin())
    velocity = world.disc_velocity[row, which] if which < discs else _wall_velocity(world, row, which - discs)
    toward = nearest[which] - place
    toward /= max(float(np.hypot(*toward)), 1e-9)
    # The pose is that of the contact; where the whole step would have led tells the speed.
    own = float((world.array("next_pose")[row, :2] - before) @ toward) / world.scenario.time.step
    return Contact(bool(np.any(velocity != 0.0)), own, float(-velocity @ toward))


def _nearest_points(segments: F64, place: F64) -> F64:
    """The point (n, 2) of each segment (n, 4) that is nearest to a place (2,)."""
    begin, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    square = np.maximum((along * along).sum(axis=1), 1e-12)
    share = np.clip(((place - begin) * along).sum(axis=1) / square, 0.0, 1.0)
    return np.asarray(begin + share[:, None] * along)


def _wall_velocity(world: World, row: int, wall: int) -> F64:
    """Velocity (2,) of the polygon that a wall belongs to; walls of moving polygons come first, in their order."""
    moving = int(world.array("moving_polygon_count")[row, 0])
    ends = np.cumsum(world.array("polygon_walls")[row, :moving])
    polygon = int(np.searchsorted(ends, wall, side="right"))
    if polygon == moving:
        return np.zeros(2)
    body = world.capacity.discs + polygon
    return np.array([world.array("body_vx")[row, body], world.array("body_vy")[row, body]])
