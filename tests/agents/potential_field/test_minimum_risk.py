"""The minimum risk method: its grid against a plain count, its three behaviours, what its search costs."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from episodes import canonical_world, run_episode

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.potential_field.risk_grid import DIRECTIONS, RiskGrid, Weights
from bug_gym.simulation import Simulation
from bug_gym.view import View


def test_the_risk_of_a_direction_is_the_sum_of_the_dots_in_its_sector() -> None:
    rng, size, reach = np.random.default_rng(0), 0.25, 2.0
    for _ in range(20):
        grid, expected = RiskGrid(size), np.zeros(DIRECTIONS)
        place = (float(rng.uniform(-3.0, 3.0)), float(rng.uniform(-3.0, 3.0)))
        grid.cover(*place, 4.0)
        seen = rng.uniform(-2.5, 2.5, (60, 2)) + place
        for _ in range(7):
            grid.add(place, seen[:, 0], seen[:, 1])
        counts: dict[tuple[int, int], int] = {}
        for x, y in seen:
            cell = int((x - grid.corner[0]) // size), int((y - grid.corner[1]) // size)
            counts[cell] = counts.get(cell, 0) + 7
        own = int((place[0] - grid.corner[0]) // size), int((place[1] - grid.corner[1]) // size)
        for cell, count in counts.items():
            dx, dy = ((cell[i] + 0.5) * size + grid.corner[i] - place[i] for i in range(2))
            if cell == own or math.hypot(dx, dy) > reach:
                continue
            gaps = [abs(math.remainder(math.atan2(dy, dx) - 2.0 * math.pi * k / 16, 2.0 * math.pi)) for k in range(16)]
            expected[int(np.argmin(gaps))] += 3.0 * min(count, 5)
        assert grid.risks(place, reach, Weights(3.0, 1.0)) == pytest.approx(expected)


def test_own_tracks_make_a_direction_unattractive_and_the_grid_keeps_them_as_it_grows() -> None:
    grid, nothing = RiskGrid(0.25), np.empty(0)
    for x in np.arange(0.0, 40.0, 0.1):
        grid.cover(float(x), 0.1, 2.0)
        grid.add((float(x), 0.1), nothing, nothing)
    assert int(grid.dots[1].sum()) == 400
    track = grid.middles(1)
    assert track[:, 0].min() == pytest.approx(0.125) and np.abs(track[:, 1] - 0.125).max() < 1e-9
    risks = grid.risks((39.9, 0.1), 2.0, Weights(3.0, 1.0))
    assert risks[8] > 0.0 and risks[[0, 4, 12]].max() == 0.0


def test_of_directions_of_the_same_risk_that_nearest_to_the_goals_is_searched() -> None:
    for turns, goal in itertools.product((0, 7), (0.4, 1.9, -1.2, 3.0)):
        world = {"family": "empty", "start": [0, 0, 0], "goal": [5 * math.cos(goal), 5 * math.sin(goal)]}
        simulation = Simulation({"world": world}, overrides={"robot.kinematics": "differential"})
        policy: Any = make_policy("minimum_risk", simulation)
        observation = simulation.reset(seeds=[0])
        for _ in range(turns):
            observation = simulation.step([[[-1.0, 1.0]]]).observation
        view = View(observation[0, 0], policy.sensors)
        gaps = np.abs(np.angle(np.exp(1j * (policy.directions - view.heading - view.goal_bearing))))
        for nearest in np.argsort(gaps)[:3]:  # one after the other is blocked
            free = gaps >= gaps[nearest]
            assert policy._search(view, policy.start(), free) == policy.directions[nearest]
        free = gaps > 0.5 * math.pi
        assert policy._aside(view, free) is None, "all that is free leads away from the goal"
        free[np.argsort(gaps)[[1, 2]]] = True
        assert math.cos(policy._aside(view, free) + view.heading - policy.directions[np.argsort(gaps)[1]]) > 1.0 - 1e-9


@pytest.mark.parametrize("free_way", [0.5, 1.5])
def test_a_direction_is_one_where_so_much_way_is_free(free_way: float) -> None:
    """A wall across the way; of the directions aside the nearest to the goal's is taken that does not end at it too soon."""
    world = {"family": "explicit", "bounds": [-9, -9, 9, 9], "start": [0, 0, 0], "goal": [6, 0.2]}
    simulation = Simulation({"world": {**world, "polygons": [[[0.5, -5], [0.7, -5], [0.7, 5], [0.5, 5]]]}})
    policy: Any = make_policy("minimum_risk", simulation, free_way=free_way)
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    way, bearing = 0.5 - policy.boundary.safe_radius, math.atan2(*reversed(policy.act(view, memory)))
    assert memory.mode == "obstacle_avoidance"
    turns = np.arange(DIRECTIONS) * 2.0 * math.pi / DIRECTIONS
    free = turns[way >= free_way * np.cos(turns)]
    assert bearing == pytest.approx(free[np.cos(free - view.goal_bearing).argmax()])


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_it_leaves_the_u_by_its_search_and_pays_for_it(kinematics: str) -> None:
    """The paper: the trial-and-return behaviour is time consuming in U-shaped environments."""
    settings = {"robot.kinematics": kinematics}
    searched = run_episode("minimum_risk", canonical_world("u_trap"), settings)
    ours = run_episode("apf_wall_following", canonical_world("u_trap"), settings)
    assert searched.outcome == ours.outcome == "success"
    assert set(searched.modes) == {"goal_seeking", "obstacle_avoidance", "path_searching"}
    assert searched.full_length > 1.05 * ours.full_length


def test_a_goal_shut_in_ends_as_looping_when_its_patience_does() -> None:
    episode = run_episode("minimum_risk", "ring", patience=60.0)
    assert episode.verdict == "looping"
    assert len(episode.modes) * episode.simulation.scenario.time.step == pytest.approx(70.0, abs=20.0)


def test_after_a_trap_it_seeks_the_goal_only_nearer_than_it_was() -> None:
    simulation = Simulation(canonical_world("u_trap"))
    agent: Any = make_policy("minimum_risk", simulation)
    observation, state = simulation.reset(seeds=[0]), None
    trapped = None
    for _ in range(2000):
        action, state = agent.predict(observation[:, 0], state)
        memory = state[0]
        distance = float(simulation.info()["goal_distance"][0, 0])
        if trapped is not None and memory.trapped_at is None:
            assert distance < trapped - 0.25 and memory.mode == "goal_seeking"
        trapped = memory.trapped_at
        step = simulation.step(action[:, None])
        if step.terminated.any():
            return
        observation = step.observation
    pytest.fail("it does not arrive")


def test_it_shows_the_dots_and_in_a_trap_the_direction_of_the_search() -> None:
    episode = run_episode("minimum_risk", canonical_world("u_trap"), max_steps=250)
    policy: Any = make_policy("minimum_risk", episode.simulation)
    assert episode.modes[-1] == "path_searching"
    drawing = policy.draw(episode.memory)
    places = {label: [one[:2] for one in drawing.points if one[2] == label] for label in ("obstacle", "trajectory")}
    half = 0.5 * policy.parameters.cell + 1e-6
    for x, y, _ in episode.path[: len(episode.modes)]:  # of each decision
        assert any(abs(x - u) <= half and abs(y - v) <= half for u, v in places["trajectory"])
    walls = np.array([[5, 3], [11, 3], [11, -3], [5, -3]], dtype=float)  # inside of the U
    for x, y in places["obstacle"]:
        near = [kernels.point_wall_distance(x, y, *walls[i], *walls[i + 1]) for i in range(3)]
        ends = [kernels.point_wall_distance(x, y, 5.0, 3.0 * side, 5.0, 4.0 * side) for side in (-1.0, 1.0)]
        assert min(near + ends) <= math.sqrt(2.0) * half
    ((x0, y0, x1, y1, label),) = drawing.segments
    assert label == "direction" and (x0, y0) == episode.memory.place
    assert math.atan2(y1 - y0, x1 - x0) == pytest.approx(math.remainder(episode.memory.direction, 2.0 * math.pi))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"cell": 0.0}, "cell must be above 0, got 0.0"),
        ({"trajectory_weight": -1.0}, "trajectory_weight must be above 0"),
        ({"cell": 0.011, "sector": 2.3}, "cell must be at least a 200th of the sector"),
        ({"cell": 1e-300, "sector": 1e-300}, "cell must be at least 0.01 m"),
        *(
            ({name: math.inf}, f"{name} must be above 0 and finite, got inf")
            for name in ("cell", "sector", "obstacle_weight", "trajectory_weight", "free_way")
        ),
    ],
)
def test_bad_parameters_are_refused_in_one_line(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy("minimum_risk", Simulation("static"), **parameters)
