"""MPPI: weights and plans by closed forms, the model against the simulation that it is, and what comes of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents import make_policy
from bug_gym.agents.local.known_world import KnownWorld, Worth, clear_of
from bug_gym.agents.local.mppi import KNOTS, MOVER_GROWN, MPPI, STEPS, Controls, MPPIMemory, weights_of
from bug_gym.geometry import F64
from bug_gym.kinematics import steering
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

KINEMATICS = ["holonomic", "differential"]
BOX: dict[str, Any] = {"family": "explicit", "bounds": [-20, -20, 20, 20], "start": [0, 0, 0]}
WORTH = Worth(keep=0.4, clearance=3.0, contact=20.0)
NOTHING, NOBODY = np.zeros((0, 3)), np.zeros((0, 5))


def made(scenario: Any, overrides: dict[str, Any] | None = None, **parameters: Any) -> tuple[MPPI, View, Simulation]:
    """The policy, what it sees first, and the world."""
    simulation = Simulation(scenario, overrides=overrides)
    policy = make_policy("mppi", simulation, **parameters)
    assert isinstance(policy, MPPI)
    return policy, View(simulation.reset(seeds=[0])[0, 0], policy.sensors), simulation


# ------------------------------------------------------------------------------------------------ weights, plans


def test_weights_are_those_of_the_closed_form() -> None:
    """A sample that costs lambda ln 2 more has half the weight; what all cost does not count."""
    for temperature in (0.01, 1.0, 30.0):
        costs = temperature * np.log([4.0, 1.0, 2.0, 4.0])
        for all_cost in (0.0, 1e4):
            found = weights_of(costs + all_cost, temperature)
            np.testing.assert_allclose(found, [1 / 8, 1 / 2, 1 / 4, 1 / 8], rtol=1e-6)
    np.testing.assert_array_equal(weights_of(np.array([3.0, 2.0, 1e300]), 1e-6), [0.0, 1.0, 0.0])
    np.testing.assert_allclose(weights_of(np.array([3.0, 2.0, 5.0]), 1e9), 1 / 3)


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_what_is_asked_for_is_driven_as_the_control_says(kinematics: str) -> None:
    drive = Sensors.of(Simulation("static", overrides={"robot.kinematics": kinematics}).scenario).drive
    controls = Controls(drive, 2.5)
    plans = controls.limited(np.random.default_rng(0).normal(0.0, 1.0, (50, 1, 2)).repeat(KNOTS, axis=1))
    for plan, actions in zip(plans, controls.actions(plans), strict=True):
        np.testing.assert_allclose(actions, np.repeat(actions[:1], STEPS, axis=0), atol=1e-12)
        np.testing.assert_allclose(steering(drive, controls.velocity(plan[0])), actions[0], atol=1e-5)


def test_a_cars_controls_are_shares_of_its_speeds_and_of_its_steering_angle() -> None:
    """What the model is told and what the car is asked for are the same arc; backwards only where it sees behind itself."""
    car = {"robot.kinematics": "ackermann", "robot.max_reverse": 0.4}
    drive = Sensors.of(Simulation("static", overrides=car).scenario).drive
    controls = Controls(drive, 2.5)
    for first, second in ((1.0, 0.0), (0.6, -0.8), (-1.0, 0.5), (-0.3, 1.0), (0.0, 0.4)):
        speed, rate = controls.arc((first, second))
        assert speed == pytest.approx(first * (drive.max_speed if first > 0.0 else 0.4))
        assert rate == pytest.approx(speed * math.tan(second * drive.max_steering) / drive.wheelbase)
        ahead, steering_angle = controls.actions(np.tile([first, second], (1, KNOTS, 1)))[0, 0].tolist()
        assert 0.5 * (ahead + 1.0) * (drive.max_speed + 0.4) - 0.4 == pytest.approx(speed)
        assert steering_angle == pytest.approx(second)
    for fov, least in ((2.0 * math.pi, -1.0), (math.pi, 0.0)):
        policy, _, _ = made("static", {**car, "lidar.fov": fov})
        assert policy.controls.limited(np.array([[-1.0, 0.0]]))[0, 0] == policy.plain[..., 0].min() == least


def test_a_plan_a_step_later_is_the_rest_of_it() -> None:
    controls = Controls(Sensors.of(Simulation("static").scenario).drive, 2.5)
    knots = np.linspace(0.0, 2.5, KNOTS)
    later = controls.later(np.stack([0.1 + 0.2 * knots, -0.3 * knots], axis=1))
    np.testing.assert_allclose(later[:-1], np.stack([0.1 + 0.2 * (knots + 0.1), -0.3 * (knots + 0.1)], axis=1)[:-1])
    np.testing.assert_allclose(later[-1], [0.6, -0.75])


# ------------------------------------------------------------------------------------------------ the model


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("acceleration", [None, 0.8])
def test_a_plans_way_is_that_of_a_robot_which_drives_it(kinematics: str, acceleration: float | None) -> None:
    """From the midst of an episode, with the velocity that it has there."""
    overrides = {"robot.kinematics": kinematics, "robot.max_acceleration": acceleration, "time.step": 0.15}
    simulation = Simulation({"world": {**BOX, "goal": [9, 3]}}, overrides=overrides)
    simulation.reset(seeds=[0])
    for _ in range(4):
        observation = simulation.step([[[0.7, 0.6]]]).observation
    sensors = Sensors.of(simulation.scenario)
    view, start = View(observation[0, 0], sensors), simulation.world.pose[0, 0].copy()
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 12, 2))
    model = KnownWorld(sensors, 5, 12, 0.15, WORTH)
    model.begin(view, NOTHING, NOBODY)
    tried = model.try_all(actions, 5)
    real = simulation.branches(5)
    cos, sin = math.cos(start[2]), math.sin(start[2])
    for number in range(12):
        real.step(actions[:, number, None])
        seen = (real.world.pose[:, 0, :2] - start[:2]) @ np.array([[cos, -sin], [sin, cos]])
        np.testing.assert_allclose(tried.places[number + 1], seen, atol=1e-6)
    np.testing.assert_array_equal(model.try_one(actions[:1]).places[:, 0], tried.places[:, 0])


def straight_on(count: int, speed: float = 1.0) -> F64:
    """Actions (1, count, 2) of a holonomic robot straight ahead."""
    return np.tile([speed, 0.0], (1, count, 1))


def test_discs_and_movers_are_met_where_they_are() -> None:
    """At 1 m/s: a disc at 3 m of 0.5 m is touched at 3 - 0.5 - 0.2; one that comes from 4 m at 1 m/s half way."""
    policy, view, _ = made({"world": {**BOX, "goal": [12, 0]}})
    model = KnownWorld(policy.sensors, 4, 40, 0.1, WORTH)
    for still, movers, way in (
        (np.array([[3.0, 0.0, 0.5]]), NOBODY, 2.3),
        (NOTHING, np.array([[4.0, 0.0, -1.0, 0.0, 0.3]]), 1.75),
        (np.array([[2.0, 0.8, 0.5]]), np.array([[0.0, 3.0, 0.0, 0.0, 0.3]]), 4.0),
    ):
        model.begin(view, still, movers)
        one = model.try_one(straight_on(40))
        assert one.places[-1, 0] == pytest.approx([way, 0.0], abs=1e-6)
        assert bool(one.touches[0]) == (way < 4.0)


def test_a_way_costs_what_the_closed_form_says() -> None:
    """Distance to the goal by steps; what is kept from a wall of discs costs by the square of what is missing."""
    policy, view, _ = made({"world": {**BOX, "goal": [12, 0]}})
    model = KnownWorld(policy.sensors, 4, 10, 0.1, WORTH)
    model.begin(view, NOTHING, NOBODY)
    distances = 12.0 - policy.sensors.goal_radius - 0.1 * np.arange(1, 11)
    assert model.try_one(straight_on(10)).costs[0] == pytest.approx(0.1 * distances.sum(), rel=1e-6)
    model.begin(view, np.array([[0.0, 0.5, 0.1]]), NOBODY)  # 0.2 m beside a robot that stands
    standing = 0.1 * 10 * (12.0 - policy.sensors.goal_radius + 3.0 * 0.5**2)
    assert model.try_one(straight_on(10, 0.0)).costs[0] == pytest.approx(standing, rel=1e-6)


def test_a_contact_costs_until_the_horizon_ends_and_nearness_only_before_it() -> None:
    """Straight on at 1 m/s a disc is met after 0.55 m, in the sixth step of ten; there the robot stays."""
    policy, view, _ = made({"world": {**BOX, "goal": [12, 0]}})
    way = np.minimum(0.1 * np.arange(1, 11), 0.55)
    for clearance, contact in ((0.0, 20.0), (3.0, 0.0)):
        model = KnownWorld(policy.sensors, 1, 10, 0.1, Worth(keep=0.4, clearance=clearance, contact=contact))
        model.begin(view, np.array([[1.25, 0.0, 0.5]]), NOBODY)
        missing = np.maximum(1.0 - (0.55 - way[:5]) / 0.4, 0.0)
        expected = (12.0 - policy.sensors.goal_radius - way).sum() + 5 * contact + clearance * (missing**2).sum()
        assert model.try_one(straight_on(10)).costs[0] == pytest.approx(0.1 * expected, rel=1e-5)


def test_a_disc_that_the_robot_would_overlap_is_cut() -> None:
    found = clear_of(np.array([[1.0, 0.0, 0.9], [0.1, 0.0, 0.3], [3.0, 0.0, 0.5]]), np.array([0.9, 0.3, 0.5]), 0.2)
    np.testing.assert_allclose(found, [[1.0, 0.0, 0.799], [3.0, 0.0, 0.5]])


# ------------------------------------------------------------------------------------------------ plans get better


@pytest.mark.parametrize(
    ("kinematics", "goal"),
    [
        ("holonomic", [9.0, 0.0]),
        ("holonomic", [-3.0, 7.0]),
        ("differential", [9.0, 0.0]),
        ("differential", [5.0, 6.0]),
    ],
)
def test_the_cost_of_the_plan_falls_from_one_iteration_to_the_next(kinematics: str, goal: list[float]) -> None:
    """By noise alone, from standing: in the open, to nearly the cost of the straight way of a robot that need not turn."""
    policy, view, _ = made({"world": {**BOX, "goal": goal}}, {"robot.kinematics": kinematics}, noise=0.15)
    policy.plain *= 0.0  # no plain ways to fall back on: all of them stand
    plan, costs = np.zeros((KNOTS, 2)), []
    for number in range(12):
        policy.model.begin(view, NOTHING, NOBODY)
        costs.append(policy.model.try_one(policy.controls.actions(plan[None])).costs[0])
        policy.model.begin(view, NOTHING, NOBODY)
        plan = policy.improved(plan, number)[0]
    assert all(later < sooner for sooner, later in zip(costs[:5], costs[1:6], strict=True))
    step = policy.model.step
    distances = math.hypot(*goal) - policy.sensors.goal_radius - step * np.arange(1, STEPS + 1)
    least = step * distances.sum()
    assert least <= costs[-1] <= (1.02 if kinematics == "holonomic" else 1.15) * least


def test_a_plans_own_size_costs_so_that_where_all_ways_are_as_good_the_plan_fades_by_that_share() -> None:
    """Normal noise e of deviation s, weighed by exp(-c u e / s^2), has the mean -c u: what comes of u is (1 - c) u."""
    share, noise = 0.5, 0.2
    settings: dict[str, Any] = {"samples": 4000, "noise": noise, "control_weight": share, "temperature": 1e6}
    policy, view, _ = made({"world": {**BOX, "goal": [9, 0]}}, **settings)
    policy.plain = policy.plain[:0]  # for these nothing is charged
    policy.model = KnownWorld(policy.sensors, 4000, STEPS, policy.parameters.horizon / STEPS, WORTH)
    policy.model.begin(view, NOTHING, NOBODY)
    plan = np.tile([0.12, -0.09], (KNOTS, 1))
    faded = policy.improved(plan, 0)[0]
    # Weights so uneven are worth 4000 exp(-c^2 u^2 / s^2) samples; five standard deviations of their mean.
    worth = 4000.0 * math.exp(-((share / noise) ** 2) * float((plan * plan).sum()))
    np.testing.assert_allclose(faded, (1.0 - share) * plan, rtol=0.0, atol=5.0 * noise / math.sqrt(worth))


def test_the_plan_itself_is_tried_unchanged_and_plain_ways_are_charged_nothing() -> None:
    """Of one sample nothing comes but the plan; beside a plain way, where neither's cost counts, the mean of both."""
    settings: dict[str, Any] = {"samples": 1, "control_weight": 1.0, "temperature": 1e6}
    policy, view, _ = made({"world": {**BOX, "goal": [9, 0]}}, **settings)
    plan, plain = np.tile([0.3, -0.2], (KNOTS, 1)), np.tile([0.9, 0.4], (KNOTS, 1))
    for others, mean in (([], plan), ([plain], 0.5 * (plan + plain))):
        policy.plain = np.array(others).reshape(-1, KNOTS, 2)
        policy.model = KnownWorld(policy.sensors, 1 + len(others), STEPS, policy.parameters.horizon / STEPS, WORTH)
        policy.model.begin(view, NOTHING, NOBODY)
        np.testing.assert_allclose(policy.improved(plan, 0)[0], mean, atol=1e-4)


def test_a_decision_goes_on_from_what_is_left_of_the_last_plan_and_no_two_iterations_draw_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policy, view, _ = made({"world": {**BOX, "goal": [9, 0]}}, iterations=2)
    memory, plans = (
        policy.start(),
        [0.1 * number + np.linspace(0.0, 0.3, 2 * KNOTS).reshape(-1, 2) for number in range(6)],
    )
    improved, begun, numbers = policy.improved, [], []

    def told(plan: F64, number: int) -> Any:
        begun.append(plan)
        numbers.append(number)
        return plans[len(begun) - 1], *improved(plan, number)[1:]

    monkeypatch.setattr(policy, "improved", told)
    for decision in range(3):
        driven = policy.act(view, memory)
        last = plans[2 * decision + 1]
        assert driven == policy.controls.velocity(last[0])
        np.testing.assert_array_equal(begun[2 * decision + 1], plans[2 * decision])
        np.testing.assert_array_equal(memory.plan, policy.controls.later(last))
        if decision > 0:
            np.testing.assert_array_equal(begun[2 * decision], policy.controls.later(plans[2 * decision - 1]))
    assert len(set(numbers)) == 6


def test_plain_ways_turn_a_robot_round_that_noise_leaves_standing() -> None:
    """With the goal behind it, turning is worth something only if it then drives on: noise seldom does both."""
    policy, view, _ = made({"world": {**BOX, "goal": [-3, 7]}}, {"robot.kinematics": "differential"})
    plain, costs = policy.plain, []
    for plans in (0.0 * plain, plain):
        policy.plain = plans
        policy.model.begin(view, NOTHING, NOBODY)
        plan = policy.improved(np.zeros((KNOTS, 2)), 0)[0]
        costs.append(policy.model.try_one(policy.controls.actions(plan[None])).costs[0])
    assert costs[1] < 0.95 * costs[0]


def test_the_mean_of_two_ways_round_is_not_driven() -> None:
    world = {"world": {**BOX, "goal": [6, 0], "circles": [[1.4, 0.0, 0.4]]}, "lidar": {"beams": 180}}
    for seed in range(10):
        policy, view, _ = made(world, seed=seed)
        memory = policy.start()
        memory.plan = np.tile([1.0, 0.0], (KNOTS, 1))
        policy.act(view, memory)
        assert memory.plan is not None
        policy.model.begin(view, np.array([[1.4, 0.0, 0.4]]), NOBODY)
        assert not policy.model.try_one(policy.controls.actions(memory.plan[None])).touches[0]


# ------------------------------------------------------------------------------------------------ what is known


def planned_with(policy: MPPI, simulation: Simulation, steps: int, monkeypatch: pytest.MonkeyPatch) -> Any:
    """View, memory, still discs and movers of a robot that was driven so many steps straight ahead, at half speed."""
    told: list[Any] = []
    begin = policy.model.begin

    def noted(*what: Any) -> None:
        told.append(what)
        begin(*what)

    monkeypatch.setattr(policy.model, "begin", noted)
    memory, observation = policy.start(), simulation.observations()
    for _ in range(steps):
        policy.act(View(observation[0, 0], policy.sensors), memory)
        observation = simulation.step([[[0.5, 0.0]]]).observation
    return told[-1][0], memory, *told[-1][1:]


def test_still_points_are_remembered_out_of_sight_and_the_nearest_are_planned_with(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A disc that was passed, beyond the scan's range now; rows of posts are more points than are planned with."""
    posts = [[x, y, 0.05] for x in np.arange(-2.0, 6.0, 0.3).tolist() for y in (-1.0, -0.7, 0.7, 1.0)]
    one, many = {"circles": [[0.0, 0.6, 0.2]]}, {"circles": posts}
    for kind, scan, passed in ((one, 1.0, True), (many, 4.0, False)):
        lidar = {"beams": 360, "range": scan}
        policy, _, simulation = made({"world": {**BOX, **kind, "goal": [12, 0]}, "lidar": lidar}, samples=1)
        view, memory, still, _ = planned_with(policy, simulation, 36, monkeypatch)
        away = np.hypot(*still[:, :2].T)
        if passed:
            assert (view.ranges >= 0.999).all() and len(still) > 0 and away.min() > 1.0 and (still[:, 0] < 0.0).all()
        else:
            every = np.sort(np.hypot(*(memory.map.points() - view.position).T))
            assert len(every) > len(still) == 96
            np.testing.assert_allclose(np.sort(away), every[:96])


@pytest.mark.parametrize(("at", "velocity"), [([3.0, -1.5], [0.0, 0.6]), ([4.0, 0.0], [-0.6, 0.0])])
def test_what_moves_is_planned_with_as_a_mover_larger_than_it_is_and_as_nothing_that_stands(
    at: list[float], velocity: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor where it was before it was known to move, though it hides that place as it comes straight on."""
    to = [at[0] + 20.0 * velocity[0], at[1] + 20.0 * velocity[1]]
    mover = {
        "shape": {"circle": 0.3},
        "at": at,
        "motion": {"law": "waypoints", "points": [to], "speed": 0.6, "stop": True},
    }
    described = {"world": {**BOX, "movers": [mover], "goal": [12, 0]}, "lidar": {"beams": 180, "range": 6.0}}
    policy, _, simulation = made(described, samples=1)
    tracked, update = [], policy.tracker.update

    def noted(*what: Any) -> Any:
        tracked.append(update(*what))
        return tracked[-1]

    monkeypatch.setattr(policy.tracker, "update", noted)
    _, _, still, movers = planned_with(policy, simulation, 25, monkeypatch)
    assert len(movers) == 1 and len(still) == 0
    np.testing.assert_allclose(movers[:, 4], tracked[-1].radius[tracked[-1].moving] + MOVER_GROWN)
    np.testing.assert_allclose(movers[0, 2:4], velocity, atol=0.1)


def test_the_first_step_leads_no_farther_than_what_is_seen_lets_the_body_come() -> None:
    wall = [[[0.25, -3], [0.5, -3], [0.5, 3], [0.25, 3]]]
    policy, view, _ = made({"world": {**BOX, "polygons": wall, "goal": [9, 0]}, "lidar": {"beams": 180}})
    step, top = policy.sensors.drive.step, policy.sensors.drive.max_speed
    for angle in np.linspace(-1.2, 1.2, 9).tolist():
        vx, vy = policy._free(view, (top * math.cos(angle), top * math.sin(angle)))
        assert math.hypot(vx, vy) * step <= view.free_distance(angle, policy.sensors.radius) + 1e-9
        assert math.atan2(vy, vx) == pytest.approx(angle)
    assert policy._free(view, (-top, 0.0)) == (-top, 0.0)


# ------------------------------------------------------------------------------------------------ episodes


@pytest.mark.parametrize("kinematics", KINEMATICS)
def test_it_arrives_in_fields_without_a_contact(kinematics: str) -> None:
    for scenario, seeds in (("static", 2), ("dynamic", 1)):
        for seed in range(seeds):
            episode = run_episode("mppi", scenario, {"robot.kinematics": kinematics}, seed=seed, max_steps=400)
            assert episode.outcome == "success" and episode.min_clearance > 0.1


def test_what_has_to_be_gone_back_from_holds_it() -> None:
    """Its weakness: it looks a horizon ahead and no farther."""
    episode = run_episode("mppi", "u_trap", max_steps=120)
    assert episode.outcome == "running" and episode.goal_distance > 5.0 and episode.min_clearance > 0.0


def test_a_decision_is_a_function_of_what_is_seen_and_the_seed() -> None:
    def actions(seed: int) -> F64:
        simulation = Simulation("static")
        policy = make_policy("mppi", simulation, seed=seed)
        flat, state, taken = simulation.reset(seeds=[0])[:, 0], None, []
        for _ in range(5):
            action, state = policy.predict(flat, state)
            taken.append(action)
            flat = simulation.step(action[:, None]).observation[:, 0]
        return np.array(taken)

    np.testing.assert_array_equal(actions(0), actions(0))
    assert not np.array_equal(actions(0), actions(1))


def test_what_it_draws_begins_at_the_robot_and_the_chosen_way_is_one_of_the_ways() -> None:
    policy, view, _ = made("static")
    memory = policy.start()
    assert isinstance(memory, MPPIMemory) and not policy.draw(memory).segments
    policy.act(view, memory)
    segments = policy.draw(memory).segments
    chosen = [one for one in segments if one[4] == "chosen"]
    assert len(chosen) == STEPS and len(segments) == 25 * STEPS
    assert chosen[0][:2] == pytest.approx(view.position, abs=1e-9)
    for one, other in zip(chosen[:-1], chosen[1:], strict=True):
        assert one[2:4] == other[:2]


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"samples": 0}, "samples must be at least 1, got 0"),
        ({"temperature": 0.0}, "temperature must be at least 1e-06, got 0.0"),
        ({"horizon": -1.0}, "horizon must be at least 0.01"),
        ({"noise": math.nan}, "noise must be at least 0.001, got nan"),
        ({"control_weight": -1.0}, "control_weight must be at least 0"),
    ],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_policy("mppi", "static", **parameters)
