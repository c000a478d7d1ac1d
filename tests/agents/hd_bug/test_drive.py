"""How fast HD-BUG drives: eq. (9), and brakes."""

from __future__ import annotations

import math
from typing import Any

import pytest

from bug_gym.agents import make_policy
from bug_gym.simulation import Simulation
from bug_gym.view import View


def between(half: float, **robot: Any) -> tuple[Any, View]:
    """How HD-BUG drives, and what it sees in the middle of a passage so wide to either side [m], along the heading."""
    walls = [[[-20, y], [20, y], [20, y + 0.5], [-20, y + 0.5]] for y in (half, -half - 0.5)]
    world = {"family": "explicit", "bounds": [-40, -40, 40, 40], "polygons": walls, "start": [0, 0, 0], "goal": [30, 0]}
    settings = {"world": world, "robot": {"kinematics": "holonomic", **robot}, "lidar": {"beams": 360, "range": 10.0}}
    simulation = Simulation(settings)
    policy: Any = make_policy("hd_bug", simulation, v_max=0.9, v_base=0.5, v_min=0.25, r_base=0.5)
    return policy.motion, View(simulation.reset(seeds=[0])[0, 0], policy.sensors)


@pytest.mark.parametrize(("half", "narrow"), [(0.36, True), (0.8, False)])
def test_it_is_fast_where_the_way_is_clear_and_slow_near_things_and_slowest_in_a_passage(
    half: float, narrow: bool
) -> None:
    """The passage is narrower than two bodies of 0.4 m, or four times as wide as one."""
    motion, view = between(half)
    for free, speed in ((5.0, 0.9), (2.0, 0.9), (1.9, 0.9), (0.51, 0.9), (0.49, 0.5), (0.2, 0.5)):
        clear = free >= 2.0
        expected = min(speed, 0.25) if narrow and not clear else speed
        assert motion.rule(view, 0.0, free, 2.0) == pytest.approx(expected)
    assert motion.rule(view, 0.0, 0.015, 2.0) == pytest.approx(0.15), "a step of 0.1 s ends where the way does"


@pytest.mark.parametrize("acceleration", [0.2, 1.0])
@pytest.mark.parametrize("free", [0.1, 0.3, 2.5])
def test_a_robot_with_inertia_stops_within_the_free_way(free: float, acceleration: float) -> None:
    """It goes on for a step, then brakes over v^2 / 2 a."""
    motion, view = between(5.0, max_acceleration=acceleration)
    speed = motion.rule(view, 0.0, free, 3.0)
    assert 0.0 <= speed <= 0.9 and 0.1 * speed + speed**2 / (2.0 * acceleration) <= free + 1e-9
    without = between(5.0)[0].rule(view, 0.0, free, 3.0)
    assert (speed < without) == (math.sqrt(2.0 * acceleration * max(free - 0.1 * without, 0.0)) < without)
