"""PointBug, K-Bug, E-Bug and CriticalPointBug, and the open points that they go by."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import OTHER, RING_ROUND_THE_START, Disc, Episode, Ring, Slab, UTrap, run_episode, tolerance

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.bugs.critical_point_bug import CriticalPointBug
from bug_gym.agents.bugs.e_bug import EBug
from bug_gym.agents.scan import open_ways
from bug_gym.agents.walls.open_points import OpenPoint, Profile
from bug_gym.agents.walls.sub_goals import SubGoals
from bug_gym.reproductions import hd_bug_tables
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

C = 0.5
SLAB, DISC, TRAP = Slab(c=C), Disc(c=C), UTrap(c=C)
POLICIES = ["point_bug", "k_bug", "e_bug", "critical_point_bug"]
BEAMS = 360
SENSORS: dict[str, Any] = {"lidar": {"beams": BEAMS, "range": 60.0}, "time": {"limit": 600.0}}
SHAPES: dict[str, Any] = {
    "slab": {"polygons": [[[8, -3], [12, -3], [12, 5], [8, 5]]]},
    "u_trap": {"polygons": [[[5, -4], [12, -4], [12, 4], [5, 4], [5, 3], [11, 3], [11, -3], [5, -3]]]},
    "disc": {"circles": [[10, 0, 3]]},
}


def world(shapes: dict[str, Any], *, angle: float = 0.0, mirrored: bool = False, goal: float = 20.0) -> dict[str, Any]:
    """Shapes between the start (0, 0) and the goal on the x axis, mirrored about it, then turned about the start."""
    mirror = np.array([1.0, -1.0 if mirrored else 1.0])
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, sin], [-sin, cos]])

    def moved(points: Any) -> Any:
        return ((np.asarray(points, dtype=float) * mirror) @ turn).tolist()

    explicit = {
        "family": "explicit",
        "bounds": [-35, -35, 35, 35],
        "polygons": [moved(ring) for ring in shapes.get("polygons", [])],
        "circles": [[*moved(circle[:2]), circle[2]] for circle in shapes.get("circles", [])],
        "start": [0, 0, angle],
        "goal": moved([goal, 0]),
    }
    return {**SENSORS, "world": explicit}


def first_look(scenario: Any, clearance: float = C, **overrides: Any) -> tuple[View, SubGoals, Profile]:
    """What a robot sees of a world from its start."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    sensors = Sensors.of(simulation.scenario)
    view = View(simulation.reset(seeds=[0])[0, 0], sensors)
    sub_goals = SubGoals(sensors, clearance=clearance)
    return view, sub_goals, sub_goals.look(view)


# ------------------------------------------------------------------------------------------------ open points


def test_the_open_points_of_a_slab_are_its_two_ends_in_sight() -> None:
    _, _, profile = first_look(world(SHAPES["slab"]))
    left, right = sorted(profile.open_points, key=lambda point: point.rotation)
    for point, corner, side in ((left, (8.0, 5.0), 1), (right, (8.0, -3.0), -1)):
        assert point.side == side
        assert math.dist(point.corner, corner) <= 2.0 * math.pi / BEAMS * math.hypot(*corner) * 1.5


def test_a_sub_goal_lies_at_the_clearance_square_to_the_line_of_sight_on_the_free_side() -> None:
    # The figures that Das, Dutta and Debnath's formulas give for the slab's right end, their sign put right.
    assert OpenPoint((8.0, -3.0), -1, 0.0, (8.0, -3.0)).sub_goal(C) == pytest.approx((7.824, -3.468), abs=1e-3)
    assert OpenPoint((8.0, -3.0), 1, 0.0, (8.0, -3.0)).sub_goal(C) == pytest.approx((8.176, -2.532), abs=1e-3)


@pytest.mark.parametrize(("spare", "ends"), [(-0.05, 2), (0.05, 4)])
def test_a_gap_has_ends_where_the_disc_passes(spare: float, ends: int) -> None:
    _, sub_goals, _ = first_look("empty")
    half = sub_goals.boundary.inner + 0.5 * spare
    discs = {"circles": [[5.0, half + 1.0, 1.0], [5.0, -half - 1.0, 1.0]]}
    _, _, profile = first_look(world(discs))
    assert len(profile.open_points) == ends


@pytest.mark.parametrize("beams", [180, 360])
def test_a_plain_room_has_no_open_points(beams: int) -> None:
    places = np.random.default_rng(3).uniform(-7.0, 7.0, (6, 2))
    for x, y in places.tolist():
        room = {"family": "empty", "bounds": [-10, -10, 10, 10], "start": [x, y, x - y], "goal": [0.0, 0.0]}
        _, _, profile = first_look({"lidar": {"beams": beams, "range": 60.0}, "world": room})
        assert profile.open_points == []


def test_no_disc_slips_through_a_wall_between_two_beams() -> None:
    # Beams 15 degrees apart meet the wall at x = 6 up to 1.6 m apart, and the disc is 0.9 m wide.
    wall = {"polygons": [[[6, -20], [7, -20], [7, 20], [6, 20]]]}
    for angle in np.radians([3.0, 7.5, 20.0, 35.0]).tolist():
        scenario = world(wall, goal=20.0)
        scenario["world"]["goal"] = [10.0, 10.0 * math.tan(angle)]
        scenario["lidar"] = {"beams": 24, "range": 60.0}
        _, sub_goals, profile = first_look(scenario)
        assert profile.goal_way == pytest.approx((6.0 - sub_goals.boundary.inner) / math.cos(angle), rel=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_the_free_ways_are_those_of_a_disc_along_finely_sampled_walls(seed: int) -> None:
    simulation = Simulation("static", 1, overrides={"lidar.beams": 48, "world.obstacles": 40})
    sensors = Sensors.of(simulation.scenario)
    view = View(simulation.reset(seeds=[seed])[0, 0], sensors)
    radius, m = 0.3, 90
    x, y = sensors.beam_directions * view.ranges
    link, is_long = np.empty((2, 48), dtype=np.bool_)
    open_ways.link_beams(x, y, view.ranges, sensors.range, 0.3, 2.0 * radius, 0.0, True, link)
    open_ways.tell_long_walls(x, y, link, radius, is_long)
    angles = 2.0 * math.pi / m * np.arange(m) + 0.123
    free, beam = np.empty(m), np.empty(m, dtype=np.int64)
    open_ways.sweep_disc(
        x, y, view.ranges, sensors.range, is_long, radius, 0.123, np.cos(angles), np.sin(angles), free, beam
    )
    px, py = view.points
    after = np.flatnonzero(link)
    share = np.linspace(0.0, 1.0, 400)[:, None]
    walls_x = ((1.0 - share) * x[after] + share * x[(after + 1) % 48]).ravel()
    walls_y = ((1.0 - share) * y[after] + share * y[(after + 1) % 48]).ravel()
    dense_x, dense_y = np.concatenate([px, walls_x]), np.concatenate([py, walls_y])
    expected = np.array([kernels.free_distance(dense_x, dense_y, angle, radius, math.inf) for angle in angles])
    seen = np.isfinite(expected)
    assert (np.isfinite(free) <= seen).all() and seen.any()
    # Walls shorter than a quarter of the radius stand for their ends: the disc sinks in by a 128th of it, at most
    # so far that headings which only graze such a wall pass it.
    grazed = ~np.isclose(free, expected, atol=radius / 16.0)
    assert grazed.mean() <= 0.03 and (free >= expected - 0.002)[seen].all()


# ------------------------------------------------------------------------------------------------ closed forms

LENGTHS: dict[str, Any] = {
    "slab": SLAB.shortest,
    "disc": lambda turn: DISC.shortest(),
    "u_trap": lambda turn: TRAP.shortest(),
}


@pytest.mark.parametrize("policy", POLICIES)
def test_an_empty_world_is_crossed_straight(policy: str) -> None:
    episode = run_episode(policy, world({}), clearance=C)
    assert episode.outcome == "success" and episode.memory.sub_goals == []
    assert episode.full_length == pytest.approx(20.0, abs=1e-6)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("angle", [0.0, 0.83])
def test_point_bug_takes_the_taut_string_on_the_side_it_turns_to(
    shape: str, turn: str, mirrored: bool, angle: float
) -> None:
    episode = run_episode("point_bug", world(SHAPES[shape], angle=angle, mirrored=mirrored), turn=turn, clearance=C)
    expected = LENGTHS[shape](OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("policy", ["k_bug", "e_bug", "critical_point_bug"])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(("mirrored", "angle"), [(False, 0.0), (True, 0.83)])
def test_the_others_take_the_taut_string_on_the_shorter_side(
    policy: str, shape: str, turn: str, mirrored: bool, angle: float
) -> None:
    episode = run_episode(policy, world(SHAPES[shape], angle=angle, mirrored=mirrored), turn=turn, clearance=C)
    expected = LENGTHS[shape]("right")
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("policy", ["k_bug", "e_bug", "critical_point_bug"])
@pytest.mark.parametrize("shape", ["disc", "u_trap"])
@pytest.mark.parametrize(("turn", "sign"), [("left", 1.0), ("right", -1.0)])
def test_of_two_equal_ends_the_one_on_the_side_of_the_turn_is_taken(
    policy: str, shape: str, turn: str, sign: float
) -> None:
    episode = run_episode(policy, world(SHAPES[shape]), turn=turn, clearance=C, max_steps=30)
    assert sign * episode.memory.sub_goals[0][1] > 0.0


# ------------------------------------------------------------------------------------------------ choices


def first_sub_goal(policy: str, shapes: dict[str, Any]) -> tuple[float, float]:
    """The first sub-goal in a world of `shapes`, with the start as the origin."""
    place: tuple[float, float] = run_episode(policy, world(shapes), clearance=C, max_steps=2).memory.sub_goals[0]
    return place


def test_critical_point_bug_counts_the_rest_of_the_way_and_e_bug_the_whole() -> None:
    # A slanting wall: the right end (2, -1) is near the robot and 18 m from the goal, the left one (14, 8) 10 m.
    wall = {"polygons": [[[2, -1], [14, 8], [14.2, 7.8], [2.2, -1.2]]]}
    assert math.hypot(14, 8) + math.hypot(6, 8) > math.hypot(2, 1) + math.hypot(18, 1)
    assert first_sub_goal("critical_point_bug", wall)[1] > 7.0
    assert first_sub_goal("e_bug", wall)[1] < 0.0


def test_k_bug_looks_one_corner_ahead() -> None:
    # A tray with its long floor on the right: past the floor's near end the base still stands in the way, as is seen
    # from the start, so the way goes over the base's foot (15, -3); over the base's head at (15, h) it is free.
    height = 3.4
    tray = {"polygons": [[[5, -3], [15, -3], [15, height], [16, height], [16, -3.2], [5.6, -3.2]]]}
    over_head = math.hypot(15, height + C) + math.hypot(5, height + C)
    past_floor = math.hypot(5, 3 + C) + math.hypot(15, 3 + C)
    over_foot = math.hypot(5, 3 + C) + 10.0 + math.hypot(5, 3 + C)
    assert past_floor < over_head < over_foot
    assert first_sub_goal("k_bug", tray)[1] > 0.0
    assert first_sub_goal("e_bug", tray)[1] < 0.0


@pytest.mark.parametrize("policy", ["e_bug", "critical_point_bug"])
@pytest.mark.parametrize("seed", range(4))
def test_no_corner_that_was_visited_is_chosen_again(policy: str, seed: int) -> None:
    simulation = Simulation("maze", 1, overrides={**HOLONOMIC, "time.limit": 600.0})
    agent = make_policy(policy, simulation)
    assert isinstance(agent, EBug | CriticalPointBug)
    observation, state, chosen = simulation.reset(seeds=[seed]), None, 0
    for _ in range(6000):
        action, state = agent.predict(observation[:, 0], state)
        memory: Any = state[0]
        if memory.verdict:
            break
        if len(memory.sub_goals) > chosen:
            chosen += 1
            assert memory.corner is not None
            visited = [math.dist(memory.corner, visit.corner) for visit in memory.visits]
            assert min(visited, default=math.inf) > agent.sub_goals.same
        step = simulation.step(action[:, None])
        observation = step.observation
        if step.terminated.any():
            break
    assert chosen > 2


@pytest.mark.parametrize(("turn", "side"), [("right", -1), ("left", 1)])
def test_point_bug_turns_on_to_the_side_of_its_last_sudden_point(turn: str, side: int) -> None:
    memory = run_episode("point_bug", world(SHAPES["slab"]), clearance=C, turn=turn).memory
    assert memory.turning_side == side


# ------------------------------------------------------------------------------------------------ no way


@pytest.mark.parametrize(
    ("policy", "verdict", "laps"),
    [("point_bug", "looping", 3), ("k_bug", "looping", 6), ("e_bug", "stuck", 3), ("critical_point_bug", "stuck", 3)],
)
def test_before_a_ring_round_the_goal_they_end_without_a_claim(policy: str, verdict: str, laps: int) -> None:
    episode = run_episode(policy, "ring", {"lidar.range": 60.0, "time.limit": 600.0}, clearance=C)
    assert (episode.outcome, episode.verdict) == ("running", verdict)
    # From the start to the ring's corner, then at most three laps before one corner is met the third time on one side;
    # K-Bug goes round it both ways. The other two visit each corner once.
    first = math.hypot(6.0, 4.0)
    assert first < episode.length <= first + laps * Ring(C).lap
    assert episode.min_clearance > 0.0


@pytest.mark.parametrize(
    ("policy", "verdict"),
    [("point_bug", "unreachable"), ("k_bug", "stuck"), ("e_bug", "stuck"), ("critical_point_bug", "stuck")],
)
def test_shut_in_by_a_ring_they_see_no_end_of_it_and_stay(policy: str, verdict: str) -> None:
    episode = run_episode(policy, {**SENSORS, "world": RING_ROUND_THE_START}, clearance=C)
    assert episode.verdict == verdict
    assert episode.length == 0.0


@pytest.mark.parametrize("seed", range(8))
def test_a_door_beside_a_corner_that_no_beam_enters_makes_no_room_shut(seed: int) -> None:
    """Walls that seem to go on from beam to beam prove nothing: all doors of these rooms are open."""
    robot = {"robot.max_speed": 0.5, "goal.radius": 0.3, "lidar.range": 10.0, "lidar.noise": 0.01}
    episode = run_episode("point_bug", "rooms", {**HOLONOMIC, **robot, "time.limit": 300.0}, seed=seed)
    assert episode.verdict != "unreachable"


# ------------------------------------------------------------------------------------------------ worlds at random

HOLONOMIC = {"robot.kinematics": "holonomic", "lidar.beams": 180}


def ends_well(episode: Episode) -> bool:
    """Whether the robot arrived or said why not, and touched nothing."""
    is_over = episode.outcome == "success" or episode.verdict in ("looping", "stuck")
    return is_over and episode.min_clearance > 0.0


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("robot", [HOLONOMIC, {}], ids=["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(3))
def test_among_many_obstacles_they_arrive_or_say_why_not(policy: str, robot: dict[str, Any], seed: int) -> None:
    assert ends_well(run_episode(policy, "static", {"world.obstacles": 60, "time.limit": 300.0, **robot}, seed=seed))


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("robot", [HOLONOMIC, {}], ids=["holonomic", "differential"])
@pytest.mark.parametrize("seed", range(3))
def test_in_a_maze_they_arrive_or_say_why_not(policy: str, robot: dict[str, Any], seed: int) -> None:
    assert ends_well(run_episode(policy, "maze", {"time.limit": 600.0, **robot}, seed=seed))


@pytest.mark.parametrize("policy", POLICIES)
def test_a_target_that_moves_is_caught(policy: str) -> None:
    assert run_episode(policy, "moving_target", seed=1).outcome == "success"


# ------------------------------------------------------------------------------------------------ parameters


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("jump", [0.0, -1.0, math.nan, math.inf])
def test_a_jump_that_is_not_above_0_is_refused(policy: str, jump: float) -> None:
    with pytest.raises(ValueError, match="jump"):
        make_policy(policy, "static", jump=jump)


@pytest.mark.parametrize(
    ("policy", "reach", "seed"), [("k_bug", 10.0, 10018), ("e_bug", 5.0, 10000), ("e_bug", 5.0, 10013)]
)
def test_a_corner_close_by_is_not_taken_for_the_goal(policy: str, reach: float, seed: int) -> None:
    """There a wall stands before the next corner, both nearer than the radius within which a goal is reached."""
    assert run_episode(policy, hd_bug_tables.field(200, reach), seed=seed).outcome == "success"
