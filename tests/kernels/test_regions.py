"""Weighted regions: how fast a robot crosses them, what it sees of them, and that nothing else minds them."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import shapely
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray
from pettingzoo.test import parallel_api_test

import bug_gym
from bug_gym.config import Scenario, ScenarioError, dump, load, to_yaml
from bug_gym.scenarios import as_explicit
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

F64 = NDArray[np.float64]

MUD = {"polygon": [[2, -3], [4, -3], [4, 3], [2, 3]], "factor": 2.5}
POND = {"circle": [4, 0, 1.5], "factor": 4.0}
FRAME = {
    "polygon": {"shell": [[-3, -3], [1, -3], [1, 3], [-3, 3]], "holes": [[[-2, -2], [0, -2], [0, 2], [-2, 2]]]},
    "factor": 1.5,
}
# Not convex, its corners the other way round, and a line of three of them.
ARROW = {"polygon": [[-6, 5], [-4, 7], [-5, 7], [-6, 7], [-7.5, 7], [-6, 9], [-9, 6]], "factor": 3.0}
REGIONS = [MUD, POND, FRAME, ARROW]
DIFFERENTIAL = {"kinematics": "differential", "max_speed": 1.0, "max_reverse": 0.4, "max_turn_rate": 1.5}


def data(regions: list[dict[str, Any]], **parts: Any) -> dict[str, Any]:
    world = {"family": "empty", "start": [0, 0, 0], "goal": [8, 0], "regions": regions, **parts.pop("world", {})}
    return {"lidar": {"beams": 16, "range": 5.0}, "world": world, **parts}


def make(regions: list[dict[str, Any]], count: int = 1, **parts: Any) -> Simulation:
    simulation = Simulation(data(regions, **parts), count)
    simulation.reset(seeds=range(count))
    return simulation


def velocity(simulation: Simulation) -> list[float]:
    values: list[float] = simulation.world.velocity[0, 0].tolist()
    return values


def terrain(simulation: Simulation, row: int = 0, robot: int = 0) -> F64:
    [field] = [field for field in simulation.fields if field.name == "terrain"]
    return simulation.world.observation[row, robot, field.begin : field.end].reshape(field.shape).astype(np.float64)


# ---------------------------------------------------------------------------------------------- speed


@pytest.mark.parametrize("region", [MUD, POND])
@pytest.mark.parametrize("action", [(1.0, 0.0), (0.6, -0.3)])
def test_a_step_inside_is_the_commanded_one_over_the_factor(
    region: dict[str, Any], action: tuple[float, float]
) -> None:
    simulation = make([region], world={"start": [3, 0, 0]})
    simulation.step([[action]])
    expected = 0.1 * np.array(action) / region["factor"]
    assert simulation.world.pose[0, 0, :2] - [3.0, 0.0] == pytest.approx(expected, abs=1e-15)
    assert velocity(simulation) == pytest.approx((np.array(action) / region["factor"]).tolist())


@pytest.mark.parametrize(("action", "speed"), [(1.0, 1.0), (-1.0, -0.4), (0.0, 0.3)])
def test_a_differential_robot_is_slower_ahead_and_backwards_and_turns_as_ever(action: float, speed: float) -> None:
    simulation = make([MUD], world={"start": [3, 0, 0]}, robot=DIFFERENTIAL)
    simulation.step([[[action, 0.5]]])
    turn = 0.5 * 1.5 * 0.1
    chord = 0.1 * speed / 2.5 * math.sin(0.5 * turn) / (0.5 * turn)
    expected = [3.0 + chord * math.cos(0.5 * turn), chord * math.sin(0.5 * turn), turn]
    assert simulation.world.pose[0, 0].tolist() == pytest.approx(expected, abs=1e-12)


def test_the_ground_under_the_centre_at_the_beginning_of_a_step_counts_for_all_of_it() -> None:
    simulation = make([MUD], world={"start": [1.95, 0, 0]})
    simulation.step([[[1.0, 0.0]]])
    assert simulation.world.pose[0, 0, 0] == pytest.approx(2.05)
    simulation.step([[[1.0, 0.0]]])
    assert simulation.world.pose[0, 0, 0] == pytest.approx(2.09)


def test_where_regions_overlap_the_larger_factor_counts_in_either_order() -> None:
    for regions in ([MUD, POND], [POND, MUD]):
        simulation = make(regions, world={"start": [3.5, 0, 0]})
        simulation.step([[[1.0, 0.0]]])
        assert simulation.world.pose[0, 0, 0] - 3.5 == pytest.approx(0.1 / 4.0)


def test_the_hole_of_a_region_is_open_ground() -> None:
    simulation = make([FRAME], world={"start": [-1, 0, 0]})
    simulation.step([[[1.0, 0.0]]])
    assert simulation.world.pose[0, 0, 0] == pytest.approx(-0.9)


def test_crossing_a_slab_takes_its_width_times_the_factor_in_time() -> None:
    """From 0 to 6 m at 1 m/s across 2 m of factor 2.5: 4 + 5 s, but for a step at either edge."""
    simulation = make([MUD], world={"goal": [6, 0]}, goal={"radius": 0.01})
    while simulation.world.active.any():
        simulation.step([[[1.0, 0.0]]])
    assert simulation.info()["outcome"][0, 0] == "success"
    assert simulation.world.time[0] == pytest.approx(9.0, abs=0.2)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_mud_stops_at_once_what_is_faster_and_lets_go_as_the_drive_can(kinematics: str) -> None:
    robot = {**DIFFERENTIAL, "kinematics": kinematics, "max_acceleration": 1.0}
    simulation = make([MUD], robot=robot, world={"start": [1, 0, 0]})
    speeds = []
    for _ in range(80):
        before = simulation.world.pose[0, 0, 0]
        simulation.step([[[1.0, 0.0]]])
        after, speed = simulation.world.pose[0, 0, 0], velocity(simulation)[0]
        assert after - before == pytest.approx(0.1 * speed)
        speeds.append((bool(2.0 < before < 4.0), speed))
    assert max(speed for inside, speed in speeds if inside) == pytest.approx(1.0 / 2.5)
    last = max(number for number, (inside, _) in enumerate(speeds) if inside)
    assert [speed for _, speed in speeds[last : last + 4]] == pytest.approx([0.4, 0.5, 0.6, 0.7])


def test_what_moves_by_itself_minds_no_region() -> None:
    mover = {"shape": {"circle": 0.3}, "at": [3, 1], "motion": {"law": "bounce", "velocity": [0.0, 0.5]}}
    world = {"family": "explicit", "movers": [mover]}
    simulation = make([MUD], world=world)
    for _ in range(10):
        simulation.step([[[0.0, 0.0]]])
    assert simulation.world.disc_position[0, 0].tolist() == pytest.approx([3.0, 1.5])


def test_regions_change_neither_scan_nor_contact() -> None:
    world = {"family": "explicit", "circles": [[3.0, 0.0, 0.5]], "start": [2.2, 0, 0]}
    muddy, plain = make([MUD], world=world), make([], world=world)
    assert (muddy.world.ranges == plain.world.ranges).all()
    for _ in range(3):
        muddy.step([[[1.0, 0.0]]])
    assert muddy.info()["outcome"][0, 0] == "collision"
    assert muddy.world.pose[0, 0, 0] == pytest.approx(3.0 - 0.5 - 0.2)


# ---------------------------------------------------------------------------------------------- what is seen


def oracle(scenario: Scenario, pose: F64) -> tuple[F64, NDArray[np.bool_]]:
    """Factors (32, 16) about a pose by shapely, and which samples are clear of the edges of all regions."""
    bearings = pose[2] + 2.0 * np.pi * np.arange(32) / 32
    distances = 0.25 * np.arange(1, 17)
    x = pose[0] + np.cos(bearings)[:, None] * distances
    y = pose[1] + np.sin(bearings)[:, None] * distances
    places = shapely.points(x, y)
    factors, clear = np.ones((32, 16)), np.ones((32, 16), dtype=bool)
    for region in scenario.world.regions:
        if region.circle is not None:
            cx, cy, radius = region.circle
            gap = np.hypot(x - cx, y - cy) - radius
            inside, near = gap < 0.0, abs(gap) < 1e-9
        else:
            inside = shapely.contains(region.geometry(), places)
            near = shapely.distance(region.geometry().boundary, places) < 1e-9
        factors[inside] = np.maximum(factors[inside], region.factor)
        clear &= ~near
    return factors, clear


def test_the_samples_are_what_shapely_says_at_their_places() -> None:
    rng = np.random.default_rng(0)
    simulation = make(REGIONS, robot=DIFFERENTIAL)
    seen: set[float] = set()
    for _ in range(200):
        pose = rng.uniform([-9.5, -9.5, -math.pi], [9.5, 9.5, math.pi])
        simulation.world.pose[0, 0] = pose
        simulation.step([[[-3.0 / 7.0, 0.0]]])  # it stands and looks
        pose = simulation.world.pose[0, 0].copy()
        expected, clear = oracle(simulation.scenario, pose)
        assert clear.mean() > 0.9
        np.testing.assert_array_equal(terrain(simulation)[clear], expected[clear])
        seen |= set(np.unique(expected[clear]).tolist())
        simulation.reset(seeds=[0])
    assert seen == {1.0, 1.5, 2.5, 3.0, 4.0}


def test_the_first_row_is_straight_ahead_and_rows_go_counter_clockwise() -> None:
    simulation = make([{"polygon": [[1, 3], [3, 3], [3, 6], [1, 6]], "factor": 2.0}], world={"start": [2, 0, 0]})
    rows = np.flatnonzero(terrain(simulation).max(axis=1) > 1.0)
    assert 8 in rows and set(rows) <= set(range(6, 11))  # row 8 of 32 points to the left
    np.testing.assert_array_equal(terrain(simulation)[8], [1.0] * 11 + [2.0] * 5)  # 0.25 m apart, from 3 m on


def test_a_scenario_without_regions_has_no_such_field() -> None:
    simulation = make([])
    assert [field.name for field in simulation.fields] == ["ranges", "goal", "pose", "velocity"]
    assert View(simulation.observations()[0, 0], Sensors.of(simulation.scenario)).terrain is None


def test_the_field_stands_between_velocity_and_peers_and_ends_at_the_largest_factor() -> None:
    simulation = make(REGIONS, robots={"count": 2})
    names = [field.name for field in simulation.fields]
    assert names == ["ranges", "goal", "pose", "velocity", "terrain", "peers"]
    [field] = [field for field in simulation.fields if field.name == "terrain"]
    assert field.shape == (32, 16) and (field.low == 1.0).all() and (field.high == 4.0).all()


def test_a_policy_sees_the_field_by_name() -> None:
    simulation = make(REGIONS, world={"start": [1.5, 0, 0.3]})
    view = View(simulation.observations()[0, 0], Sensors.of(simulation.scenario))
    assert view.terrain is not None
    np.testing.assert_array_equal(view.terrain, terrain(simulation))
    assert view.terrain.max() == 4.0


# ---------------------------------------------------------------------------------------------- faces

ROWS = 3
WILD = {"lidar.noise": 0.02, "odometry.rotation_noise": 0.05, "time.limit": 8.0}


def random_actions(steps: int) -> NDArray[np.float32]:
    return np.random.default_rng(1).uniform([-0.2, -1.0], 1.0, (steps, ROWS, 2)).astype(np.float32)


def muddy_field() -> Scenario:
    world = {"family": "field", "obstacles": 6, "moving": 0.5, "regions": REGIONS}
    return load({"robot": DIFFERENTIAL, "lidar": {"beams": 16, "range": 5.0}, "world": world}, WILD)


def test_gymnasium_finds_nothing_to_say() -> None:
    for observation in ("dict", "flat"):
        env = gym.make("BugGym/Navigation-v0", scenario="terrain", observation=observation)
        check_env(env.unwrapped, skip_render_check=True)


def test_a_row_of_the_vector_env_is_the_single_env_bit_for_bit() -> None:
    vector = gym.make_vec("BugGym/Navigation-v0", num_envs=ROWS, scenario=muddy_field(), observation="flat")
    singles = [gym.make("BugGym/Navigation-v0", scenario=muddy_field(), observation="flat") for _ in range(ROWS)]
    seen = [single.reset(seed=5 + row)[0] for row, single in enumerate(singles)]
    np.testing.assert_array_equal(vector.reset(seed=5)[0], seen)
    for actions in random_actions(40):
        came, expected = vector.step(actions), [single.step(actions[row]) for row, single in enumerate(singles)]
        for number in range(4):
            np.testing.assert_array_equal(came[number], [step[number] for step in expected])
        if (came[2] | came[3]).any():
            break
    assert vector.unwrapped.simulation.world.steps.max() > 10  # type: ignore[attr-defined]


def test_the_vec_env_of_sb3_sees_what_the_vector_env_sees() -> None:
    sb3 = pytest.importorskip("bug_gym.agents.sb3", reason="stable-baselines3 comes with the extra `train`")
    ours = sb3.make_vec_env(dump(muddy_field()), ROWS, seed=5)
    vector = gym.make_vec("BugGym/Navigation-v0", num_envs=ROWS, scenario=muddy_field())
    np.testing.assert_array_equal(ours.reset()["terrain"], vector.reset(seed=5)[0]["terrain"])
    actions = random_actions(1)[0]
    np.testing.assert_array_equal(ours.step(actions)[0]["terrain"], vector.step(actions)[0]["terrain"])


def test_several_robots_each_see_the_ground_about_themselves() -> None:
    env = bug_gym.parallel_env(load(data(REGIONS)), robots=2)
    observations, _ = env.reset(seed=0)
    for robot, agent in enumerate(env.agents):
        expected, clear = oracle(env.simulation.scenario, env.simulation.world.pose[0, robot])
        np.testing.assert_array_equal(observations[agent]["terrain"][clear], expected[clear])
    parallel_api_test(env, num_cycles=50)


def test_saved_worlds_go_on_bit_for_bit_in_this_simulation_and_in_a_pickled_one() -> None:
    simulation = Simulation(muddy_field(), ROWS)
    simulation.reset(seeds=range(ROWS))
    actions = random_actions(30)[:, :, None]
    for action in actions[:15]:
        simulation.step(action)
    saved, copy = simulation.save(), pickle.loads(pickle.dumps(simulation))
    first = [simulation.step(action).observation for action in actions[15:]]
    simulation.restore(saved)
    for again in (simulation, copy):
        np.testing.assert_array_equal([again.step(action).observation for action in actions[15:]], first)


# ---------------------------------------------------------------------------------------------- files


@pytest.mark.parametrize("family", ["empty", "field", "maze", "u_trap", "rooms"])
def test_every_family_has_regions_and_keeps_them_when_a_world_is_written_out(family: str) -> None:
    simulation = Simulation({"world": {"family": family, "regions": REGIONS}})
    simulation.reset(seeds=[1])
    explicit = as_explicit(simulation.scenario, simulation.world.layout(0))
    assert explicit.world.regions == simulation.scenario.world.regions
    again = Simulation(explicit)
    again.reset(seeds=[1])
    np.testing.assert_array_equal(terrain(again), terrain(simulation))


def test_regions_are_written_as_they_are_read() -> None:
    assert dump(load(data(REGIONS)))["world"]["regions"] == REGIONS
    assert "factor: 2.5" in to_yaml(load(data(REGIONS)))


def message(regions: list[Mapping[str, Any]]) -> str:
    with pytest.raises(ScenarioError) as caught:
        load({"world": {"family": "empty", "regions": regions}})
    return str(caught.value)


def test_a_region_that_cannot_be_is_refused_by_its_key() -> None:
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert "world.regions.0.factor: got 0.5, expected at least 1" in message([{"polygon": square, "factor": 0.5}])
    assert "world.regions.1.polygon: the polygon crosses itself at (0.5, 0.5)" in message(
        [MUD, {"polygon": [[0, 0], [1, 1], [1, 0], [0, 1]], "factor": 2.0}]
    )
    assert "unknown key, did you mean 'factor'?" in message([{"polygon": square, "factors": 2.0}])
    assert "world.regions.0.factor: missing" in message([{"polygon": square}])
    for outlines in ({}, {"polygon": square, "circle": [0, 0, 1]}):
        assert "world.regions.0.polygon: expected either polygon" in message([{**outlines, "factor": 2.0}])
    assert "world.regions.0.circle.2: got 0, expected a number above 0" in message([{"circle": [0, 0, 0], "factor": 2}])


# ---------------------------------------------------------------------------------------------- pictures


def test_regions_tint_the_floor_the_darker_the_larger_their_factor() -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    from bug_gym.drawing.canvas import Canvas

    canvas = Canvas(make(REGIONS, world={"start": [-9, -9, 0]}))
    frame = canvas.draw(scan=False)
    places = [(7.0, -5.0), (0.5, -2.5), (2.3, -2.5), (4.6, 0.8), (-1.0, 1.0)]  # open, 1.5, 2.5, 4.0, in the hole
    pixels = [tuple(int(value) for value in canvas.view.pixel(*place)) for place in places]
    colors = [frame[row, column].astype(int).tolist() for column, row in pixels]
    assert colors[4] == colors[0]
    for light, dark in zip(colors[:3], colors[1:4], strict=True):
        assert all(a > b for a, b in zip(light, dark, strict=True))
