"""Goals in corners, so near to both walls that the body comes within their radius on some straight ways alone."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.scan.way_in import is_goal_by_wall, way_in
from bug_gym.evaluation import evaluate
from bug_gym.navigation_env import NavigationEnv
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

RADIUS, REACH = 0.2, 0.3
WALL_BUGS = ["bug1", "bug2", "alg1", "alg2", "rev1", "rev3", "com1", "class1", "dist_bug", "tangent_bug"]
LOOKING = ["vis_bug_21", "vis_bug_22", "hd_bug_map", "apf_wall_following"]
CORNER_BUGS = ["point_bug", "k_bug", "e_bug", "critical_point_bug", "modified_critical_point_bug"]
U = [(-1.0, -2.0), (1.0, -2.0), (1.0, 2.0), (-1.0, 2.0), (-1.0, 1.8), (0.8, 1.8), (0.8, -1.8), (-1.0, -1.8)]


def turned(place: tuple[float, float], angle: float) -> list[float]:
    """A place turned about the middle of the world."""
    cos, sin = math.cos(angle), math.sin(angle)
    return [cos * place[0] - sin * place[1], sin * place[0] + cos * place[1]]


def described(kinematics: str, world: dict[str, Any]) -> dict[str, Any]:
    """The robot of 0.2 m in a world of its own."""
    lidar = {"beams": 180, "range": 20.0}
    return {
        "robot": {"kinematics": kinematics, "radius": RADIUS},
        "lidar": lidar,
        "goal": {"radius": REACH},
        "time": {"limit": 120.0},
        "world": {"family": "explicit", **world},
    }


def room(goal: float) -> dict[str, Any]:
    """An empty room, the goal near its corner."""
    return {"bounds": [-5, -5, 5, 5], "start": [0, 0, 0], "goal": [goal, goal]}


def trap(angle: float) -> dict[str, Any]:
    """A U turned by an angle, the goal in one of its inner corners."""
    outline = [turned(corner, angle) for corner in U]
    return {
        "bounds": [-8, -8, 8, 8],
        "start": [-5, 0.3, 0.2],
        "goal": turned((0.77, 1.77), angle),
        "polygons": [outline],
    }


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("goal", [4.93, 4.97])
def test_the_corner_of_a_room_is_reached(kinematics: str, goal: float) -> None:
    for row in evaluate([*WALL_BUGS, *LOOKING, *CORNER_BUGS], described(kinematics, room(goal)), episodes=1):
        assert (row.outcome, row.verdict) == ("success", ""), row.policy


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("angle", [0.1, 1.1, 2.2, 4.3])
def test_no_goal_in_an_inner_corner_is_called_unreachable(kinematics: str, angle: float) -> None:
    for row in evaluate([*WALL_BUGS, *LOOKING, *CORNER_BUGS], described(kinematics, trap(angle)), episodes=1):
        assert row.success or (row.policy, row.verdict) == ("hd_bug_map", "stuck"), row.policy


@pytest.mark.parametrize("policy", ["bug2", "tangent_bug", "vis_bug_21", "hd_bug_map", "point_bug"])
def test_a_goal_by_a_wall_that_no_body_comes_to_is_given_up(policy: str) -> None:
    # 0.02 m within a hollow square whose walls are 0.15 m thick: outside it the body stays 0.37 m away.
    walls = [
        ((0.4, -0.9), (2.2, -0.75)),
        ((0.4, 0.75), (2.2, 0.9)),
        ((0.4, -0.75), (0.55, 0.75)),
        ((2.05, -0.75), (2.2, 0.75)),
    ]
    polygons = [[[x, y], [u, y], [u, v], [x, v]] for (x, y), (u, v) in walls]
    world = {"bounds": [-5, -5, 5, 5], "start": [-2, 0.1, 0], "goal": [0.57, 0.0], "polygons": polygons}
    (row,) = evaluate([policy], described("holonomic", world), episodes=1)
    assert row.outcome == "gave_up"


@pytest.mark.parametrize("seed", range(20))
def test_a_way_in_touches_nothing_and_ends_within_the_radius(seed: int) -> None:
    rng = np.random.default_rng(seed)
    goal = float(rng.uniform(4.85, 4.99)), float(rng.uniform(4.85, 4.99))
    place = rng.uniform(3.9, 4.75, 2).tolist()
    world = {"bounds": [-5, -5, 5, 5], "start": [*place, float(rng.uniform(-3, 3))], "goal": [*goal]}
    simulation = Simulation(described("holonomic", world))
    observation = simulation.reset(seeds=[0])
    view = View(observation.reshape(-1), Sensors.of(simulation.scenario))
    assert is_goal_by_wall(view)  # 0.15 m at most
    radius = RADIUS + 0.01
    found = way_in(view, radius)
    if found is None:
        # No point of the disc's way to its place in the corner, but for what lies between two beams, is within the radius.
        assert math.dist((5.0 - radius, 5.0 - radius), goal) > REACH - 0.05
        return
    bearing, ahead = found
    ends = np.array([ahead * math.cos(bearing), ahead * math.sin(bearing)])
    assert math.dist(ends, view.goal) < REACH
    x, y, turn = simulation.world.pose[0, 0].tolist()
    cos, sin = math.cos(turn), math.sin(turn)
    end = x + cos * ends[0] - sin * ends[1], y + sin * ends[0] + cos * ends[1]
    assert 5.0 - max(end) >= RADIUS


def test_a_goal_is_by_no_wall_any_more_when_what_stood_there_has_gone() -> None:
    """Else the map planner would end its way short of it, and say "stuck" for what a mover did that stood there."""
    env = NavigationEnv(described("holonomic", {"bounds": [-5, -5, 5, 5], "start": [-4, 0, 0], "goal": [4, 0]}))
    policy = make_policy("hd_bug_map", env)
    observation, _ = env.reset(seed=0)
    state: Any = None
    for step in range(20):
        action, state = policy.predict(observation, state)
        if step == 15:
            state[0].is_goal_by_wall, state[0].beside_goal = True, 10_000
        observation, *_ = env.step(action)
    assert (state[0].is_goal_by_wall, state[0].beside_goal, state[0].verdict) == (False, 0, "")
