"""What a planner asks of a live env: the map of an episode, and what moves, where it is now. It reads and never writes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.planning.map import PlanningMap, Pose, in_frame
from bug_gym.checks import shortened
from bug_gym.geometry import F64, Point, wrap
from bug_gym.policy import source_scenario
from bug_gym.simulation import Simulation
from bug_gym.world import World
from bug_gym.worlds.layout import Mover, Rings


class Moving(NamedTuple):
    """What moves, as it is now, in the frame of an episode's start."""

    discs: F64
    """Movers about which a disc is told (n, 3): x, y, radius [m]; round ones are it, others lie in it."""
    velocities: F64
    """Of each (n, 2) [m/s]."""
    polygons: tuple[Rings, ...]
    """The outlines of those that are not round."""
    is_round: NDArray[np.bool_]
    """Which of the discs (n,) are the bodies themselves."""

    def select(self, chosen: NDArray[np.bool_]) -> Moving:
        """Those chosen (n,) alone."""
        kept = zip(self.polygons, chosen[~self.is_round], strict=True)
        polygons = tuple(rings for rings, is_chosen in kept if is_chosen)
        return Moving(self.discs[chosen], self.velocities[chosen], polygons, self.is_round[chosen])


@dataclass(frozen=True)
class LiveMap:
    """The world of one robot in one episode, in the frame of its start: the odometry's, without its errors."""

    world: World
    row: int
    """Of the world."""
    robot: int
    """Which of its robots."""
    start: Pose
    """Where the episode began, in the frame of the world."""
    still: PlanningMap
    """What stands."""
    outlines: tuple[F64, ...]
    """Corners (k, 2) of the movers that are not round, about their places, in the frame of the start [m]."""

    @classmethod
    def of(cls, world: World, row: int, robot: int) -> LiveMap:
        """The world of a robot; where its episode began, its odometry tells."""
        x, y, heading = world.pose[row, robot].tolist()
        ahead, left, turned = world.odometry[row, robot].tolist()
        heading -= turned
        x -= math.cos(heading) * ahead - math.sin(heading) * left
        y -= math.sin(heading) * ahead + math.cos(heading) * left
        layout = world.layout(row)
        still = PlanningMap.of_layout(layout, world.scenario.world.regions).seen_from((x, y, heading))
        turn = (0.0, 0.0, heading)
        outlines = tuple(in_frame(outline_of(mover), turn) for mover in layout.movers if not mover.is_circle)
        return cls(world, row, robot, (x, y, heading), still, outlines)

    @property
    def pose(self) -> Pose:
        """Where the robot is now."""
        x, y, heading = self.world.pose[self.row, self.robot].tolist()
        (place,) = in_frame(np.array([[x, y]]), self.start).tolist()
        return place[0], place[1], wrap(heading - self.start[2])

    @property
    def goal(self) -> Point:
        """Where its goal is now [m]."""
        (place,) = in_frame(self.world.goal[self.row, self.robot][None], self.start).tolist()
        return place[0], place[1]

    @cached_property
    def has_movers(self) -> bool:
        """Whether anything but the robot can move."""
        world, row = self.world, self.row
        movers = int(world.array("moving_disc_count")[row, 0]) + len(self.outlines)
        return movers + world.robots > 1

    def movers(self) -> Moving:
        """What moves, the other robots too, where it is now."""
        world, row = self.world, self.row
        round_ones = int(world.array("moving_disc_count")[row, 0])
        first = int(world.spec["discs"][0])
        bodies = [*range(round_ones), *range(first, first + len(self.outlines))]
        discs = np.column_stack([world.array(name)[row, bodies] for name in ("body_x", "body_y", "body_radius")])
        velocities = np.column_stack([world.array(name)[row, bodies] for name in ("body_vx", "body_vy")])
        others = [robot for robot in range(world.robots) if robot != self.robot]
        reach = world.scenario.robot.reach
        poses = world.pose[row, others]
        discs = np.concatenate([discs, np.column_stack([poses[:, :2], np.full(len(others), reach)])])
        velocities = np.concatenate([velocities, ground_velocities(world, row, others)])
        is_round = np.ones(len(discs), dtype=bool)
        is_round[round_ones : len(bodies)] = False
        here = np.hypot(*(discs[:, :2] - self.start[:2]).T) < FAR_AWAY
        places = in_frame(discs[:, :2], self.start)
        polygons = tuple(
            (outline + place,)
            for outline, place, is_here in zip(
                self.outlines, places[round_ones:], here[round_ones : len(bodies)], strict=False
            )
            if is_here
        )
        turned = in_frame(velocities, (0.0, 0.0, self.start[2]))
        return Moving(np.column_stack([places, discs[:, 2]])[here], turned[here], polygons, is_round[here])

    def now(self) -> PlanningMap:
        """The map with the movers where they are now."""
        moving = self.movers()
        return self.still.with_obstacles(moving.discs[moving.is_round], moving.polygons)


FAR_AWAY = 5e5
"""Bodies that are not there, such as pedestrians of a record who have left, wait farther away than this [m]."""


def outline_of(mover: Mover) -> F64:
    """Corners (k, 2) of a mover that is not round, about its place [m]."""
    return np.asarray(mover.outline, dtype=np.float64)


def ground_velocities(world: World, row: int, robots: list[int]) -> F64:
    """Velocities (n, 2) of some robots in the frame of the world [m/s]."""
    ahead, left = world.velocity[row, robots].T
    if world.scenario.robot.kinematics != "holonomic":
        left = np.zeros_like(ahead)  # what stands there is a turn rate
    heading = world.pose[row, robots, 2]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack([cos * ahead - sin * left, sin * ahead + cos * left])


class Maps:
    """The maps of the worlds of a live env, a world a row.

    A policy is asked with observations. Where they are as many as the env has robots, they are those of row 0, then those
    of row 1, and so on. Else each is the one of the robot that has seen just that.

    Args:
        simulation: what the env stands on.
    """

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation

    @classmethod
    def of(cls, source: Any, policy: str) -> Maps:
        """The maps of an env of any face, or of a Simulation.

        Raises:
            ValueError: nothing of the kind: a scenario has no map yet, and another process's env hides its map.
        """
        core = getattr(source, "unwrapped", source)
        simulation = getattr(core, "simulation", core)
        if isinstance(simulation, Simulation):
            return cls(simulation)
        came = type(source).__name__
        if not isinstance(source, (str, dict)):
            source_scenario(source)  # what is nothing of ours is told so
        raise ValueError(
            f"policy {shortened(policy)} reads the map of a live world: expected an env of bug_gym or a Simulation, got {came}"
        )

    @property
    def span(self) -> float:
        """Longest distance within the bounds of the worlds [m]."""
        return float(self.simulation.world.spec["span"][0])

    def of_robot(self, robot: int) -> LiveMap:
        """The world of a robot, the robots numbered row by row: robot r of row n is n R + r.

        Raises:
            ValueError: there is no such robot, or its row has no episode yet.
        """
        world = self.simulation.world
        most = world.count * world.robots
        if not 0 <= robot < most:
            raise ValueError(f"expected a robot from 0 to {most - 1}, got {robot}")
        row, number = divmod(robot, world.robots)
        if not self.simulation.has_episode(row):
            raise ValueError(f"row {row} has no episode yet: reset the env before its map is read")
        return LiveMap.of(world, row, number)

    def robot_behind(self, flat: NDArray[np.float32], number: int) -> int:
        """The robot whose observation stands at a number of a batch (n, D) of flat ones.

        Raises:
            ValueError: none has seen that, or several have in worlds of their own.
        """
        world = self.simulation.world
        if len(flat) == world.count * world.robots:
            return number
        seen = world.observation.reshape(world.count * world.robots, -1)
        same = np.flatnonzero((seen == flat[number]).all(axis=1))
        if len(same) == 0:
            raise ValueError(
                f"got {len(flat)} observations of an env of {len(seen)} robots, and number {number} is none of theirs: "
                "hand in those of all rows, or begin each episode with the observation of its reset"
            )
        rows = world.floats[same // world.robots]
        if (rows != rows[0]).any():
            raise ValueError(
                f"robots {same[0]} and {same[1]} of the env see the same in different worlds: hand in the observations "
                "of all rows at once"
            )
        return int(same[0])
