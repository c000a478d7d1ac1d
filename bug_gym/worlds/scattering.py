"""Obstacles scattered about a start and a goal, with the gaps and the free space that a family promises."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bug_gym.geometry import F64, Point
from bug_gym.worlds.clearance import clearance, contains, is_clear, share_of_box
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import ATTEMPTS, TRIES, Pose, border_of, draw_both, robot_places
from bug_gym.worlds.polygons import Rectangle


@dataclass(frozen=True)
class Scattering:
    """What a family says of the obstacles that it scatters."""

    count: int
    """How many."""
    sizes: tuple[float, float]
    """Least and greatest radius [m]."""
    solvable: float | None
    """Clearance [m] at which a path is certain; None: no such promise, and obstacles may overlap."""
    start_clearance: float
    """Free space around the robot's body at the start [m]."""
    goal_clearance: float
    """Free space around the goal [m]."""


def draw_around(
    crew: Crew, world: DrawnPlaces, scattering: Scattering, rng: Rng, furnish: Callable[[Pose, Point], Layout]
) -> Layout:
    """A world whose start and goal are drawn first, then the obstacles around them.

    Raises:
        ValueError: no world had room for all; what the last one lacked.
    """
    border, reach = border_of(world), crew.robot.reach
    start_free = is_clear(np.zeros((0, 3)), (), border, start_room(crew, scattering))
    goal_free = is_clear(np.zeros((0, 3)), (), border, goal_room_of(scattering))
    fault = ValueError()
    for _ in range(ATTEMPTS):
        start, goal = draw_both(crew, world, world.start, world.goal, rng, start_free, goal_free, world.separation)
        try:
            layout = furnish(start, goal)
        except ValueError as error:
            fault = error
            continue
        # Gaps are wide enough by construction; a border that is no box may have narrow places of its own.
        if scattering.solvable is None or len(border) == 4 or all_reachable(layout, max(scattering.solvable, reach)):
            return layout
        fault = ValueError(f"no path at a clearance of {scattering.solvable:g} m")
    raise ValueError(f"{fault}; {ATTEMPTS} worlds were tried")


def start_room(crew: Crew, scattering: Scattering) -> float:
    """Distance from the robot's origin at the start to anything [m]."""
    return max(crew.robot.reach + scattering.start_clearance, scattering.solvable or 0.0)


def goal_room_of(scattering: Scattering) -> float:
    """Distance from the goal to anything [m]."""
    return max(scattering.goal_clearance, scattering.solvable or 0.0)


def all_reachable(layout: Layout, radius: float) -> bool:
    """Whether each robot, were it a disc of some radius [m], can get to its goal."""
    from bug_gym.shortest_path import reachable  # SciPy and shapely, slow to load

    goals = np.broadcast_to(layout.goals, (len(layout.starts), 2))
    return all(
        reachable(layout.circles, layout.polygons, layout.border, start, goal, radius=radius)
        for start, goal in zip(layout.starts[:, :2], goals, strict=True)
    )


def scattered(crew: Crew, world: DrawnPlaces, scattering: Scattering, start: Pose, goal: Point, rng: Rng) -> F64:
    """Still circles (k, 3) around start and goal, with the gaps that the family promises.

    Raises:
        ValueError: not all of them found a place.
    """
    gap = None if scattering.solvable is None else 2.0 * scattering.solvable
    free = is_apart(crew, world, scattering, start, goal, edge=gap or 0.0)
    circles = scatter(scattering.count, scattering.sizes, world.box, free, rng, gap=gap)
    if len(circles) < scattering.count:
        share = told_share(world, circles) + told_gaps(scattering.solvable)
        raise ValueError(f"only {len(circles)} of {scattering.count} obstacles found a free place{share}")
    return circles


def told_share(world: DrawnPlaces, circles: F64) -> str:
    """How full a world of circles (k, 3) is, as the end of a sentence."""
    return f"; they cover {100.0 * share_of_box(circles[:, 2], world.box):.0f} % of the world"


def told_gaps(solvable: float | None) -> str:
    """What else takes the room where a path is certain at a clearance [m], as the end of a sentence."""
    return "" if solvable is None else f", and keep gaps of {2.0 * solvable:g} m (world.solvable: {solvable:g})"


def is_apart(
    crew: Crew, world: DrawnPlaces, scattering: Scattering, start: Pose, goal: Point, *, edge: float
) -> Callable[[float, float, float], bool]:
    """A test whether a circle leaves start and goal their room and keeps a distance `edge` [m] from the border."""
    starts, goals = robot_places(crew, start, goal)
    border = border_of(world)
    keep = [(*pose[:2], start_room(crew, scattering)) for pose in starts.tolist()]
    keep += [(*place, goal_room_of(scattering)) for place in goals.tolist()]

    def free(x: float, y: float, radius: float) -> bool:
        if any(math.hypot(x - px, y - py) < radius + room for px, py, room in keep):
            return False
        return contains(border, x, y) and clearance(np.zeros((0, 3)), [border], x, y) >= radius + edge

    return free


def scatter(
    count: int,
    sizes: tuple[float, float],
    box: Rectangle,
    is_free: Callable[[float, float, float], bool],
    rng: Rng,
    *,
    gap: float | None,
) -> F64:
    """Circles (k, 3) at random, each at least `gap` [m] from the others (None: they may overlap).

    Args:
        count: how many are wanted; k is less where no more found a place.
        sizes: least and greatest radius [m].
        box: where their middles are drawn.
        is_free: whether a circle x, y, radius may stand there, for all the function knows of other things.
        rng: random numbers.
        gap: least distance between two circles' rims [m].
    """
    xmin, ymin, xmax, ymax = box
    circles = np.zeros((count, 3))
    for number in range(count):
        for _ in range(TRIES):
            radius, x, y = float(rng.uniform(*sizes)), float(rng.uniform(xmin, xmax)), float(rng.uniform(ymin, ymax))
            if gap is not None:
                apart = np.hypot(circles[:number, 0] - x, circles[:number, 1] - y) - circles[:number, 2]
                if number and apart.min() < radius + gap:
                    continue
            if is_free(x, y, radius):
                circles[number] = x, y, radius
                break
        else:
            return circles[:number]
    return circles
