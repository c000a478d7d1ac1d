"""How HD-BUG chooses among doors: their cost, what makes it change its mind, and what becomes of ways that are blocked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug.explore import LEAST_GAIN, SAFE, SAME_DOOR, SUCCESSOR
from bug_gym.agents.hd_bug.memory import Walls
from bug_gym.agents.hd_bug.path_list import Door
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.evaluation import evaluate
from bug_gym.geometry import Point
from bug_gym.simulation import Simulation
from bug_gym.view import View

WIDE = 5.0
"""Room about a door without risk [m]."""


def before(*places: Point, rooms: tuple[float, ...] = (), **parameters: Any) -> tuple[Any, Scene, Any, list[Door]]:
    """An explorer, what it sees, its memory, and its doors: at the origin in the open, v half-way to each q."""
    world = {"family": "empty", "bounds": [-40, -40, 40, 40], "start": [0, 0, 0], "goal": [30, 0]}
    simulation = Simulation({"world": world, "robot": {"kinematics": "holonomic"}})
    policy: Any = make_policy("hd_bug", simulation, **parameters)
    memory, view = policy.start(), View(simulation.reset(seeds=[0])[0, 0], policy.sensors)
    tracks = policy.perception.tracker.update(memory.tracker, view, 0.0)
    node = memory.path.visit(view.position, 0.0, memory.light)
    rooms = rooms or (WIDE,) * len(places)
    node.doors = [
        Door((0.5 * x, 0.5 * y), (x, y), room, node.number) for (x, y), room in zip(places, rooms, strict=True)
    ]
    memory.goal, memory.walls = (30.0, 0.0), Walls(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.bool_))
    return policy.explorer, Scene(view, tracks), memory, node.doors


@pytest.mark.parametrize("narrow", [0, 1])
@pytest.mark.parametrize("room", [0.25, 0.6, 1.15])
def test_of_two_equal_doors_it_takes_the_wider_one(room: float, narrow: int) -> None:
    """The risk is the square of the share that the room beside the body lacks to what is safe."""
    rooms = (room, WIDE) if narrow == 0 else (WIDE, room)
    explorer, scene, memory, doors = before((2.0, 1.0), (2.0, -1.0), rooms=rooms, beta=0.5)
    explorer.choose(scene, memory)
    assert memory.door is doors[1 - narrow]
    lacking = 1.0 - (room - explorer.sensors.radius) / SAFE
    assert memory.costs[narrow] - memory.costs[1 - narrow] == pytest.approx(0.5 * lacking**2)


@pytest.mark.parametrize("hysteresis", [0.0, 0.1])
@pytest.mark.parametrize(("share", "changes"), [(0.9, False), (1.1, True)])
def test_it_keeps_its_door_until_another_is_better_by_a_share_of_its_cost(
    share: float, changes: bool, hysteresis: float
) -> None:
    cost = 2.0 + 32.0
    gain = share * max(LEAST_GAIN, hysteresis * cost)
    better = (-2.0 + 0.5 * gain, 0.0)
    explorer, scene, memory, doors = before((-2.0, 0.0), better, hysteresis=hysteresis)
    memory.door, memory.heading_to = doors[0], doors[0].outside
    explorer.choose(scene, memory)
    assert memory.costs.tolist() == pytest.approx([cost, cost - gain])
    assert memory.door is doors[1 if changes else 0]


@pytest.mark.parametrize(("off", "carries_on"), [(-0.1, True), (0.1, False)])
def test_a_door_about_the_one_that_has_closed_carries_on_with_it(off: float, carries_on: bool) -> None:
    """It led round the same obstacle; another way is taken only where it is better by far."""
    aside = 1.0 + SUCCESSOR + off
    successor, other = (-2.0, aside), (-1.9, -aside)
    explorer, scene, memory, doors = before(successor, other)
    memory.door, memory.heading_to = None, (-2.0, 1.0)
    explorer.choose(scene, memory)
    assert memory.costs[1] < memory.costs[0] < memory.costs[1] + LEAST_GAIN
    assert memory.door is doors[0 if carries_on else 1]


def test_a_way_back_that_is_blocked_is_cut_and_its_door_stays() -> None:
    """The door that it goes to straight is closed instead, and where it was there is none any more."""
    explorer, scene, memory, doors = before((-2.0, 0.0), (0.0, 2.0))
    path, here = memory.path, memory.path.here
    there = path.visit((1.0, 0.0), 1.0, np.full_like(memory.light, 3.0))
    path.visit((0.0, 0.0), 2.0, np.full_like(memory.light, 3.0))
    assert path.here is here and path.way_to(here.number, there.number) == [here.number, there.number]
    memory.door, memory.way = doors[0], [there.number]
    explorer.give_up(scene, memory)
    assert path.way_to(here.number, there.number) == [] and doors[0] in path.doors and not memory.closed
    assert memory.door is None and memory.way == [] and memory.must_look
    memory.door = doors[0]
    gone = doors[0]
    explorer.give_up(scene, memory)
    assert gone not in path.doors and [closing.place for closing in memory.closed] == [gone.outside]
    assert all(math.isinf(closing.until) for closing in memory.closed)


def test_a_door_that_a_newer_node_sees_too_is_that_ones_unless_it_heads_for_it() -> None:
    explorer, _, memory, doors = before((-2.0, 0.0), (0.0, 2.0), (0.0, -3.0))
    headed_for, again, other = doors
    memory.door = headed_for
    explorer._take_over(memory, np.array([[-2.1, 0.0], [0.1, 2.1], [0.0, -3.0 - 2.0 * SAME_DOOR]]))
    assert memory.path.doors == [headed_for, other] and again not in memory.path.doors


@pytest.mark.parametrize("kinematics", ["differential", "holonomic"])
def test_in_a_corridor_it_sees_no_doors_in_the_walls_that_it_has_passed(kinematics: str) -> None:
    """A dead end of 14 m whose walls 64 beams meet far apart from one another: out of it, and back along it outside."""
    walls = [(-7.0, 0.6, 7.0, 0.8), (-7.0, -0.8, 7.0, -0.6), (6.8, -0.6, 7.0, 0.6)]
    polygons = [[[left, low], [right, low], [right, high], [left, high]] for left, low, right, high in walls]
    world = {"family": "explicit", "bounds": [-9, -4, 9, 4], "polygons": polygons, "start": [3, 0, 0], "goal": [3, 2.5]}
    settings = {
        "robot": {"kinematics": kinematics},
        "lidar": {"beams": 64, "range": 5.0, "noise": 0.01},
        "time": {"limit": 200.0},
        "world": world,
    }
    rows = evaluate(["hd_bug"], settings, episodes=6)
    assert all(row.success for row in rows)
    assert np.mean([row.path_length for row in rows]) < 2.2 * rows[0].shortest_path_length
