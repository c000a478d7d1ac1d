"""The map planner where nothing moves: straight to the next node of its way, past what stands in the first steps."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.hd_bug.frames import direction_to
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import Measures
from bug_gym.agents.hd_bug_map.perceive import BODY_MARGIN, Scene
from bug_gym.agents.hd_bug_map.poses import TURNING, turn_to
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.scan.way_in import way_in
from bug_gym.geometry import F64
from bug_gym.kinematics import TURN_IN_PLACE
from bug_gym.policy import braking_radius, is_steered

HEADINGS: F64 = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
"""Headings that are looked at all round [rad]."""

OFFSETS: F64 = np.radians(np.stack([np.arange(3.0, 177.0, 3.0), -np.arange(3.0, 177.0, 3.0)], axis=1).ravel())
"""Turns away from a direction that are tried, the smallest first [rad]."""


TURNED_BACK = 3
"""Turned back so often before a cell of the map, it takes the cell for blocked."""

STEADY = 0.005
"""Standard deviation of a range up to which one scan shows what the next one does [m]."""

HELD, HELD_FOR = 1e-3, 2.0
"""A robot that neither drives nor turns faster than this, as a share of its top speed, for so long [s] is held up."""

STANDS = 0.05
"""A robot slower than this turns on the spot, as a share of its top speed."""


def follow_way(scene: Scene, memory: HDBugMapMemory, way: Way, measures: Measures) -> tuple[float, float]:
    """Direction [rad] and speed [m/s] toward the next node of the way, where nothing moves."""
    view = scene.view
    node = way.places[1]
    gap = math.dist(view.position, node)
    is_last = len(way.places) == 2
    memory.mode = "direct" if is_last else "following"
    if memory.is_goal_by_wall and (inward := way_in(view, view.sensors.radius + BODY_MARGIN)) is not None:
        memory.mode, memory.chosen = "direct", view.goal_position
        return view.heading + inward[0], min(measures.top, inward[1] / view.sensors.drive.step)
    memory.candidates, memory.costs, memory.forecast = np.empty((0, 2)), np.empty(0), np.empty((0, 0, 2))
    direction = memory.direction
    if not is_turning(scene, memory, measures):
        # Else: which node comes next may change with what the beams meet while it turns on the spot: finish the turn.
        memory.chosen = float(node[0]), float(node[1])
        direction = direction_to(view, memory.chosen)
    return drive_along(scene, memory, direction, gap, measures, is_last=is_last)


def is_turning(scene: Scene, memory: HDBugMapMemory, measures: Measures) -> bool:
    """Whether a differential robot still turns on the spot toward the last direction, which is free."""
    drive = scene.view.sensors.drive
    if drive.kinematics == "holonomic" or memory.steps == 1 or abs(scene.view.velocity[0]) > STANDS * drive.max_speed:
        return False
    if abs(turn_to(scene.view.heading, memory.direction)) <= TURN_IN_PLACE:
        return False
    bearing = memory.direction - scene.view.heading
    return bool(scene.light.free(np.array([bearing]))[0] >= measures.top * drive.step)


def drive_along(
    scene: Scene, memory: HDBugMapMemory, direction: float, gap: float, measures: Measures, *, is_last: bool
) -> tuple[float, float]:
    """Direction and speed along a direction [rad] for a gap [m]; never faster than it can stop in the free way."""
    drive = scene.view.sensors.drive
    wanted = direction
    direction, free = slide(scene, memory, wanted, min(measures.top * drive.step, gap))
    if math.cos(direction - wanted) < 0.0 or is_held(scene, memory):
        bar_cell(scene, memory, wanted)
    speed = measures.top
    if math.isfinite(drive.max_acceleration):
        speed = min(speed, math.sqrt(2.0 * drive.max_acceleration * max(free - speed * drive.step, 0.0)))
    speed = min(speed, free / drive.step)
    if not is_last and not is_steered(scene.view.sensors):
        # One that is steered rounds the node.
        speed = min(speed, max(gap, 1e-3) / drive.step)
    if is_last and drive.latency > 0:
        speed = min(speed, gap / (drive.step * (1 + drive.latency)))  # else it drives past the goal, and back, for ever
    return direction, max(speed, TURNING)


def is_held(scene: Scene, memory: HDBugMapMemory) -> bool:
    """Whether it has stood for a while though its way is free to the disc: what cares for its inertia does not let it begin."""
    view, drive = scene.view, scene.view.sensors.drive
    stands = np.abs(view.velocity).max() < HELD * drive.max_speed
    memory.held = memory.held + 1 if stands else 0
    return memory.held * drive.step > HELD_FOR


def bar_cell(scene: Scene, memory: HDBugMapMemory, direction: float) -> None:
    """Count that the disc was turned back on its way; bar the cell of the map where that has happened too often.

    A cell is open up to half its diagonal too near to a point, and remembers but one: a way over the map may lead where the
    disc does not pass, and would lead there again from wherever it has slid back to.
    """
    view, size = scene.view, scene.grid.cells.size
    free = float(scene.light.free(np.array([direction - view.heading]))[0])
    own = _cell_at(scene, 0.0, direction)
    ahead = free
    while (cell := _cell_at(scene, ahead, direction)) == own:
        ahead += 0.25 * size
    memory.turned_back[cell] = count = memory.turned_back.get(cell, 0) + 1
    if count >= TURNED_BACK:
        scene.grid.bar(((cell[0] + 0.5) * size, (cell[1] + 0.5) * size))
        memory.barred_then, memory.way = scene.grid.removed, None


def _cell_at(scene: Scene, ahead: float, direction: float) -> tuple[int, int]:
    """The cell a way ahead [m], by its column and row from the origin."""
    (x, y), size = scene.view.position, scene.grid.cells.size
    return math.floor((x + ahead * math.cos(direction)) / size), math.floor((y + ahead * math.sin(direction)) / size)


def slide(scene: Scene, memory: HDBugMapMemory, direction: float, need: float) -> tuple[float, float]:
    """The direction nearest to the desired one with a free way of `need` [m], and that way [m].

    Without any, that of the place about the robot that is farthest from everything.
    """
    bearing = direction - scene.view.heading
    free = free_to_drive(scene, np.array([bearing]))
    if free[0] >= need:
        return direction, float(free[0])
    found = free_to_drive(scene, bearing + OFFSETS)
    good = np.flatnonzero(found >= need)
    if len(good):
        return direction + float(OFFSETS[good[0]]), float(found[good[0]])
    return emergency_point(scene, memory)


def free_to_drive(scene: Scene, bearings: F64) -> F64:
    """How far the disc can go along bearings (m,) [m]: nowhere that a round robot's brake would not let it begin to go.

    The disc is smaller than what the brake keeps clear where something is as near as that: else the robot would stand there
    for ever, before a way that only the disc has. Where ranges scatter the next scan lets it go.
    """
    view, light = scene.view, scene.light
    ways, sensors, disc = light.free(bearings), view.sensors, braking_radius(view.sensors)
    if light.radius < disc and sensors.radius < disc and len(sensors.footprint) == 1 and sensors.range_noise <= STEADY:
        ways[view.free_distances(bearings, disc) <= disc - sensors.radius] = 0.0
    return ways


def emergency_point(scene: Scene, memory: HDBugMapMemory) -> tuple[float, float]:
    """Direction and way to the place about the robot that is farthest from everything seen."""
    memory.mode = "emergency"
    light, bearings = scene.light, HEADINGS - scene.view.heading
    ways = np.minimum(free_to_drive(scene, bearings), light.reach)
    gaps = light.gaps(ways[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)]))
    # Among points equally far from everything, the one with the longest way.
    best = int(np.lexsort((-ways, -gaps))[0]) if ways.max() > 0.0 else 0
    return float(HEADINGS[best]), float(ways[best])
