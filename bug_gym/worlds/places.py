"""Starts and goals: drawn where there is room, and checked where they are written."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bug_gym.geometry import F64, Point
from bug_gym.schema.motions import Motion
from bug_gym.schema.values import Region, StartRegion
from bug_gym.worlds.clearance import Clear, Free, clear_among, is_clear, obstacles_of
from bug_gym.worlds.family import Crew, DrawnPlaces, Family, Rng
from bug_gym.worlds.layout import Layout, Mover, Rings, side_by_side

if TYPE_CHECKING:
    from bug_gym.worlds.outlines import Outlines  # loads the compiler

TRIES = 1000  # at one place
ATTEMPTS = 20  # at a whole world

Pose = tuple[float, float, float]
"""x, y [m], heading [rad]."""


def border_of(world: Family) -> F64:
    """Corners (k, 2) of the border of a family's world."""
    return np.array(world.corners, dtype=np.float64)


def draw_point(region: Sequence[float], rng: Rng, free: Free, what: str) -> Point:
    """A point of a rectangle, evenly over what is free in it.

    Raises:
        ValueError: no free point was found.
    """
    xmin, ymin, xmax, ymax = region
    for _ in range(TRIES):
        x, y = float(rng.uniform(xmin, xmax)), float(rng.uniform(ymin, ymax))
        if free(x, y):
            return x, y
    raise ValueError(f"no free place for the {what} in {list(region)} after {TRIES} tries")


def draw_start(crew: Crew, world: Family, start: object, rng: Rng, free: Free) -> Pose:
    """A start pose: fixed, drawn from a region, or from the whole of the bounds.

    Raises:
        ValueError: no place was found where all robots are free.
    """
    if isinstance(start, tuple):
        return start
    region = start.region if isinstance(start, Region) else world.box
    heading = start.heading if isinstance(start, StartRegion) else None
    for _ in range(TRIES):
        x, y = draw_point(region, rng, free, "start")
        pose = x, y, float(rng.uniform(-math.pi, math.pi)) if heading is None else heading
        if has_room_for_all(crew, pose, free):
            return pose
    raise ValueError(f"no free place for all {crew.robots.count} robots in {list(region)} after {TRIES} tries")


def has_room_for_all(crew: Crew, pose: Sequence[float], free: Free) -> bool:
    """Whether robots side by side about a free pose are all free; those with places of their own are elsewhere."""
    if crew.robots.count == 1 or crew.robots.places:
        return True
    return all(free(x, y) for x, y, _ in side_by_side(pose, crew.robots.count))


def draw_goal(world: Family, goal: object, rng: Rng, free: Free) -> Point:
    """A goal: fixed, drawn from a region, or from the whole of the bounds."""
    if isinstance(goal, tuple):
        return goal
    region = goal.region if isinstance(goal, Region) else world.box
    return draw_point(region, rng, free, "goal")


def draw_both(
    crew: Crew,
    world: Family,
    start: object,
    goal: object,
    rng: Rng,
    start_free: Free,
    goal_free: Free,
    separation: float,
) -> tuple[Pose, Point]:
    """A start and a goal at least `separation` [m] apart.

    Raises:
        ValueError: no such pair was found.
    """
    for _ in range(TRIES):
        pose = draw_start(crew, world, start, rng, start_free)
        place = draw_goal(world, goal, rng, goal_free)
        if math.hypot(pose[0] - place[0], pose[1] - place[1]) >= separation:
            return pose, place
    raise ValueError(f"no start and goal at least {separation:g} m apart (world.separation) after {TRIES} tries")


def finish(
    crew: Crew,
    world: Family,
    start: Sequence[float],
    goal: Point,
    *,
    circles: F64 | None = None,
    polygons: tuple[Rings, ...] = (),
    movers: tuple[Mover, ...] = (),
    target: Motion | None = None,
    goal_room: float | None = None,
    clear: Clear | None = None,
) -> Layout:
    """The layout of a world, its robots placed as the scenario says: by their own places, or side by side.

    A moving goal keeps `goal_room` [m] from still obstacles; unless told, the robot can always reach it.

    Raises:
        ValueError: a robot or a goal would be in an obstacle or outside.
    """
    check_spacing(crew)
    return finish_crew(
        crew,
        world,
        *robot_places(crew, start, goal),
        circles=circles,
        polygons=polygons,
        movers=movers,
        target=target,
        goal_room=goal_room,
        clear=clear,
    )


def finish_crew(
    crew: Crew,
    world: Family,
    starts: F64,
    goals: F64,
    *,
    circles: F64 | None = None,
    polygons: tuple[Rings, ...] = (),
    movers: tuple[Mover, ...] = (),
    target: Motion | None = None,
    goal_room: float | None = None,
    clear: Clear | None = None,
) -> Layout:
    """The layout of a world that has starts (R, 3) and goals (R, 2) or (1, 2) for its robots.

    Raises:
        ValueError: a robot or a goal would be in an obstacle or outside.
    """
    layout = Layout(
        border=border_of(world),
        starts=starts,
        goals=goals,
        circles=np.zeros((0, 3)) if circles is None else circles,
        polygons=polygons,
        movers=movers,
        target=target,
        goal_room=crew.goal_room if goal_room is None else goal_room,
    )
    check_places(crew, layout, clear)
    return layout


def robot_places(crew: Crew, start: Sequence[float], goal: Point) -> tuple[F64, F64]:
    """Poses (R, 3) and goals (1, 2) or (R, 2) of the robots, where the world's own are `start` and `goal`."""
    robots, places = crew.robots.count, crew.robots.places
    starts = np.array([place.start for place in places[:robots]]) if places else side_by_side(start, robots)
    goals = [place.goal or goal for place in places[:robots]] if any(place.goal for place in places) else [goal]
    return starts.astype(np.float64), np.array(goals, dtype=np.float64)


def written_or_drawn(crew: Crew, starts: F64, goals: F64) -> tuple[F64, F64]:
    """Poses (R, 3) and goals (R, 2) that a world has drawn for its robots, or those that the scenario writes down."""
    places = crew.robots.places[: crew.robots.count]
    if not places:
        return starts, goals
    written = [place.goal or tuple(goal) for place, goal in zip(places, goals.tolist(), strict=True)]
    return np.array([place.start for place in places]), np.array(written)


def check_spacing(crew: Crew) -> None:
    """Raises where robots that start side by side would overlap."""
    reach = crew.robot.reach
    if crew.robots.count > 1 and not crew.robots.places and reach > 1.0:
        raise ValueError(f"robots that reach {reach:g} m overlap where they start 2 m apart: give each its own place")


def _in_a_row(crew: Crew) -> str:
    """What to say of robots that nobody gave places."""
    if crew.robots.count == 1 or crew.robots.places:
        return ""
    return f" ({crew.robots.count} robots start side by side, 2 m apart; robots.places gives each its own place)"


def check_places(crew: Crew, layout: Layout, clear: Clear | None = None) -> None:
    """Raises where a robot starts, or a goal lies, in an obstacle or outside, as `clear` says if it is told."""
    if clear is None:
        clear = partial(is_clear, *obstacles_of(layout.circles, layout.polygons, layout.movers), layout.border)
    for number, pose in enumerate(layout.starts.tolist()):
        for x, y, radius in crew.robot.body(tuple(pose)):
            # 1e-9: what touches when it starts is free, whatever the rounding
            if not clear(radius - 1e-9)(x, y):
                raise ValueError(
                    f"robot {number} cannot start at {pose}: an obstacle or the border is in its way{_in_a_row(crew)}"
                )
    for x, y in layout.goals.tolist():
        if not clear(0.0)(x, y):
            raise ValueError(f"the goal {[x, y]} lies in an obstacle or outside")


class Walls(NamedTuple):
    """Walls that are drawn before start and goal."""

    polygons: tuple[Rings, ...]
    """Corners of each of them [m]."""
    outlines: Outlines | None = None
    """The same for compiled code, of walls without holes whose family has it compiled."""


def draw_within(crew: Crew, world: DrawnPlaces, rng: Rng, build: Callable[[], Walls]) -> Layout:
    """A world whose walls are drawn first, then start and goal in what is free and not enclosed.

    Raises:
        ValueError: no world had room for start and goal; why the last one had none.
    """
    fault = ValueError()
    for _ in range(ATTEMPTS):
        polygons, outlines = build()
        clear = clear_among(border_of(world), polygons) if outlines is None else outlines.clear
        free = clear(crew.robot.reach)
        try:
            pair = None if outlines is None else outlines.draw_both(crew, world, rng, TRIES)
            start, goal = pair or draw_both(crew, world, world.start, world.goal, rng, free, free, world.separation)
            return finish(crew, world, start, goal, polygons=polygons, clear=None if outlines is None else clear)
        except ValueError as error:
            fault = error
    raise ValueError(f"{fault}; none of {ATTEMPTS} worlds had room for start and goal")
