"""Numbers of a scenario that are drawn for each episode: `max_speed: {uniform: [0.5, 1.5]}`."""

import copy
import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy import stats

import bug_gym
from bug_gym.config import ScenarioError, dump, load, to_yaml
from bug_gym.draws import CONSTANTS, draw, drawn_numbers
from bug_gym.evaluation import evaluate
from bug_gym.schema.ranges import Drawn
from bug_gym.schema.yaml_text import parse_yaml
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

EMPTY = {"robot": {"radius": 0.2}, "lidar": {"beams": 16}, "world": {"family": "empty"}}
SOME = {
    "robot.radius": {"uniform": [0.1, 0.2]},
    "robot.max_speed": {"uniform": [0.5, 1.5]},
    "robot.max_turn_rate": {"choice": [1.0, 1.5, 2.5]},
    "robot.max_acceleration": {"log_uniform": [0.5, 5.0]},
    "lidar.range": {"uniform": [4.0, 8.0]},
    "lidar.noise": {"uniform": [0.0, 0.03]},
    "lidar.dropout": {"choice": [0.0, 0.02]},
    "odometry.translation_noise": {"uniform": [0.0, 0.05]},
    "odometry.rotation_bias": {"uniform": [-0.02, 0.02]},
}


def drawn_of(simulation: Simulation, key: str) -> np.ndarray:
    """The column (N,) of a key."""
    return simulation.world.drawn[:, simulation.world.drawn_keys.index(key)]


def holonomic(**robot: Any) -> dict[str, Any]:
    """An empty world whose robot has these numbers."""
    return {**EMPTY, "robot": {"kinematics": "holonomic", **robot}}


def differential(**robot: Any) -> dict[str, Any]:
    """Likewise, of a differential robot."""
    return {**EMPTY, "robot": {"kinematics": "differential", **robot}}


# ----------------------------------------------------------------------------------------------------------- the laws


def test_numbers_follow_their_laws_over_seeds_and_over_episodes() -> None:
    laws = drawn_numbers(load("static", SOME))
    for pairs in ([(seed, 0) for seed in range(2000)], [(7, episode) for episode in range(2000)]):
        numbers = dict(zip(laws, np.array([draw(laws, *pair) for pair in pairs]).T, strict=True))
        for key, law in laws.items():
            if law.law == "choice":
                counts = [int((numbers[key] == choice).sum()) for choice in law.numbers]
                assert sum(counts) == 2000 and stats.chisquare(counts).pvalue > 1e-3
                continue
            low, high = law.numbers
            shares = (numbers[key] - low) / (high - low)
            if law.law == "log_uniform":
                shares = np.log(numbers[key] / low) / math.log(high / low)
            assert low <= numbers[key].min() and numbers[key].max() <= high
            assert stats.kstest(shares, "uniform").pvalue > 1e-3, key
        among = np.corrcoef(np.array(list(numbers.values())))
        assert np.abs(among - np.eye(len(laws))).max() < 0.1  # 4.5 standard deviations of independent numbers


def test_what_else_is_drawn_changes_no_number() -> None:
    alone = Simulation(load("static", {"lidar.range": SOME["lidar.range"]}))
    among = Simulation(load("static", SOME))
    for simulation in (alone, among):
        simulation.reset(seeds=[11])
    assert alone.drawn()["lidar.range"] == among.drawn()["lidar.range"]


@pytest.mark.parametrize("law", [{"uniform": [2.0, 2.0]}, {"log_uniform": [2.0, 2.0]}, {"choice": [2.0]}])
def test_a_range_without_width_is_the_number(law: dict[str, list[float]]) -> None:
    drawn, plain = (Simulation(load("static", {"robot.max_speed": speed}), 3) for speed in (law, 2.0))
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 3, 1, 2))
    assert np.array_equal(drawn.reset(seeds=range(3)), plain.reset(seeds=range(3)))
    for action in actions:
        assert np.array_equal(drawn.step(action).observation, plain.step(action).observation)


# ------------------------------------------------------------------------------------------- rows, episodes, snapshots


def test_a_row_of_many_is_the_single_world_of_its_seed() -> None:
    scenario = load("static", SOME)
    many, one = Simulation(scenario, 6, threads=2), Simulation(scenario)
    seen = many.reset(seeds=range(40, 46))
    assert np.array_equal(seen[3], one.reset(seeds=[43])[0])
    assert many.drawn(3) == one.drawn() and len({tuple(row) for row in many.world.drawn}) == 6
    rng, episodes = np.random.default_rng(0), 0
    for _ in range(250):
        actions = rng.uniform(-1.0, 1.0, (6, 1, 2))
        actions[:, :, 0] = np.abs(actions[:, :, 0])
        came, alone = many.step(actions), one.step(actions[3:4])
        assert np.array_equal(came.observation[3], alone.observation[0])
        assert np.array_equal(many.world.pose[3], one.world.pose[0])
        if len(ended := np.flatnonzero((came.terminated | came.truncated)[:, 0])):
            many.reset(ended)
            if 3 in ended:
                one.reset()
                episodes += 1
                assert many.drawn(3) == one.drawn()
    assert episodes > 0


def test_a_world_does_not_depend_on_the_robot_that_drove_in_its_row_before() -> None:
    scenario = load("rush", {"robot.radius": {"uniform": [0.01, 0.3]}})
    used, fresh = Simulation(scenario, 100), Simulation(scenario, 100)
    used.reset(seeds=range(100))
    assert np.array_equal(used.reset(seeds=range(100, 200)), fresh.reset(seeds=range(100, 200)))


def test_a_snapshot_brings_its_numbers_back_wherever_it_is_restored() -> None:
    scenario = load("dynamic", {"robot.max_speed": {"uniform": [0.5, 1.5]}, "lidar.noise": {"uniform": [0.0, 0.1]}})
    here, there = Simulation(scenario, 4), Simulation(scenario, 4)
    here.reset(seeds=range(4))
    here.reset(np.array([2]))
    there.reset(seeds=range(100, 104))
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (30, 4, 1, 2))
    here.advance(actions[0])
    state = here.save()
    seen = [here.step(action).observation for action in actions]
    pickled = pickle.loads(pickle.dumps(here))
    there.restore(state)
    assert np.array_equal(there.world.drawn, here.world.drawn) and np.array_equal(pickled.world.drawn, here.world.drawn)
    assert all(np.array_equal(there.step(action).observation, was) for action, was in zip(actions, seen, strict=True))
    assert np.array_equal(pickled.step(actions[0]).observation, there.step(actions[0]).observation)


def test_rows_keep_their_numbers_while_the_room_for_worlds_grows() -> None:
    scenario = load("maze", {"robot.max_speed": {"uniform": [0.5, 1.5]}})
    simulation = Simulation(scenario, 8)
    for _ in range(3):
        simulation.reset()
        told = [
            draw(drawn_numbers(scenario), *key)
            for key in zip(simulation.world.seed, simulation.world.episode, strict=True)
        ]
        assert np.array_equal(simulation.world.drawn, told)
        assert np.array_equal(simulation.world.spec["max_speed"], simulation.world.drawn[:, 0])


def test_a_scenario_without_ranges_has_one_record_for_all_rows() -> None:
    simulation = Simulation("static", 100)
    simulation.reset()
    assert len(simulation.world.spec) == 1 and simulation.drawn() == {}


# -------------------------------------------------------------------------------------------- what the numbers are of


def test_each_robot_drives_as_fast_as_its_own_limits_let_it() -> None:
    world = holonomic(max_speed={"uniform": [0.5, 1.5]}, max_acceleration={"uniform": [1.0, 20.0]})
    simulation = Simulation(world, 32)
    simulation.reset(seeds=range(32))
    for step in range(1, 3):
        simulation.advance(np.full((32, 1, 2), 1.0))
        speed = np.hypot(*simulation.world.velocity[:, 0].T)
        grown = step * 0.1 * drawn_of(simulation, "robot.max_acceleration")
        assert np.allclose(speed, np.minimum(drawn_of(simulation, "robot.max_speed"), grown), atol=1e-12)


def test_an_action_is_a_share_of_the_greatest_limits_and_is_cut_to_the_robots_own() -> None:
    world = differential(
        max_speed={"uniform": [0.5, 1.5]}, max_reverse={"uniform": [0.0, 0.4]}, max_turn_rate={"uniform": [0.5, 3.0]}
    )
    simulation = Simulation(world, 64)
    speed, reverse, rate = 1.5, 0.4, 3.0
    for first, second in [(-1.0, 1.0), (2.0 * reverse / (speed + reverse) - 1.0, 0.0), (0.2, -0.3), (1.0, -1.0)]:
        simulation.reset(seeds=range(64))
        simulation.advance(np.full((64, 1, 2), (first, second)))
        wanted = -reverse + 0.5 * (first + 1.0) * (speed + reverse)
        going = simulation.world.active[:, 0]  # what has touched something stands
        velocity = simulation.world.velocity[going, 0]
        own = [drawn_of(simulation, f"robot.{key}")[going] for key in ("max_reverse", "max_speed", "max_turn_rate")]
        assert going.sum() > 50
        assert np.allclose(velocity[:, 0], np.clip(wanted, -own[0], own[1]), atol=1e-12)
        assert np.allclose(velocity[:, 1], np.clip(second * rate, -own[2], own[2]), atol=1e-12)


def test_a_scanner_sees_as_far_as_its_own_range_and_what_nothing_returns_reads_the_longest() -> None:
    world = {**EMPTY, "lidar": {"beams": 90, "range": 12.0}, "world": {"family": "empty", "bounds": [-6, -6, 6, 6]}}
    full, drawn = Simulation(world, 16), Simulation(load(world, {"lidar.range": {"uniform": [2.0, 12.0]}}), 16)
    true, seen = (simulation.reset(seeds=range(16))[:, 0, :90] for simulation in (full, drawn))
    own = drawn_of(drawn, "lidar.range").astype(np.float32)[:, None]
    assert np.array_equal(seen, np.where(true < own, true, np.float32(12.0)))
    assert (seen < own).any() and (seen == 12.0).any()


def test_noise_is_as_large_as_what_was_drawn() -> None:
    world = {**EMPTY, "lidar": {"beams": 2000, "range": 60.0}}
    plain = Simulation(world, 8)
    noisy = Simulation(
        load(world, {"lidar.noise": {"uniform": [0.01, 0.2]}, "lidar.dropout": {"uniform": [0, 0.3]}}), 8
    )
    true, seen = (simulation.reset(seeds=range(8))[:, 0, :2000] for simulation in (plain, noisy))
    lost = seen == 60.0
    for row in range(8):
        spread = (seen - true)[row][~lost[row]].std()
        assert spread == pytest.approx(drawn_of(noisy, "lidar.noise")[row], rel=0.1)
        assert lost[row].mean() == pytest.approx(drawn_of(noisy, "lidar.dropout")[row], abs=0.04)


def test_a_body_touches_with_its_own_radius() -> None:
    simulation = Simulation(holonomic(radius={"uniform": [0.1, 0.6]}, max_speed=2.0), 24)
    simulation.reset(seeds=range(24))
    wall = float(simulation.world.wall[0, :, 0].max())
    while simulation.world.active.any():
        simulation.advance(np.tile([1.0, 0.0], (24, 1, 1)))
    ended = simulation.world.outcome[:, 0] == 2
    assert ended.sum() > 5
    assert all(
        simulation.world.body(row)[0, 2] == radius for row, radius in enumerate(drawn_of(simulation, "robot.radius"))
    )
    # Headings are drawn: whichever wall it met, its centre lies one radius before it.
    away = wall - np.abs(simulation.world.pose[:, 0, :2]).max(axis=1)
    assert np.allclose(away[ended], drawn_of(simulation, "robot.radius")[ended], atol=1e-6)


# ----------------------------------------------------------------------------------------------- what is told of them


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_observations_stay_within_their_spaces(kinematics: str) -> None:
    scenario = load("static", {**SOME, "robot.kinematics": kinematics, "lidar.min_range": {"uniform": [0.0, 0.1]}})
    env = gym.make_vec("BugGym/Navigation-v0", 16, vectorization_mode="vector_entry_point", scenario=scenario)
    env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(60):
        observation, *_ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)


def test_policies_are_made_for_the_end_with_which_they_are_safe() -> None:
    sensors = Sensors.of(load("static", {**SOME, "lidar.min_range": {"uniform": [0.0, 0.1]}}))
    assert (sensors.radius, sensors.drive.max_speed, sensors.drive.max_turn_rate) == (0.2, 1.5, 2.5)
    assert sensors.drive.max_acceleration == 0.5 and sensors.range_noise == 0.03 and sensors.range == 8.0
    assert not any(isinstance(value, Drawn) for value in vars(sensors.drive).values())


def test_infos_tell_what_was_drawn_on_request() -> None:
    scenario = load("static", SOME)
    env = gym.make("BugGym/Navigation-v0", scenario=scenario)
    _, plain = env.reset(seed=5)
    _, told = env.reset(seed=5, options={"drawn": True})
    assert told.keys() - plain.keys() == {f"drawn.{key}" for key in SOME}
    assert 0.5 <= told["drawn.robot.max_speed"] <= 1.5
    many = gym.make_vec("BugGym/Navigation-v0", 3, vectorization_mode="vector_entry_point", scenario=scenario)
    _, infos = many.reset(seed=5, options={"drawn": True})
    assert infos["drawn.robot.max_speed"][0] == told["drawn.robot.max_speed"] and infos["_drawn.lidar.range"].all()
    team = bug_gym.parallel_env(
        "crossing_robots", overrides={"robot.max_speed": {"uniform": [0.8, 1.0]}}, info="numeric"
    )
    _, of_robots = team.reset(seed=5, options={"drawn": True})
    assert len({info["drawn.robot.max_speed"] for info in of_robots.values()}) == 1


@pytest.mark.parametrize("policy", ["bug2", "hd_bug", "tangent_bug"])
def test_scripted_policies_touch_nothing_whatever_is_drawn(policy: str) -> None:
    ranges = {key: SOME[key] for key in SOME if not key.startswith("odometry")}
    rows = evaluate([policy], [load("static", ranges)], episodes=6)
    assert [row.outcome for row in rows] == ["success"] * 6


# --------------------------------------------------------------------------------------------------- files and faults


def test_ranges_come_back_from_yaml() -> None:
    scenario = load("static", SOME)
    again = load(parse_yaml(to_yaml(scenario)))
    assert again == scenario and hash(again) == hash(scenario) and again.digest == scenario.digest
    assert copy.deepcopy(scenario) == scenario == pickle.loads(pickle.dumps(scenario)) == load(dump(scenario))
    assert dump(scenario)["robot"]["max_speed"] == {"uniform": [0.5, 1.5]}


def test_a_range_is_another_scenario_than_its_end_or_another_law() -> None:
    speeds: list[Any] = [
        1.5,
        {"uniform": [0.5, 1.5]},
        {"uniform": [0.4, 1.5]},
        {"log_uniform": [0.5, 1.5]},
        {"choice": [0.5, 1.5]},
    ]
    made = [load("static", {"robot.max_speed": speed}) for speed in speeds]
    assert len({scenario.digest for scenario in made}) == len(set(made)) == len(speeds)
    numbers = [scenario.robot.max_speed for scenario in made]
    assert all((one != other) == (one is not other) for one in numbers for other in numbers)


def test_one_end_can_be_overridden() -> None:
    scenario = load(load("static", SOME), {"robot.max_speed.uniform.1": 2.0})
    assert scenario.robot.max_speed == Drawn("uniform", (0.5, 2.0))


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (
            {"robot.max_speed": {"uniform": [0.1, 1.0]}, "robot.max_reverse": 0.3},
            r"robot.max_reverse: got 0.3, expected at most max_speed",
        ),
        ({"robot.max_reverse": {"uniform": [0.1, 1.1]}}, r"robot.max_reverse: got {uniform: \[0.1, 1.1\]}"),
        ({"lidar.min_range": {"uniform": [0.1, 5.0]}, "lidar.range": {"uniform": [5.0, 9.0]}}, "lidar.min_range: got"),
        (
            {"robot.max_speed": {"uniform": [2.0, 1.0]}},
            r"robot.max_speed.uniform: got \[2.0, 1.0\], expected \[least, most\]",
        ),
        ({"robot.max_speed": {"uniform": [1.0]}}, r"robot.max_speed.uniform: got \[1.0\]"),
        ({"robot.max_speed": {"uniform": 1.0}}, r"robot.max_speed.uniform: got 1.0, expected a list"),
        ({"robot.max_speed": {"unifrom": [1.0, 2.0]}}, "did you mean 'uniform'"),
        ({"robot.max_speed": {"uniform": [1.0, 2.0], "choice": [1.0]}}, "robot.max_speed: got"),
        ({"robot.max_speed": {}}, "robot.max_speed: got {}"),
        ({"robot.max_speed": {"uniform": [-1.0, 2.0]}}, "robot.max_speed: got -1.0, expected a number above 0"),
        ({"robot.max_speed": {"choice": ["fast"]}}, "robot.max_speed: got 'fast', expected a number"),
        ({"robot.max_speed": {"choice": [True]}}, "robot.max_speed: got True, expected a number"),
        ({"robot.max_speed": {"choice": []}}, "robot.max_speed.choice: got"),
        ({"lidar.dropout": {"log_uniform": [0.0, 0.1]}}, "lidar.dropout.log_uniform: got"),
        ({"lidar.dropout": {"uniform": [0.0, 1.1]}}, "lidar.dropout: got 1.1, expected at most 1"),
        ({"lidar.beams": {"choice": [32, 64]}}, "lidar.beams: got"),
        ({"time.step": {"uniform": [0.1, 0.2]}}, "time.step: got"),
        ({"robot.radius": {"uniform": [0.1, 0.2]}, "robot.circles": [[0.0, 0.0, 0.2]]}, "robot.radius: got"),
    ],
)
def test_what_cannot_be_drawn_is_told_in_a_line(overrides: dict[str, Any], told: str) -> None:
    with pytest.raises(ScenarioError, match=told) as raised:
        load("static", overrides)
    assert "\n" not in str(raised.value)


def test_the_radius_of_several_robots_is_one_number() -> None:
    with pytest.raises(ScenarioError, match=r"robot\.radius: got {uniform"):
        load("crossing_robots", {"robot.radius": {"uniform": [0.1, 0.2]}})


def test_each_key_that_may_be_drawn_reaches_the_rows() -> None:
    for key, constant in CONSTANTS.items():
        simulation = Simulation(load(EMPTY, {"robot.max_reverse": 0.0, key: {"uniform": [0.31, 0.32]}}), 2)
        simulation.reset(seeds=[0, 1])
        assert ((simulation.world.spec[constant] > 0.31) & (simulation.world.spec[constant] < 0.32)).all(), key
        assert len(set(simulation.world.spec[constant])) == 2, key
