"""The map planner: closed forms, traps, movers, moving targets."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from episodes import CLOSED_FORM_SENSORS, Disc, Episode, Slab, UTrap, canonical_world, run_episode, tolerance
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug.moving_goal import meeting_time
from bug_gym.agents.hd_bug_map.parameters import HDBugMapParameters, measures_of
from bug_gym.agents.prediction import predictor_names
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.reproductions import barn, cylinder_claims
from bug_gym.shortest_path import shortest_path
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

MODES = {"direct", "following", "avoidance", "emergency", "turning", "waiting"}
LABELS = {"light", "shadow", "cheap", "candidate", "dear", "chosen", "way", "forecast"}

# -------------------------------------------------------------------------------------------------------- parameters


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"predictor": "kalmann"}, "unknown predictor 'kalmann', did you mean 'kalman'"),
        ({"predictor": "oracle"}, "known: none, constant_velocity, kalman"),
        ({"beta": -0.1}, "beta must not be negative, got -0.1"),
        ({"alpha": 0.0}, "alpha must be positive, got 0.0"),
        ({"clearance": 0.1}, "clearance must be above the robot's radius of 0.2 m, got 0.1"),
        ({"clearance": math.nan}, "clearance must be above"),
        ({"v_turning": 1.5}, "v_turning is a share of the top speed, at most 1, got 1.5"),
        ({"horizon": math.inf}, "horizon must be positive, got inf"),
        ({"patience": 0}, "patience must be at least 1, got 0"),
    ],
)
def test_parameters_that_cannot_be_are_refused(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_policy("hd_bug_map", Simulation("static"), **parameters)


@pytest.mark.parametrize("predictor", ["none", "constant_velocity", "kalman"])
def test_each_plain_predictor_is_taken(predictor: str) -> None:
    assert predictor in predictor_names()
    episode = run_episode("hd_bug_map", "dynamic", seed=1, max_steps=30, predictor=predictor)
    assert episode.outcome in ("running", "success")


# ------------------------------------------------------------------------------------------------------ closed forms


def test_an_empty_world_is_crossed_straight_at_top_speed() -> None:
    episode = run_episode("hd_bug_map", {"world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}})
    assert episode.outcome == "success" and set(episode.modes) == {"direct"}
    np.testing.assert_array_equal(episode.path[:, 1], 0.0)
    # Until the goal's radius of 0.3 m is reached, in whole steps of 0.1 m.
    assert len(episode.path) - 1 in (77, 78)
    np.testing.assert_allclose(np.diff(episode.path[:-1, 0]), 0.1, rtol=1e-5)


SHORTEST = {
    "slab": min(Slab().shortest("left"), Slab().shortest("right")),
    "disc": Disc().shortest(),
    "u_trap": UTrap().shortest(),
}


@cache
def canonical(world: str, sight: float, angle: float = 0.0, mirrored: bool = False) -> Episode:
    scenario = canonical_world(world, angle=angle, mirrored=mirrored)
    scenario["lidar"]["range"] = sight
    return run_episode("hd_bug_map", scenario, clearance=0.5)


@pytest.mark.parametrize("world", SHORTEST)
def test_seen_from_afar_the_way_is_hardly_longer_than_the_shortest(world: str) -> None:
    episode = canonical(world, 50.0)
    assert episode.outcome == "success"
    # Shorter: cells let it cut corners by half a diagonal. Longer: what lies behind a corner is seen when it gets there.
    assert SHORTEST[world] - 0.3 <= episode.full_length <= 1.01 * SHORTEST[world]


@pytest.mark.parametrize(("world", "most"), [("slab", 24.5), ("disc", 1.05 * SHORTEST["disc"]), ("u_trap", 29.0)])
def test_with_short_sight_the_way_is_as_short_as_the_reference_says(world: str, most: float) -> None:
    episode = canonical(world, 5.0)
    assert episode.outcome == "success" and episode.full_length <= most


@pytest.mark.parametrize(("angle", "mirrored"), [(0.83, False), (0.0, True), (0.83, True)])
@pytest.mark.parametrize("world", SHORTEST)
def test_a_turned_or_mirrored_world_takes_the_same_way(world: str, angle: float, mirrored: bool) -> None:
    episode = canonical(world, 5.0, angle, mirrored)
    assert episode.outcome == "success"
    assert episode.length == pytest.approx(canonical(world, 5.0).length, rel=0.01)


def test_out_of_the_hook_it_takes_the_slit_when_it_sees_it() -> None:
    episode = run_episode("hd_bug_map", "hook", {"lidar.range": 50.0, "time.limit": 600.0})
    layout = episode.simulation.world.layout(0)
    exact = shortest_path(
        layout.circles, layout.polygons, layout.border, episode.path[0, :2], layout.goals[0], radius=0.25
    )
    assert episode.full_length == pytest.approx(exact.length, abs=tolerance(exact.length))


@pytest.mark.parametrize("sight", [5.0, 50.0])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_goal_shut_in_is_unreachable_within_a_lap(sight: float, noise: float) -> None:
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": sight, "lidar.noise": noise}
    episode = run_episode("hd_bug_map", "ring", settings)
    assert episode.verdict == "unreachable" and episode.outcome == "running"
    lap = 4.0 * 8.0 + 2.0 * math.pi * 0.25
    assert episode.length <= 5.75 + lap


@pytest.mark.parametrize("radius", [0.005, 0.02, 0.04])
def test_walls_have_no_holes_for_a_tiny_robot(radius: float) -> None:
    """A wall is a row of points, one a cell: what is open between them is no way."""
    settings = {**CLOSED_FORM_SENSORS, "lidar.range": 5.0, "robot.radius": radius, "time.limit": 120.0}
    assert run_episode("hd_bug_map", "ring", settings).verdict == "unreachable"
    assert run_episode("hd_bug_map", "hook", settings).outcome == "success"


@pytest.mark.parametrize("radius", [0.001, 0.01, 0.0125, 0.03, 0.05, 0.0999, 0.2, 1.0, 5.0])
def test_a_point_blocks_the_cell_that_remembers_it_at_every_clearance(radius: float) -> None:
    sensors = Sensors.of(load({"robot": {"radius": radius}}))
    measures = measures_of(sensors, HDBugMapParameters())
    assert math.sqrt(0.5) * measures.cell < measures.tight <= measures.clearance and radius < measures.tight


@pytest.mark.parametrize("seed", range(3))
def test_few_beams_and_noise_do_not_hide_that_there_is_no_way(seed: int) -> None:
    settings = {"robot.kinematics": "differential", "lidar.beams": 64, "lidar.noise": 0.01, "time.limit": 600.0}
    assert run_episode("hd_bug_map", "ring", settings, seed=seed).verdict == "unreachable"


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_shut_in_itself_it_says_so(noise: float) -> None:
    world = {"family": "ring", "bounds": [-15, -15, 25, 15], "centre": [10, 0], "inside": "start"}
    world |= {"start": [10, 0, 0], "goal": [0, 0]}
    episode = run_episode("hd_bug_map", "ring", {**CLOSED_FORM_SENSORS, "lidar.noise": noise, "world": world})
    assert episode.verdict == "unreachable"


def test_patience_is_how_many_decisions_it_waits_before_it_says_so() -> None:
    world = {"family": "ring", "bounds": [-15, -15, 25, 15], "centre": [10, 0], "inside": "start"}
    world |= {"start": [10, 0, 0], "goal": [0, 0]}
    episode = run_episode("hd_bug_map", "ring", {**CLOSED_FORM_SENSORS, "world": world}, patience=7)
    assert episode.modes == ("waiting",) * 7


# ------------------------------------------------------------------------------------------------ traps, still worlds

TRAPS: dict[str, dict[str, Any]] = {
    "maze": {},
    "rooms": {},
    "u_trap": {"world.rotation": "random"},
    "hook": {"world.rotation": "random"},
    "static": {"world.obstacles": 60},
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scenario", TRAPS)
def test_solvable_worlds_are_solved_without_contact(scenario: str, seed: int) -> None:
    episode = run_episode("hd_bug_map", scenario, {**TRAPS[scenario], "time.limit": 1500.0}, seed=seed)
    assert episode.outcome == "success" and episode.verdict == "" and episode.min_clearance > 0.0
    assert set(episode.modes) <= MODES
    layout = episode.simulation.world.layout(0)
    obstacles = (layout.circles, layout.polygons, layout.border)
    exact = shortest_path(*obstacles, episode.path[0, :2], layout.goals[0], radius=0.2)
    assert episode.full_length >= exact.length - 1e-6


@pytest.mark.parametrize("seed", [1017, 1019])
def test_it_does_not_turn_to_and_fro_between_two_candidates(seed: int) -> None:
    # Candidates that turned with the robot, right behind it: it turned left, right, left in place for ever.
    assert run_episode("hd_bug_map", "maze", {"time.limit": 400.0}, seed=seed).outcome == "success"


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(2))
def test_it_does_not_turn_to_and_fro_before_a_bog(kinematics: str, seed: int) -> None:
    # What the ground behind was supposed to cost changed with the heading, and the side to go round with it.
    assert run_episode("hd_bug_map", "terrain", {"robot.kinematics": kinematics}, seed=seed).outcome == "success"


@pytest.mark.parametrize("scenario", ["u_trap", "dynamic"])
def test_the_same_world_twice_gives_the_same_run_bit_for_bit(scenario: str) -> None:
    first, second = (run_episode("hd_bug_map", scenario, seed=4, max_steps=150) for _ in range(2))
    np.testing.assert_array_equal(first.path, second.path)
    assert first.modes == second.modes


@pytest.mark.parametrize("gap", [0.0, 0.003])
def test_touched_all_round_it_does_not_press_on(gap: float) -> None:
    simulation = Simulation("u_trap", 1)
    flat = simulation.reset(seeds=[0])[:, 0].copy()
    flat[:, :360] = 0.2 + gap
    policy, state = make_policy("hd_bug_map", simulation), None
    for _ in range(30):
        action, state = policy.predict(flat, state)
        assert np.hypot(*action[0]) * 0.1 <= gap + 1e-3


@pytest.mark.parametrize("scenario", ["u_trap", "dynamic", "ring"])
def test_what_it_draws_is_finite_and_labelled(scenario: str) -> None:
    simulation = Simulation(scenario, 1)
    policy: Any = make_policy("hd_bug_map", simulation)
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


# ----------------------------------------------------------------------------------------------------- what moves


def test_most_worlds_of_movers_are_crossed() -> None:
    outcomes = [run_episode("hd_bug_map", "dynamic", seed=seed).outcome for seed in range(20)]
    assert outcomes.count("success") >= 18


def least_gap(mover_turns: float, kinematics: str) -> float:
    """How near a mover that comes the other way passes a robot 1.2 m beside it, between the bodies [m]."""
    motion = {"law": "bounce", "velocity": [-0.8, 0.0]}
    world = {
        "family": "explicit",
        "bounds": [-20, -20, 20, 20],
        "start": [-8, 0, 0],
        "goal": [8, 0],
        "movers": [{"shape": {"circle": 0.3}, "at": [8, 1.2], "motion": motion}],
    }
    scenario = {"world": world, "robot": {"kinematics": kinematics}}
    episode = run_episode("hd_bug_map", scenario, mover_turns=mover_turns)
    assert episode.outcome == "success"
    return episode.min_clearance


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_who_fears_turns_leaves_movers_more_room(kinematics: str) -> None:
    assert least_gap(1.0, kinematics) > least_gap(0.0, kinematics) + 0.1


@pytest.mark.parametrize(
    "parameters",
    [{"alpha": 4.0}, {"beta": 3.0}, {"horizon": 1.0}, {"margin": 1.0}, {"spread": 0.6}, {"mover_turns": 0.0}],
)
def test_each_parameter_of_the_avoidance_does_work(parameters: dict[str, Any]) -> None:
    usual = run_episode("hd_bug_map", "dynamic", seed=5, max_steps=80).path
    assert not np.array_equal(run_episode("hd_bug_map", "dynamic", seed=5, max_steps=80, **parameters).path, usual)


def chase(policy: str, velocity: tuple[float, float], kinematics: str) -> float:
    """Time that a policy takes to a target that starts at (10, 0) and keeps its velocity [s]."""
    motion = {"law": "bounce", "velocity": list(velocity)}
    target = {"at": [10, 0], "motion": motion}
    world = {"family": "explicit", "bounds": [-60, -60, 60, 60], "start": [0, 0, 0], "target": target}
    episode = run_episode(policy, {"world": world, "robot": {"kinematics": kinematics}, "time": {"limit": 120.0}})
    assert episode.outcome == "success"
    return 0.1 * (len(episode.path) - 1)


VELOCITIES = [(0.0, 0.5), (0.5, 0.0), (-0.5, 0.0), (0.3, 0.3), (0.2, -0.7), (-0.4, 0.6), (0.0, 0.0)]


@pytest.mark.parametrize("velocity", VELOCITIES)
def test_an_open_target_is_met_within_three_percent_of_the_closed_form(velocity: tuple[float, float]) -> None:
    best = meeting_time((0.0, 0.0), (10.0, 0.0), velocity, 1.0, 0.3)
    assert chase("hd_bug_map", velocity, "holonomic") <= 1.03 * best + 0.1


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_it_meets_moving_targets_sooner_than_pure_pursuit(kinematics: str) -> None:
    gains = [
        chase("go_to_goal", velocity, kinematics) - chase("hd_bug_map", velocity, kinematics) for velocity in VELOCITIES
    ]
    assert min(gains) >= -0.1 - 1e-9 and float(np.mean(gains)) > 0.3


# ---------------------------------------------------------------------------------------------------------- barred cells


@pytest.mark.parametrize(
    ("robot", "seed", "outcome", "verdict"),
    [
        ("jackal", 12, "success", ""),  # another way is open
        ("jackal", 99, "running", "unreachable"),
        ("holonomic", 7, "running", "stuck"),  # only cells that turned it back close the goal off
    ],
)
def test_where_its_map_is_open_and_the_disc_does_not_pass_it_does_not_go_to_and_fro(
    robot: str, seed: int, outcome: str, verdict: str
) -> None:
    """Cylinders that close a way for the disc by less than the half diagonal of a cell."""
    world = cylinder_claims.scenario(robot, shut=cylinder_claims.is_shut(seed))
    episode = run_episode("hd_bug_map", world, seed=seed, **barn.PARAMETERS[robot])
    assert (episode.outcome, episode.verdict) == (outcome, verdict)
    assert episode.memory.turned_back and episode.min_clearance > 0.0


@pytest.mark.parametrize(("seed", "verdict"), [(416, ""), (601, ""), (827, "unreachable")])
def test_it_does_not_stand_before_a_way_that_its_brake_does_not_let_it_go(seed: int, verdict: str) -> None:
    """Where a cylinder is nearer than the brake keeps, the smaller disc that looks for ways finds some that it cannot begin."""
    world = cylinder_claims.scenario("jackal", shut=cylinder_claims.is_shut(seed))
    episode = run_episode("hd_bug_map", world, seed=seed, **barn.PARAMETERS["jackal"])
    assert (episode.outcome, episode.verdict) == ("running" if verdict else "success", verdict)
    assert episode.min_clearance > 0.0


@pytest.mark.parametrize("seed", [13, 15, 19])
def test_where_ranges_scatter_widely_it_waits_for_no_scan_that_pleases_its_brake(seed: int) -> None:
    """With a standard deviation of 0.2 m something always seems nearer than the brake keeps: the next scan shows another."""
    noise = {"lidar.beams": 180, "lidar.noise": 0.2}
    assert run_episode("hd_bug_map", "static", noise, seed=seed).outcome == "success"


def drive_past_bars(places: NDArray[np.float64], *, gone: int) -> tuple[Any, str]:
    """Its memory and the outcome in an empty world, where it takes cells (k, 2) for blocked from the start.

    `gone` points have been taken away from its map since.
    """
    world = {"family": "empty", "bounds": [-2, -4, 12, 4], "start": [0, 0, 0], "goal": [10, 0]}
    simulation = Simulation({"world": world}, overrides={"robot.kinematics": "holonomic"})
    policy: Any = make_policy("hd_bug_map", simulation)
    observation = simulation.reset(seeds=[0])
    _, (memory,) = policy.predict(observation[:, 0], None)
    memory.map.set_clearance(policy.measures.tight)
    for place in places.tolist():
        memory.map.cover(*place, 1.0)
        memory.map.bar(place)
    memory.barred_then, memory.way = memory.map.removed - gone, None
    while not (memory.verdict or simulation.info()["outcome"][0, 0] != "running"):
        action, _ = policy.predict(observation[:, 0], (memory,))
        observation = simulation.step(action[:, None]).observation
    return memory, simulation.info()["outcome"][0, 0]


def ring_about_the_goal() -> NDArray[np.float64]:
    """Two cells thick, as ways go between cells that touch with their corners."""
    turns = np.linspace(0.0, 2.0 * math.pi, 400)
    rim = np.column_stack([np.cos(turns), np.sin(turns)])
    return np.concatenate([1.5 * rim, 1.6 * rim]) + (10.0, 0.0)


def test_cells_that_turned_it_back_are_tried_again_once_points_have_gone() -> None:
    memory, outcome = drive_past_bars(ring_about_the_goal(), gone=1)
    assert outcome == "success" and memory.bars_lifted == 1 and "waiting" not in memory.mode


def test_only_barred_cells_about_the_goal_are_no_proof() -> None:
    memory, outcome = drive_past_bars(ring_about_the_goal(), gone=0)
    assert (outcome, memory.verdict, memory.bars_lifted) == ("running", "stuck", 0)


def test_it_goes_round_barred_cells() -> None:
    up = np.arange(-2.0, 2.0, 0.05)
    memory, outcome = drive_past_bars(np.column_stack([np.full(len(up), 5.05), up]), gone=0)
    assert (outcome, memory.verdict) == ("success", "")


@pytest.mark.parametrize(
    ("robot", "step"),
    [
        ({"max_acceleration": 10.0, "max_turn_rate": 0.3}, 0.2),
        ({"max_acceleration": 50.0, "max_turn_rate": 0.3}, 0.5),
        ({"max_acceleration": 50.0, "max_speed": 5.0}, 0.1),
    ],
)
def test_a_way_that_inertia_does_not_let_it_begin_is_given_up_for_a_wider_one(
    robot: dict[str, Any], step: float
) -> None:
    # The way past the box's corner was open to the disc by 12 mm, and less than a scan may hide: it stood there for ever.
    described = {
        "robot": {"kinematics": "differential", **robot},
        "lidar": {"beams": 180, "range": 20.0},
        "time": {"step": step, "limit": 60.0},
        "world": {
            "family": "explicit",
            "bounds": [-8, -8, 8, 8],
            "polygons": [[[-1, -2], [1, -2], [1, 3], [-1, 3]]],
            "start": [-6, 0, 0],
            "goal": [6, 0.3],
        },
    }
    (row,) = evaluate(["hd_bug_map"], described, episodes=1)
    assert row.success
