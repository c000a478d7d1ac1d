"""The velocity-obstacle navigator: what it chooses, against all that it might have, and how it meets movers."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest
from episodes import Episode, run_episode

from bug_gym.agents import make_policy
from bug_gym.agents.local.navigator import Avoidance, Navigator, NavigatorParameters
from bug_gym.evaluation import evaluate
from bug_gym.geometry import F64
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

SCENARIO: dict[str, Any] = {"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}, "lidar": {"beams": 180}}
HORIZON, MARGIN = 3.0, 0.2


def empty_view(**overrides: Any) -> View:
    """What a robot sees in an empty world as it begins."""
    simulation = Simulation(SCENARIO, overrides=overrides)
    flat = simulation.reset(seeds=[0])[0, 0].copy()
    flat[:180] = simulation.scenario.lidar.range
    return View(flat, Sensors.of(simulation.scenario))


def nearest_approach(movers: F64, velocity: F64, horizon: float = HORIZON) -> F64:
    """The least gap to each mover (n,) within the horizon if all go on, looked at every 5 ms [m]."""
    times = np.linspace(0.0, horizon, 601)[:, None, None]
    apart = movers[None, :, :2] + times * (movers[None, :, 2:4] - velocity)
    return np.asarray(np.hypot(*np.moveaxis(apart, -1, 0)).min(axis=0) - movers[:, 4], dtype=np.float64)


def crowd(seed: int, count: int) -> F64:
    """Movers about the robot, none of them nearer than the margin."""
    generator = np.random.default_rng([seed, count])
    angle, away = generator.uniform(0.0, 2.0 * np.pi, count), generator.uniform(1.2, 4.0, count)
    going, speed = generator.uniform(0.0, 2.0 * np.pi, count), generator.uniform(0.0, 1.2, count)
    columns = [away * np.cos(angle), away * np.sin(angle), speed * np.cos(going), speed * np.sin(going)]
    return np.column_stack([*columns, generator.uniform(0.2, 0.5, count)])


def discs(max_speed: float) -> F64:
    """Velocities all over the robot's disc (k, 2)."""
    axis = np.linspace(-max_speed, max_speed, 61)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return np.asarray(grid[np.hypot(*grid.T) <= max_speed], dtype=np.float64)


@pytest.mark.parametrize("count", [1, 3, 8, 20])
@pytest.mark.parametrize("seed", range(6))
def test_the_choice_is_outside_every_velocity_obstacle_where_a_velocity_is(seed: int, count: int) -> None:
    view = empty_view()
    sensors = view.sensors
    navigator = Navigator(sensors, NavigatorParameters(horizon=HORIZON, mover_margin=MARGIN, steadiness=0.0))
    movers, wish = crowd(seed, count), np.array([sensors.drive.max_speed, 0.0])
    chosen = np.array(navigator.velocity(view, tuple(wish), 8.0, movers))
    assert np.hypot(*chosen) <= sensors.drive.max_speed * (1.0 + 1e-9)
    every = discs(sensors.drive.max_speed)
    gaps = np.array([nearest_approach(movers, velocity).min() for velocity in every]) - sensors.radius
    if (gaps >= MARGIN + 1e-3).any():
        assert nearest_approach(movers, chosen).min() - sensors.radius >= MARGIN - 1e-4
        # and no velocity outside is much nearer to the wish: samples are 1/16 of the speed and 10 degrees apart
        best = np.hypot(*(every[gaps >= MARGIN + 1e-3] - wish).T).min()
        assert np.hypot(*(chosen - wish)) <= best + 0.15 * sensors.drive.max_speed
    elif (gaps >= 0.1 * MARGIN + 1e-3).any():
        assert nearest_approach(movers, chosen).min() - sensors.radius >= 0.1 * MARGIN - 1e-4


def test_far_movers_change_nothing() -> None:
    view = empty_view()
    movers = np.array([[9.0, 0.0, 0.0, 0.0, 0.4], [0.0, 3.0, 0.0, 1.0, 0.4], [-3.0, 0.0, 0.5, 0.0, 0.4]])
    for avoidance in get_args(Avoidance):
        navigator = Navigator(view.sensors, NavigatorParameters(avoidance=avoidance))
        assert navigator.velocity(view, (0.9, 0.0), 8.0, movers) == pytest.approx((0.9, 0.0), abs=1e-12)


def test_what_it_overlaps_it_parts_from_as_fast_as_it_can() -> None:
    view = empty_view()
    navigator = Navigator(view.sensors, NavigatorParameters())
    for bearing in np.linspace(0.0, 2.0 * np.pi, 7):
        x, y = 0.3 * math.cos(bearing), 0.3 * math.sin(bearing)
        vx, vy = navigator.velocity(view, (1.0, 0.0), 8.0, np.array([[x, y, 0.0, 0.0, 0.4]]))
        away = -(x * vx + y * vy) / 0.3
        assert away >= math.cos(math.radians(10.0)) * view.sensors.drive.max_speed


def test_a_wall_is_stopped_before_and_one_behind_the_goal_is_not_minded() -> None:
    view = empty_view()
    sensors = view.sensors
    across = 1.0 / np.maximum(np.cos(sensors.angles), 1e-9)
    view.ranges[:] = np.where((np.cos(sensors.angles) > 0.0) & (across < 4.0), np.minimum(across, 4.0), sensors.range)
    navigator = Navigator(sensors, NavigatorParameters(still_horizon=2.0))
    free = view.free_distance(0.0, sensors.radius)
    vx, _ = navigator.velocity(view, (1.0, 0.0), 8.0, np.zeros((0, 5)))
    assert 0.0 <= vx <= free / 2.0 + 1e-9
    assert navigator.velocity(view, (1.0, 0.0), 0.5, np.zeros((0, 5))) == pytest.approx((1.0, 0.0))


def test_only_what_can_be_reached_in_a_step_is_chosen() -> None:
    view = empty_view(**{"robot.max_acceleration": 1.0})
    navigator = Navigator(view.sensors, NavigatorParameters())
    ahead = np.array([[2.0, 0.0, -1.0, 0.0, 0.4]])
    for movers in (np.zeros((0, 5)), ahead):
        vx, vy = navigator.velocity(view, (1.0, 0.0), 8.0, movers)
        assert math.hypot(vx - view.velocity[0], vy - view.velocity[1]) <= 0.1 + 1e-9


def walker(x: float, y: float, speed: float) -> dict[str, Any]:
    """A pedestrian that crosses upwards, or downwards with a speed below 0."""
    ways = [[x, y], [x, y + math.copysign(40.0, speed)]]
    return {"shape": {"circle": 0.3}, "at": [x, y], "motion": {"law": "waypoints", "points": ways, "speed": abs(speed)}}


def world(*movers: dict[str, Any]) -> dict[str, Any]:
    """An open world to cross from (0, 0) to (20, 0)."""
    explicit = {"family": "explicit", "bounds": [-8, -45, 28, 45], "movers": list(movers)}
    return {"world": {**explicit, "start": [0, 0, 0], "goal": [20, 0]}, "lidar": {"beams": 360, "range": 8.0}}


HEAD_ON = {
    "shape": {"circle": 0.3},
    "at": [14.0, 0.0],
    "motion": {"law": "waypoints", "points": [[14.0, 0.0], [-6.0, 0.0]], "speed": 0.8},
}


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("policy", ["velocity_obstacle", "d2t_eaco"])
@pytest.mark.parametrize("avoidance", ["vo", "orca"])
def test_head_on(policy: str, avoidance: str, kinematics: str) -> None:
    episode = run_episode(policy, world(HEAD_ON), {"robot.kinematics": kinematics}, avoidance=avoidance)
    # Half planes leave half of the avoiding to the other, who does none of it here; the rest comes step by step.
    assert episode.outcome == "success" and episode.min_clearance >= (MARGIN - 0.02 if avoidance == "vo" else 0.05)
    assert episode.length <= 21.0


@pytest.mark.parametrize("planner", ["a_star", "d_star_lite", "rrt_star", "visibility_graph"])
def test_every_planned_way_can_be_followed_among_movers(planner: str) -> None:
    still = {**world(HEAD_ON)["world"], "polygons": [[[5, -3], [6, -3], [6, 0.5], [5, 0.5]]]}
    settings = {**world(), "world": still}
    episode = run_episode(planner, settings, {"robot.kinematics": "holonomic"}, follower="velocity_obstacle")
    assert episode.outcome == "success" and episode.min_clearance > 0.0 and episode.length <= 22.0
    assert episode.memory.plans == 1  # the mover is left to the follower


@pytest.mark.parametrize("avoidance", ["vo", "rvo", "orca"])
def test_robots_that_all_avoid_each_other_never_touch(avoidance: str) -> None:
    simulation = Simulation("crossing_robots")
    policy = make_policy("velocity_obstacle", simulation, avoidance=avoidance)
    for seed in range(2):
        observation, state = simulation.reset(seeds=[seed]), None
        for _ in range(400):
            action, state = policy.predict(observation[0], state)
            step = simulation.step(action[None])
            observation = step.observation
            if (step.terminated | step.truncated).all():
                break
        assert set(simulation.info()["outcome"][0]) == {"success"}


def two_crossings(policy: str, **parameters: Any) -> Episode:
    """Two pedestrians, from the right and from the left, each where the robot would be."""
    movers = world(walker(6.0, -4.8, 0.8), walker(12.5, 10.0, -0.8))
    return run_episode(policy, movers, **parameters)


@pytest.mark.parametrize("policy", ["velocity_obstacle", "d2t_eaco"])
def test_two_crossing_pedestrians_are_passed_as_in_the_paper(policy: str) -> None:
    episode = two_crossings(policy, mover_margin=1.2)
    assert episode.outcome == "success"
    assert 1.1 <= episode.min_clearance <= 1.35
    steps = np.diff(episode.path[:, :2], axis=0)
    speed, heading = np.hypot(*steps.T) / 0.1, np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
    slows, turns = int((speed < 0.95).argmax()), int((np.abs(heading) > 5.0).argmax())
    assert slows < turns  # it slows first
    first, second = (np.abs(episode.path[(episode.path[:, 0] > a) & (episode.path[:, 0] < b), 1]).max()
                     for a, b in ((0.0, 7.5), (9.5, 16.0)))  # fmt: skip
    assert second < first  # the second deviation is the smaller one
    assert np.abs(heading[-20:-3]).max() < 5.0  # and it comes back without swinging
    moving = heading[speed > 0.2]
    signs = np.sign(moving[np.abs(moving) > 5.0])
    assert (np.diff(signs) != 0.0).sum() <= 2


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_crowd_of_movers_is_crossed_without_contact(kinematics: str) -> None:
    for seed in range(3):
        episode = run_episode("velocity_obstacle", "dynamic", {"robot.kinematics": kinematics}, seed=seed)
        assert episode.outcome == "success"


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"horizon": 0.0}, "horizon must be above 0"),
        ({"mover_margin": -0.1}, "mover_margin must not be negative"),
        ({"avoidance": "none"}, "avoidance must be one of"),
    ],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_policy("velocity_obstacle", "static", **parameters)


def test_a_differential_robot_is_taken_larger_for_what_it_cannot_do_at_once() -> None:
    free, held = (
        Navigator(Sensors.of(Simulation("static", overrides={"robot.kinematics": one}).scenario), NavigatorParameters())
        for one in ("holonomic", "differential")
    )
    assert held.robot.margin > free.robot.margin


BEHIND: dict[str, Any] = {
    "shape": {"circle": 0.3},
    "at": [14.0, 0.0],
    "motion": {"law": "waypoints", "points": [[14.0, 0.0], [-6.0, 0.0]], "speed": 2.0},
}


def test_who_is_told_the_movers_gets_out_of_the_way_of_what_is_beyond_the_scan() -> None:
    """A fast mover comes straight on; the scan shows it half a second before contact, too late for who has to see it."""
    short = {**world(BEHIND), "lidar": {"beams": 180, "range": 1.5}}
    told, tracked = (run_episode("velocity_obstacle", short, privileged=privileged) for privileged in (True, False))
    assert told.outcome == "success" and told.min_clearance >= MARGIN - 0.02
    assert tracked.min_clearance < told.min_clearance
    sideways = np.abs(told.path[:, 1]) > 1e-3
    first = int(sideways.argmax())
    gap = 14.0 - 0.1 * first * 2.0 - told.path[first, 0]
    assert sideways.any() and gap > 2.0  # it has left the straight way before the scan reaches the mover


def test_who_is_told_the_movers_is_marked_and_needs_a_live_world() -> None:
    policy: Any = make_policy("velocity_obstacle", Simulation("static"), privileged=True)
    assert policy.privileged and not getattr(make_policy("velocity_obstacle", Simulation("static")), "privileged", True)
    with pytest.raises(ValueError, match="policy 'velocity_obstacle' reads the map of a live world: expected an env"):
        make_policy("velocity_obstacle", "static", privileged=True)
    rows = evaluate(["velocity_obstacle", "velocity_obstacle:privileged=true"], "empty", episodes=1)
    assert [row.policy for row in rows] == ["velocity_obstacle", "velocity_obstacle:privileged=true (privileged)"]
    only = evaluate(["velocity_obstacle", "velocity_obstacle:privileged=true"], "empty", episodes=1, privileged=False)
    assert [row.policy for row in only] == ["velocity_obstacle"]
