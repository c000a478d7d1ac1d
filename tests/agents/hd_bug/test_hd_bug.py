"""HD-BUG: its promise, its closed forms, movers and moving targets, and that each of its parts does something."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, get_args

import numpy as np
import pytest
import shapely
from episodes import CLOSED_FORM_SENSORS, Disc, Episode, Slab, UTrap, canonical_world, run_episode

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug import explore
from bug_gym.agents.hd_bug.memory import Walls
from bug_gym.agents.hd_bug.moving_goal import meeting_time
from bug_gym.agents.hd_bug.parameters import Part
from bug_gym.agents.hd_bug.path_list import Door
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.agents.hd_bug.policy import HDBug
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.reproductions import hd_bug_tables
from bug_gym.scenarios import draw_layout
from bug_gym.shortest_path import shortest_path
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

MODES = {"direct", "candidates", "backtracking", "circumnavigation", "anticipation", "reaction", "emergency"}
LABELS = {"light", "cheap", "candidate", "dear", "chosen", "closed", "list", "way", "forecast", "hit", "leave", "wall"}


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"predictor": "kalmann"}, "unknown predictor 'kalmann', did you mean 'kalman'"),
        ({"without": "phase_3"}, "without must be one of .* got 'phase_3', did you mean 'phase_"),
        ({"beta": -0.1}, "beta must not be negative, got -0.1"),
        ({"patience": 0.0}, "patience must be positive, got 0.0"),
        ({"clearance": 0.1}, "clearance must be above the body's radius of 0.2 m, got 0.1"),
        ({"clearance": math.nan}, "clearance must be above"),
        ({"v_base": 1.5}, "v_base is a share of the top speed, at most 1, got 1.5"),
        ({"horizon": math.inf}, "horizon must be positive, got inf"),
    ],
)
def test_parameters_that_cannot_be_are_refused(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy("hd_bug", Simulation("static"), **parameters)


def test_a_part_that_it_has_not_is_refused_of_the_class_too() -> None:
    sensors = Sensors.of(load("static"))
    with pytest.raises(ValueError, match="without is one of '', 'path_list', .*, got 'phase_3'"):
        HDBug(sensors, without="phase_3")


# ------------------------------------------------------------------------------------------------------ still worlds


def test_an_empty_world_is_crossed_straight_at_top_speed() -> None:
    episode = run_episode("hd_bug", {"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}})
    assert episode.outcome == "success"
    np.testing.assert_allclose(episode.path[:, 1], 0.0, atol=1e-6)
    # Until the goal's radius of 0.3 m is reached, in whole steps of 0.1 m.
    assert len(episode.path) - 1 in (77, 78)


SHORTEST = {
    "slab": min(Slab().shortest("left"), Slab().shortest("right")),
    "disc": Disc().shortest(),
    "u_trap": UTrap().shortest(),
}


@cache
def canonical(world: str, sight: float, angle: float = 0.0, mirrored: bool = False) -> Episode:
    scenario = canonical_world(world, angle=angle, mirrored=mirrored)
    scenario["lidar"]["range"] = sight
    return run_episode("hd_bug", scenario, clearance=0.5)


@pytest.mark.parametrize("world", SHORTEST)
def test_seen_from_afar_the_way_is_little_longer_than_the_shortest(world: str) -> None:
    episode = canonical(world, 50.0)
    # The light is that of a disc a little smaller than the clearance; the paper asks for 12 %.
    assert episode.outcome == "success" and SHORTEST[world] - 0.3 <= episode.full_length <= 1.12 * SHORTEST[world]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("scenario", ["rooms", "u_trap", "hook", "static"])
def test_solvable_worlds_are_solved_without_contact(scenario: str, seed: int) -> None:
    overrides = {"world.rotation": "random"} if scenario in ("u_trap", "hook") else {}
    episode = run_episode("hd_bug", scenario, {**overrides, "time.limit": 900.0}, seed=seed)
    assert episode.outcome == "success" and episode.verdict == "" and episode.min_clearance > 0.0
    assert set(episode.modes) <= MODES
    layout = episode.simulation.world.layout(0)
    obstacles = (layout.circles, layout.polygons, layout.border)
    exact = shortest_path(*obstacles, episode.path[0, :2], layout.goals[0], radius=0.2)
    assert episode.full_length >= exact.length - 1e-6


@pytest.mark.parametrize("seed", (40_000, 40_003))
def test_a_robot_that_seldom_changes_its_mind_does_not_go_to_and_fro_for_ever(seed: int) -> None:
    # A livelock of doors without the circumnavigation: 0 of 4 of these fields arrived.
    episode = run_episode("hd_bug", hd_bug_tables.field(500, 10.0), {"time.limit": 900.0}, seed=seed, hysteresis=0.5)
    assert episode.outcome == "success"


def turned_about(self: explore.Explorer, *arguments: Any) -> Any:
    """The costs with their sign changed at every second look: it goes for the best door, then for the worst."""
    self.asked = getattr(self, "asked", 0) + 1  # type: ignore[attr-defined]
    return COSTS(self, *arguments) * (1.0 if self.asked % 2 else -1.0)  # type: ignore[attr-defined]


COSTS = explore.Explorer._costs


@pytest.mark.parametrize("world", ["u_trap", "ring"])
def test_whatever_doors_it_chooses_it_arrives_or_is_right(world: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(explore.Explorer, "_costs", turned_about)
    episode = run_episode("hd_bug", world, {"time.limit": 2000.0}, patience=2.0)
    assert "circumnavigation" in episode.modes
    assert (episode.outcome, episode.verdict) == (("success", "") if world == "u_trap" else ("running", "unreachable"))


@pytest.mark.parametrize("without", ["candidates", "backtracking", "path_list"])
def test_no_door_left_is_no_verdict(without: str) -> None:
    assert run_episode("hd_bug", "u_trap", {"time.limit": 600.0}, without=without).outcome == "success"


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_goal_shut_in_is_unreachable_and_a_lap_says_so(noise: float) -> None:
    episode = run_episode("hd_bug", "ring", {**CLOSED_FORM_SENSORS, "lidar.noise": noise})
    assert episode.verdict == "unreachable" and episode.outcome == "running"
    lap = 4.0 * 8.0 + 2.0 * math.pi * 0.3
    modes = np.array(episode.modes)
    assert modes[-1] == "circumnavigation" and 0.1 * (modes == "circumnavigation").sum() >= 0.9 * lap


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_shut_in_itself_it_says_so(noise: float) -> None:
    world = {"family": "ring", "bounds": [-15, -15, 25, 15], "centre": [10, 0], "inside": "start"}
    world |= {"start": [10, 0, 0], "goal": [0, 0]}
    episode = run_episode("hd_bug", "ring", {**CLOSED_FORM_SENSORS, "lidar.noise": noise, "world": world})
    assert episode.verdict == "unreachable"


@pytest.mark.parametrize("scenario", ["u_trap", "dynamic"])
def test_the_same_world_twice_gives_the_same_run_bit_for_bit(scenario: str) -> None:
    first, second = (run_episode("hd_bug", scenario, seed=4, max_steps=150) for _ in range(2))
    np.testing.assert_array_equal(first.path, second.path)
    assert first.modes == second.modes


@pytest.mark.parametrize("gap", [0.0, 0.003])
def test_touched_all_round_it_does_not_press_on(gap: float) -> None:
    simulation = Simulation("u_trap", 1)
    flat = simulation.reset(seeds=[0])[:, 0].copy()
    flat[:, :360] = 0.2 + gap
    policy, state = make_policy("hd_bug", simulation), None
    for _ in range(30):
        action, state = policy.predict(flat, state)
        assert np.hypot(*action[0]) * 0.1 <= gap + 1e-3


def test_it_goes_back_over_its_list_out_of_the_hook() -> None:
    episode = run_episode("hd_bug", "hook", {"time.limit": 600.0})
    assert "backtracking" in episode.modes and episode.memory.closed
    assert len(episode.memory.path) <= episode.length / 0.5 + 30
    assert episode.memory.odometer == pytest.approx(episode.length, abs=0.2)


@pytest.mark.parametrize(("scenario", "seed"), [("ring", 0), ("rooms", 0), ("hook", 0)])
def test_the_list_is_drawn_where_the_robot_went_and_through_no_wall(scenario: str, seed: int) -> None:
    """Nodes made one after the other may lie on both sides of a wall, where it went back to an older one in between."""
    limits = {"robot.kinematics": "differential", "time.limit": 300.0}
    episode = run_episode("hd_bug", scenario, limits, seed=seed)
    policy: Any = make_policy("hd_bug", episode.simulation)
    layout = draw_layout(episode.simulation.scenario, seed, 0)
    walls = shapely.union_all([shapely.Polygon(shell, holes) for shell, *holes in layout.polygons])
    x, y, heading = layout.starts[0]
    rows = [row[:4] for row in policy.draw(episode.memory).segments if row[-1] == "list"]
    cos, sin = math.cos(heading), math.sin(heading)
    ends = np.array(rows).reshape(-1, 2, 2) @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    assert len(ends) >= 3 and not shapely.intersects(shapely.linestrings(ends), walls).any()


def test_it_goes_round_obstacles_as_fast_as_tangent_bug() -> None:
    """On arcs round their corners: with turns on the spot it kept 0.89 of that pace in these mazes."""
    pace = []
    for policy in ("hd_bug:patience=0.01", "tangent_bug"):  # it has none, and goes round what is in the way at once
        rows = evaluate([policy], "maze", episodes=4, seed=0, overrides={"time.limit": 60.0})
        pace.append(sum(row.path_length for row in rows) / sum(row.time for row in rows))
    assert pace[0] >= 0.94 * pace[1]


@pytest.mark.parametrize(
    ("robot", "discrete", "rounds"),
    [
        ({}, False, True),
        ({}, True, False),
        ({"latency": 0.1}, False, False),
        ({"max_acceleration": 2.0}, False, False),
        ({"kinematics": "holonomic"}, False, False),
        ({"kinematics": "ackermann"}, False, False),
    ],
)
def test_it_keeps_to_contours_exactly_where_it_cannot_be_driven_on_arcs(
    robot: dict[str, Any], discrete: bool, rounds: bool
) -> None:
    robot = {"kinematics": "differential"} | robot
    policy = HDBug(
        Sensors.of(load("rooms", {f"robot.{key}": value for key, value in robot.items()})), discrete=discrete
    )
    assert (policy.boundary.rounding is not None) == rounds


def test_a_car_that_goes_round_a_maze_says_nothing_of_a_goal_that_has_a_way() -> None:
    # Steered straight on where a lap had led along the contour, it came to its end elsewhere and took it for closed.
    episode = run_episode("hd_bug", "maze", {"robot.kinematics": "ackermann", "time.limit": 180.0}, seed=126)
    assert "circumnavigation" in episode.modes and episode.verdict == ""


@pytest.mark.parametrize("scenario", ["u_trap", "dynamic", "ring"])
def test_what_it_draws_is_finite_and_labelled(scenario: str) -> None:
    simulation = Simulation(scenario, 1)
    policy: Any = make_policy("hd_bug", simulation)
    flat, state = simulation.reset(seeds=[0])[:, 0], None
    assert not policy.draw(policy.start()).areas
    for step in range(120):
        actions, state = policy.predict(flat, state)
        flat = simulation.step(actions[:, None]).observation[:, 0]
        if step % 20 == 0:
            drawing = policy.draw(state[0])
            rows: list[tuple[Any, ...]] = [*drawing.points, *drawing.segments]
            assert all(math.isfinite(number) for *numbers, _ in rows for number in numbers)
            assert all(np.isfinite(ring).all() and ring.shape[1] == 2 for ring, _ in drawing.areas)
            assert {row[-1] for row in rows} | {label for _, label in drawing.areas} <= LABELS
            assert sum(label == "chosen" for *_, label in drawing.points) == 1


# ------------------------------------------------------------------------------------------------------ each part

TIMES = {"rooms": 150.0, "rush": 40.0}
MUTANTS: dict[str, tuple[str, int]] = {
    "path_list": ("rooms", 0),
    "backtracking": ("rooms", 0),
    "shadow": ("rooms", 0),
    "candidates": ("rooms", 0),
    "travel": ("rooms", 0),
    "goal": ("rooms", 0),
    "risk": ("rooms", 5),
    "velocity_rule": ("rush", 5),
    "phase_1": ("rush", 2),
    "phase_2": ("rush", 35),
    "prediction": ("rush", 6),
    "spread": ("rush", 6),
    "radius_ladder": ("rush", 6),
}
"""For each part a world, by scenario and seed, in which it makes a difference."""


@cache
def ending(scenario: str, seed: int, without: str) -> tuple[str, str, float]:
    """Outcome, verdict and length [m] in a world."""
    episode = run_episode("hd_bug", scenario, {"time.limit": TIMES[scenario]}, seed=seed, without=without)
    return episode.outcome, episode.verdict, episode.length


def test_each_part_has_a_world() -> None:
    assert {"", *MUTANTS} == set(get_args(Part))


@pytest.mark.parametrize("part", MUTANTS)
def test_without_a_part_a_world_ends_otherwise(part: str) -> None:
    whole, less = ending(*MUTANTS[part], ""), ending(*MUTANTS[part], part)
    assert whole[:2] != less[:2] or abs(whole[2] - less[2]) > 0.05


@pytest.mark.parametrize("part", ["backtracking", "path_list"])
def test_who_has_no_way_back_still_goes_on_to_its_door(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It gives the door up when that is lit or leads into something, as the whole does; all doors of older nodes are closed."""
    look, kept = explore.Explorer.look, []

    def watched(explorer: Any, scene: Scene, memory: Any) -> bool:
        door, has_looked = memory.door, look(explorer, scene, memory)
        if has_looked and door is not None:
            is_lit = explorer._is_light(memory, np.array([door.outside]))[0]
            is_solid = explorer._is_solid(memory.walls, [door])[0]
            kept.append(memory.door is door)
            assert kept[-1] != (is_lit or is_solid)
        if has_looked:
            assert all(door is memory.door or door.owner == memory.path.here.number for door in memory.path.doors)
        return has_looked

    monkeypatch.setattr(explore.Explorer, "look", watched)
    run_episode("hd_bug", "rooms", {"time.limit": 60.0}, seed=0, without=part)
    assert kept.count(True) > 10 and kept.count(False) > 10


# ----------------------------------------------------------------------------------------------------- what moves


def test_most_worlds_of_movers_are_crossed() -> None:
    outcomes = [run_episode("hd_bug", "dynamic", seed=seed).outcome for seed in range(15)]
    assert outcomes.count("success") >= 14


@pytest.mark.parametrize("before", [0, 1])
def test_of_two_equal_doors_it_takes_the_one_where_no_mover_will_be(before: int) -> None:
    """What moves is 0.1 m off the body at q of the one door when the robot gets there, by 2 exp(-(gap / 0.5)^2) of a risk."""
    world = {"family": "empty", "bounds": [-20, -20, 20, 20], "start": [0, 0, 0], "goal": [10, 0]}
    simulation = Simulation({"world": world, "robot": {"kinematics": "holonomic"}})
    policy: Any = make_policy("hd_bug", simulation, beta=0.5)
    memory, view = policy.start(), View(simulation.reset(seeds=[0])[0, 0], policy.sensors)
    tracks = policy.perception.tracker.update(memory.tracker, view, 0.0)
    node = memory.path.visit(view.position, 0.0, memory.light)
    node.doors = [Door((0.9, 1.2 * side), (1.2, 1.6 * side), 5.0, node.number) for side in (1.0, -1.0)]
    memory.goal, memory.walls = (10.0, 0.0), Walls(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.bool_))
    # At 1 m/s the robot is at q, 2 m from here, after 2 s, and the mover of 0.3 m is 0.6 m beside that; another one stands.
    x, y = node.doors[before].outside
    place, other = [x + 0.6 + 2.0 * 0.4, y], node.doors[1 - before].outside
    scene = Scene(
        view,
        tracks._replace(
            position=np.array([place, other]),
            velocity=np.array([[-0.4, 0.0], [0.0, 0.0]]),
            radius=np.array([0.3, 0.3]),
            moving=np.array([True, False]),
        ),
    )
    policy.explorer.choose(scene, memory)
    assert memory.door is node.doors[1 - before]
    risk = 2.0 * math.exp(-(((0.6 - 0.3 - 0.2) / 0.5) ** 2))
    assert memory.costs[before] - memory.costs[1 - before] == pytest.approx(0.5 * risk)


@pytest.mark.parametrize("predictor", ["none", "constant_velocity", "kalman", "rl"])
def test_each_predictor_is_taken(predictor: str) -> None:
    episode = run_episode("hd_bug", "dynamic", seed=1, max_steps=30, predictor=predictor)
    assert episode.outcome in ("running", "success")


def crossing(side: float, kinematics: str) -> Episode:
    """A mover that comes along from one side, to meet the robot half-way if it goes straight on."""
    mover = {"shape": {"circle": 0.4}, "at": [4.0, 4.0 * side], "motion": {"law": "bounce", "velocity": [0.0, -side]}}
    world = {"family": "explicit", "bounds": [-20, -20, 20, 20], "movers": [mover], "start": [0, 0, 0], "goal": [8, 0]}
    return run_episode("hd_bug", {"world": world, "robot": {"kinematics": kinematics}, "time": {"limit": 60.0}})


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_passes_behind_what_crosses(side: float, kinematics: str) -> None:
    episode = crossing(side, kinematics)
    assert episode.outcome == "success" and "anticipation" in episode.modes
    # Where the mover's line is crossed the robot is on the side that the mover came from, or has let it by.
    index = int(np.abs(episode.path[:, 0] - 4.0).argmin())
    mover = side * (4.0 - 0.1 * index)
    assert side * (episode.path[index, 1] - mover) > 0.6


def test_what_comes_on_head_on_without_the_first_phase_is_given_way_to_by_the_second() -> None:
    mover = {"shape": {"circle": 0.4}, "at": [6.0, 0.05], "motion": {"law": "bounce", "velocity": [-0.8, 0.0]}}
    world = {"family": "explicit", "bounds": [-20, -20, 20, 20], "movers": [mover], "start": [0, 0, 0], "goal": [9, 0]}
    settings = {"world": world, "robot": {"kinematics": "holonomic"}, "time": {"limit": 60.0}}
    assert run_episode("hd_bug", settings, without="phase_2").outcome == "success"
    second = run_episode("hd_bug", settings, without="phase_1")
    assert second.outcome == "success" and "reaction" in second.modes


def test_a_robot_that_backs_out_no_longer_does_when_nothing_is_near() -> None:
    simulation = Simulation("static", 1)
    policy: Any = make_policy("hd_bug", simulation)
    flat = simulation.reset(seeds=[0])[:, 0]
    _, state = policy.predict(flat)
    state[0].is_backing = True
    action, state = policy.predict(flat, state)
    assert not state[0].is_backing and action[0, 0] >= 0.0


def chase(policy: str, velocity: tuple[float, float], kinematics: str, **parameters: Any) -> float:
    """Time that a policy takes to a target that starts at (10, 0) and keeps its velocity [s]."""
    target = {"at": [10, 0], "motion": {"law": "bounce", "velocity": list(velocity)}}
    world = {"family": "explicit", "bounds": [-60, -60, 60, 60], "start": [0, 0, 0], "target": target}
    settings = {"world": world, "robot": {"kinematics": kinematics}, "time": {"limit": 120.0}}
    episode = run_episode(policy, settings, **parameters)
    assert episode.outcome == "success"
    return 0.1 * (len(episode.path) - 1)


VELOCITIES = [(0.0, 0.5), (0.5, 0.0), (-0.5, 0.0), (0.3, 0.3), (0.2, -0.7), (-0.4, 0.6), (0.0, 0.0)]


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_an_open_target_is_met_within_three_percent_of_the_closed_form(velocity: tuple[float, float]) -> None:
    best = meeting_time((0.0, 0.0), (10.0, 0.0), velocity, 1.0, 0.3)
    assert chase("hd_bug", velocity, "holonomic") <= 1.03 * best + 0.1


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_where_odometry_drifts_a_beacon_that_stands_is_no_goal_that_moves(noise: float) -> None:
    """Its place in the robot's frame goes to and fro by centimetres; led, it would be driven at whenever the way is free."""
    drift = {"odometry.translation_noise": noise, "odometry.rotation_noise": 0.2 * noise}
    episode = run_episode("hd_bug", "u_trap", {"goal.sensing": "beacon", "lidar.beams": 180, **drift}, seed=1)
    assert episode.outcome == "success"


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_it_meets_moving_targets_sooner_than_pure_pursuit(kinematics: str) -> None:
    gains = [
        chase("hd_bug", velocity, kinematics, lead=False) - chase("hd_bug", velocity, kinematics)
        for velocity in VELOCITIES
    ]
    assert min(gains) >= -0.1 - 1e-9 and float(np.mean(gains)) > 0.3
