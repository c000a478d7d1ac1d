"""Streams of movers across the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np

from bug_gym.limits import MOST_OBSTACLES, OBSTACLE_BYTES, told_bytes
from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Waypoints
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Box, Positive, Region, Speeds, StartRegion, Streams
from bug_gym.worlds.clearance import is_clear, obstacles_of
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.places import border_of, draw_both, finish


class CrossingWorld(DrawnPlaces):
    """Streams of round movers across the way: each goes up one lane and down another, round and round.

    Start and goal are drawn from the strips beside the streams, where no mover comes.
    """

    family: Literal["crossing"]
    bounds: Box = (-10.0, -8.0, 10.0, 8.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    streams: Streams = 3
    """How many streams lie beside one another along x."""
    lane: Positive = 1.6
    """Distance from a stream's lane up to its lane down [m]."""
    radius: Positive = 0.3
    """Radius of the movers [m]."""
    gap: Positive = 3.0
    """Least free way from one mover of a stream to the next [m]."""
    speeds: Speeds = (0.3, 0.8)
    """Least and greatest speed of a stream [m/s]."""
    apron: Positive = 3.0
    """Width of the free strips on the left for the start and on the right for the goal [m]."""

    @property
    def stream_width(self) -> float:
        """Room along x for a stream [m]."""
        xmin, _, xmax, _ = self.bounds
        return (xmax - xmin - 2.0 * self.apron) / self.streams

    @property
    def turn_room(self) -> float:
        """Distance from the upper and the lower border to where a stream turns [m]."""
        return 2.0 * self.radius

    @property
    def round_trip(self) -> float:
        """Length of the way of a stream, up and down [m]."""
        low, high = self.bounds[1] + self.turn_room, self.bounds[3] - self.turn_room
        return 2.0 * (self.lane + high - low)

    @property
    def in_a_stream(self) -> int:
        """Movers of a stream."""
        return max(math.floor(self.round_trip / (2.0 * self.radius + self.gap)), 1)

    def check(self, robot: Robot) -> None:
        """The streams fit between the strips, and the robot into the strips and between two movers."""
        self.check_width(self.apron, robot, "apron")
        self.check_width(self.gap, robot, "gap")
        if self.lane + 2.0 * self.radius > self.stream_width:
            reason = f"got {self.streams}, expected fewer: each needs {self.lane + 2.0 * self.radius:g} m along x"
            raise wrong(reason, "streams")
        movers = self.streams * self.in_a_stream
        if movers > MOST_OBSTACLES:
            memory = f"{movers:,} movers would take {told_bytes(OBSTACLE_BYTES * movers)} in each world"
            raise wrong(f"got {self.gap:g}, expected more: {memory}", "gap")
        if self.lane < 2.0 * self.radius:
            raise wrong(f"got {self.lane:g}, expected at least the width of a mover ({2 * self.radius:g})", "lane")
        height = self.bounds[3] - self.bounds[1]
        if height <= 2.0 * self.turn_room:
            raise wrong(f"got {self.radius:g}, expected less than a quarter of the height ({height:g})", "radius")
        super().check(robot)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Streams of movers; start and goal at first wherever no mover comes, to their left and to their right."""
        xmin, ymin, xmax, ymax = self.bounds
        start = self.start or StartRegion(region=(xmin, ymin, xmin + self.apron, ymax))
        goal = self.goal or Region(region=(xmax - self.apron, ymin, xmax, ymax))
        movers = streams(self, rng)
        reach = crew.robot.reach

        def free(x: float, y: float) -> bool:
            """Clear of the border, and in a strip where it is drawn."""
            return clear(x, y) and not xmin + self.apron - reach < x < xmax - self.apron + reach

        clear = is_clear(*obstacles_of(np.zeros((0, 3)), (), movers), border_of(self), reach)
        pose, place = draw_both(crew, self, start, goal, rng, free, free, self.separation)
        return finish(crew, self, pose, place, movers=movers)


def streams(world: CrossingWorld, rng: Rng) -> tuple[Mover, ...]:
    """Movers evenly spaced on rectangles beside one another, each rectangle with a speed and a sense of its own."""
    xmin, ymin, _, ymax = world.bounds
    low, high = ymin + world.turn_room, ymax - world.turn_room
    length, count = world.round_trip, world.in_a_stream
    movers = []
    for number in range(world.streams):
        middle = xmin + world.apron + (number + 0.5) * world.stream_width
        left, right = middle - 0.5 * world.lane, middle + 0.5 * world.lane
        corners = [(left, low), (right, low), (right, high), (left, high)]
        if rng.random() < 0.5:
            corners.reverse()
        speed, phase = float(rng.uniform(*world.speeds)), float(rng.random())
        for mover in range(count):
            at, points = _on_loop(corners, (mover + phase) * length / count)
            movers.append(Mover(world.radius, at, Waypoints(law="waypoints", points=points, speed=speed)))
    return tuple(movers)


def _on_loop(
    corners: Sequence[tuple[float, float]], way: float
) -> tuple[tuple[float, float], tuple[tuple[float, float], ...]]:
    """The place after some way [m] along a closed line from its first corner, and the corners from there on."""
    for index, (x, y) in enumerate(corners):
        after = corners[(index + 1) % len(corners)]
        side = math.dist((x, y), after)
        if way < side:
            share = way / side
            ahead = [*corners[index + 1 :], *corners[: index + 1]]
            return (x + share * (after[0] - x), y + share * (after[1] - y)), tuple(ahead)
        way -= side
    return _on_loop(corners, max(way, 0.0))
