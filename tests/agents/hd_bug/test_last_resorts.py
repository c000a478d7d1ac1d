"""What HD-BUG does where nothing else is left: emergency points, and doors that are tried again where something moved."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.simulation import Simulation
from bug_gym.view import View

RADIUS, BASE = 0.2, 0.25
"""Of the robot [m], and v_min as a share of its top speed of 1 m/s."""
BETWEEN = 2.0 * math.pi / 32
"""From one direction of the ring to the next [rad]."""


def slab(angle: float, near: float) -> list[list[float]]:
    """A wall of 40 m whose face lies `near` [m] from the origin, beside it at an angle [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    corners = ((near, -20.0), (near + 0.5, -20.0), (near + 0.5, 20.0), (near, 20.0))
    return [[cos * x - sin * y, sin * x + cos * y] for x, y in corners]


def among(*walls: list[list[float]], turns: int = 0) -> tuple[Any, View]:
    """A policy and what it sees at the origin between walls, after some steps of turning on the spot."""
    world = {"family": "explicit", "bounds": [-40, -40, 40, 40], "start": [0, 0, 0], "goal": [30, 30]}
    settings = {
        "world": world | {"polygons": list(walls)},
        "robot": {"kinematics": "differential", "max_turn_rate": 1.5},
    }
    simulation = Simulation({**settings, "lidar": {"beams": 360, "range": 10.0}})
    policy: Any = make_policy("hd_bug", simulation)
    flat = simulation.reset(seeds=[0])[0, 0]
    still = 2.0 * 0.3 / 1.3 - 1.0  # -max_reverse to max_speed is -1 to 1
    for _ in range(turns):
        flat = simulation.step(np.array([[[still, 1.0]]])).observation[0, 0]
    return policy, View(flat, policy.sensors)


def apart(one: float, other: float) -> float:
    """Angle between two directions [rad]."""
    return abs(math.remainder(one - other, 2.0 * math.pi))


@pytest.mark.parametrize("turns", [0, 7])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, -1.9])
def test_beside_a_wall_the_emergency_point_lies_straight_away_from_it(angle: float, turns: int) -> None:
    policy, view = among(slab(angle, 0.3), turns=turns)
    direction, speed = policy.motion.emergency_point(view, 2.0)
    assert apart(direction, angle + math.pi) <= 0.5 * BETWEEN + 1e-3
    assert speed == pytest.approx(BASE)  # v_min: what is near is not known to stand


@pytest.mark.parametrize(("reach", "across"), [(0.5, 1.0), (4.0, 0.7 / 4.0)])
def test_between_two_walls_it_is_the_place_on_the_ring_that_is_farthest_from_both(reach: float, across: float) -> None:
    """The walls lie 0.3 m to the right and 1.7 m to the left, so the middle is 0.7 m to the left, if that is within r'."""
    policy, view = among(slab(-0.5 * math.pi, 0.3), slab(0.5 * math.pi, 1.7))
    direction, _ = policy.motion.emergency_point(view, reach)
    assert min(apart(direction, angle) for angle in (math.asin(across), math.pi - math.asin(across))) <= 0.5 * BETWEEN


def test_shut_in_all_round_it_stands() -> None:
    policy, view = among(turns=3)
    view.ranges[:] = RADIUS
    assert policy.motion.emergency_point(view, 2.0) == (view.heading, 0.0)


def test_where_it_is_pushed_into_a_corner_with_no_way_on_it_goes_to_the_emergency_point(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policy, view = among(slab(0.7, 0.3))
    memory = policy.start()
    monkeypatch.setattr(policy.motion, "toward", lambda *_: None)
    monkeypatch.setattr(policy.circumnavigation, "velocity", lambda *_: (0.0, 0.0))
    velocity = policy.act(view, memory)
    assert memory.mode == "emergency"
    assert apart(math.atan2(velocity[1], velocity[0]), 0.7 + math.pi) <= 0.5 * BETWEEN + 1e-3
    assert math.hypot(*velocity) == pytest.approx(BASE)


@pytest.mark.parametrize("gap", [0.5, 1.5, None])
def test_a_door_that_led_nowhere_is_tried_again_if_something_moved_near_it(gap: float | None) -> None:
    """Within a metre of it; after five seconds, and never where nothing moved."""
    simulation = Simulation("u_trap", 1)
    policy: Any = make_policy("hd_bug", simulation)
    memory, view = policy.start(), View(simulation.reset(seeds=[0])[0, 0], policy.sensors)
    scene = policy.perception.perceive(view, memory)
    policy.explorer.look(scene, memory)
    policy.explorer.choose(scene, memory)
    place = memory.door.outside
    if gap is not None:
        mover = np.array([[place[0] + 0.3 + gap, place[1]]])
        tracks = scene.tracks._replace(
            position=mover, velocity=np.zeros((1, 2)), radius=np.array([0.3]), moving=np.ones(1, dtype=np.bool_)
        )
        policy.explorer.give_up(Scene(view, tracks), memory)
    else:
        policy.explorer.give_up(scene, memory)

    def is_back(seconds: float) -> bool:
        """Whether the door is there again when it looks so long after [s]."""
        memory.steps, memory.must_look = begun + round(seconds / 0.1), True
        policy.explorer.look(scene, memory)
        return any(math.dist(door.outside, place) < 0.2 for door in memory.path.doors)

    begun = memory.steps
    assert not is_back(0.0) and not is_back(4.8)
    assert is_back(5.2) == (gap is not None and gap < 1.0)


@pytest.mark.parametrize("angle", [math.pi / 6.0, math.pi / 1.5, math.pi / 1.2, math.pi / 0.75])
@pytest.mark.parametrize("arrived", [1, 2])
def test_what_stands_in_the_way_right_before_the_goal_is_gone_round(angle: float, arrived: int) -> None:
    """As robots do that have arrived. The way is no longer than straight on and once round them."""
    far, radius, start = 0.33, 0.2, (-5.0, 0.3)
    turns = [angle + 1.5 * number for number in range(arrived)]
    circles = [[far * math.cos(turn), far * math.sin(turn), radius] for turn in turns]
    world = {
        "family": "explicit",
        "bounds": [-8, -8, 8, 8],
        "start": [*start, 0.0],
        "goal": [0.0, 0.0],
        "circles": circles,
    }
    simulation = Simulation({"world": world, "robot": {"kinematics": "differential"}})
    policy: Any = make_policy("hd_bug", simulation)
    flat, memory = simulation.reset(seeds=[0]), None
    while simulation.world.active[0, 0]:
        action, memory = policy.predict(flat[:, 0], memory)
        flat = simulation.step(action[:, None]).observation
    apart_by = math.dist(circles[0][:2], circles[-1][:2])
    round_them = 2.0 * math.pi * (radius + policy.boundary.clearance) + 2.0 * apart_by
    assert simulation.info()["is_success"][0]
    assert simulation.world.array("path_length")[0, 0] < math.hypot(*start) + round_them
