"""Robots whose actions act later: the same motion, so many steps later, in every face, and no way into what is seen."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import run_episode
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bug_gym import inertia
from bug_gym.agents import make_policy
from bug_gym.config import ScenarioError, load
from bug_gym.geometry import velocity_along
from bug_gym.inertia import foreseen, needs_care, speed_within
from bug_gym.kinematics import Drive, steering
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv
from bug_gym.view import Sensors, View

STEPS = 25
ROBOTS: dict[str, dict[str, Any]] = {
    "holonomic": {"kinematics": "holonomic", "max_acceleration": 2.0},
    "differential": {"kinematics": "differential", "max_speed": 1.5, "max_reverse": 0.5, "max_acceleration": 3.0},
    "at once": {"kinematics": "differential"},
}


def described(robot: str, latency: float, **rest: Any) -> dict[str, Any]:
    """A world with movers for a robot of ROBOTS."""
    world = {"family": "field", "obstacles": 8, "moving": 0.5}
    return {
        "robot": {**ROBOTS[robot], "latency": latency},
        "lidar": {"beams": 32, "noise": 0.01},
        "world": world,
        **rest,
    }


def random_actions(rows: int, robots: int, seed: int = 0) -> NDArray[np.float64]:
    """Actions (STEPS, rows, robots, 2)."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (STEPS, rows, robots, 2))


def standing(simulation: Simulation) -> NDArray[np.float64]:
    """The action of a robot that stands, for all (N, R, 2)."""
    robot = simulation.scenario.robot
    first = 0.0
    if robot.kinematics == "differential":
        first = 2.0 * robot.max_reverse / (robot.max_speed + robot.max_reverse) - 1.0
    actions = np.zeros((simulation.count, simulation.robots, 2))
    actions[..., 0] = first
    return actions


@pytest.mark.parametrize("robots", [1, 3])
@pytest.mark.parametrize("latency", [1, 2, 5])
@pytest.mark.parametrize("robot", ROBOTS)
def test_an_action_acts_so_many_steps_later_and_is_the_same_then(robot: str, latency: int, robots: int) -> None:
    late = Simulation(described(robot, 0.1 * latency, robots={"count": robots}), 2)
    prompt = Simulation(described(robot, 0.0, robots={"count": robots}), 2)
    seen = [simulation.reset(seeds=[3, 4]) for simulation in (late, prompt)]
    assert np.array_equal(seen[0], seen[1])
    asked = random_actions(2, robots)
    for step in range(STEPS):
        acting = asked[step - latency] if step >= latency else standing(prompt)
        a, b = late.step(asked[step]), prompt.step(acting)
        assert np.array_equal(late.world.pose, prompt.world.pose), step
        assert np.array_equal(a.observation, b.observation) and np.array_equal(a.terminated, b.terminated)


def test_a_row_of_many_is_the_single_world_in_every_face() -> None:
    source, asked = described("differential", 0.3), random_actions(3, 1)
    many = Simulation(source, 3)
    many.reset(seeds=[5, 6, 7])
    vector = NavigationVectorEnv(3, scenario=source, observation="flat")
    singles = [NavigationEnv(source, observation="flat") for _ in range(3)]
    vector.reset(seed=[5, 6, 7])
    for number, env in enumerate(singles):
        env.reset(seed=5 + number)
    for actions in asked[:10].astype(np.float32):
        rows = many.step(actions).observation[:, 0]
        beside = vector.step(actions[:, 0])[0]
        alone = [env.step(action[0])[0] for env, action in zip(singles, actions, strict=True)]
        assert np.array_equal(rows, np.stack(alone)) and np.array_equal(rows, beside)


def test_actions_under_way_are_part_of_a_snapshot() -> None:
    simulation, asked = Simulation(described("differential", 0.4), 2), random_actions(2, 1)
    simulation.reset(seeds=[1, 2])
    for actions in asked[:7]:
        simulation.step(actions)
    saved, ends = simulation.save(), []
    for _ in range(2):
        ends.append([simulation.step(actions).observation for actions in asked[7:12]][-1])
        simulation.restore(saved)
    assert np.array_equal(ends[0], ends[1])
    # The first four steps after it are those that were asked for before it.
    poses = []
    for other in (1.0, -1.0):
        simulation.restore(saved)
        for _ in range(4):
            simulation.step(np.full((2, 1, 2), other))
        poses.append(simulation.world.pose.copy())
    assert np.array_equal(poses[0], poses[1])


def test_a_robot_that_is_put_back_forgets_what_was_under_way() -> None:
    simulation = Simulation({**described("holonomic", 0.3), "world": {"family": "empty"}, "time": {"limit": 0.5}})
    simulation.reset(seeds=[0])
    start = simulation.world.pose.copy()
    for _ in range(5):
        simulation.step(np.full((1, 1, 2), 0.5))
    assert not simulation.world.active.any()
    simulation.restart_robots(simulation.all_rows, start)
    for _ in range(3):
        simulation.step(np.full((1, 1, 2), 0.5))
        assert np.array_equal(simulation.world.pose, start)


def test_the_reward_judges_what_is_asked_for_now() -> None:
    simulation = Simulation({**described("holonomic", 0.2), "reward": {"smoothness": 1.0}})
    simulation.reset(seeds=[0])
    simulation.step(np.array([[[0.6, 0.0]]]))
    assert simulation.world.array("terms")[0, 5] == pytest.approx(0.36)


@pytest.mark.parametrize(
    ("latency", "step", "said"),
    [(0.07, 0.05, "a whole number of steps of 0.05 s"), (11.0, 0.1, "at most 100 steps"), (-0.1, 0.1, "robot.latency")],
)
def test_a_latency_that_cannot_be_is_refused(latency: float, step: float, said: str) -> None:
    with pytest.raises(ScenarioError, match=said):
        load({"robot": {"latency": latency}, "time": {"step": step}})


def test_decimal_fractions_are_whole_numbers_of_steps() -> None:
    assert load({"robot": {"latency": 0.3}, "time": {"step": 0.1}}).latency_steps == 3  # 0.3 / 0.1 is a little less


# -- Stopping in time ----------------------------------------------------------------------------------------------------


def late_way(speed: float, acceleration: float, step: float, latency: int) -> float:
    """Way of a step at a speed, of those until the brake acts, and of all in which the robot brakes [m]."""
    way = (1 + latency) * speed * step
    while (speed := speed - acceleration * step) > 1e-12:
        way += speed * step
    return way


@given(
    st.floats(0.0, 20.0), st.floats(0.1, 10.0) | st.just(math.inf), st.sampled_from([0.05, 0.1, 0.2]), st.integers(1, 6)
)
def test_at_the_speed_within_a_way_a_late_robot_stands_at_its_end(
    way: float, acceleration: float, step: float, latency: int
) -> None:
    speed = speed_within(Drive("holonomic", 5.0, 0.0, 0.0, step, acceleration, latency), way)
    needed = late_way(speed, acceleration, step, latency)
    assert needed == pytest.approx(way, abs=1e-9) if speed < 5.0 else needed <= way + 1e-9


@pytest.mark.parametrize("robot", ROBOTS)
def test_where_an_action_of_now_will_find_the_robot_is_where_it_will_be(robot: str) -> None:
    latency = 4
    scenario = load({**described(robot, 0.1 * latency), "world": {"family": "empty"}})
    simulation, sensors = Simulation(scenario), Sensors.of(scenario)
    observation = simulation.reset(seeds=[0])
    sent: list[NDArray[np.float32]] = []
    told = []
    for actions in random_actions(1, 1)[:12].astype(np.float32):
        view = View(observation[0, 0], sensors, sent[-latency:])
        ahead = foreseen(view)
        told.append((*view.to_odometry(ahead.x, ahead.y), view.heading + ahead.turn, *ahead.velocity))
        sent.append(actions[0, 0])
        observation = simulation.step(actions).observation
    simulation.reset(seeds=[0])
    for number, actions in enumerate(random_actions(1, 1)[:12].astype(np.float32)):
        if number >= latency:
            x, y, heading = simulation.world.odometry[0, 0]
            vx, vy = simulation.world.velocity[0, 0]
            foretold = told[number - latency]
            assert foretold[:2] == pytest.approx((x, y), abs=1e-5)
            assert math.cos(foretold[2] - heading) == pytest.approx(1.0, abs=1e-6)
            assert foretold[3:] == pytest.approx((vx, vy), abs=1e-5)
        simulation.step(actions)


class Ram(ScriptedPolicy):
    """Full speed at the nearest thing in sight, for ever."""

    def start(self) -> Memory:
        return Memory()

    def act(self, view: View, memory: Memory) -> Velocity:
        return velocity_along(view.nearest()[1], self.sensors.drive.max_speed)


def least_clearance(scenario: Any, seed: int, steps: int) -> float:
    """How near a Ram comes to something [m]."""
    env = NavigationEnv(scenario, observation="flat")
    policy: Any = Ram(Sensors.of(env.simulation.scenario))
    assert needs_care(policy.sensors)
    observation, info = env.reset(seed=seed)
    state = None
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            break
    return float(info["min_clearance"])


STILL = {"family": "field", "obstacles": 30, "moving": 0}


@pytest.mark.parametrize("latency", [1, 3])
@pytest.mark.parametrize("robot", ROBOTS)
def test_even_a_late_robot_that_runs_at_everything_touches_nothing_still(robot: str, latency: int) -> None:
    scenario = {**described(robot, 0.1 * latency), "world": STILL, "lidar": {"beams": 360}}
    clearances = [least_clearance(scenario, seed, 120) for seed in range(3)]
    assert min(clearances) > 0.0
    assert min(clearances) < 0.5  # it was near


def test_who_forgets_what_is_under_way_runs_into_things(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = {**described("differential", 0.3), "world": STILL, "lidar": {"beams": 360}}
    monkeypatch.setattr(inertia, "foreseen", lambda view: inertia.Ahead(0.0, 0.0, 0.0, view.velocity))
    assert min(least_clearance(scenario, seed, 120) for seed in range(3)) <= 0.0


@pytest.mark.parametrize("name", ["bug2", "tangent_bug", "hd_bug", "hd_bug_map"])
def test_the_jackal_arrives_though_its_actions_are_late(name: str) -> None:
    env = gym.make("BugGym/Navigation-v0", scenario="jackal", observation="flat", disable_env_checker=True)
    policy: Any = make_policy(name, env)
    observation, info = env.reset(seed=1)
    state, done = None, False
    while not done:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    assert info["outcome"] == "success"


@pytest.mark.parametrize("name", ["bug2", "rev3", "k_bug", "vis_bug_21"])
def test_a_holonomic_robot_slides_round_a_corner_into_no_face_that_it_has_not_seen(name: str) -> None:
    """At 2 m/s, a command acts 1.2 m after it is given: the slab's other face comes into sight meanwhile."""
    changes = {"robot.max_speed": 2.0, "robot.latency": 0.6, "time.step": 0.2, "lidar.beams": 128, "lidar.range": 3.0}
    episode = run_episode(name, "slab", changes)
    assert episode.outcome == "success" and episode.min_clearance > 0.0


@pytest.mark.parametrize("fov", [2.0 * math.pi, 4.0])
def test_faces_that_may_be_hidden_lie_behind_what_ends_a_surface(fov: float) -> None:
    """A box ahead: behind the corners at its ends, and as far as the robot goes blindly; none at the ends of the fan."""
    box = [[[1.0, -0.5], [1.6, -0.5], [1.6, 0.5], [1.0, 0.5]]]
    world = {"family": "explicit", "bounds": [-6, -6, 6, 6], "start": [0, 0, 0], "goal": [5, 5], "polygons": box}
    lidar = {"beams": 241, "range": 4.0, "fov": fov}
    env = NavigationEnv({"world": world, "lidar": lidar}, observation="flat")
    view = View(env.reset(seed=0)[0], Sensors.of(env.simulation.scenario))
    x, y = inertia._hidden_faces(view, 0.5)
    corner, spacing = math.hypot(1.0, 0.5), view.sensors.beam_spacing
    away = np.hypot(x, y)
    assert 0.0 < away.min() - corner < inertia.FACE_SPACING + 0.02 and abs(away.max() - corner - 0.5) < 0.05
    assert np.abs(np.abs(np.arctan2(y, x)) - math.atan2(0.5, 1.0)).max() < spacing
    assert (y > 0.0).any() and (y < 0.0).any()
    assert inertia._hidden_faces(view, 0.0).size == 0


def test_where_the_fan_of_beams_ends_nothing_ends_that_is_seen() -> None:
    """The last beam of 4 rad meets the middle of a disc; the first, which is no neighbour of it, looks far."""
    fov, at = 4.0, (math.cos(2.0), math.sin(2.0))
    world = {
        "family": "explicit",
        "bounds": [-6, -6, 6, 6],
        "start": [0, 0, 0],
        "goal": [5, 5],
        "circles": [[*at, 0.3]],
    }
    lidar = {"beams": 241, "range": 4.0, "fov": fov}
    env = NavigationEnv({"world": world, "lidar": lidar}, observation="flat")
    view = View(env.reset(seed=0)[0], Sensors.of(env.simulation.scenario))
    bearings = np.arctan2(*inertia._hidden_faces(view, 0.5)[::-1])
    assert bearings.size > 0  # at the disc's other end
    assert bearings == pytest.approx(2.0 - math.asin(0.3), abs=2.0 * view.sensors.beam_spacing)


@pytest.mark.parametrize("seed", [1070, 1071, 1074])
def test_a_late_robot_beside_a_wall_does_not_stand_for_ever(seed: int) -> None:
    """Late commands bring it nearer to a wall than it keeps; standing was then always clear, and so it stood."""
    changes = {"robot.kinematics": "differential", "robot.radius": 0.3, "robot.latency": 0.1, "time.step": 0.05}
    changes |= {"lidar.beams": 64, "lidar.range": 5.0, "time.limit": 120.0}
    episode = run_episode("rev2", "corridor", changes, seed=seed)
    assert episode.outcome == "success" and episode.min_clearance > 0.0


def test_the_memory_of_a_robot_without_latency_holds_no_actions() -> None:
    env = NavigationEnv("static", observation="flat")
    policy: Any = make_policy("bug2", env)
    observation, _ = env.reset(seed=0)
    _, state = policy.predict(observation)
    assert state[0].under_way == []
    assert steering(policy.sensors.drive, (0.0, 0.0)).shape == (2,)


@pytest.mark.parametrize(
    ("kinematics", "key"),
    [
        ("differential", "max_speed"),
        ("differential", "max_reverse"),
        ("ackermann", "max_speed"),
        ("ackermann", "max_reverse"),
        ("holonomic", "max_speed"),  # which has no reverse
    ],
)
def test_it_stands_until_the_first_action_acts_whatever_speeds_are_drawn(kinematics: str, key: str) -> None:
    robot = {"kinematics": kinematics, "latency": 0.3, key: {"uniform": [0.4, 0.9]}}
    simulation = Simulation({"robot": robot, "world": {"family": "empty"}}, 16)
    simulation.reset(seeds=range(16))
    began = simulation.world.pose.copy()
    for _ in range(3):
        simulation.step(np.ones((16, 1, 2)))
        np.testing.assert_allclose(simulation.world.pose, began, atol=1e-12)
    simulation.step(np.ones((16, 1, 2)))
    assert (np.abs(simulation.world.pose - began).max(axis=2) > 1e-3).all()
