"""What a robot observes: each field with its meaning, its shape, its bounds and the kernel that fills it.

OBSERVATION is the one place that says so, in the order of the flat vector. To add a field, write its kernel and its entry
here: the record of a row, the kernel `observe`, spaces, faces, views and widths follow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from math import prod
from typing import Any, NamedTuple

import numpy as np

from bug_gym.compiling import inlined
from bug_gym.kernels.geometry import clip
from bug_gym.kernels.ground import sample_ground
from bug_gym.kernels.layout import (
    HOLONOMIC,
    TERRAIN_HEADINGS,
    TERRAIN_RINGS,
    Floats,
    Footprint,
    Integers,
    Ranges,
    Record,
    Regions,
)
from bug_gym.kernels.sensing import Look, goal_in_frame, peer_in_frame, scan

PEER = 4  # numbers of each other robot

Fill = Callable[..., None]


class Sense(NamedTuple):
    """A field of the observation, in any world: `s` is the record (of SPEC) of its rows."""

    meaning: str
    """What its numbers are, with their units."""
    shape: Callable[[Record], tuple[int, ...]]
    """Its shape; it is not there where that has no elements."""
    bounds: Callable[[Record], tuple[Any, Any]]
    """Its smallest and its largest values, of its shape or broadcast to it."""
    fill: Fill
    """Fills it, from `seen[s.see_NAME]` on; all kernels are handed the same."""


@inlined
def see_ranges(
    f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
) -> None:
    """The scan."""
    scan(f, k, s, seen[s.see_ranges : s.see_ranges + s.beams], look, footprint)


@inlined
def see_goal(
    f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
) -> None:
    """Where the goal is, within the bounds also where odometry has gone far astray."""
    ahead, left = goal_in_frame(f, s, look)
    seen[s.see_goal] = clip(ahead, -s.span, s.span)
    seen[s.see_goal + 1] = clip(left, -s.span, s.span)


@inlined
def see_pose(
    f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
) -> None:
    """The robot's own estimate."""
    seen[s.see_pose] = clip(f[s.odometry + 3 * look.robot], -2.0 * s.span, 2.0 * s.span)
    seen[s.see_pose + 1] = clip(f[s.odometry + 3 * look.robot + 1], -2.0 * s.span, 2.0 * s.span)
    seen[s.see_pose + 2] = f[s.odometry + 3 * look.robot + 2]


@inlined
def see_velocity(
    f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
) -> None:
    """As it is."""
    seen[s.see_velocity] = f[s.velocity + 2 * look.robot]
    seen[s.see_velocity + 1] = f[s.velocity + 2 * look.robot + 1]


def velocity_bounds(s: Record) -> tuple[Any, Any]:
    """A holonomic robot goes at full speed in any direction."""
    if s.kinematics == HOLONOMIC:
        return -s.max_speed, s.max_speed
    return (-s.max_reverse, -s.max_turn_rate), (s.max_speed, s.max_turn_rate)


@inlined
def see_terrain(
    f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
) -> None:
    """What the ground costs about the robot."""
    if regions is not None:
        samples = TERRAIN_HEADINGS * TERRAIN_RINGS
        ground = seen[s.see_terrain : s.see_terrain + samples]
        sample_ground(s, regions, ground, look.x, look.y, look.heading)


@inlined
def see_peers(
    f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
) -> None:
    """The others, in their order."""
    if footprint is not None and s.robots > 1:
        at = s.see_peers
        for other in range(s.robots):
            if other != look.robot:
                ahead, left, speed_ahead, speed_left = peer_in_frame(f, s, look, other)
                seen[at] = clip(ahead, -s.span, s.span)
                seen[at + 1] = clip(left, -s.span, s.span)
                seen[at + 2] = speed_ahead
                seen[at + 3] = speed_left
                at += PEER


def peers_bounds(s: Record) -> tuple[Any, Any]:
    """A robot is as fast as its motors let it, forward or back."""
    top = max(s.max_speed, s.max_reverse)
    return (-s.span, -s.span, -top, -top), (s.span, s.span, top, top)


OBSERVATION: dict[str, Sense] = {
    "ranges": Sense(
        "range of each beam, counter-clockwise [m]",
        lambda s: (s.beams,),
        lambda s: (s.min_range, s.reach),
        see_ranges,
    ),
    "goal": Sense(
        "the goal in the robot's frame [m]",
        lambda s: (2,),
        lambda s: (-s.span, s.span),
        see_goal,
    ),
    "pose": Sense(
        "odometry x, y [m] and heading [rad] in the frame of the start",
        lambda s: (3,),
        lambda s: ((-2.0 * s.span, -2.0 * s.span, -np.pi), (2.0 * s.span, 2.0 * s.span, np.pi)),
        see_pose,
    ),
    "velocity": Sense(
        "ahead [m/s] and turn rate [rad/s]; holonomic: ahead and to the left [m/s]",
        lambda s: (2,),
        velocity_bounds,
        see_velocity,
    ),
    "terrain": Sense(
        "cost of the ground at 32 bearings, every 0.25 m up to 4 m",
        lambda s: (TERRAIN_HEADINGS if s.regions else 0, TERRAIN_RINGS),
        lambda s: (1.0, s.largest_factor),
        see_terrain,
    ),
    "peers": Sense(
        "of each other robot place [m] and velocity [m/s] in the robot's frame",
        lambda s: (s.robots - 1, PEER),
        peers_bounds,
        see_peers,
    ),
}


class Place(NamedTuple):
    """Where a field of the observation lies in the flat vector of a world."""

    begin: int
    shape: tuple[int, ...]


def observation_places(s: Record) -> dict[str, Place]:
    """Where each field begins in the worlds of a record, and its shape; without elements for one that is not there."""
    places = {}
    begin = 0
    for name, sense in OBSERVATION.items():
        shape = tuple(int(size) for size in sense.shape(s))
        places[name] = Place(begin, shape)
        begin += prod(shape)
    return places


def one_after_another(fills: Sequence[Fill]) -> Fill:
    """A kernel that does what some kernels do in turn, all with the same arguments; numba can't loop over functions."""
    return reduce(_both, fills)


def _both(earlier: Fill, later: Fill) -> Fill:
    @inlined
    def both(
        f: Floats, k: Integers, s: Record, seen: Ranges, look: Look, footprint: Footprint, regions: Regions
    ) -> None:
        earlier(f, k, s, seen, look, footprint, regions)
        later(f, k, s, seen, look, footprint, regions)

    return both


observe = one_after_another([sense.fill for sense in OBSERVATION.values()])
"""Fills a robot's observation `seen` (D,)."""
