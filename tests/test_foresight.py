"""A robot whose commands act late, and that decides by what it will see then, drives as one whose commands act at once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.bugs.bug2 import Bug2
from bug_gym.agents.hd_bug.policy import HDBug
from bug_gym.config import load
from bug_gym.foresight import NEAR, as_it_lies, in_frame, left_behind, seen_nearby, seen_then
from bug_gym.geometry import velocity_along
from bug_gym.inertia import as_it_will_lie
from bug_gym.kernels.scan_then import SLANTED
from bug_gym.policy import CREEP, Memory, ScriptedPolicy
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

F64 = NDArray[np.float64]
BLOCK = [[-1.0, -2.0], [0.5, -2.0], [0.5, 1.0], [-1.0, 1.0]]
CIRCLES = [[-2.5, -0.8, 0.3], [1.5, 0.9, 0.4]]
LATE = {
    "robot.latency": 0.2,
    "robot.max_speed": 1.0,
    "robot.max_turn_rate": 3.0,
    "lidar.beams": 360,
    "lidar.noise": 0.0,
}


def world(polygons: list[Any], circles: list[Any], **rest: Any) -> dict[str, Any]:
    """A room with things in it, the robot on the left and the goal on the right."""
    return {
        "family": "explicit",
        "bounds": [-5, -5, 5, 5],
        "polygons": polygons,
        "circles": circles,
        "start": [-4.0, 0.2, 0.3],
        "goal": [4.0, 0.0],
        **rest,
    }


def scenario(kinematics: str, *, latency: float = 0.2, polygons: Any = (), circles: Any = (), **rest: Any) -> Any:
    """That world for a robot whose commands act late."""
    overrides = {**LATE, "robot.kinematics": kinematics, "robot.latency": latency, **rest}
    return load({"world": world(list(polygons), list(circles))}, overrides)


def drives(described: Any, steps: int) -> list[tuple[View, View]]:
    """At each of some steps of a random drive what is foreseen, and what is seen when the command of then acts."""
    simulation = Simulation(described)
    sensors, latency = Sensors.of(described), described.latency_steps
    rng = np.random.default_rng(5)
    sent: list[NDArray[np.float32]] = []
    flat, then = simulation.reset(seeds=[0])[0, 0], []
    views = []
    for number in range(steps):
        view = View(flat.copy(), sensors, under_way=sent[-latency:] if sent else [])
        views.append(view)
        then.append(seen_then(view))
        action = (0.4 * rng.uniform(-1.0, 1.0, 2) + [0.3 * (number < steps // 2), 0.0]).astype(np.float32)
        sent.append(action)
        flat = simulation.step(action[None, None]).observation[0, 0]
    return list(zip(then[: steps - latency], views[latency:], strict=True))


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("acceleration", [None, 2.0])
def test_pose_velocity_and_goal_are_those_of_when_the_command_acts(kinematics: str, acceleration: float | None) -> None:
    inertia: dict[str, Any] = {"robot.max_acceleration": acceleration}
    for then, seen in drives(scenario(kinematics, **inertia), 40):
        assert then.pose[:2] == pytest.approx(seen.pose[:2], abs=1e-5)
        assert math.remainder(then.heading - seen.heading, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-5)
        assert then.velocity == pytest.approx(seen.velocity, abs=1e-5)
        assert then.goal == pytest.approx(seen.goal, abs=1e-4)


@pytest.mark.parametrize("fov", [2.0 * math.pi, 4.7])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_an_empty_room_is_seen_as_it_will_be(kinematics: str, fov: float) -> None:
    for then, seen in drives(scenario(kinematics, **{"lidar.fov": fov, "lidar.range": 20.0}), 30):
        told = then.ranges < then.sensors.range
        assert told.all() or fov < 6.0  # of what comes into the field of view nothing is known
        assert told.mean() > 0.85
        off = np.abs(then.ranges - seen.ranges)[told][1:-1]
        assert np.count_nonzero(off > 1e-4) <= 4 * 3  # corners lie between two beams, and to three from nearby
        assert off.max() < SLANTED * seen.ranges.max() * then.sensors.beam_spacing  # as far apart as joined points are


def test_points_lie_on_what_is_there_and_hidden_things_are_not_shown_as_walls() -> None:
    described = scenario("differential", polygons=[BLOCK], circles=CIRCLES)
    things = shapely.unary_union(
        [shapely.Polygon(BLOCK), *(shapely.Point(x, y).buffer(r, 64) for x, y, r in CIRCLES)]
    ).boundary.union(shapely.box(-5, -5, 5, 5).boundary)
    cos, sin = math.cos(0.3), math.sin(0.3)
    for then, seen in drives(described, 40):
        x, y = then.points
        heading = then.heading
        ahead = then.pose[0] + math.cos(heading) * x - math.sin(heading) * y
        left = then.pose[1] + math.sin(heading) * x + math.cos(heading) * y
        places = shapely.points(-4.0 + cos * ahead - sin * left, 0.2 + sin * ahead + cos * left)
        assert shapely.distance(places, things).max() < 1e-3
        off = np.abs(then.ranges - seen.ranges) > 0.05
        assert off.mean() < 0.06  # beside the edges of things


def test_what_was_seen_nearby_is_kept_while_it_lies_behind_and_no_longer() -> None:
    """A robot with eyes ahead turns round beside a block, twice: it goes on knowing where that is, and no point twice."""
    turns: dict[str, Any] = {
        "lidar.fov": 4.0,
        "lidar.range": 8.0,
        "robot.max_acceleration": 20.0,
        "world.start": [-1.5, 0.0, 0.0],
    }
    described = scenario("differential", polygons=[BLOCK], **turns)
    simulation, sensors = Simulation(described), Sensors.of(described)
    flat, nearby = simulation.reset(seeds=[0])[0, 0], np.zeros((2, 0))
    counts = []
    for _ in range(50):
        view = View(flat.copy(), sensors, under_way=[])
        behind = left_behind(view, nearby)
        nearby = np.concatenate([behind, seen_nearby(view)], axis=1)
        x, y = in_frame(behind, view.pose)
        assert (np.abs(np.arctan2(y, x)) > 2.0 - 1e-9).all() and (np.hypot(x, y) < NEAR).all()
        assert np.abs(behind[0] - 0.5).max(initial=0.0) < 1e-3  # the block's left side, half a metre ahead of the start
        shown = np.hypot(*seen_then(view, behind).points)
        assert shown.min() == pytest.approx(0.5, abs=0.02)
        counts.append(behind.shape[1])
        flat = simulation.step(np.array([[[2.0 * 0.3 / 1.3 - 1.0, 1.0]]], np.float32)).observation[0, 0]
    assert 0 in counts and max(counts) > 20
    assert max(counts[25:]) <= max(counts[:25]) + 2
    near, far = (np.array(view.to_odometry(-distance, 0.0))[:, None] for distance in (0.9 * NEAR, 1.1 * NEAR))
    assert np.array_equal(left_behind(view, near), near)
    assert left_behind(view, far).size == 0


class Turner(ScriptedPolicy):
    """Turns on the spot, and notes how near what it is shown comes."""

    foresight = True

    def __init__(self, *arguments: Any, **rest: Any) -> None:
        super().__init__(*arguments, **rest)
        self.nearest: list[float] = []

    def start(self) -> Memory:
        """Nothing."""
        return Memory()

    def act(self, view: View, memory: Memory) -> tuple[float, float]:
        """Always to the left."""
        self.nearest.append(float(np.hypot(*view.points).min()))
        return velocity_along(0.5 * math.pi, CREEP)


@pytest.mark.parametrize("latency", [0.0, 0.2])
def test_a_policy_that_turns_is_shown_what_lies_behind_where_commands_act_late(latency: float) -> None:
    turns: dict[str, Any] = {"lidar.fov": 4.0, "robot.max_acceleration": 20.0, "world.start": [-1.5, 0.0, 0.0]}
    simulation = Simulation(scenario("differential", latency=latency, polygons=[BLOCK], **turns))
    policy = Turner(Sensors.of(simulation.scenario))
    flat, state = simulation.reset(seeds=[0])[0, 0], None
    for _ in range(60):
        action, state = policy.predict(flat, state)
        flat = simulation.step(action[None, None]).observation[0, 0]
    assert abs(simulation.world.pose[0, 0, 0] + 1.5) < 0.01  # the block's side is half a metre off
    assert policy.nearest[0] == pytest.approx(0.5, abs=0.01)
    assert (max(policy.nearest) < 0.52) == (latency > 0.0)


def test_velocities_are_turned_there_and_back() -> None:
    described = scenario("differential")
    view = View(
        Simulation(described).reset(seeds=[0])[0, 0],
        Sensors.of(described),
        under_way=[np.array([0.5, 0.8], np.float32)] * 2,
    )
    assert as_it_will_lie(view, as_it_lies(view, (0.3, -0.4))) == pytest.approx((0.3, -0.4), abs=1e-12)
    assert as_it_lies(view, (1.0, 0.0)) != pytest.approx((1.0, 0.0), abs=0.1)


def path(described: Any, policy: str, **parameters: Any) -> tuple[F64, str]:
    """Places (k, 2) of an episode, and how it ended."""
    simulation = Simulation(described)
    driver = make_policy(policy, simulation, **parameters)
    observation, state = simulation.reset(seeds=[0])[:, 0], None
    places = []
    while simulation.world.active[0, 0]:
        places.append(simulation.world.pose[0, 0, :2].copy())
        action, state = driver.predict(observation, state)
        observation = simulation.step(action[:, None]).observation[:, 0]
    return np.array(places), str(simulation.info()["outcome"][0, 0])


@pytest.mark.parametrize("policy", ["bug1", "bug2", "com1", "rev3", "dist_bug", "vis_bug_21", "k_bug", "minimum_risk"])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_late_robot_drives_as_one_whose_commands_act_at_once_but_later(policy: str, kinematics: str) -> None:
    shared = {"polygons": [BLOCK], "circles": CIRCLES, "robot.max_acceleration": 20.0}
    prompt, late = (path(scenario(kinematics, latency=latency, **shared), policy) for latency in (0.0, 0.2))
    assert prompt[1] == late[1] == "success"
    assert shapely.hausdorff_distance(*(shapely.LineString(places) for places, _ in (prompt, late))) < 0.05
    assert len(late[0]) <= len(prompt[0]) + 4  # two steps for the latency


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_late_potential_field_goes_where_a_prompt_one_goes(kinematics: str) -> None:
    """Past cylinders: before a block it is caught, prompt or late."""
    shared = {"circles": CIRCLES, "robot.max_acceleration": 20.0}
    prompt, late = (path(scenario(kinematics, latency=latency, **shared), "apf") for latency in (0.0, 0.2))
    assert prompt[1] == late[1] == "success"
    assert shapely.hausdorff_distance(*(shapely.LineString(places) for places, _ in (prompt, late))) < 0.05
    assert len(late[0]) <= len(prompt[0]) + 4


@pytest.mark.parametrize("policy", ["tangent_bug", "apf_wall_following"])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_late_robot_is_no_slower_than_its_latency(policy: str, kinematics: str) -> None:
    """These choose among ways by small differences: theirs may be others."""
    shared = {"polygons": [BLOCK], "circles": CIRCLES, "robot.max_acceleration": 20.0}
    prompt, late = (path(scenario(kinematics, latency=latency, **shared), policy) for latency in (0.0, 0.2))
    assert prompt[1] == late[1] == "success"
    assert len(late[0]) <= 1.15 * len(prompt[0])


def test_who_decides_by_what_it_sees_now_leaves_no_contour_before_it_is_told() -> None:
    """A team's laws, what HD-BUG falls back on, and discrete actions, which nobody keeps: no farther than their room."""
    sensors = Sensors.of(scenario("differential", **{"robot.max_acceleration": 20.0}))
    foreseeing = Bug2(sensors).boundary
    for late in (
        Bug2(sensors).driven_late(),
        Bug2(sensors, discrete=True),
        HDBug(sensors).circumnavigation.tangent_bug,
    ):
        boundary = late.boundary
        way = boundary.pace * sensors.drive.step * (1 + sensors.drive.latency)
        assert way <= boundary.clearance - sensors.radius + 1e-9
        assert boundary.pace < 0.5 * foreseeing.pace
    prompt = Sensors.of(scenario("differential", latency=0.0, **{"robot.max_acceleration": 20.0}))
    assert foreseeing.pace == Bug2(prompt).boundary.pace == Bug2(prompt).driven_late().boundary.pace


def test_a_batch_of_late_robots_is_each_alone() -> None:
    described = scenario("differential", polygons=[BLOCK], circles=CIRCLES, **{"robot.max_acceleration": 20.0})
    many, alone = Simulation(described, 3), Simulation(described, 3)
    batch, single = make_policy("bug2", many), make_policy("bug2", alone)
    seen, state = many.reset(seeds=[0, 1, 2])[:, 0], None
    states: list[Any] = [None] * 3
    also = alone.reset(seeds=[0, 1, 2])[:, 0]
    for _ in range(80):
        actions, state = batch.predict(seen, state)
        each = []
        for row in range(3):
            action, states[row] = single.predict(also[row], states[row])
            each.append(action)
        assert np.array_equal(actions, np.stack(each))
        seen, also = (
            many.step(actions[:, None]).observation[:, 0],
            alone.step(np.stack(each)[:, None]).observation[:, 0],
        )
