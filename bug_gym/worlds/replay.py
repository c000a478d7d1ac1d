"""Recorded pedestrians, and a robot that crosses their way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, Self

import numpy as np
from pydantic import ModelWrapValidatorHandler, model_validator

from bug_gym.geometry import Point
from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Replay
from bug_gym.schema.movers import SAME_PLACE
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import (
    Box,
    ExistingPath,
    Goal,
    Moment,
    NotNegative,
    Positive,
    Start,
    Window,
    existing_path,
    unsaid,
)
from bug_gym.worlds.clearance import Free, is_clear, obstacles_of
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.places import TRIES, Pose, border_of, draw_both, finish, has_room_for_all
from bug_gym.worlds.recordings import Recording, load_recording

CROSSING_ROOM = 0.5
"""Free space round a robot that starts among pedestrians, and between a goal and the border [m]."""


class ReplayWorld(Family):
    """Pedestrians where they were recorded, and a robot that has to cross their way."""

    family: Literal["replay"]
    bounds: Box
    """xmin, ymin, xmax, ymax [m]; the border is always a wall. Left out: what holds all recorded bodies and `margin`.
    Who leaves given bounds isn't there until he comes in again."""
    path: ExistingPath
    """A .csv with the columns time_s, pedestrian, x_m, y_m; relative to the scenario's file."""
    margin: NotNegative = 1.0
    """Free space on all sides, where `bounds` are left out [m]."""
    radius: Positive = 0.3
    """Radius of a pedestrian [m]."""
    start_time: Moment | None = None
    """Time of the recording at which the episode begins [s]; none: drawn so that the recording doesn't run out."""
    window: Window | None = None
    """Part of the recording to draw from [s]; none: all of it."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: at one side of the flow of pedestrians."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: straight across, on the other side."""

    @model_validator(mode="wrap")
    @classmethod
    def _bounds_hold_the_record(cls, data: object, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if not isinstance(data, Mapping) or data.get("bounds") is not None:
            return handler(data)
        # Without a record there are no bounds; its own fault is told where `path` is checked.
        box, path = (0.0, 0.0, 1.0, 1.0), data.get("path")
        margin, radius = (data.get(name, cls.model_fields[name].default) for name in ("margin", "radius"))
        numbers = all(isinstance(value, (int, float)) and value >= 0.0 for value in (margin, radius))
        if numbers and existing_path(path):
            xmin, ymin, xmax, ymax = _recording(str(path)).extent
            room = margin + radius
            box = (xmin - room, ymin - room, xmax + room, ymax + room)
        return unsaid(handler({**data, "bounds": box}), "bounds")

    def data_files(self) -> tuple[Path, ...]:
        """The recording."""
        return load_recording.files(self.path)

    def check(self, robot: Robot) -> None:
        """The recording can be read, the time asked for is in it, and start and goal lie within the bounds."""
        first, last = _recording(self.path).times
        if self.start_time is not None and self.window is not None:
            raise wrong("expected either start_time or window, got both", "window")
        if self.start_time is not None and not first <= self.start_time <= last:
            raise wrong(f"got {self.start_time:g}, expected a time from {first:g} to {last:g}", "start_time")
        if self.window is not None and not first <= self.window[0] <= self.window[1] <= last:
            raise wrong(f"got {list(self.window)}, expected times from {first:g} to {last:g}", "window")
        if (self.start is None) != (self.goal is None):
            raise wrong("expected both start and goal, or neither", "goal" if self.goal is None else "start")
        self.check_start(self.start, robot)
        self.check_goal(self.goal)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Pedestrians of a recording from a time on; the robot goes across their flow."""
        recording, limit = load_recording(self.path), crew.time_limit
        since = self.start_time
        if since is None:
            first, last = self.window or recording.times
            since = float(rng.uniform(first, max(first, last - limit)))
        xmin, ymin, xmax, ymax = self.bounds
        radius = self.radius
        inside = recording.within((xmin + radius, ymin + radius, xmax - radius, ymax - radius))
        movers = []
        for track in inside.tracks:
            records = track.records - [since, 0.0, 0.0]
            if records[-1, 0] >= 0.0 and records[0, 0] <= limit:
                # The records have been checked as they were read; pydantic would take as long again for each episode.
                motion = Replay.model_construct(law="replay", points=tuple(map(tuple, records.tolist())))
                movers.append(Mover(radius, motion.place(0.0), motion))
        border = border_of(self)
        present = obstacles_of(np.zeros((0, 3)), (), movers)
        room = crew.robot.reach + CROSSING_ROOM
        if self.start is None:
            # All starts lie at just that distance from the border, which rounding makes too little at some of them.
            just_free = is_clear(*present, border, room - SAME_PLACE)
            start, goal = draw_crossing(crew, self, recording.flow(), rng, just_free)
        else:
            start_free = is_clear(*present, border, room)
            goal_free = is_clear(np.zeros((0, 3)), (), border, crew.robot.reach)
            start, goal = draw_both(crew, self, self.start, self.goal, rng, start_free, goal_free, 0.0)
        return finish(crew, self, start, goal, movers=tuple(movers))


def _recording(path: str) -> Recording:
    """A recording, its faults told as those of the key `path`."""
    try:
        return load_recording(str(Path(path).expanduser().absolute()))
    except ValueError as error:
        raise wrong(str(error), "path") from None


def draw_crossing(crew: Crew, world: ReplayWorld, flow: float, rng: Rng, start_free: Free) -> tuple[Pose, Point]:
    """A start and a goal at opposite sides of the bounds, straight across a direction of flow [rad].

    Args:
        crew: who starts.
        world: whose bounds they are.
        flow: direction in which most pedestrians walk, one way or the other [rad].
        rng: draws.
        start_free: whether a start is free; it lies at just CROSSING_ROOM from the border.

    Raises:
        ValueError: no free start was found.
    """
    xmin, ymin, xmax, ymax = world.bounds
    room = crew.robot.reach + CROSSING_ROOM
    low, high = np.array([xmin + room, ymin + room]), np.array([xmax - room, ymax - room])
    for _ in range(TRIES):
        heading = flow + float(rng.choice([-0.5, 0.5])) * math.pi
        across = np.array([math.cos(heading), math.sin(heading)])
        middle = rng.uniform(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
        ahead, behind = np.where(across > 0.0, [high - middle, middle - low], [middle - low, high - middle])
        with np.errstate(divide="ignore"):  # along an axis there is no end in the other one
            ends, begins = ahead / abs(across), -behind / abs(across)
        start, goal = middle + begins.max() * across, middle + ends.min() * across
        pose = float(start[0]), float(start[1]), heading
        if start_free(*pose[:2]) and has_room_for_all(crew, pose, start_free):
            return pose, (float(goal[0]), float(goal[1]))
    raise ValueError(f"no free start found among the pedestrians after {TRIES} tries")
