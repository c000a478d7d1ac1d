"""The velocity-obstacle navigator: what it chooses, against all that it might have, and how it meets movers."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pytest
from episodes import Episode, run_episode

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.local.navigator import ROOM, Avoidance, Navigator, NavigatorParameters
from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.route import Route
from bug_gym.agents.planning.vo_follower import VelocityObstacleFollower
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


def test_who_steers_changes_its_direction_at_once_and_its_speed_as_fast_as_it_can() -> None:
    view = empty_view(**{"robot.kinematics": "ackermann", "robot.max_acceleration": 1.0})
    navigator = Navigator(view.sensors, NavigatorParameters())
    for bearing in (0.0, 1.5, -3.0):
        wish = math.cos(bearing), math.sin(bearing)
        assert navigator.velocity(view, wish, 8.0, np.zeros((0, 5))) == pytest.approx((0.1 * wish[0], 0.1 * wish[1]))
        ahead = np.array([[2.0, 0.0, -1.0, 0.0, 0.4]])
        assert math.hypot(*navigator.velocity(view, wish, 8.0, ahead)) <= 0.1 + 1e-9  # it stood before


@pytest.mark.parametrize(("step", "acceleration"), [(0.02, 0.3), (0.02, 1.0), (0.05, 0.5), (0.1, 0.3), (0.1, 1.0)])
@pytest.mark.parametrize("policy", ["velocity_obstacle", "d2t_eaco"])
def test_a_car_with_inertia_comes_to_a_goal_beside_it(policy: str, step: float, acceleration: float) -> None:
    """It had steered by as little as a body in space changes its direction, and gone round the goal until time was up."""
    for heading, goal in ((0.0, [1.0, 2.0]), (2.5, [1.0, 3.0]), (-1.5, [1.0, 0.7])):
        world = {"family": "empty", "start": [0, 0, heading], "goal": goal}
        scenario = {"world": world, "time": {"step": step, "limit": 30.0}, "robot": {"kinematics": "ackermann"}}
        episode = run_episode(policy, scenario, {"robot.max_acceleration": acceleration})
        assert episode.outcome == "success"
        assert episode.length <= math.hypot(*goal) + 1.0


# ------------------------------------------------------------------------------------------------ rule by rule


def chosen(
    movers: Any,
    wish: tuple[float, float],
    own: tuple[float, float] = (0.0, 0.0),
    *,
    points: F64 | None = None,
    acceleration: float | None = None,
    **parameters: Any,
) -> F64:
    """The velocity (2,) of a navigator among movers (n, 5) and scan points (k, 2), without steadiness unless it is told."""
    sensors = Sensors.of(Simulation(SCENARIO, overrides={"robot.max_acceleration": acceleration}).scenario)
    navigator = Navigator(sensors, NavigatorParameters(**{"steadiness": 0.0, **parameters}))
    x, y = np.zeros((2, 0)) if points is None else points.T
    view: Any = SimpleNamespace(points=(x, y), own_velocity=own)
    return np.array(navigator.velocity(view, wish, 8.0, np.array(movers, dtype=float).reshape(-1, 5)))


BODY = 0.2


def edges_of(place: F64, apex: F64, together: float) -> list[tuple[F64, F64]]:
    """Both edges of the cone of velocities that lead to a disc: where they begin, and their directions."""
    middle, half = math.atan2(place[1], place[0]), math.asin(together / np.hypot(*place))
    return [(apex, np.array([math.cos(angle), math.sin(angle)])) for angle in (middle - half, middle + half)]


@pytest.mark.parametrize("avoidance", ["vo", "rvo"])
@pytest.mark.parametrize("seed", range(12))
def test_before_one_mover_the_choice_is_the_nearest_on_the_edge_of_its_cone(avoidance: str, seed: int) -> None:
    """Whose apex is the mover's velocity, or the mean of it and one's own (van den Berg, Lin and Manocha 2008)."""
    generator = np.random.default_rng(seed)
    away, bearing, size = generator.uniform(1.0, 1.8), generator.uniform(-0.3, 0.3), generator.uniform(0.2, 0.5)
    place = away * np.array([math.cos(bearing), math.sin(bearing)])
    going, own, wish = np.array([-0.3, generator.uniform(-0.2, 0.2)]), generator.uniform(0.2, 0.5, 2), (0.8, 0.0)
    apex = 0.5 * (going + own) if avoidance == "rvo" else going
    found = chosen([*place, *going, size], wish, (own[0], own[1]), avoidance=avoidance, horizon=20.0)
    ahead = math.atan2(*(wish - apex)[::-1]) - bearing
    is_inside = abs(ahead) < math.asin((BODY + size + MARGIN) / away)
    nearest = math.inf if is_inside else 0.0
    for begin, along in edges_of(place, apex, BODY + size + MARGIN):
        on_edge = begin + max(float((wish - begin) @ along), 0.0) * along
        if np.hypot(*on_edge) <= 1.0:
            nearest = min(nearest, float(np.hypot(*(on_edge - wish))))
    assert np.hypot(*(found - wish)) == pytest.approx(nearest, abs=1e-4)


def test_of_two_sides_the_one_that_it_goes_to_already_is_kept() -> None:
    for aside in (0.2, -0.2):
        for movers in ([3.0, 0.0, -0.5, 0.0, 0.4], [2.0, 0.0, 0.0, 0.0, 0.3]):
            assert chosen(movers, (1.0, 0.0), (0.9, aside), steadiness=0.4)[1] * aside > 0.0
            # With all of the weight on the wish both are alike, however it goes.
            found = chosen(movers, (1.0, 0.0), (0.9, aside)), chosen(movers, (1.0, 0.0), (0.9, -aside))
            np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_nearer_than_the_margin_comes_no_nearer(seed: int) -> None:
    generator = np.random.default_rng(seed)
    (bearing, heading), gap = generator.uniform(-math.pi, math.pi, 2), generator.uniform(0.01, 0.19)
    away = BODY + 0.4 + gap
    mover = np.array([[away * math.cos(bearing), away * math.sin(bearing), 0.0, 0.0, 0.4]])
    wish = math.cos(bearing + 0.4 * heading), math.sin(bearing + 0.4 * heading)
    found = chosen(mover, wish)
    assert nearest_approach(mover, found).min() - BODY >= gap - 0.0011 * away
    assert np.hypot(*found) > 0.1 or abs(heading) < 0.5  # it goes on beside it


def test_where_the_whole_margin_leaves_no_velocity_half_of_it_is_kept() -> None:
    """A row comes in faster than the robot can get out of its way, with 0.12 m beside the body in its only gap."""
    aside = np.concatenate([0.62 + 0.6 * np.arange(6), -0.62 - 0.6 * np.arange(6)])
    row = np.column_stack([np.full(12, 1.2), aside, np.full(12, -1.5), np.zeros(12), np.full(12, 0.3)])
    wish = np.array([0.5, 0.15])
    assert 0.0 < nearest_approach(row, wish).min() - BODY < 0.05
    found = nearest_approach(row, chosen(row, (0.5, 0.15))).min() - BODY
    assert 0.5 * MARGIN - 1e-3 <= found <= 0.12


def test_where_all_lead_to_contact_time_is_weighed_against_the_wish() -> None:
    """Twelve come in from all round, faster than the robot: the more contact weighs the later it is."""
    around = 2.0 * np.pi * np.arange(12) / 12 + 0.05
    away = 1.5 + 0.4 * np.cos(around - 2.0)
    ring = np.column_stack([away * np.cos(around), away * np.sin(around), -1.5 * np.cos(around), -1.5 * np.sin(around)])
    ring = np.column_stack([ring, np.full(12, 0.4)])
    wish = np.array([0.6, -0.3])

    def time(velocity: F64) -> float:
        toward = velocity - ring[:, 2:4]
        ahead, speed = (ring[:, :2] * toward).sum(axis=1), (toward**2).sum(axis=1)
        left = (ring[:, :2] ** 2).sum(axis=1) - (BODY + ring[:, 4]) ** 2
        root = ahead**2 - speed * left
        meets = (root >= 0.0) & (ahead > 0.0)
        return float(((ahead - np.sqrt(np.where(meets, root, 0.0))) / speed)[meets].min(initial=math.inf))

    every = discs(1.0)[::5]
    latest = max(map(time, every))
    assert latest < 3.0
    np.testing.assert_allclose(chosen(ring, (0.6, -0.3), contact_weight=0.0), wish)
    assert time(chosen(ring, (0.6, -0.3), contact_weight=1e4)) >= latest - 0.02
    for weight in (0.1, 1.0):
        cost = np.hypot(*(every - wish).T) + weight / np.array([time(one) for one in every])
        found = chosen(ring, (0.6, -0.3), contact_weight=weight)
        assert (
            np.hypot(*(found - wish)) + weight / time(found) <= cost.min() + 0.1
        )  # samples are 1/16 of the speed and 10 degrees apart


@pytest.mark.parametrize("acceleration", [None, 2.0])
@pytest.mark.parametrize("gap", [0.06, 0.2, 0.4, 0.6])
def test_what_is_seen_of_a_mover_is_stopped_before_and_is_nothing_that_stands(
    gap: float, acceleration: float | None
) -> None:
    """One that goes away faster leads to no contact; still its points have to leave room to stop, and no more than that."""
    angles, away = np.linspace(-1.0, 1.0, 41), BODY + ROOM + gap + 0.4
    points = np.stack([away - 0.4 * np.cos(angles), 0.4 * np.sin(angles)], axis=1)
    mover, wish, own = [away, 0.0, 1.5, 0.0, 0.4], (1.0, 0.0), (1.0, 0.0)
    brake = acceleration or math.inf
    for movers in ([mover], []):
        found = chosen(movers, wish, own, points=points, acceleration=acceleration)
        speed, bearing = float(np.hypot(*found)), math.atan2(found[1], found[0])
        free = kernels.free_distance(points[:, 0].copy(), points[:, 1].copy(), bearing, BODY + ROOM, 8.0)
        assert 0.1 * speed + speed**2 / (2.0 * brake) <= free + 1e-6
        can_stop = 0.1 + 1.0 / (2.0 * brake) < gap
        assert np.allclose(found, wish) == (can_stop and movers == [mover])  # what stands is less than a second away


def test_a_pair_of_half_planes_makes_no_larger_a_change_than_is_needed() -> None:
    """Each does half: then the two pass just so far apart as they want to be, and not farther."""
    for across in (0.1, 0.25, 0.4):
        one = chosen([2.0, across, -0.5, 0.0, BODY], (0.5, 0.0), (0.5, 0.0), avoidance="orca")
        other = chosen([-2.0, -across, 0.5, 0.0, BODY], (-0.5, 0.0), (-0.5, 0.0), avoidance="orca")
        gap = nearest_approach(np.array([[2.0, across, *other, BODY]]), one) - BODY
        assert gap[0] == pytest.approx(MARGIN, abs=2e-3)


def test_straight_toward_a_mover_half_planes_give_way_to_the_left() -> None:
    mover = [2.0, 0.0, 0.0, 0.0, 0.3]
    vx, vy = chosen(mover, (1.0, 0.0), (0.6, 0.0), avoidance="orca")
    assert 0.5 < vx < 1.0 and 0.01 < vy < 0.1
    np.testing.assert_array_equal(chosen(mover, (-0.5, 0.0), avoidance="orca"), [-0.5, 0.0])  # which nothing cuts


def test_a_goal_nearer_than_a_step_is_not_driven_past() -> None:
    described = {"world": {**SCENARIO["world"], "goal": [0.04, 0]}, "goal": {"radius": 0.01}}
    simulation = Simulation(described)
    policy: Any = make_policy("velocity_obstacle", simulation)
    speed = policy.act(View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start())[0]
    assert speed * policy.sensors.drive.step == pytest.approx(0.04, abs=1e-6)


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


@pytest.mark.parametrize(
    ("post", "along"), [(None, 1.0), ((0.25, 0.35), 0.5), ((0.5, 0.15), 0.25)], ids=["open", "a bend", "beside it"]
)
def test_on_a_way_with_a_bend_the_place_ahead_is_the_first_that_the_body_comes_to_straight(
    post: tuple[float, float] | None, along: float
) -> None:
    """The way leads 0.6 m on and then left; a post stands within the bend, and the body is 0.2 m wide to either side."""
    circles = [] if post is None else [[*post, 0.01]]
    world = {"family": "explicit", "bounds": [-5, -5, 9, 5], "circles": circles, "start": [0, 0, 0], "goal": [8, 0]}
    simulation = Simulation(
        {"world": world, "robot": {"kinematics": "holonomic", "radius": 0.2}, "lidar": {"beams": 720}}
    )
    sensors = Sensors.of(simulation.scenario)
    view = View(simulation.reset(seeds=[0])[0, 0], sensors)
    route, follower = (
        Route(np.array([[0.0, 0.0], [0.6, 0.0], [0.6, 3.0]]), margin=0.0),
        VelocityObstacleFollower(sensors),
    )
    place, found = follower._target(route, view, Scene((0.0, 0.0, 0.0), (0.6, 3.0), None), ROOM)
    assert found == along and place == pytest.approx(route.at(along))


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
